//! Whether a drive fits a memory profile, and what it costs where it does not.

use std::collections::HashMap;
use std::fmt::Write;

use sdslam_core::estimate::BufferUse;
use sdslam_core::{FrameEstimate, MapPose};
use sdslam_firmware_sim::Fault;
use sdslam_firmware_sim::profile::LoopUse;

use crate::replay::Replay;

/// A buffer that was too small.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Overflow {
    /// Scans in which something did not fit.
    scans: u32,
    /// The first of them: number and stamp \[s\].
    first: Option<(u32, f64)>,
    /// Most that did not fit in one scan.
    most: u32,
    /// All that did not fit.
    all: u64,
}

impl Overflow {
    fn add(&mut self, sequence: u32, stamp_s: f64, lost: u32) {
        if lost > 0 {
            self.first = self.first.or(Some((sequence, stamp_s)));
            (self.scans, self.most) = (self.scans + 1, self.most.max(lost));
            self.all += u64::from(lost);
        }
    }
}

/// The buffers that were too small in `replay`, and how far its poses are from those of `full`, replayed in the full
/// profile with the same parameters or not.
pub fn report(replay: &Replay, full: &Replay) -> String {
    let overflows = overflows(replay);
    let full_names = overflows.iter().filter(|(_, o)| o.scans > 0);
    let mut text = format!("{} bytes, {} scans\n\n", replay.bytes, replay.totals.scans);
    if full_names.clone().count() == 0 {
        text += "the drive fits: nothing was left out\n";
    } else {
        text += &format!(
            "{:18}{:>22}{:>8}{:>18}{:>10}\n",
            "full", "first in scan", "scans", "most in a scan", "in all"
        );
        for (name, overflow) in full_names {
            let Overflow { scans, first, most, all } = overflow;
            let first = first.map_or_else(String::new, |(scan, s)| format!("{scan} ({s:.3} s)"));
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name:18}{first:>22}{scans:>8}{most:>18}{all:>10}");
        }
    }
    text + &loss(replay, full)
}

/// The buffers, in the order of the table.
const BUFFERS: [&str; 8] = [
    "points",
    "cells",
    "landmarks",
    "tracks",
    "submap voxels",
    "submap landmarks",
    "loop places",
    "loop columns",
];

fn overflows(replay: &Replay) -> [(&'static str, Overflow); BUFFERS.len()] {
    let mut all = BUFFERS.map(|name| (name, Overflow::default()));
    let stamps: HashMap<u32, f64> = replay.estimates().map(|(s, e)| (s, e.stamp_s)).collect();
    for (sequence, fault) in replay.faults() {
        if let Fault::PointsLost { received, capacity } = fault {
            let stamp_s = stamps.get(&sequence).copied().unwrap_or(f64::NAN);
            all[0].1.add(sequence, stamp_s, (received - capacity) as u32);
        }
    }
    let mut before = (BufferUse::default(), LoopUse::default());
    for ((sequence, FrameEstimate { stamp_s, evidence, .. }), loops) in replay.estimates().zip(replay.loops())
    {
        let now = evidence.buffers;
        // Submap and loop table count from their beginning; they may have been started anew.
        let since = |now: u32, before: u32| if now >= before { now - before } else { now };
        let lost = [
            now.cells_refused,
            now.landmarks_refused,
            now.tracks_refused,
            since(now.voxels_evicted, before.0.voxels_evicted),
            since(now.submap_landmarks_evicted, before.0.submap_landmarks_evicted),
            since(loops.places_forgotten, before.1.places_forgotten),
            since(loops.points_left_out, before.1.points_left_out),
        ];
        for ((_, overflow), lost) in all[1..].iter_mut().zip(lost) {
            overflow.add(sequence, *stamp_s, lost);
        }
        before = (now, loops);
    }
    all
}

/// What the estimate lost, next to the full profile.
fn loss(replay: &Replay, full: &Replay) -> String {
    let poses: HashMap<u32, MapPose> = full.estimates().map(|(s, e)| (s, e.map_from_sensor)).collect();
    let apart = |(s, e): (u32, &FrameEstimate)| {
        let apart = poses.get(&s)?.inv_mul(&e.map_from_sensor);
        Some((apart.translation.vector.norm(), apart.rotation.angle().to_degrees()))
    };
    let (mut metres, mut degrees) = (0.0f64, 0.0f64);
    for (m, d) in replay.estimates().filter_map(apart) {
        (metres, degrees) = (metres.max(m), degrees.max(d));
    }
    let tracks = |r: &Replay| -> u32 { r.estimates().map(|(_, e)| e.evidence.motion.tracks).sum() };
    let recognised = |r: &Replay| r.loops().last().map_or(0, |loops| loops.recognised);
    format!(
        "\nnext to the full profile of {} bytes: poses at most {metres:.3} m and {degrees:.3} deg apart; \
         {} estimates predicted against {}; {} tracks over all scans against {}; \
         {} keyframes in which an old place was recognised against {}\n",
        full.bytes,
        replay.totals.predicted,
        full.totals.predicted,
        tracks(replay),
        tracks(full),
        recognised(replay),
        recognised(full)
    )
}
