//! The landmarks of the local submap (section 3.4.1): for each the view with the most points so far.

use heapless::VecView;
use nalgebra::{Point3, Vector3};

use crate::landmarks::Landmark;
use crate::pose::Pose;

/// A landmark of the submap; its coordinates are in the local frame.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct MapLandmark {
    /// The landmark.
    pub landmark: Landmark,
    /// Path driven [m] when last seen.
    pub seen_at_m: f32,
}

/// Adds the landmarks of a scan, those that `usable` accepts: a known one is seen again, and replaced when the new view
/// has more points; an unknown one is added. Gives the number dropped although within the window: when the submap is
/// full, the one seen longest ago makes room.
pub fn merge(
    map: &mut VecView<MapLandmark>,
    landmarks: &[Landmark],
    local_from_sensor: &Pose,
    path_m: f32,
    window_m: f32,
    usable: impl Fn(&Landmark) -> bool,
) -> u32 {
    map.retain(|m| path_m - m.seen_at_m <= window_m);
    let mut dropped = 0;
    for landmark in landmarks.iter().filter(|l| usable(l)) {
        let moved = landmark.transformed(local_from_sensor);
        match find(map, &moved) {
            Some(known) => {
                known.seen_at_m = path_m;
                if moved.point_count >= known.landmark.point_count {
                    known.landmark = moved;
                }
            }
            None => {
                if map.is_full() {
                    let oldest =
                        map.iter().enumerate().min_by(|a, b| a.1.seen_at_m.total_cmp(&b.1.seen_at_m));
                    if let Some(index) = oldest.map(|(i, _)| i).filter(|i| *i < map.len()) {
                        map.swap_remove(index);
                        dropped += 1;
                    }
                }
                let _ = map.push(MapLandmark { landmark: moved, seen_at_m: path_m });
            }
        }
    }
    dropped
}

/// The known landmark that is the same thing: same family, and its box holds the centre.
fn find<'a>(map: &'a mut VecView<MapLandmark>, landmark: &Landmark) -> Option<&'a mut MapLandmark> {
    map.iter_mut().find(|m| {
        let known = &m.landmark;
        let holds = |k: usize| {
            let margin = 0.3;
            landmark.centre[k] > known.min[k] - margin && landmark.centre[k] < known.max[k] + margin
        };
        known.family == landmark.family && holds(0) && holds(1)
    })
}

/// Moves the origin of the local frame.
pub fn shift(map: &mut VecView<MapLandmark>, by: &Vector3<f32>) {
    let back = Pose::from_parts((-by).into(), nalgebra::UnitQuaternion::identity());
    for entry in map {
        entry.landmark = entry.landmark.transformed(&back);
    }
}

impl Landmark {
    /// The landmark seen from another frame; its box stays aligned with the axes.
    pub(crate) fn transformed(&self, target_from_source: &Pose) -> Self {
        let moved = |p: &[f32; 3]| -> [f32; 3] { (target_from_source * Point3::from(*p)).coords.into() };
        let mut result = self.clone();
        result.centre = moved(&self.centre);
        (result.min, result.max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in result.outline.iter_mut().flatten().flatten() {
            *p = moved(p);
            for k in 0..3 {
                result.min[k] = result.min[k].min(p[k]);
                result.max[k] = result.max[k].max(p[k]);
            }
        }
        for p in &mut result.samples {
            *p = moved(p);
        }
        result
    }
}
