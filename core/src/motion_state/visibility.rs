//! What the sensor saw through: coarse range images of the last scans.
//!
//! A thing that stands where the sensor recently looked through has moved there; a thing whose old place is now looked
//! through has left. Neither depends on which side of the thing is seen, which is what makes the centre of a parked
//! car wander when it is passed (weakness of eq. 5).

#[cfg(feature = "snapshot")]
mod snapshot;

use heapless::Deque;
use micromath::F32Ext;
use nalgebra::{Point3, Vector3};

use crate::capacity::RANGE_COLUMNS;
use crate::math;
use crate::pose::{self, Pose};
use crate::scan::LabelledPoint;

/// Rows of an image.
const ROWS: usize = 32;
/// Slope z / horizontal range of the lowest and of the highest row: covers -26 to +6 degrees.
const SLOPES: (f32, f32) = (-0.5, 0.1);
/// Points above which every other one is taken.
const DENSE_SCAN: usize = 80_000;
/// No return in this pixel.
const EMPTY: u16 = u16::MAX;
/// Images kept: a second of scans.
pub const HISTORY: usize = 11;

/// Nearest horizontal range per pixel [cm].
#[derive(Clone)]
struct RangeImage<const COLUMNS: usize> {
    ranges: [[u16; COLUMNS]; ROWS],
    local_from_sensor: Pose,
}

/// What an image says about a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// The sensor saw something farther away: the place was free.
    Free,
    /// The sensor saw something at this place.
    Occupied,
    /// Nothing can be said: hidden, outside the view, or no return.
    Unknown,
}

/// The last range images, newest at index 0; `COLUMNS` of them make a turn (see [`crate::capacity`]).
pub struct Visibility<const COLUMNS: usize = RANGE_COLUMNS> {
    images: [RangeImage<COLUMNS>; HISTORY],
    order: Deque<u8, HISTORY>,
}

/// Row, column and horizontal range [m] of a point in the sensor frame.
#[inline]
fn pixel<const COLUMNS: usize>(p: &Vector3<f32>) -> Option<(usize, usize, f32)> {
    let horizontal = math::sqrt(p.x * p.x + p.y * p.y);
    let row = (p.z / horizontal - SLOPES.0) * (ROWS as f32 / (SLOPES.1 - SLOPES.0));
    // micromath's atan2 is off by up to 0.16 degrees, the same for every image: right for choosing a column.
    let turn = F32Ext::atan2(p.y, p.x) * (0.5 / core::f32::consts::PI) + 0.5;
    let column = (turn * COLUMNS as f32) as usize % COLUMNS;
    (row >= 0.0 && row < ROWS as f32).then_some((row as usize, column, horizontal))
}

impl<const COLUMNS: usize> RangeImage<COLUMNS> {
    const EMPTY: Self = Self { ranges: [[EMPTY; COLUMNS]; ROWS], local_from_sensor: pose::IDENTITY };
}

impl<const COLUMNS: usize> Visibility<COLUMNS> {
    /// Nothing seen yet.
    pub const fn new() -> Self {
        const { assert!(COLUMNS > 0, "RANGE_COLUMNS must be positive") };
        Self { images: [RangeImage::EMPTY; HISTORY], order: Deque::new() }
    }

    /// Forgets all images.
    pub fn clear(&mut self) {
        self.order.clear();
    }

    /// Adds the image of a scan, in place of the oldest when the history is full. Points that are not finite are left out.
    pub fn add(&mut self, points: &[LabelledPoint], local_from_sensor: &Pose) {
        let slot =
            if self.order.is_full() { self.order.pop_back().unwrap_or(0) } else { self.order.len() as u8 };
        let Some(image) = self.images.get_mut(slot as usize) else { return };
        image.ranges = [[EMPTY; COLUMNS]; ROWS];
        image.local_from_sensor = *local_from_sensor;
        // Half a degree is wide: of a dense scan every other point fills a pixel as well.
        let stride = 1 + points.len() / DENSE_SCAN;
        for point in points.iter().step_by(stride) {
            let Some((row, column, range)) = pixel::<COLUMNS>(&Vector3::from(point.position)) else {
                continue;
            };
            let nearest = image.ranges.get_mut(row).and_then(|row| row.get_mut(column));
            let Some(nearest) = nearest else { continue };
            // 655 m at most: the cast saturates.
            *nearest = (*nearest).min((range * 100.0) as u16);
        }
        let _ = self.order.push_front(slot);
    }

    /// Corrects the pose of the newest image.
    pub fn set_newest_pose(&mut self, local_from_sensor: &Pose) {
        let newest = self.order.front().and_then(|slot| self.images.get_mut(*slot as usize));
        if let Some(image) = newest {
            image.local_from_sensor = *local_from_sensor;
        }
    }

    /// Moves the origin of the local frame.
    pub fn shift(&mut self, by: &Vector3<f32>) {
        for image in &mut self.images {
            image.local_from_sensor.translation.vector -= by;
        }
    }

    /// Images held.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// No image is held.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// What the image `age` scans before the newest says about a place in the local frame.
    pub fn seen(&self, age: usize, place: &Vector3<f32>, margin_m: f32) -> Seen {
        let image = self.order.iter().nth(age).and_then(|slot| self.images.get(*slot as usize));
        let Some(image) = image else { return Seen::Unknown };
        let p = image.local_from_sensor.inverse_transform_point(&Point3::from(*place)).coords;
        let Some((row, column, range)) = pixel::<COLUMNS>(&p) else { return Seen::Unknown };
        let at = |dr: isize, dc: usize| {
            let r = row.checked_add_signed(dr).filter(|r| *r < ROWS)?;
            let range = *image.ranges.get(r)?.get((column + COLUMNS + dc - 1) % COLUMNS)?;
            (range != EMPTY).then_some(f32::from(range) * 0.01)
        };
        let Some(centre) = at(0, 1) else { return Seen::Unknown };
        let around = (-1..=1).flat_map(|dr| (0..3).map(move |dc| (dr, dc)));
        let nearest = around.filter_map(|(dr, dc)| at(dr, dc)).fold(centre, f32::min);
        if nearest > range + margin_m {
            Seen::Free
        } else if math::abs(centre - range) <= margin_m || math::abs(nearest - range) <= margin_m {
            Seen::Occupied
        } else {
            Seen::Unknown
        }
    }

    /// Share of the places of which the image of that age says `what`.
    pub fn share(&self, what: Seen, age: usize, places: &[[f32; 3]], margin_m: f32) -> f32 {
        let count = places.iter().filter(|p| self.seen(age, &Vector3::from(**p), margin_m) == what).count();
        count as f32 / places.len().max(1) as f32
    }
}

impl<const COLUMNS: usize> Default for Visibility<COLUMNS> {
    fn default() -> Self {
        Self::new()
    }
}
