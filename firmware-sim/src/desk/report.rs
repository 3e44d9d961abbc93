//! What is printed at the end of a replay.

use std::fmt::Write;

use sdslam_core::{FrameEstimate, LabelledPoint, Stage};
use sdslam_firmware_sim::Totals;
use sdslam_firmware_sim::memory::Part;
use sdslam_firmware_sim::profile::{AnyLoops, AnyOdometry, Profile};

use crate::replay::Replay;

/// Most lines about faults.
const FAULT_LINES: usize = 10;

/// The tables of memory and time, and the last pose.
pub fn report(replay: &Replay) -> String {
    let mut text = memory_table(&replay.parts, replay.points, replay.bytes, Some(replay));
    let Totals { scans, missed, estimates, predicted, faults, .. } = replay.totals;
    let (damaged, skipped) = (replay.damaged().count(), replay.skipped);
    text += &format!(
        "\n{scans} scans, {missed} missed, {estimates} estimates, {predicted} of them predicted, {faults} faults; \
         {damaged} damaged messages, {skipped} bytes of garbage; \
         largest answer {} bytes\n",
        replay.largest_answer
    );
    for (sequence, fault) in replay.faults().take(FAULT_LINES) {
        text += &format!("  scan {sequence}: {fault}\n");
    }
    for error in replay.damaged().take(FAULT_LINES) {
        text += &format!("  {error}\n");
    }
    let left_out = replay.faults().count().saturating_sub(FAULT_LINES);
    if left_out > 0 {
        text += &format!("  and {left_out} more\n");
    }
    text += &time_table(&replay.stages_ms);
    if let Some((_, last)) = replay.estimates().last() {
        text += &format!("\nlast pose (stamp x y z qx qy qz qw):\n{}\n", pose_line(last));
    }
    text
}

/// The exact bytes of a profile.
pub fn profile_table<P: Profile>() -> String {
    memory_table(&parts_of::<P>(), P::POINTS, P::BYTES, None)
}

/// The parts of a profile's memory, the points left out.
pub fn parts_of<P: Profile>() -> Vec<Part> {
    [&P::Odometry::parts()[..], &P::Loops::parts()[..]].concat()
}

/// Bytes of each part; how full it was at most, and how many did not fit in one scan (or, in the submap, in all).
fn memory_table(parts: &[Part], points: usize, bytes: usize, replay: Option<&Replay>) -> String {
    let mut text = format!("{:22}{:>10}", "memory", "capacity");
    if replay.is_some() {
        text += &format!("{:>11}{:>13}", "most used", "did not fit");
    }
    text += &format!("{:>12}\n", "bytes");
    let mut row = |name: &str, capacity: usize, used: Option<(u32, u32)>, bytes: usize| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{name:22}{capacity:>10}");
        if replay.is_some() {
            let (used, refused) =
                used.map_or_else(Default::default, |(used, refused)| (used.to_string(), refused.to_string()));
            let _ = write!(text, "{used:>11}{refused:>13}");
        }
        let _ = writeln!(text, "{bytes:>12}");
    };
    let used = replay.map(|replay| {
        let most = replay.totals.high_water.points;
        (most.min(points) as u32, most.saturating_sub(points) as u32)
    });
    row("points of a scan", points, used, points * size_of::<LabelledPoint>());
    for part in parts {
        row(part.name, part.capacity, replay.and_then(|replay| used_of(part.name, replay)), part.bytes);
    }
    let width = if replay.is_some() { 46 } else { 22 };
    text + &format!("{:22}{:>width$}\n", "in all", bytes)
}

/// Most that was used of a part, and most that did not fit.
fn used_of(part: &str, replay: &Replay) -> Option<(u32, u32)> {
    let buffers = &replay.totals.high_water.buffers;
    match part {
        "scan cells" => Some((buffers.cells, buffers.cells_refused)),
        "landmarks" => Some((buffers.landmarks, buffers.landmarks_refused)),
        "tracks" => Some((buffers.tracks, buffers.tracks_refused)),
        "submap voxels" => Some((buffers.voxels, buffers.voxels_evicted)),
        "submap landmarks" => Some((buffers.submap_landmarks, buffers.submap_landmarks_evicted)),
        "loop places" => replay.loops().last().map(|loops| (loops.places, loops.places_forgotten)),
        _ => None,
    }
}

fn time_table(stages_ms: &[[f64; Stage::ALL.len()]]) -> String {
    let mut text =
        format!("\n{:22}{:>10}{:>10}{:>10}\n", "time on this machine", "mean ms", "p95 ms", "max ms");
    let mut row = |name: &str, times: Vec<f64>| {
        let (mean, p95, max) = statistics(times);
        let _ = writeln!(text, "{name:22}{mean:>10.2}{p95:>10.2}{max:>10.2}");
    };
    for stage in Stage::ALL {
        row(stage.name(), stages_ms.iter().map(|times| times[stage as usize]).collect());
    }
    row("a scan in all", stages_ms.iter().map(|times| times.iter().sum()).collect());
    text
}

fn statistics(mut times: Vec<f64>) -> (f64, f64, f64) {
    times.sort_by(f64::total_cmp);
    let Some(max) = times.last() else { return (0.0, 0.0, 0.0) };
    let mean = times.iter().sum::<f64>() / times.len() as f64;
    (mean, times[(times.len() * 95).div_ceil(100) - 1], *max)
}

/// As in a TUM trajectory.
pub fn pose_line(estimate: &FrameEstimate) -> String {
    let (t, q) = (estimate.map_from_sensor.translation, estimate.map_from_sensor.rotation);
    format!(
        "{:.9} {:.9} {:.9} {:.9} {:.12} {:.12} {:.12} {:.12}",
        estimate.stamp_s, t.x, t.y, t.z, q.i, q.j, q.k, q.w
    )
}
