//! A grid for planning: what stands on the ground, where the ground is free, and what is not known.

use std::collections::HashMap;

use sdslam_core::MotionClass;

use super::StaticMap;

/// Heights above the ground that are in a vehicle's way \[m\].
const OBSTACLE_M: (f32, f32) = (0.3, 2.5);
/// The height of the ground is known per square of this size \[m\].
const GROUND_M: f32 = 1.0;
/// The ground of a square without any is looked for this many squares around.
const GROUND_REACH: i32 = 3;
/// Values of a pixel as ROS' map_server reads them.
const OCCUPIED: u8 = 0;
const UNKNOWN: u8 = 205;
const FREE: u8 = 254;
/// Cells a side at most; a larger map is written coarser.
const MAX_SIDE: usize = 16384;

/// Obstacles and free ground from above.
#[derive(Clone, Debug, PartialEq)]
pub struct ObstacleGrid {
    /// Edge of a cell \[m\].
    pub cell_m: f64,
    /// Lower left corner \[m\], map frame.
    pub origin: [f64; 2],
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// 0 occupied, 254 free, 205 unknown; row by row, the largest y first.
    pub pixels: Vec<u8>,
}

impl StaticMap {
    /// The grid, as fine as the map.
    pub fn obstacle_grid(&self) -> ObstacleGrid {
        let mut grid = ObstacleGrid::around(self);
        let ground = self.ground_heights();
        for cell in &self.cells {
            let Some(pixel) = grid.pixel(cell.position) else { continue };
            let is_ground = cell.class.motion() == MotionClass::Ground;
            if is_ground && grid.pixels[pixel] == UNKNOWN {
                grid.pixels[pixel] = FREE;
            }
            let above = |ground_m: f32| cell.position[2] - ground_m;
            let in_the_way = |ground_m| (OBSTACLE_M.0..=OBSTACLE_M.1).contains(&above(ground_m));
            if !is_ground && ground_below(&ground, cell.position).is_some_and(in_the_way) {
                grid.pixels[pixel] = OCCUPIED;
            }
        }
        grid
    }

    /// Lowest ground per square of [`GROUND_M`].
    fn ground_heights(&self) -> HashMap<[i32; 2], f32> {
        let mut heights = HashMap::new();
        for cell in self.cells.iter().filter(|cell| cell.class.motion() == MotionClass::Ground) {
            let lowest = heights.entry(square(cell.position)).or_insert(f32::INFINITY);
            *lowest = cell.position[2].min(*lowest);
        }
        heights
    }
}

fn square([x, y, _]: [f32; 3]) -> [i32; 2] {
    [x, y].map(|v| (v / GROUND_M).floor() as i32)
}

/// The ground in the square of a place or, if there is none, the lowest in the nearest squares that have some.
fn ground_below(heights: &HashMap<[i32; 2], f32>, position: [f32; 3]) -> Option<f32> {
    let [x, y] = square(position);
    (0..=GROUND_REACH).find_map(|reach| {
        let around = (-reach..=reach).flat_map(|dx| (-reach..=reach).map(move |dy| [dx, dy]));
        let ring = around.filter(|[dx, dy]| dx.abs().max(dy.abs()) == reach);
        ring.filter_map(|[dx, dy]| heights.get(&[x + dx, y + dy]).copied()).reduce(f32::min)
    })
}

impl ObstacleGrid {
    /// Unknown everywhere, as large as the map.
    fn around(map: &StaticMap) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for cell in &map.cells {
            for axis in 0..2 {
                low[axis] = low[axis].min(cell.position[axis].into());
                high[axis] = high[axis].max(cell.position[axis].into());
            }
        }
        if map.cells.is_empty() {
            (low, high) = ([0.0; 2], [0.0; 2]);
        }
        let longest_m = (high[0] - low[0]).max(high[1] - low[1]);
        let cell_m = map.voxel_m.max(longest_m / (MAX_SIDE - 2) as f64);
        let origin = low.map(|v| (v / cell_m).floor() * cell_m);
        let cells = |axis: usize| ((high[axis] - origin[axis]) / cell_m).floor() as usize + 1;
        let (width, height) = (cells(0), cells(1));
        Self { cell_m, origin, width, height, pixels: vec![UNKNOWN; width * height] }
    }

    /// Index of the pixel of a place in the map, if the grid reaches there.
    pub fn pixel(&self, [x, y, _]: [f32; 3]) -> Option<usize> {
        let column = ((f64::from(x) - self.origin[0]) / self.cell_m).floor();
        let row = ((f64::from(y) - self.origin[1]) / self.cell_m).floor();
        let inside = (0.0..self.width as f64).contains(&column) && (0.0..self.height as f64).contains(&row);
        inside.then(|| (self.height - 1 - row as usize) * self.width + column as usize)
    }

    /// Binary PGM.
    pub fn to_pgm(&self) -> Vec<u8> {
        let mut pgm = format!("P5\n{} {}\n255\n", self.width, self.height).into_bytes();
        pgm.extend(&self.pixels);
        pgm
    }

    /// The YAML beside the image of that name, as ROS' map_server reads it.
    pub fn to_yaml(&self, image: &str) -> String {
        let [x, y] = self.origin;
        format!(
            "image: {image}\nresolution: {}\norigin: [{x}, {y}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
            self.cell_m
        )
    }
}
