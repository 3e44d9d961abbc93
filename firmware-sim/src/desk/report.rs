//! What is printed at the end.

use std::fmt::Write;

use sdslam_core::{FrameEstimate, FullScanOdometry, LabelledPoint};
use sdslam_firmware_sim::{Totals, memory};

use crate::board::DeskBoard;

/// The tables of memory and time, and the last pose.
pub fn report(odometry: &FullScanOdometry, points: usize, totals: &Totals, board: &DeskBoard) -> String {
    let mut text = memory_table(odometry, points, totals);
    let Totals { scans, estimates, predicted, faults, .. } = totals;
    text +=
        &format!("\n{scans} scans, {estimates} estimates, {predicted} of them predicted, {faults} faults\n");
    text += &format!("time per scan on this machine [ms]: {}\n", statistics(&board.times_ms));
    if let Some(last) = &board.last {
        text += &format!("\nlast pose (stamp x y z qx qy qz qw):\n{}\n", pose_line(last));
    }
    text
}

/// Bytes of each part, how full it was at most, and how many did not fit in one scan (or, in the submap, in all).
fn memory_table(odometry: &FullScanOdometry, points: usize, totals: &Totals) -> String {
    let (high, buffers) = (totals.high_water, totals.high_water.buffers);
    let mut text =
        format!("{:22}{:>10}{:>11}{:>13}{:>10}\n", "memory", "capacity", "most used", "did not fit", "KiB");
    let mut row = |name: &str, capacity: usize, used: Option<(usize, u32)>, bytes: usize| {
        let (used, refused) =
            used.map_or_else(Default::default, |(used, refused)| (used.to_string(), refused.to_string()));
        let kib = bytes as f64 / 1024.0;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name:22}{capacity:>10}{used:>11}{refused:>13}{kib:>10.1}");
    };
    let points_bytes = points * size_of::<LabelledPoint>();
    let lost = high.points.saturating_sub(points) as u32;
    row("points of a scan", points, Some((high.points.min(points), lost)), points_bytes);
    for part in memory::parts(odometry) {
        let used = match part.name {
            "scan cells" => Some((buffers.cells, buffers.cells_refused)),
            "landmarks" => Some((buffers.landmarks, buffers.landmarks_refused)),
            "tracks" => Some((buffers.tracks, buffers.tracks_refused)),
            "submap voxels" => Some((buffers.voxels, buffers.voxels_evicted)),
            "submap landmarks" => Some((buffers.submap_landmarks, buffers.submap_landmarks_evicted)),
            _ => None,
        };
        row(part.name, part.capacity, used.map(|(used, refused)| (used as usize, refused)), part.bytes);
    }
    let total = (points_bytes + size_of_val(odometry)) as f64 / 1024.0;
    text + &format!("{:22}{total:>44.1}\n", "in all")
}

fn statistics(times_ms: &[f64]) -> String {
    let mut sorted = times_ms.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(max) = sorted.last() else { return "none".into() };
    let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
    let p95 = sorted[(sorted.len() * 95).div_ceil(100) - 1];
    format!("{mean:.1} mean, {p95:.1} p95, {max:.1} max")
}

/// As in a TUM trajectory.
fn pose_line(estimate: &FrameEstimate) -> String {
    let (t, q) = (estimate.map_from_sensor.translation, estimate.map_from_sensor.rotation);
    format!(
        "{:.9} {:.9} {:.9} {:.9} {:.12} {:.12} {:.12} {:.12}",
        estimate.stamp_s, t.x, t.y, t.z, q.i, q.j, q.k, q.w
    )
}
