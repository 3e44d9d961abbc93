//! The relief of a town without its streets.

use nalgebra::{Point2, Vector2};

use super::{
    options::TownOptions,
    plan::Plan,
    random::{Domain, Random},
};

/// Distance of the hills [m].
const HILL_SPACING_M: f32 = 120.0;

/// Smooth heights: two long waves and some hills.
#[derive(Debug)]
pub struct Relief {
    waves: Vec<(Vector2<f64>, f64, f64)>,
    hills: Vec<(Point2<f64>, f64, f64)>,
}

impl Relief {
    /// Draws the relief of a seed.
    pub fn draw(seed: u64, town: &TownOptions, plan: &Plan) -> Self {
        let mut random = Random::keyed(seed, Domain::Plan, &[1]);
        let wave = |random: &mut Random| {
            let angle = f64::from(random.between(0.0, 6.3));
            let number = std::f64::consts::TAU / f64::from(random.between(200.0, 320.0));
            (Vector2::new(angle.cos(), angle.sin()) * number, f64::from(random.between(0.0, 6.3)), 0.7)
        };
        let waves = vec![wave(&mut random), wave(&mut random)];
        let mut hills = Vec::new();
        let [x0, x1, y0, y1] = plan.extent();
        let middle = Point2::new(0.5 * (x0 + x1), 0.5 * (y0 + y1));
        // One hill beside the middle of the town, where drives begin, and others around it.
        let beside = Vector2::new(random.pick(&[-24.0, 24.0]), random.between(-24.0, 24.0));
        let around = |length: f32| (0.5 * length / HILL_SPACING_M).ceil() as i32;
        let (columns, rows) = (around(x1 - x0), around(y1 - y0));
        for (i, j) in (-columns..=columns).flat_map(|i| (-rows..=rows).map(move |j| (i, j))) {
            let shift = Vector2::new(random.between(-15.0, 15.0), random.between(-15.0, 15.0));
            let shift = if (i, j) == (0, 0) { Vector2::zeros() } else { shift };
            let at = middle + beside + shift + Vector2::new(i as f32, j as f32) * HILL_SPACING_M;
            let height = if (i, j) == (0, 0) { 1.0 } else { random.between(0.5, 1.0) };
            let width = f64::from(random.between(28.0, 34.0));
            hills.push((at.cast::<f64>(), f64::from(town.hill_m * height), width));
        }
        Self { waves, hills }
    }

    /// Height at a place of the town [m].
    pub fn height(&self, q: Point2<f64>) -> f64 {
        let waves: f64 = self.waves.iter().map(|(k, phase, a)| a * (k.dot(&q.coords) + phase).sin()).sum();
        let hill = |(middle, height, width): &(Point2<f64>, f64, f64)| {
            let far = (q - middle).norm_squared() / (2.0 * width * width);
            if far < 16.0 { height * (-far).exp() } else { 0.0 }
        };
        waves + self.hills.iter().map(hill).sum::<f64>()
    }
}
