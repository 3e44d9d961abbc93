//! A street along x: facades with gaps, trees, poles, parked cars, and what moves on it.

use sdslam_core::SemanticClass;

use crate::world::{Plan, Solid, World, unit};

fn block(at: [f64; 2], half_m: [f64; 2], height: [f64; 2], class: SemanticClass) -> Solid {
    let plan = Plan::Block { half_m };
    Solid { at, velocity: [0.0; 2], plan, height, class, rough_m: 0.0 }
}

fn post(at: [f64; 2], radius_m: f64, height: [f64; 2], class: SemanticClass) -> Solid {
    Solid { at, velocity: [0.0; 2], plan: Plan::Post { radius_m }, height, class, rough_m: 0.0 }
}

/// A car.
pub fn car(at: [f64; 2], speed_mps: f64) -> Solid {
    Solid { velocity: [speed_mps, 0.0], ..block(at, [2.1, 0.85], [0.25, 1.5], SemanticClass::Car) }
}

/// A bicyclist.
pub fn bicyclist(at: [f64; 2], speed_mps: f64) -> Solid {
    Solid { velocity: [speed_mps, 0.0], ..block(at, [0.8, 0.3], [0.1, 1.75], SemanticClass::Bicyclist) }
}

/// Everything that stands still along a street from x = -80 m to `length_m` + 80 m; no two stretches are alike.
pub fn street(length_m: f64, seed: u64) -> World {
    let mut solids = Vec::new();
    for (lane, side) in [1.0, -1.0].into_iter().enumerate() {
        facades(&mut solids, length_m, side, seed + 10 * lane as u64);
        furniture(&mut solids, length_m, side, seed + 10 * lane as u64);
    }
    World { solids }
}

fn facades(solids: &mut Vec<Solid>, length_m: f64, side: f64, seed: u64) {
    let mut x = -80.0;
    for k in 0.. {
        if x > length_m + 80.0 {
            return;
        }
        let draw = |what| unit(seed, k, what);
        let (half, gap) = (4.0 + 4.0 * draw(1), 1.5 + 5.0 * draw(2));
        let setback = 9.5 + 3.0 * draw(3);
        let height = [-0.5, 5.0 + 5.0 * draw(4)];
        solids.push(block([x + half, side * (setback + 4.0)], [half, 4.0], height, SemanticClass::Building));
        x += 2.0 * half + gap;
    }
}

fn furniture(solids: &mut Vec<Solid>, length_m: f64, side: f64, seed: u64) {
    for k in 0..((length_m + 160.0) / 12.0) as u64 {
        let x = -80.0 + 12.0 * k as f64;
        let draw = |what| unit(seed, k, what);
        let tree = [x + 4.0 * draw(5), side * (6.3 + 0.6 * draw(6))];
        let crown = Solid {
            rough_m: 0.15,
            ..block(tree, [1.3, 1.3], [2.4, 4.5 + draw(7)], SemanticClass::Vegetation)
        };
        solids.extend([post(tree, 0.17, [-0.5, 2.4], SemanticClass::Trunk), crown]);
        solids.push(post([x + 6.0 + 3.0 * draw(8), side * 5.4], 0.09, [-0.5, 5.0], SemanticClass::Pole));
        if draw(9) < 0.6 {
            solids.push(car([x + 3.0 + 3.0 * draw(10), side * 3.6], 0.0));
        }
    }
}
