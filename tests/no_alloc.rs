//! The core never allocates: an allocator counts every call while whole frames are processed.

use assert_no_alloc::{AllocDisabler, assert_no_alloc, reset_violation_count, violation_count};
use sdslam_core::loop_closure::{self, FeatureExtractor, LoopDetector};
use sdslam_core::pose;
use sdslam_core::{Config, FrameStatus, FullScanOdometry, LabelledPoint, LabelledScan};
use sdslam_tests::drive::{Drive, Frame};
use sdslam_tests::loops;
use sdslam_tests::odometry::{TinyOdometry, full_scan, on_heap};

#[global_allocator]
static COUNTING: AllocDisabler = AllocDisabler;

/// Calls of the allocator, by this thread, while `work` runs.
fn allocations<T>(work: impl FnOnce() -> T) -> (T, u32) {
    reset_violation_count();
    let result = assert_no_alloc(work);
    (result, violation_count())
}

/// Processes a frame, counting; also looks at everything that the caller can ask for.
fn process(odometry: &mut FullScanOdometry, frame: &Frame) -> (FrameStatus, u32) {
    let mut points = frame.points.clone();
    let mut scan = LabelledScan { stamp_s: frame.stamp_s, points: &mut points };
    allocations(|| {
        let estimate = odometry.process_scan(&mut scan).expect("the stamps are in order");
        let tracks = odometry.tracks().count();
        assert!(tracks == estimate.evidence.buffers.tracks as usize && odometry.landmarks().len() < 400);
        estimate.status
    })
}

#[test]
fn the_counter_counts() {
    let (grown, calls) = allocations(|| vec![1, 2, 3]);
    assert!(calls > 0 && grown.len() == 3);
    assert_eq!(allocations(|| grown[1] + 1), (3, 0));
}

#[test]
fn whole_drives_are_processed_without_allocating() {
    let drive = Drive::down_the_street(25, 8.0);
    for config in [Config::accurate(), Config::paper()] {
        let mut odometry = full_scan(config);
        for frame in &drive.frames {
            let (status, calls) = process(&mut odometry, frame);
            assert_eq!(calls, 0, "{status:?} at {} s", frame.stamp_s);
        }
        let ((), calls) = allocations(|| odometry.reset());
        assert_eq!(calls, 0, "reset");
    }
}

#[test]
fn bad_scans_are_handled_without_allocating() {
    let mut drive = Drive::down_the_street(12, 8.0);
    drive.frames[3].points.clear();
    drive.frames[5].points.iter_mut().step_by(2).for_each(|p| p.position[1] = f32::NAN);
    drive.frames[7].points.iter_mut().for_each(|p| p.class = sdslam_core::SemanticClass::Car);
    let mut odometry = full_scan(Config::accurate());
    let statuses: Vec<FrameStatus> = drive
        .frames
        .iter()
        .map(|frame| {
            let (status, calls) = process(&mut odometry, frame);
            assert_eq!(calls, 0, "{status:?} at {} s", frame.stamp_s);
            status
        })
        .collect();
    assert!(matches!(statuses[3], FrameStatus::Predicted(_)), "{statuses:?}");
    let mut points: Vec<LabelledPoint> = drive.frames[0].points.clone();
    let mut late = LabelledScan { stamp_s: 0.0, points: &mut points };
    let (result, calls) = allocations(|| odometry.process_scan(&mut late));
    assert!(result.is_err() && calls == 0);
}

#[test]
fn full_buffers_do_not_allocate() {
    let mut tiny: Box<TinyOdometry> = on_heap(Config::accurate());
    for frame in &Drive::down_the_street(10, 8.0).frames {
        let mut points = frame.points.clone();
        let mut scan = LabelledScan { stamp_s: frame.stamp_s, points: &mut points };
        let (estimate, calls) = allocations(|| tiny.process_scan(&mut scan));
        let buffers = estimate.expect("the stamps are in order").evidence.buffers;
        assert!(calls == 0 && buffers.cells_refused > 0, "{calls} calls, {buffers:?}");
    }
}

#[test]
fn loops_are_found_without_allocating() {
    let drive = Drive::down_the_street(12, 8.0);
    for config in [loop_closure::Config::DEFAULT, loop_closure::Config::PAPER] {
        let mut extractor = loops::on_heap(FeatureExtractor::<4096>::new);
        // So small that places are forgotten.
        let mut detector: Box<LoopDetector<4, 512>> = loops::detector(config);
        let mut found = 0;
        for frame in drive.frames.iter().chain(&drive.frames) {
            let ((), calls) = allocations(|| {
                extractor.clear();
                extractor.add(&config, &frame.points, &pose::IDENTITY);
                let features = extractor.finish(&config);
                found += detector.query(&features, None).len();
                detector.add(0, frame.stamp_s, &features);
            });
            assert_eq!(calls, 0, "{:?} at {} s", config.rule, frame.stamp_s);
        }
        assert!(found > 0 && detector.forgotten() > 0);
    }
}
