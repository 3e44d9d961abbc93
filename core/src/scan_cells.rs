//! A scan reduced to cells: the points of one class in one small cube, with their first and second moments.
//!
//! Everything after the label filter works on cells, so that the cost of a frame follows the area seen and not
//! the density of the sensor, and no index per point is needed: a point carries its cell, later its landmark.

use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

use crate::math::floor_i32;
use crate::scan::SemanticClass;

/// The points of one class in one cube. Sums are relative to the centre of the cube.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    key: u64,
    centre: [f32; 3],
    sum: [f32; 3],
    /// Sums of xx, xy, xz, yy, yz, zz.
    sum2: [f32; 6],
    count: u32,
    /// Class of the points.
    pub class: SemanticClass,
    /// Landmark of the cell, or [`Cell::NO_LANDMARK`].
    pub landmark: u16,
}

impl Cell {
    /// Value of [`Cell::landmark`] for a cell without one.
    pub const NO_LANDMARK: u16 = u16::MAX;

    /// Number of points.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Mean position [m], sensor frame.
    pub fn mean(&self) -> Vector3<f32> {
        Vector3::from(self.centre) + Vector3::from(self.sum) / self.count as f32
    }

    /// Covariance [m2] of the points about their mean.
    pub fn covariance(&self) -> Matrix3<f32> {
        let n = 1.0 / self.count as f32;
        let [x, y, z] = self.sum.map(|s| s * n);
        let [xx, xy, xz, yy, yz, zz] = self.sum2.map(|s| s * n);
        let (xx, xy, xz, yy, yz, zz) =
            (xx - x * x, xy - x * y, xz - x * z, yy - y * y, yz - y * z, zz - z * z);
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    }

    /// The block of 2 x 2 x 2 cells in which it lies, counted from far outside.
    pub fn block(&self) -> [u16; 3] {
        [32, 16, 0].map(|at| ((self.key >> at) as u16 ^ 0x8000) >> 1)
    }

    /// Moves all its points [m].
    pub fn shift(&mut self, by: &Vector3<f32>) {
        for (c, v) in self.centre.iter_mut().zip(by.iter()) {
            *c += v;
        }
    }

    fn add(&mut self, p: [f32; 3]) {
        let [x, y, z] = [p[0] - self.centre[0], p[1] - self.centre[1], p[2] - self.centre[2]];
        for (s, v) in self.sum.iter_mut().zip([x, y, z]) {
            *s += v;
        }
        for (s, v) in self.sum2.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *s += v;
        }
        self.count += 1;
    }
}

/// The cells of one scan: a hash grid of at most `CELLS` cells (a power of two, at most 32768).
///
/// Invariant: `slots[h]` is `EMPTY` or an index into `cells`; every cell is reachable from its hash without
/// meeting an empty slot, because there are twice as many slots as cells and nothing is removed.
pub struct ScanCells<const CELLS: usize> {
    cells: Vec<Cell, CELLS>,
    slots: [[u16; 2]; CELLS],
    /// Key and index of the cell of the last point: the next point of a beam is often in it too.
    last: (u64, u16),
}

const EMPTY: u16 = u16::MAX;
/// A key that no cell has.
const NO_KEY: u64 = u64::MAX;

impl<const CELLS: usize> ScanCells<CELLS> {
    /// No cells.
    pub const fn new() -> Self {
        const { assert!(CELLS.is_power_of_two() && CELLS <= 32768, "CELLS must be a power of two, at most 32768") };
        Self { cells: Vec::new(), slots: [[EMPTY; 2]; CELLS], last: (NO_KEY, 0) }
    }

    /// Forgets all cells.
    pub fn clear(&mut self) {
        self.cells.clear();
        self.slots.fill([EMPTY; 2]);
        self.last = (NO_KEY, 0);
    }

    /// Adds a point to the cell of its class and place; gives the cell's index, or `None` when all cells are taken.
    #[inline]
    pub fn add(&mut self, p: [f32; 3], class: SemanticClass, side_m: f32, inverse_side: f32) -> Option<u16> {
        let at = p.map(|v| floor_i32(v * inverse_side));
        let key = (class as u64) << 48
            | (at[0] as u16 as u64) << 32
            | (at[1] as u16 as u64) << 16
            | at[2] as u16 as u64;
        let index = if key == self.last.0 { self.last.1 } else { self.locate(key, class, at, side_m)? };
        self.last = (key, index);
        self.cells.get_mut(index as usize)?.add(p);
        Some(index)
    }

    /// The cell with this key, made if it is new.
    fn locate(&mut self, key: u64, class: SemanticClass, at: [i32; 3], side_m: f32) -> Option<u16> {
        let mask = 2 * CELLS - 1;
        let mut slot = (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as usize & mask;
        loop {
            let entry = self.slots.as_flattened_mut().get_mut(slot)?;
            if *entry == EMPTY {
                let index = self.cells.len() as u16;
                let centre = at.map(|i| (i as f32 + 0.5) * side_m);
                let empty = Cell {
                    key,
                    centre,
                    sum: [0.0; 3],
                    sum2: [0.0; 6],
                    count: 0,
                    class,
                    landmark: Cell::NO_LANDMARK,
                };
                self.cells.push(empty).ok()?;
                *entry = index;
            }
            if self.cells.get(*entry as usize)?.key == key {
                return Some(*entry);
            }
            slot = (slot + 1) & mask;
        }
    }

    /// The cells, in the order in which their first points came.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// The cells, to write their landmarks.
    pub fn cells_mut(&mut self) -> &mut [Cell] {
        &mut self.cells
    }
}
