//! The loop table of a vehicle: keyframes along the way, recognised when they are passed again.
//!
//! [`crate::run`] does not call it, for every scan pays for what that does: a board that wants loops feeds the table where it
//! publishes, as the desk does. Its panics are not proven away.

use sdslam_core::loop_closure::{Config, FeatureExtractor, LoopDetector};
use sdslam_core::{FrameEstimate, FrameStatus, LabelledPoint, MapPose, ParameterError};

use crate::memory::{LOOP_PARTS, Part};

/// Way between two keyframes \[m\],
const KEYFRAME_M: f64 = 2.0;
/// and turn that makes one before it \[rad\].
const KEYFRAME_TURN_RAD: f64 = 0.25;

/// What a loop table has seen, and what did not fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LoopUse {
    /// Places in the table.
    pub places: u32,
    /// Places forgotten because the table was full: loops to them are lost.
    pub places_forgotten: u32,
    /// Points left out for want of columns, over all keyframes.
    pub points_left_out: u32,
    /// Keyframes in which an old place was recognised.
    pub recognised: u32,
}

/// The loop table of a profile.
pub trait AnyLoops: Send {
    /// A table that knows no place.
    ///
    /// # Errors
    /// A parameter that is out of range.
    fn create(config: Config) -> Result<Self, ParameterError>
    where
        Self: Sized;

    /// Takes a scan and its estimate; at every keyframe it asks for old places and adds a new one.
    fn add_scan(&mut self, estimate: &FrameEstimate, points: &[LabelledPoint]);

    /// Forgets everything.
    fn clear(&mut self);

    /// What it has seen so far.
    fn usage(&self) -> LoopUse;

    /// The parts of its memory.
    fn parts() -> [Part; LOOP_PARTS]
    where
        Self: Sized;
}

/// A loop table; its capacities are explained in [`sdslam_core::capacity`]. It is large: see [`LoopDetector`].
pub struct LoopTable<const PLACES: usize, const BUCKETS: usize, const COLUMNS: usize> {
    config: Config,
    detector: LoopDetector<PLACES, BUCKETS>,
    extractor: FeatureExtractor<COLUMNS>,
    /// Pose and stamp \[s\] of the keyframe whose features are being gathered.
    keyframe: Option<(MapPose, f64)>,
    usage: LoopUse,
}

impl<const PLACES: usize, const BUCKETS: usize, const COLUMNS: usize> LoopTable<PLACES, BUCKETS, COLUMNS> {
    /// The features of the last keyframe are complete: looks for old places, then makes it one.
    fn complete(&mut self, stamp_s: f64) {
        let features = self.extractor.finish(&self.config);
        self.usage.points_left_out += self.extractor.left_out();
        self.extractor.clear();
        let found = self.detector.query(&features, Some(stamp_s));
        self.usage.recognised += u32::from(!found.is_empty());
        let number = self.usage.places + self.usage.places_forgotten;
        self.detector.add(number, stamp_s, &features);
        self.usage.places = self.detector.len() as u32;
        self.usage.places_forgotten = self.detector.forgotten();
    }
}

/// The vehicle has gone on far enough for the next keyframe.
fn is_left_behind(keyframe: &MapPose, pose: &MapPose) -> bool {
    let moved = keyframe.inv_mul(pose);
    moved.translation.vector.norm() >= KEYFRAME_M || moved.rotation.angle() >= KEYFRAME_TURN_RAD
}

impl<const PLACES: usize, const BUCKETS: usize, const COLUMNS: usize> AnyLoops
    for LoopTable<PLACES, BUCKETS, COLUMNS>
{
    fn create(config: Config) -> Result<Self, ParameterError> {
        Ok(Self {
            config,
            detector: LoopDetector::new(config)?,
            extractor: FeatureExtractor::new(),
            keyframe: None,
            usage: LoopUse::default(),
        })
    }

    fn add_scan(&mut self, estimate: &FrameEstimate, points: &[LabelledPoint]) {
        if matches!(estimate.status, FrameStatus::Predicted(_)) {
            return;
        }
        let pose = estimate.map_from_sensor;
        let keyframe = match self.keyframe {
            Some((keyframe, stamp_s)) if is_left_behind(&keyframe, &pose) => {
                self.complete(stamp_s);
                *self.keyframe.insert((pose, estimate.stamp_s))
            }
            _ => *self.keyframe.get_or_insert((pose, estimate.stamp_s)),
        };
        self.extractor.add(&self.config, points, &keyframe.0.inv_mul(&pose).cast());
    }

    fn clear(&mut self) {
        self.detector.clear();
        self.extractor.clear();
        (self.keyframe, self.usage) = (None, LoopUse::default());
    }

    fn usage(&self) -> LoopUse {
        self.usage
    }

    fn parts() -> [Part; LOOP_PARTS] {
        let columns = size_of::<FeatureExtractor<COLUMNS>>();
        [
            Part { name: "loop places", capacity: PLACES, bytes: size_of::<Self>() - columns },
            Part { name: "loop columns", capacity: COLUMNS, bytes: columns },
        ]
    }
}

/// A profile without loops.
pub struct NoLoops;

impl AnyLoops for NoLoops {
    fn create(_: Config) -> Result<Self, ParameterError> {
        Ok(Self)
    }

    fn add_scan(&mut self, _: &FrameEstimate, _: &[LabelledPoint]) {}

    fn clear(&mut self) {}

    fn usage(&self) -> LoopUse {
        LoopUse::default()
    }

    fn parts() -> [Part; LOOP_PARTS] {
        ["loop places", "loop columns"].map(|name| Part { name, capacity: 0, bytes: 0 })
    }
}
