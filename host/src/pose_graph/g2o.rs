//! g2o files: `VERTEX_SE3:QUAT`, `EDGE_SE3:QUAT` and `FIX`, as g2o, GTSAM and Ceres' examples read them.
//!
//! g2o weighs the vector part of the quaternion, half the rotation vector: the rotational rows and columns of the
//! information are scaled by 2 on the way out and back.

use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;

use nalgebra::{Matrix6, Quaternion, UnitQuaternion, Vector3};
use sdslam_core::MapPose;

use super::{Edge, EdgeKind, GraphError, PoseGraph};

const VERTEX: &str = "VERTEX_SE3:QUAT";
const EDGE: &str = "EDGE_SE3:QUAT";

/// The graph as text; loops taken for wrong are left out.
pub fn to_text(graph: &PoseGraph) -> String {
    let mut text = String::new();
    for (id, pose) in graph.poses.iter().enumerate() {
        let _ = writeln!(text, "{VERTEX} {id} {}", pose_text(pose));
    }
    if !graph.poses.is_empty() {
        text.push_str("FIX 0\n");
    }
    for (edge, _) in graph.edges.iter().zip(&graph.weights).filter(|(_, weight)| **weight > 0.5) {
        let _ = write!(text, "{EDGE} {} {} {}", edge.from, edge.to, pose_text(&edge.from_from_to));
        for row in 0..6 {
            for column in row..6 {
                let _ = write!(text, " {}", edge.information[(row, column)] * scale(row) * scale(column));
            }
        }
        text.push('\n');
    }
    text
}

/// Reads a g2o file. Ids may be any whole numbers; keyframes are numbered in their order in the file. An edge between
/// neighbours in that order is taken for odometry, any other for a loop.
///
/// # Errors
/// The file cannot be read, or a line is not understood: the line is named.
pub fn load(file: &Path) -> Result<PoseGraph, GraphError> {
    let text = std::fs::read_to_string(file)
        .map_err(|source| GraphError::Unreadable { file: file.into(), source })?;
    parse(&text, file)
}

/// Like [`load`] with the text at hand; `file` is for messages.
pub fn parse(text: &str, file: &Path) -> Result<PoseGraph, GraphError> {
    let mut reader = Reader { graph: PoseGraph::new(), index_of: HashMap::new() };
    for (index, line) in text.lines().enumerate() {
        reader.line(line).map_err(|fault| GraphError::Line { file: file.into(), line: index + 1, fault })?;
    }
    Ok(reader.graph)
}

fn scale(row: usize) -> f64 {
    if row < 3 { 1.0 } else { 2.0 }
}

fn pose_text(pose: &MapPose) -> String {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    format!("{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w)
}

struct Reader {
    graph: PoseGraph,
    index_of: HashMap<i64, usize>,
}

impl Reader {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_whitespace();
        let Some(tag) = words.next().filter(|tag| !tag.starts_with('#')) else { return Ok(()) };
        let words: Vec<&str> = words.collect();
        match tag {
            VERTEX => self.vertex(&words),
            EDGE => self.edge(&words),
            "FIX" => self.fixed(&words),
            other => Err(format!("unknown entry {other}; {VERTEX}, {EDGE} and FIX are read")),
        }
    }

    fn vertex(&mut self, words: &[&str]) -> Result<(), String> {
        expect_words(words, 8)?;
        let id = id(words[0])?;
        let keyframe = self.graph.poses.len();
        if self.index_of.insert(id, keyframe).is_some() {
            return Err(format!("vertex {id} is there twice"));
        }
        self.graph.add_keyframe(pose(&numbers(&words[1..])?)?);
        Ok(())
    }

    fn edge(&mut self, words: &[&str]) -> Result<(), String> {
        expect_words(words, 2 + 7 + 21)?;
        let (from, to) = (self.keyframe(words[0])?, self.keyframe(words[1])?);
        let values = numbers(&words[2..])?;
        let mut upper = values[7..].iter();
        let mut information = Matrix6::zeros();
        for row in 0..6 {
            for (column, value) in (row..6).zip(upper.by_ref()) {
                let value = value / (scale(row) * scale(column));
                (information[(row, column)], information[(column, row)]) = (value, value);
            }
        }
        let kind = if from.abs_diff(to) == 1 { EdgeKind::Odometry } else { EdgeKind::Loop };
        let edge = Edge { from, to, from_from_to: pose(&values[..7])?, information, kind };
        self.graph.add_edge(edge).map_err(|error| error.to_string())
    }

    /// The first keyframe is held anyway, and no other can be.
    fn fixed(&mut self, words: &[&str]) -> Result<(), String> {
        expect_words(words, 1)?;
        match self.keyframe(words[0])? {
            0 => Ok(()),
            _ => Err(format!("FIX {}: only the first vertex can be held", words[0])),
        }
    }

    fn keyframe(&self, word: &str) -> Result<usize, String> {
        let id = id(word)?;
        self.index_of.get(&id).copied().ok_or_else(|| format!("vertex {id} is not in the lines before"))
    }
}

fn expect_words(words: &[&str], expected: usize) -> Result<(), String> {
    if words.len() == expected {
        Ok(())
    } else {
        Err(format!("{} values after the tag, expected {expected}", words.len()))
    }
}

fn id(word: &str) -> Result<i64, String> {
    word.parse().map_err(|_| format!("'{word}' is not a vertex id, which is a whole number"))
}

fn numbers(words: &[&str]) -> Result<Vec<f64>, String> {
    let number = |word: &&str| match word.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("'{word}' is not a finite number")),
    };
    words.iter().map(number).collect()
}

/// From x y z qx qy qz qw; files round, so the quaternion is normalised.
fn pose(values: &[f64]) -> Result<MapPose, String> {
    let [x, y, z, qx, qy, qz, qw] = values else { return Err("a pose has 7 numbers".into()) };
    let quaternion = Quaternion::new(*qw, *qx, *qy, *qz);
    if (quaternion.norm() - 1.0).abs() > 0.01 {
        return Err(format!("the quaternion has length {}, expected 1", quaternion.norm()));
    }
    let rotation = UnitQuaternion::new_normalize(quaternion);
    Ok(MapPose::from_parts(Vector3::new(*x, *y, *z).into(), rotation))
}
