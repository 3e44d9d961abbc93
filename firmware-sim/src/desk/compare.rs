//! Two files of answers, bit against bit.

use std::path::Path;

use anyhow::{Context, anyhow};
use sdslam_core::{FrameEstimate, TrackReport};
use sdslam_firmware_sim::wire::{AnswerRecord, read_answer};

/// What a comparison found.
pub struct Comparison {
    /// Not a bit differs.
    pub equal: bool,
    /// What to print.
    pub text: String,
}

/// Compares two files; tells the first answer that differs.
pub fn compare(left: &Path, right: &Path) -> anyhow::Result<Comparison> {
    let read =
        |path: &Path| std::fs::read(path).with_context(|| format!("failed to read {}", path.display()));
    let (left_bytes, right_bytes) = (read(left)?, read(right)?);
    let (a, b) = (answers(&left_bytes, left)?, answers(&right_bytes, right)?);
    let differs = a.iter().zip(&b).find(|(a, b)| a.bytes != b.bytes);
    let text = match differs {
        Some((a, b)) => format!("scan {}: {}\n", a.record.sequence, difference(&a.record, &b.record)),
        None if a.len() != b.len() => format!("{} answers against {}\n", a.len(), b.len()),
        None if a.is_empty() => "no answers at all\n".into(),
        None => {
            let tracks: usize = a.iter().map(|answer| answer.record.tracks().count()).sum();
            format!("{} answers with {tracks} tracks, equal to the bit\n", a.len())
        }
    };
    Ok(Comparison { equal: left_bytes == right_bytes && !a.is_empty(), text })
}

struct Bytes<'a> {
    bytes: &'a [u8],
    record: AnswerRecord<'a>,
}

fn answers<'a>(bytes: &'a [u8], path: &Path) -> anyhow::Result<Vec<Bytes<'a>>> {
    let mut rest = bytes;
    let mut all = Vec::new();
    loop {
        let at = bytes.len() - rest.len();
        match read_answer(rest) {
            Ok(None) => return Ok(all),
            Ok(Some((record, after))) => {
                all.push(Bytes { bytes: &rest[..rest.len() - after.len()], record });
                rest = after;
            }
            Err(error) => return Err(anyhow!("{} is damaged at byte {at}: {error}", path.display())),
        }
    }
}

/// What differs first between two answers, in words.
fn difference(a: &AnswerRecord<'_>, b: &AnswerRecord<'_>) -> String {
    let text = |estimate: &FrameEstimate| format!("{estimate:?}");
    let tracks = |record: &AnswerRecord<'_>| -> Vec<TrackReport> { record.tracks().flatten().collect() };
    if a.sequence != b.sequence {
        return format!("the other answer is that to scan {}", b.sequence);
    }
    if text(&a.estimate) != text(&b.estimate) {
        return format!("the estimates differ:\n{:#?}\nagainst\n{:#?}", a.estimate, b.estimate);
    }
    if a.landmarks_checksum != b.landmarks_checksum {
        return "the landmarks of the points differ".into();
    }
    let (a, b) = (tracks(a), tracks(b));
    match a.iter().zip(&b).find(|(a, b)| format!("{a:?}") != format!("{b:?}")) {
        Some((a, b)) => format!("the tracks differ:\n{a:#?}\nagainst\n{b:#?}"),
        None => format!("{} tracks against {}", a.len(), b.len()),
    }
}
