//! Odometries on the heap: they are too large for the stack of a test.

use sdslam_core::{
    Config, FrameEstimate, FullScanOdometry, LabelledPoint, LabelledScan, Odometry, TrackReport,
};

/// A profile so small that an ordinary scan fills every buffer.
pub type TinyOdometry = Odometry<2048, 64, 12, 2, 4, 4>;

/// Builds an odometry on a thread with a large stack, and moves it to the heap.
pub fn on_heap<
    const CELLS: usize,
    const INSTANCES: usize,
    const LANDMARKS: usize,
    const TRACKS: usize,
    const VOXEL_SETS: usize,
    const MAP_LANDMARKS: usize,
>(
    config: Config,
) -> Box<Odometry<CELLS, INSTANCES, LANDMARKS, TRACKS, VOXEL_SETS, MAP_LANDMARKS>> {
    let bytes = size_of::<Odometry<CELLS, INSTANCES, LANDMARKS, TRACKS, VOXEL_SETS, MAP_LANDMARKS>>();
    let builder = std::thread::Builder::new().stack_size(4 * bytes + (1 << 20));
    let build = move || Box::new(Odometry::new(config).expect("the configuration is valid"));
    builder.spawn(build).expect("a thread starts").join().expect("the odometry is built")
}

/// A full-scan odometry on the heap.
pub fn full_scan(config: Config) -> Box<FullScanOdometry> {
    on_heap(config)
}

/// What the core says about one scan, everything a caller can see.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Pose, status and evidence.
    pub estimate: FrameEstimate,
    /// Living tracks.
    pub tracks: Vec<TrackReport>,
    /// The scan's points with their landmarks.
    pub points: Vec<LabelledPoint>,
    /// Landmarks, written out (they cannot be compared).
    pub landmarks: String,
}

/// Processes a scan that must be accepted.
pub fn process(odometry: &mut FullScanOdometry, stamp_s: f64, points: &[LabelledPoint]) -> FrameEstimate {
    let mut points = points.to_vec();
    odometry
        .process_scan(&mut LabelledScan { stamp_s, points: &mut points })
        .expect("the stamp is after the one before it")
}

/// Processes a scan that must be accepted, and gives everything there is to see.
pub fn process_fully(odometry: &mut FullScanOdometry, stamp_s: f64, points: &[LabelledPoint]) -> Answer {
    let mut points = points.to_vec();
    let estimate = odometry
        .process_scan(&mut LabelledScan { stamp_s, points: &mut points })
        .expect("the stamp is after the one before it");
    Answer {
        estimate,
        tracks: odometry.tracks().collect(),
        landmarks: format!("{:?}", odometry.landmarks()),
        points,
    }
}
