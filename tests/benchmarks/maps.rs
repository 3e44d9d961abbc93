//! How good a map is, by true labels and true poses.
//!
//!   maps points RESULT DATASET NN                  which points of the drive are in the map: static ones should be, moving
//!                                                  ones (labels 252..259) should not
//!   maps localised RESULT DATASET NN MAP_RESULT MAP_DATASET     how far a localisation is from the truth, relative to the
//!                                                  keyframe of the mapping drive that is nearest by the truth
//!   maps loops RESULT DATASET NN                   what became of right and of wrong proposals, and how far the accepted ones
//!                                                  are from the truth
//!
//! RESULT and MAP_RESULT are folders that `sdslam localize` and `sdslam run` wrote.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::error::Error;
use std::path::Path;

use nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};
use sdslam::dataset::{Sequence, labels, trajectory};
use sdslam_core::{MapPose, MotionClass};

type Key = [i32; 3];

const VOXEL_M: f64 = 0.2;
/// The map takes points up to here \[m\].
const MAX_RANGE_M: f32 = 60.0;
/// A pose farther from the truth than this is a wrong place \[m\].
const WRONG_M: f64 = 1.0;

fn key(point: [f64; 3]) -> Key {
    point.map(|v| (v / VOXEL_M).floor() as i32)
}

/// Voxels of a map.ply.
fn voxels_of(file: &Path) -> Result<HashSet<Key>, Box<dyn Error>> {
    const BYTES_PER_CELL: usize = 29;
    let bytes = std::fs::read(file)?;
    let body = bytes.windows(11).position(|w| w == b"end_header\n").ok_or("no PLY header")? + 11;
    let float = |cell: &[u8], at: usize| {
        f64::from(f32::from_le_bytes([cell[at], cell[at + 1], cell[at + 2], cell[at + 3]]))
    };
    let cells = bytes[body..].chunks_exact(BYTES_PER_CELL);
    Ok(cells.map(|cell| key([float(cell, 0), float(cell, 4), float(cell, 8)])).collect())
}

/// True poses of the sensor, seen from the first.
fn truth(sequence: &Sequence) -> Result<Vec<MapPose>, Box<dyn Error>> {
    let camera_from_sensor = sequence.camera_from_sensor();
    let camera = sequence.ground_truth()?.ok_or("no ground truth")?;
    Ok(camera.iter().map(|pose| camera_from_sensor.inverse() * pose * camera_from_sensor).collect())
}

fn points(result: &Path, dataset: &Path, name: &str) -> Result<(), Box<dyn Error>> {
    let sequence = Sequence::open(dataset, name, None)?;
    let map = voxels_of(&result.join("map.ply"))?;
    let poses = trajectory::read_tum(&result.join("poses_tum.txt"))?;
    let mut seen: HashMap<Key, [u32; 2]> = HashMap::new();
    for (frame, (_, pose)) in poses.iter().enumerate() {
        let scan = sequence.read(frame)?;
        for (point, &raw) in scan.points.iter().zip(&scan.labels.ok_or("no labels")?) {
            let range_m = point[..3].iter().map(|v| v * v).sum::<f32>().sqrt();
            let stands =
                matches!(labels::class_of(raw).motion(), MotionClass::Ground | MotionClass::PureStatic);
            if (stands || labels::is_moving(raw)) && range_m > 0.1 && range_m <= MAX_RANGE_M {
                let place = pose * Point3::new(point[0].into(), point[1].into(), point[2].into());
                seen.entry(key(place.coords.into())).or_default()[usize::from(!stands)] += 1;
            }
        }
    }
    let (mut all, mut inside, mut mostly) = ([0u64; 2], [0u64; 2], [0u64; 2]);
    for (key, counts) in &seen {
        let kept = map.contains(key);
        for kind in 0..2 {
            all[kind] += u64::from(counts[kind]);
            inside[kind] += if kept { u64::from(counts[kind]) } else { 0 };
        }
        if counts[1] > counts[0] {
            mostly[0] += 1;
            mostly[1] += u64::from(kept);
        }
    }
    let share = |part: u64, all: u64| part as f64 / all.max(1) as f64;
    println!("cells                                 {}", map.len());
    println!("static points preserved               {:.4}", share(inside[0], all[0]));
    println!("moving points rejected                {:.4}", 1.0 - share(inside[1], all[1]));
    println!("voxels of mostly moving points, rejected {:.4}", 1.0 - share(mostly[1], mostly[0]));
    Ok(())
}

fn localised(
    result: &Path,
    dataset: &Path,
    name: &str,
    map_result: &Path,
    map_dataset: &Path,
) -> Result<(), Box<dyn Error>> {
    let sequence = Sequence::open(dataset, name, None)?;
    let truth_of_drive = truth(&sequence)?;
    let truth_of_map = truth(&Sequence::open(map_dataset, name, None)?)?;
    let mapped = trajectory::read_tum(&map_result.join("poses_tum.txt"))?;
    let found = trajectory::read_tum(&result.join("poses_tum.txt"))?;
    let frame_of: HashMap<i64, usize> =
        (0..sequence.len()).map(|frame| ((sequence.stamp_s(frame) * 1e4).round() as i64, frame)).collect();
    let (mut metres, mut degrees) = (Vec::new(), Vec::new());
    for (stamp_s, pose) in &found {
        let frame =
            *frame_of.get(&((stamp_s * 1e4).round() as i64)).ok_or("a stamp that the drive has not")?;
        let here = &truth_of_drive[frame];
        let away = |k: &usize| (truth_of_map[*k].translation.vector - here.translation.vector).norm();
        let nearest = (0..mapped.len()).min_by(|a, b| away(a).total_cmp(&away(b))).ok_or("an empty map")?;
        let off = truth_of_map[nearest].inv_mul(here).inv_mul(&mapped[nearest].1.inv_mul(pose));
        metres.push(off.translation.vector.norm());
        degrees.push(off.rotation.angle().to_degrees());
    }
    let wrong = metres.iter().filter(|&&m| m > WRONG_M).count();
    let quantile = |values: &mut Vec<f64>, share: f64| {
        values.sort_by(f64::total_cmp);
        values.get(((values.len() as f64 * share) as usize).min(values.len().saturating_sub(1))).copied()
    };
    print!("poses {} wrong {wrong}", found.len());
    for (what, values) in [("m", &mut metres), ("deg", &mut degrees)] {
        let [median, most] = [0.5, 0.95].map(|share| quantile(values, share).unwrap_or(f64::NAN));
        print!(" | median {median:.4} 95 % {most:.4} {what}");
    }
    println!();
    Ok(())
}

/// A line of loops.csv.
struct Proposed {
    new: usize,
    old: usize,
    old_from_new: MapPose,
    accepted: bool,
    reason: String,
}

fn proposed(line: &str) -> Option<Proposed> {
    let words: Vec<&str> = line.split(',').collect();
    let number = |at: usize| words.get(at)?.parse::<f64>().ok();
    let position = Vector3::new(number(4)?, number(5)?, number(6)?);
    let rotation = Quaternion::new(number(10)?, number(7)?, number(8)?, number(9)?);
    Some(Proposed {
        new: words.first()?.parse().ok()?,
        old: words.get(1)?.parse().ok()?,
        old_from_new: MapPose::from_parts(position.into(), UnitQuaternion::new_normalize(rotation)),
        accepted: *words.get(15)? == "true",
        reason: (*words.get(16)?).into(),
    })
}

fn loops(result: &Path, dataset: &Path, name: &str) -> Result<(), Box<dyn Error>> {
    let truth = truth(&Sequence::open(dataset, name, None)?)?;
    let text = std::fs::read_to_string(result.join("loops.csv"))?;
    let mut fates: BTreeMap<String, [u32; 2]> = BTreeMap::new();
    let mut squares = [0.0; 2];
    for line in text.lines().skip(1) {
        let proposal = proposed(line).ok_or("a line of loops.csv that is none")?;
        let off = truth[proposal.old].inv_mul(&truth[proposal.new]).inv_mul(&proposal.old_from_new);
        let off_m = off.translation.vector.norm();
        let wrong = usize::from(off_m > WRONG_M);
        fates.entry(proposal.reason).or_default()[wrong] += 1;
        if proposal.accepted && wrong == 0 {
            squares[0] += off_m * off_m;
            squares[1] += off.rotation.angle().to_degrees().powi(2);
        }
    }
    println!("{:<45} right  wrong", "proposals");
    for (reason, [right, wrong]) in &fates {
        println!("{reason:<45} {right:5} {wrong:6}");
    }
    let right = f64::from(fates.get("accepted").map_or(0, |counts| counts[0]).max(1));
    let [m, deg] = squares.map(|sum| (sum / right).sqrt());
    println!("error of the right accepted ones, rms: {m:.4} m {deg:.4} deg");
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    match words[..] {
        ["points", result, dataset, name] => points(Path::new(result), Path::new(dataset), name),
        ["loops", result, dataset, name] => loops(Path::new(result), Path::new(dataset), name),
        ["localised", result, dataset, name, map_result, map_dataset] => localised(
            Path::new(result),
            Path::new(dataset),
            name,
            Path::new(map_result),
            Path::new(map_dataset),
        ),
        _ => Err(
            "maps points|loops RESULT DATASET NN | maps localised RESULT DATASET NN MAP_RESULT MAP_DATASET"
                .into(),
        ),
    }
}
