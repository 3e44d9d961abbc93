//! The on-vehicle loop on a board that is stricter than a device.

use std::thread;

use sdslam_core::estimate::BufferUse;
use sdslam_core::snapshot::SnapshotError;
use sdslam_core::{
    Config, FrameEstimate, FrameStatus, LabelledPoint, Odometry, OdometryError, SemanticClass,
};
use sdslam_firmware_sim::profile::AnyOdometry;
use sdslam_firmware_sim::wire::Answer;
use sdslam_firmware_sim::{Board, Fault, SAVED_HEAD_BYTES, ScanHeader, Totals, run};

const POINTS: usize = 16384;

type SmallOdometry = Odometry<4096, 128, 32, 16, 512, 32>;

/// Built on a thread with room for it: it passes through the stack.
fn odometry() -> Box<SmallOdometry> {
    let build = || SmallOdometry::new(Config::accurate()).map(Box::new);
    let thread = thread::Builder::new().stack_size(4 * size_of::<SmallOdometry>() + (1 << 20));
    let built = thread.spawn(build).expect("a thread").join().expect("enough stack");
    built.expect("the presets are valid")
}

/// A scan of `size` points: a short street with a house at its end and poles beside it, seen after driving `travelled_m`.
fn street(size: usize, travelled_m: f32) -> Vec<LabelledPoint> {
    let point = |i: usize| {
        // Places from irrational steps: spread evenly, no two the same.
        let (a, b) = ((i as f32 * 0.618_034).fract(), (i as f32 * 0.754_877).fract());
        let (along, height) = (24.0 * a - 12.0, 3.0 * b - 1.7);
        let (x, y, z, class) = match i % 5 {
            0 => (along, -6.4, height, SemanticClass::Building),
            1 => (along, 6.4, height, SemanticClass::Building),
            2 => (12.3, 12.8 * a - 6.4, height, SemanticClass::Building),
            3 => (4.0 * (6.0 * a).floor() - 10.0 + 0.05 * b, 4.0, height, SemanticClass::Pole),
            _ => (along, 12.8 * b - 6.4, -1.7, SemanticClass::Road),
        };
        LabelledPoint::new([x - travelled_m, y, z], class)
    };
    (0..size).map(point).collect()
}

/// Panics on an estimate that no scan has asked for; fails once `fail_at` scans were fetched.
#[derive(Default)]
struct FakeBoard {
    scans: Vec<(f64, Vec<LabelledPoint>)>,
    /// Their numbers, where they do not count from 0.
    sequences: Vec<u32>,
    /// What was saved before.
    saved: Option<Vec<u8>>,
    /// Room for the state, and the bytes saved there.
    room: Vec<u8>,
    saved_bytes: usize,
    fail_at: Option<usize>,
    /// Scans that come this much later than their stamp says \[us\].
    late_us: u64,
    /// Time from a scan to its answer \[us\].
    busy_us: u64,
    fetched: usize,
    fed: usize,
    clock_us: u64,
    awaits_estimate: bool,
    estimates: Vec<FrameEstimate>,
    faults: Vec<Fault>,
}

impl Board for FakeBoard {
    type Error = &'static str;

    fn next_scan(&mut self, points: &mut [LabelledPoint]) -> Result<Option<ScanHeader>, Self::Error> {
        if self.fail_at == Some(self.fetched) {
            return Err("the sensor is gone");
        }
        let Some((stamp_s, scan)) = self.scans.get(self.fetched) else { return Ok(None) };
        for (to, from) in points.iter_mut().zip(scan) {
            *to = *from;
        }
        let sequence = self.sequences.get(self.fetched).copied().unwrap_or(self.fetched as u32);
        self.clock_us = self.clock_us.max(100_000 * u64::from(sequence) + self.late_us);
        self.fetched += 1;
        self.awaits_estimate = true;
        Ok(Some(ScanHeader { sequence, stamp_s: *stamp_s, points: scan.len() }))
    }

    fn now_us(&mut self) -> u64 {
        self.clock_us
    }

    fn publish(&mut self, answer: Answer<'_>) -> Result<(), Self::Error> {
        assert!(self.awaits_estimate, "published twice, or without a scan");
        self.awaits_estimate = false;
        self.estimates.push(answer.estimate);
        self.clock_us += self.busy_us;
        Ok(())
    }

    fn alive(&mut self) {
        self.fed += 1;
    }

    fn fault(&mut self, fault: Fault) {
        self.faults.push(fault);
    }

    fn saved_state(&mut self) -> Option<&[u8]> {
        self.saved.as_deref()
    }

    fn room_for_state(&mut self) -> Option<&mut [u8]> {
        (!self.room.is_empty()).then_some(&mut *self.room)
    }

    fn state_saved(&mut self, bytes: usize) {
        self.saved_bytes = bytes;
    }
}

/// Drives through `scans` with a buffer of `capacity` points.
fn drive_with(mut board: FakeBoard, capacity: usize) -> (FakeBoard, Totals, Result<(), &'static str>) {
    let mut points = vec![LabelledPoint::new([0.0; 3], SemanticClass::Unlabelled); capacity];
    let mut totals = Totals::default();
    let end = run(&mut board, &mut *odometry(), &mut points, &mut totals);
    (board, totals, end)
}

fn drive(scans: Vec<(f64, Vec<LabelledPoint>)>) -> (FakeBoard, Totals) {
    let (board, totals, end) = drive_with(FakeBoard { scans, ..FakeBoard::default() }, POINTS);
    end.expect("this board does not fail");
    (board, totals)
}

fn steady(frames: usize) -> Vec<(f64, Vec<LabelledPoint>)> {
    (0..frames).map(|frame| (0.1 * frame as f64, street(16000, 0.3 * frame as f32))).collect()
}

#[test]
fn every_scan_is_published_once_and_in_order() {
    let (board, totals) = drive(steady(6));
    assert_eq!((totals.scans, totals.estimates, totals.predicted, totals.faults), (6, 6, 0, 0));
    let frames: Vec<u32> = board.estimates.iter().map(|estimate| estimate.frame).collect();
    assert_eq!(frames, [0, 1, 2, 3, 4, 5]);
    let x = board.estimates.last().map(|estimate| estimate.map_from_sensor.translation.x);
    assert!(x.is_some_and(|x| (x - 1.5).abs() < 0.1), "driven 1.5 m, found {x:?}");
}

#[test]
fn a_refused_scan_is_a_fault_and_changes_nothing_else() {
    let (without, _) = drive(steady(5));
    // A scan that comes late, one that comes twice, and one whose stamp is none.
    for (sequence, stamp_s, error) in [
        (1, 0.1, OdometryError::TimeWentBack { previous_s: 0.2, current_s: 0.1 }),
        (2, 0.2, OdometryError::TimeWentBack { previous_s: 0.2, current_s: 0.2 }),
        (2, f64::NAN, OdometryError::StampNotFinite),
    ] {
        let (mut scans, sequences) = (steady(5), vec![0, 1, 2, sequence, 3, 4]);
        scans.insert(3, (stamp_s, street(16000, 3.0)));
        let (with, totals, _) = drive_with(FakeBoard { scans, sequences, ..FakeBoard::default() }, POINTS);
        assert_eq!(with.faults, [Fault::Refused(error)]);
        assert_eq!((totals.scans, totals.estimates, totals.faults), (6, 5, 1));
        assert_eq!(with.estimates, without.estimates);
    }
}

#[test]
fn an_over_full_scan_is_a_fault_and_is_cut() {
    let capacity = 6000;
    let (cut, ..) =
        drive_with(FakeBoard { scans: vec![(0.0, street(capacity, 0.0))], ..FakeBoard::default() }, capacity);
    let (full, totals, _) =
        drive_with(FakeBoard { scans: vec![(0.0, street(16000, 0.0))], ..FakeBoard::default() }, capacity);
    assert_eq!(full.faults, [Fault::PointsLost { received: 16000, capacity }]);
    assert_eq!(full.estimates, cut.estimates);
    assert_eq!(full.estimates[0].evidence.points.received, capacity as u32);
    assert_eq!((totals.faults, totals.high_water.points), (1, 16000));
}

#[test]
fn a_scan_that_cannot_be_registered_is_counted() {
    let mut scans = steady(4);
    scans[2].1.clear();
    let (board, totals) = drive(scans);
    assert!(matches!(board.estimates[2].status, FrameStatus::Predicted(_)));
    assert_eq!((totals.estimates, totals.predicted, totals.faults), (4, 1, 0));
}

/// All fields, in the order of the struct.
fn fields(buffers: &BufferUse) -> [u32; 10] {
    let b = buffers;
    [
        b.cells,
        b.cells_refused,
        b.landmarks,
        b.landmarks_refused,
        b.tracks,
        b.tracks_refused,
        b.voxels,
        b.voxels_evicted,
        b.submap_landmarks,
        b.submap_landmarks_evicted,
    ]
}

#[test]
fn high_water_marks_are_the_most_of_any_scan() {
    let mut scans: Vec<_> = steady(3);
    // More things of movable classes than there are landmarks and tracks.
    let crowd = (0..40).flat_map(|thing| {
        let (x, y) = (3.0 * (thing % 8) as f32 - 12.0, 3.0 * (thing / 8) as f32 - 6.0);
        (0..40).map(move |i| {
            LabelledPoint::new([x, y + 0.01 * i as f32, 0.04 * i as f32 - 1.0], SemanticClass::Person)
        })
    });
    scans[1].1 = crowd.collect();
    let (board, totals) = drive(scans);
    let most = board.estimates.iter().map(|estimate| fields(&estimate.evidence.buffers));
    let most = most.reduce(|a, b| std::array::from_fn(|k| a[k].max(b[k]))).expect("estimates");
    let high = totals.high_water;
    assert_eq!(fields(&high.buffers), most);
    assert_eq!(high.points, 16000);
    assert!(high.buffers.landmarks_refused > 0 && high.buffers.tracks_refused > 0, "{high:?}");
    let last = board.estimates[2].evidence.buffers;
    assert!(high.buffers.landmarks > last.landmarks, "the mark stays when the crowd is gone: {last:?}");
}

#[test]
fn an_error_of_the_board_ends_the_loop_and_keeps_the_totals() {
    let board = FakeBoard { scans: steady(5), fail_at: Some(3), ..FakeBoard::default() };
    let (board, totals, end) = drive_with(board, POINTS);
    assert_eq!(end, Err("the sensor is gone"));
    assert_eq!((totals.scans, totals.estimates, board.estimates.len()), (3, 3, 3));
}

#[test]
fn the_parts_of_the_memory_are_the_whole() {
    let parts = SmallOdometry::parts();
    let bytes: usize = parts.iter().map(|part| part.bytes).sum();
    assert_eq!(bytes, size_of::<SmallOdometry>());
    let rest = parts.last().map(|part| part.bytes);
    assert!(rest.is_some_and(|rest| rest < bytes / 50), "parts that have no row: {rest:?} of {bytes} bytes");
}

#[test]
fn a_clock_that_is_set_loses_no_scan_and_changes_no_pose() {
    let (steady_clock, _) = drive(steady(6));
    for by_s in [-3600.0, -0.5, -0.2, -0.1, 0.1, 0.2, 0.5, 1e6] {
        let mut scans = steady(6);
        for (stamp_s, _) in &mut scans[3..] {
            *stamp_s += by_s;
        }
        let (board, totals) = drive(scans);
        assert!(matches!(board.faults[..], [Fault::ClockSet { by_s: found }] if (found - by_s).abs() < 1e-6));
        assert_eq!((totals.estimates, totals.predicted), (6, 0), "set by {by_s} s");
        for (set, steady) in board.estimates.iter().zip(&steady_clock.estimates) {
            let apart = set.map_from_sensor.translation.vector - steady.map_from_sensor.translation.vector;
            assert!(apart.norm() < 1e-3, "set by {by_s} s: {apart}");
        }
        let stamps: Vec<f64> = board.estimates[3..].iter().map(|estimate| estimate.stamp_s).collect();
        assert!(stamps.iter().all(|s| (s - by_s) < 0.6), "the answer has the sensor's stamp: {stamps:?}");
    }
}

#[test]
fn late_answers_are_faults() {
    let (board, totals, _) =
        drive_with(FakeBoard { scans: steady(3), busy_us: 100_001, ..FakeBoard::default() }, POINTS);
    assert_eq!(board.faults, [Fault::Late { took_us: 100_001 }; 3]);
    assert_eq!((totals.longest_us, board.fed), (100_001, 3));
    let (on_time, ..) = drive_with(
        FakeBoard { scans: steady(3), busy_us: 100_000, late_us: 30_000, ..FakeBoard::default() },
        POINTS,
    );
    assert_eq!(on_time.faults, []);
}

/// Drives through `steady(8)`, the sensor's clock set back in the fourth scan.
fn with_a_clock_set(scans: std::ops::Range<usize>) -> FakeBoard {
    let mut all = steady(8);
    for (stamp_s, _) in &mut all[3..] {
        *stamp_s -= 100.0;
    }
    let sequences = scans.clone().map(|scan| scan as u32).collect();
    FakeBoard { scans: all[scans].to_vec(), sequences, ..FakeBoard::default() }
}

/// What was saved after five scans of that drive.
fn saved_after_five() -> Vec<u8> {
    let room = vec![0; size_of::<SmallOdometry>() + SAVED_HEAD_BYTES];
    let (mut board, ..) = drive_with(FakeBoard { room, ..with_a_clock_set(0..5) }, POINTS);
    board.room.truncate(board.saved_bytes);
    board.room
}

/// The text of the numbers shows every bit.
fn bits(estimates: &[FrameEstimate]) -> Vec<String> {
    estimates.iter().map(|estimate| format!("{estimate:?}")).collect()
}

#[test]
fn after_a_power_cycle_the_loop_goes_on_with_the_same_bits() {
    let (without, ..) = drive_with(with_a_clock_set(0..8), POINTS);
    let (resumed, totals, _) =
        drive_with(FakeBoard { saved: Some(saved_after_five()), ..with_a_clock_set(5..8) }, POINTS);
    assert_eq!((totals.resumed, totals.estimates, &resumed.faults[..]), (1, 3, &[][..]));
    assert_eq!(bits(&resumed.estimates), bits(&without.estimates[5..]));
}

#[test]
fn a_damaged_state_is_refused_and_the_loop_starts_anew() {
    let (anew, ..) = drive_with(with_a_clock_set(5..8), POINTS);
    let good = saved_after_five();
    for (at, error) in [
        (0, SnapshotError::NotASnapshot),
        (10, SnapshotError::Checksum),
        (SAVED_HEAD_BYTES, SnapshotError::NotASnapshot),
        (good.len() / 2, SnapshotError::Checksum),
    ] {
        let mut damaged = good.clone();
        damaged[at] ^= 0x10;
        let (board, totals, _) =
            drive_with(FakeBoard { saved: Some(damaged), ..with_a_clock_set(5..8) }, POINTS);
        assert_eq!((totals.resumed, &board.faults[..]), (0, &[Fault::NotRestored(error)][..]));
        assert_eq!(bits(&board.estimates), bits(&anew.estimates));
    }
}

#[test]
fn a_state_that_does_not_fit_is_a_fault_and_nothing_else() {
    let (without, _) = drive(steady(3));
    let board = FakeBoard { scans: steady(3), room: vec![0; 1000], ..FakeBoard::default() };
    let (board, ..) = drive_with(board, POINTS);
    assert_eq!(board.faults, [Fault::NotSaved(SnapshotError::BufferFull); 3]);
    assert_eq!((board.saved_bytes, bits(&board.estimates)), (0, bits(&without.estimates)));
}
