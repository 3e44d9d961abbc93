//! A uniform grid over the ground plane and the walk of a ray through it.

use nalgebra::Vector2;

use super::shape::{Ray, Vec3};

/// Items sorted into square cells by their bounds.
#[derive(Debug)]
pub struct Grid {
    origin: Vector2<f32>,
    cell_m: f32,
    size: [usize; 2],
    /// `starts[c]..starts[c + 1]` are the items of cell `c`.
    starts: Vec<u32>,
    items: Vec<u32>,
    tops: Vec<f32>,
}

/// A cell on the way of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// The cell.
    pub cell: usize,
    /// Range at which the ray enters it [m].
    pub from_m: f32,
    /// Range at which the ray leaves it [m].
    pub to_m: f32,
}

impl Grid {
    /// Sorts items with these bounds into a grid.
    pub fn new(origin: Vector2<f32>, extent: Vector2<f32>, cell_m: f32, bounds: &[(Vec3, Vec3)]) -> Self {
        let size = [(extent.x / cell_m).ceil() as usize, (extent.y / cell_m).ceil() as usize];
        let mut grid = Self { origin, cell_m, size, starts: vec![], items: vec![], tops: vec![] };
        let mut cells = vec![Vec::new(); grid.len()];
        grid.tops = vec![f32::MIN; grid.len()];
        for (item, (low, high)) in bounds.iter().enumerate() {
            for cell in grid.cells_between(low.xy(), high.xy()) {
                cells[cell].push(item as u32);
                grid.tops[cell] = grid.tops[cell].max(high.z);
            }
        }
        grid.starts.push(0);
        for items in cells {
            grid.items.extend(items);
            grid.starts.push(grid.items.len() as u32);
        }
        grid
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Lower corner of a cell [m].
    pub fn corner(&self, cell: usize) -> Vector2<f32> {
        self.origin + Vector2::new((cell % self.size[0]) as f32, (cell / self.size[0]) as f32) * self.cell_m
    }

    /// The items of a cell.
    pub fn items(&self, cell: usize) -> &[u32] {
        &self.items[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// Highest item of a cell [m].
    pub fn top(&self, cell: usize) -> f32 {
        self.tops[cell]
    }

    /// The cells within a square around a place.
    pub fn cells_near(&self, at: Vector2<f32>, radius_m: f32) -> impl Iterator<Item = usize> + use<> {
        self.cells_between(at.add_scalar(-radius_m), at.add_scalar(radius_m))
    }

    fn cells_between(&self, low: Vector2<f32>, high: Vector2<f32>) -> impl Iterator<Item = usize> + use<> {
        let index = |c: f32, axis: usize| {
            let k = ((c - self.origin[axis]) / self.cell_m).floor();
            k.clamp(0.0, (self.size[axis] - 1) as f32) as usize
        };
        let columns = index(low.x, 0)..=index(high.x, 0);
        let width = self.size[0];
        (index(low.y, 1)..=index(high.y, 1)).flat_map(move |j| columns.clone().map(move |i| j * width + i))
    }

    /// The cells that a ray crosses, in order, from its start to `limit_m` or the edge of the grid.
    pub fn walk(&self, ray: &Ray, limit_m: f32) -> Walk<'_> {
        let axis = |k: usize| {
            let (from, rate) = (ray.origin[k] - self.origin[k], ray.direction[k]);
            let cell = (from / self.cell_m).floor() as i32;
            let edge = if rate > 0.0 { cell + 1 } else { cell };
            let next_m = if rate == 0.0 { f32::INFINITY } else { (edge as f32 * self.cell_m - from) / rate };
            Axis {
                cell,
                direction: if rate > 0.0 { 1 } else { -1 },
                next_m,
                step_m: self.cell_m / rate.abs(),
            }
        };
        Walk { grid: self, axes: [axis(0), axis(1)], from_m: 0.0, limit_m }
    }
}

#[derive(Clone, Copy, Debug)]
struct Axis {
    cell: i32,
    direction: i32,
    next_m: f32,
    step_m: f32,
}

/// The walk of a ray through a grid.
#[derive(Debug)]
pub struct Walk<'a> {
    grid: &'a Grid,
    axes: [Axis; 2],
    from_m: f32,
    limit_m: f32,
}

impl Iterator for Walk<'_> {
    type Item = Step;

    fn next(&mut self) -> Option<Step> {
        let inside = (0..2).all(|k| (0..self.grid.size[k] as i32).contains(&self.axes[k].cell));
        if !inside || self.from_m >= self.limit_m {
            return None;
        }
        let cell = self.axes[1].cell as usize * self.grid.size[0] + self.axes[0].cell as usize;
        let axis =
            if self.axes[0].next_m < self.axes[1].next_m { &mut self.axes[0] } else { &mut self.axes[1] };
        let to_m = axis.next_m.min(self.limit_m);
        axis.cell += axis.direction;
        axis.next_m += axis.step_m;
        let step = Step { cell, from_m: self.from_m, to_m };
        self.from_m = to_m;
        Some(step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        let item = (Vec3::new(4.5, 4.5, 0.0), Vec3::new(5.5, 6.5, 3.0));
        Grid::new(Vector2::zeros(), Vector2::new(20.0, 20.0), 1.0, &[item])
    }

    #[test]
    fn walk_is_gapless_and_every_step_lies_in_its_cell() {
        let grid = grid();
        for k in 0..60 {
            let angle = 0.1 * k as f32 + 0.01;
            let ray = Ray {
                origin: Vec3::new(9.7, 10.2, 1.0),
                direction: Vec3::new(angle.cos(), angle.sin(), 0.0),
            };
            let steps: Vec<Step> = grid.walk(&ray, 8.0).collect();
            assert_eq!(steps[0].from_m, 0.0);
            assert!((steps[steps.len() - 1].to_m - 8.0).abs() < 1e-5);
            for pair in steps.windows(2) {
                assert_eq!(pair[0].to_m, pair[1].from_m);
            }
            for step in steps {
                let middle = ray.at(0.5 * (step.from_m + step.to_m)).xy() - grid.corner(step.cell);
                assert!(middle.min() > -1e-3 && middle.max() < 1.0 + 1e-3);
            }
        }
    }

    #[test]
    fn item_is_in_every_cell_that_it_touches() {
        let grid = grid();
        let holding: Vec<usize> = (0..grid.len()).filter(|c| !grid.items(*c).is_empty()).collect();
        assert_eq!(holding, [84, 85, 104, 105, 124, 125]);
        assert_eq!((grid.top(84), grid.top(83)), (3.0, f32::MIN));
    }
}
