//! People: walking up and down a sidewalk, crossing at a crossing, standing.

use nalgebra::{Point2, Vector2};

use super::{
    Casting,
    actor::{Kind, Motion},
};
use crate::simulate::{path::Path, plan::Street, random::Random};

/// A side of a street on the plan.
struct Sidewalk {
    street: Street,
    /// From the middle of the street outwards.
    out: Vector2<f64>,
    /// On the centre line at the kerbs of two neighbouring crossing streets.
    ends: [Point2<f64>; 2],
}

impl Sidewalk {
    /// A sidewalk of a street at the vehicle's nearest crossing.
    fn near(cast: &Casting, random: &mut Random) -> Option<Self> {
        let (_, _, [i, j]) = cast.moment(random);
        let plan = &cast.town.plan;
        let along_avenue = random.chance(0.5);
        let (street, lines, at, axis, across) = if along_avenue {
            (plan.avenues[i], &plan.streets, j, Vector2::y(), Vector2::x())
        } else {
            (plan.streets[j], &plan.avenues, i, Vector2::x(), Vector2::y())
        };
        let first = if random.chance(0.5) { at } else { at.checked_sub(1)? };
        let (from, to) = (lines[first], lines.get(first + 1)?);
        let centre = across * f64::from(street.centre_m);
        let end = |c: f32| Point2::from(centre + axis * f64::from(c));
        let ends = [end(from.centre_m + from.half_width_m), end(to.centre_m - to.half_width_m)];
        Some(Self { street, out: if random.chance(0.5) { across } else { -across }, ends })
    }

    fn along(&self) -> Vector2<f64> {
        (self.ends[1] - self.ends[0]).normalize()
    }

    /// A place `along_m` from the first end, `outside_m` outside the kerb.
    fn at(&self, along_m: f64, outside_m: f64) -> Point2<f64> {
        self.ends[0] + self.along() * along_m + self.out * (f64::from(self.street.half_width_m) + outside_m)
    }

    fn length_m(&self) -> f64 {
        (self.ends[1] - self.ends[0]).norm()
    }

    /// Somewhere on the sidewalk, clear of what stands at its edges.
    fn clear_offset(&self, random: &mut Random) -> f64 {
        f64::from(random.between(1.05, self.street.sidewalk_m - 0.75))
    }
}

/// Someone who walks along a sidewalk, and back after a pause.
pub fn add_walker(cast: &mut Casting, random: &mut Random) {
    let Some(side) = Sidewalk::near(cast, random) else { return };
    let outside = side.clear_offset(random);
    let path =
        Path::along_line(&cast.town.plan, &[side.at(5.5, outside), side.at(side.length_m() - 5.5, outside)]);
    offer_pacing(cast, path, 1.0, random);
}

/// Someone who crosses a street near a crossing, and back after a pause.
pub fn add_crosser(cast: &mut Casting, random: &mut Random) {
    let Some(side) = Sidewalk::near(cast, random) else { return };
    let at = if random.chance(0.5) { 3.2 } else { side.length_m() - 3.2 };
    let reach = 2.0 * f64::from(side.street.half_width_m);
    let path = Path::along_line(&cast.town.plan, &[side.at(at, 1.3), side.at(at, -reach - 1.3)]);
    offer_pacing(cast, path, 4.0, random);
}

/// Someone, or two, standing on a sidewalk.
pub fn add_standing(cast: &mut Casting, random: &mut Random) {
    let Some(side) = Sidewalk::near(cast, random) else { return };
    let outside = side.clear_offset(random);
    let along = f64::from(random.unit()) * (side.length_m() - 6.0) + 3.0;
    for k in 0..1 + random.below(2) {
        let at = side.at(along + 0.9 * k as f64, outside);
        let heading = f64::from(random.between(0.0, std::f32::consts::TAU));
        let position = cast.town.plan.town_from_plan(at);
        if is_clear(cast, position) {
            cast.offer(draw_person(random), Motion::Standing { position, heading });
        }
    }
}

fn offer_pacing(cast: &mut Casting, path: Path, pause_s: f64, random: &mut Random) {
    let clear = (0..=path.length_m() as usize).all(|k| is_clear(cast, path.at(k as f64).position));
    if clear {
        let speed_mps = f64::from(random.between(0.9, 1.7));
        let phase_s = f64::from(random.between(0.0, 60.0));
        let pause_s = pause_s * f64::from(random.between(0.7, 1.5));
        cast.offer(draw_person(random), Motion::Pacing { path, speed_mps, pause_s, phase_s });
    }
}

fn draw_person(random: &mut Random) -> Kind {
    Kind::Person(random.between(1.55, 1.9), random.between(0.1, 0.5))
}

fn is_clear(cast: &Casting, position: Point2<f64>) -> bool {
    let scene = &cast.town.scene;
    let z = scene.ground().height(position) as f32;
    scene.is_free(position.cast::<f32>().coords, 0.4, z + 0.3..z + 1.9)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{drive::Drive, options::Options, plan::Plan, town::Town, traffic::Crowd};

    #[test]
    fn people_keep_off_the_road_unless_they_cross_it() {
        let options = Options { frames: 100, traffic: crate::simulate::Traffic::Heavy, ..Options::demo() };
        let town = Town::build(options.seed, &options.town);
        let drive = Drive::plan(&options, &town.plan);
        let crowd = Crowd::draw(&options, &town, &drive);
        let mut walkers = 0;
        for actor in &crowd.actors {
            let Motion::Pacing { path, .. } = &actor.motion else { continue };
            let outside: Vec<f32> = (0..=path.length_m() as usize)
                .map(|k| outside_m(&town.plan, path.at(k as f64).position))
                .collect();
            let crosses = path.length_m() < 16.0;
            walkers += usize::from(!crosses);
            assert!(outside[0] > 0.5, "{outside:?}");
            assert!(crosses || outside.iter().all(|e| *e > 0.5), "{outside:?}");
        }
        assert!(walkers > 3, "{walkers}");
    }

    fn outside_m(plan: &Plan, q: Point2<f64>) -> f32 {
        plan.place(plan.plan_from_town(q).cast()).outside_m
    }
}
