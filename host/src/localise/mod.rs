//! A vehicle in a saved map: finds itself by the features of its places, then tracks by dense registration. The map stays
//! as it is.
//!
//! The odometry carries the pose from scan to scan; the registration against the map takes out its drift. A scan that
//! does not fit keeps the odometry's step; after many of them the search begins again.

mod index;
mod search;

use sdslam_core::capacity::HostLoopDetector;
use sdslam_core::{LabelledPoint, MapPose};

use crate::config::HostConfig;
use crate::heap::on_heap;
use crate::loops::{Refined, Refiner, Verdict};
use crate::run::RunError;
use crate::saved_map::SavedMap;
use index::MapIndex;
use search::Search;

/// The map is loaded around the vehicle anew when it has gone this far \[m\].
const RELOAD_M: f64 = 8.0;
/// A scan in the map fits it at least this well, 0..1: less than a loop must, because the search is over.
const MIN_FIT: f32 = 0.6;
/// Share of the scan that lies on something in the map, 0..1.
const MIN_OVERLAP: f32 = 0.3;
/// The odometry is never off by more than this from scan to scan \[m\].
const MAX_CORRECTION_M: f32 = 0.7;
/// Scans in a row that do not fit before the vehicle is lost.
const MAX_MISSES: u32 = 20;

/// How a pose in the map came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LocalisationStatus {
    /// Not found yet, or lost.
    Searching,
    /// Registered in the map.
    Tracked,
    /// Carried on by the odometry: the scan does not fit the map.
    Predicted,
}

impl LocalisationStatus {
    /// For localisation.csv.
    pub fn name(self) -> &'static str {
        match self {
            Self::Searching => "searching",
            Self::Tracked => "tracked",
            Self::Predicted => "predicted",
        }
    }
}

/// Where the vehicle is.
#[derive(Clone, Copy, Debug)]
pub struct Localisation {
    /// How the pose came about.
    pub status: LocalisationStatus,
    /// Pose in the map; none while searching.
    pub map_from_sensor: Option<MapPose>,
    /// Share of the points above ground on something of their kind that fit it, 0..1.
    pub fit: f32,
    /// Share of the points above ground that lie on something of their kind, 0..1.
    pub overlap: f32,
}

impl Localisation {
    const SEARCHING: Self =
        Self { status: LocalisationStatus::Searching, map_from_sensor: None, fit: 0.0, overlap: 0.0 };

    fn of(status: LocalisationStatus, map_from_sensor: MapPose, refined: &Refined) -> Self {
        let Refined { fit, overlap, .. } = *refined;
        Self { status, map_from_sensor: Some(map_from_sensor), fit, overlap }
    }
}

/// Where to begin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// Anywhere in the map.
    Global,
    /// Near this place \[m\] with this heading \[rad\], map frame; height and slope are the map's.
    Near {
        /// x and y \[m\].
        position: [f64; 2],
        /// Heading \[rad\].
        yaw: f64,
    },
}

/// The vehicle is in the map.
struct Track {
    map_from_sensor: MapPose,
    odometry: MapPose,
    /// Where the map was loaded.
    map_from_centre: MapPose,
    misses: u32,
}

/// A saved map and where the vehicle is in it.
pub(crate) struct Localiser {
    saved: SavedMap,
    index: MapIndex,
    config: HostConfig,
    detector: Box<HostLoopDetector>,
    refiner: Refiner,
    search: Search,
    track: Option<Track>,
}

impl Localiser {
    pub(crate) fn new(saved: SavedMap, config: &HostConfig, start: Start) -> Result<Self, RunError> {
        let loop_closure = config.core.loop_closure;
        let mut detector = on_heap(move || HostLoopDetector::new(loop_closure))?;
        for (number, place) in (0..).zip(&saved.places) {
            detector.add(number, 0.0, &place.features);
        }
        Ok(Self {
            index: MapIndex::of(&saved.map),
            search: Search::new(&saved, start)?,
            saved,
            config: config.clone(),
            detector,
            refiner: Refiner::new(config.core)?,
            track: None,
        })
    }

    /// Takes the next scan with its pose by the odometry.
    pub(crate) fn add(&mut self, points: &[LabelledPoint], odometry: &MapPose) -> Localisation {
        if self.track.is_some() {
            return self.follow(points, odometry);
        }
        let Some((map_from_sensor, refined)) = self.find(points, odometry) else {
            return Localisation::SEARCHING;
        };
        self.begin_track(map_from_sensor, *odometry);
        Localisation::of(LocalisationStatus::Tracked, map_from_sensor, &refined)
    }

    /// The vehicle's pose once two finds agree.
    fn find(&mut self, points: &[LabelledPoint], odometry: &MapPose) -> Option<(MapPose, Refined)> {
        let proposals =
            self.search.proposals(&self.config, &mut self.detector, &self.saved, points, odometry);
        for map_from_sensor in proposals {
            // The place is the proposed pose itself.
            let place = self.index.around(&self.saved.map, &map_from_sensor);
            let refined = self.refiner.refine(points, &place, &MapPose::identity());
            if Verdict::against(&self.config.loops, &refined).is_none() {
                let found = map_from_sensor * refined.place_from_sensor;
                return self.search.confirm(&found, odometry).then_some((found, refined));
            }
        }
        None
    }

    fn begin_track(&mut self, map_from_sensor: MapPose, odometry: MapPose) {
        self.refiner.load_place(&self.index.around(&self.saved.map, &map_from_sensor));
        self.track = Some(Track { map_from_sensor, odometry, map_from_centre: map_from_sensor, misses: 0 });
        self.search.clear();
    }

    fn follow(&mut self, points: &[LabelledPoint], odometry: &MapPose) -> Localisation {
        let Some(track) = &mut self.track else { return Localisation::SEARCHING };
        let predicted = track.map_from_sensor * track.odometry.inv_mul(odometry);
        let mut centre_from_sensor = track.map_from_centre.inv_mul(&predicted);
        if centre_from_sensor.translation.vector.norm() > RELOAD_M {
            self.refiner.load_place(&self.index.around(&self.saved.map, &predicted));
            (track.map_from_centre, centre_from_sensor) = (predicted, MapPose::identity());
        }
        let refined = self.refiner.track(points, &centre_from_sensor);
        track.odometry = *odometry;
        let fits = refined.fit >= MIN_FIT
            && refined.overlap >= MIN_OVERLAP
            && refined.moved_m <= MAX_CORRECTION_M
            && refined.determined;
        if fits {
            (track.map_from_sensor, track.misses) = (track.map_from_centre * refined.place_from_sensor, 0);
            return Localisation::of(LocalisationStatus::Tracked, track.map_from_sensor, &refined);
        }
        (track.map_from_sensor, track.misses) = (predicted, track.misses + 1);
        if track.misses > MAX_MISSES {
            self.track = None;
            return Localisation::SEARCHING;
        }
        Localisation::of(LocalisationStatus::Predicted, predicted, &refined)
    }
}
