//! Open land in varied towns: what stands in fields and along roads without sidewalks.

use nalgebra::Point2;

use super::{
    barriers, clutter, curved,
    kerbside::Kerb,
    open_blocks::{Yard, any_direction, plant_strip},
    plants,
    random::Random,
    scene::{Finish, Surface, rod},
    town::Site,
};

/// A few trees and bushes; now and then a tower.
pub fn fill_field(site: &mut Site, yard: &Yard, random: &mut Random) {
    for _ in 0..random.below(7) {
        let foot = site.foot(yard.anywhere(random));
        site.solids.extend(plants::varied_tree(foot, random));
    }
    for _ in 0..random.below(9) {
        let foot = site.foot(yard.anywhere(random));
        let (radius, free_path_m) = (random.between(0.3, 1.6), site.free_path_m(0.14, random));
        site.solids.extend(plants::bush(foot, radius, free_path_m, random));
    }
    if random.chance(0.06) {
        curved::add_rotunda(site, yard, random);
    }
}

/// Reflector posts, signs, bushes and trees along a road, and what shields it.
pub fn furnish_roadside(site: &mut Site, kerb: &Kerb, random: &mut Random) {
    let spacing = random.pick(&[4.0, 8.0, 16.0]);
    let trees = random.pick(&[0.0, 0.0, 0.1, 0.5]) * site.options.vegetation.min(1.5);
    let mut at = 5.0 + spacing * random.unit();
    while at < kerb.length_m - 5.0 {
        furnish_spot(site, kerb, at, trees, random);
        at += spacing * random.between(0.5, 1.5);
    }
    if random.chance(0.15) {
        let (from, width) = (random.between(0.8, 2.5), random.between(0.5, 3.0));
        let ends = [kerb.at(kerb.length_m - 6.0, from), kerb.at(6.0, from)];
        plant_strip(site, ends, width, random);
    }
    shield(site, kerb, random);
}

fn furnish_spot(site: &mut Site, kerb: &Kerb, at: f32, trees: f32, random: &mut Random) {
    let beside = random.between(1.0, 7.0);
    match random.unit() {
        draw if draw < trees => {
            let foot = site.foot(kerb.at(at, beside));
            site.solids.extend(plants::varied_tree(foot, random));
        }
        draw if draw < 0.60 => {
            let post = rod(Surface::matte(80, 0.5), [0.0, 0.0, -0.2], [0.0, 0.0, 0.95], 0.06);
            site.stand(&[post], kerb.at(at, 0.6), kerb.along);
        }
        draw if draw < 0.68 => site.stand(&clutter::sign(random), kerb.at(at, 0.9), -kerb.along),
        draw if draw < 0.73 => site.stand(&clutter::pole(random), kerb.at(at, 1.2), kerb.outward()),
        draw if draw < 0.75 => {
            site.stand(&clutter::board(random), kerb.at(at, beside), any_direction(random))
        }
        draw if draw < 0.80 => {
            let foot = site.foot(kerb.at(at, beside));
            let (radius, free_path_m) = (random.between(0.3, 1.2), site.free_path_m(0.14, random));
            site.solids.extend(plants::bush(foot, radius, free_path_m, random));
        }
        _ => {}
    }
}

/// A guard rail, noise wall or fence along the road.
fn shield(site: &mut Site, kerb: &Kerb, random: &mut Random) {
    let ends =
        |outside: f32| -> [Point2<f64>; 2] { [6.0, kerb.length_m - 6.0].map(|at| kerb.at(at, outside)) };
    let wide = kerb.street.half_width_m > 6.0;
    if random.chance(if wide { 0.6 } else { 0.3 }) {
        let outside = random.pick(&[0.3, 0.6, 2.5, 6.0]);
        barriers::add_barrier(site, ends(outside), random);
    }
    if random.chance(0.15) {
        let open = Finish::Open(random.between(0.25, 0.6));
        let outside = random.between(3.0, 8.0);
        barriers::add_fence(site, ends(outside), random.between(0.9, 1.8), 0.015, open);
    }
}

/// A barrier between the two halves of a wide road, clear of the crossings.
pub fn divide_road(site: &mut Site, kerb: &Kerb, random: &mut Random) {
    let middle = -kerb.street.half_width_m;
    let ends = [15.0, kerb.length_m - 15.0].map(|at| kerb.at(at, middle));
    if kerb.length_m > 35.0 {
        barriers::add_median(site, ends, random);
    }
}
