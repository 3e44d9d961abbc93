//! Least-squares planes through points that lie roughly level: z = a x + b y + c.

use nalgebra::{Matrix3, Vector3};

/// Sums for a robust fit of z = a x + b y + c.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlaneFit {
    h: Matrix3<f32>,
    g: Vector3<f32>,
}

/// The plane z = slope_x x + slope_y y + offset.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LevelPlane {
    /// Slope along x [-].
    pub slope_x: f32,
    /// Slope along y [-].
    pub slope_y: f32,
    /// Height at the origin [m].
    pub offset: f32,
}

impl LevelPlane {
    /// Height [m] of a point above the plane, measured vertically.
    pub fn height_above(&self, p: &Vector3<f32>) -> f32 {
        p.z - (self.slope_x * p.x + self.slope_y * p.y + self.offset)
    }
}

impl PlaneFit {
    /// Adds a point with a weight.
    pub fn add(&mut self, p: &Vector3<f32>, weight: f32) {
        let row = Vector3::new(p.x, p.y, 1.0);
        self.h += row * row.transpose() * weight;
        self.g += row * (p.z * weight);
    }

    /// The plane, or `None` when the points do not span one.
    pub fn solve(&self) -> Option<LevelPlane> {
        let s = self.h.cholesky()?.solve(&self.g);
        (s.x.is_finite() && s.y.is_finite() && s.z.is_finite()).then_some(LevelPlane {
            slope_x: s.x,
            slope_y: s.y,
            offset: s.z,
        })
    }
}

/// Plane through the points that `points` yields anew each round, re-weighted with a Cauchy kernel of `scale_m`.
pub fn fit_level<I: Iterator<Item = Vector3<f32>>>(
    points: impl Fn() -> I,
    scale_m: f32,
    rounds: u32,
    start: LevelPlane,
) -> Option<LevelPlane> {
    let mut plane = start;
    for _ in 0..rounds {
        let mut fit = PlaneFit::default();
        for p in points() {
            let r = plane.height_above(&p) / scale_m;
            fit.add(&p, 1.0 / (1.0 + r * r));
        }
        plane = fit.solve()?;
    }
    Some(plane)
}
