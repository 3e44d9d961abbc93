//! Traffic: things that move, drawn at random and kept only if they touch neither the vehicle nor each other.

mod actor;
mod people;
mod spacing;
mod vehicles;

use nalgebra::Isometry3;

pub use actor::Actor;
use spacing::Spacing;

use super::{
    drive::Drive,
    options::{Options, Traffic},
    random::{Domain, Random},
    scene::Solid,
    shape::Vec3,
    town::Town,
};

/// How many of each kind are tried for each second of the drive, in normal traffic.
struct Rates {
    through: f64,
    sharing: f64,
    cyclists: f64,
    walkers: f64,
    crossers: f64,
    standing: f64,
}

const RATES: Rates =
    Rates { through: 0.8, sharing: 0.25, cyclists: 0.35, walkers: 0.55, crossers: 0.12, standing: 0.20 };

/// Everything that moves, or could.
#[derive(Debug)]
pub struct Crowd {
    actors: Vec<Actor>,
}

/// What an actor looks like at one moment.
#[derive(Clone, Debug)]
pub struct Presence {
    /// Its solids in the town.
    pub solids: Vec<Solid>,
    /// Middle of a sphere around them.
    pub centre: Vec3,
    /// Radius of that sphere [m].
    pub radius_m: f32,
}

impl Crowd {
    /// Draws the traffic of a drive.
    pub fn draw(options: &Options, town: &Town, drive: &Drive) -> Self {
        let duration_s = options.frames as f64 * options.interval_s;
        let mut random = Random::keyed(options.seed, Domain::Traffic, &[]);
        let mut cast = Casting {
            town,
            drive,
            duration_s,
            spacing: Spacing::new(drive, duration_s),
            actors: vec![],
            next_instance: town.next_instance,
        };
        let factor = match options.traffic {
            Traffic::None => 0.0,
            Traffic::Normal => 1.0,
            Traffic::Heavy => 2.5,
        };
        let tries = |rate: f64| (factor * rate * duration_s).ceil() as usize;
        if options.traffic != Traffic::None {
            vehicles::add_leader(&mut cast, &mut random);
        }
        (0..tries(RATES.crossers)).for_each(|_| people::add_crosser(&mut cast, &mut random));
        (0..tries(RATES.cyclists)).for_each(|_| vehicles::add_cyclist(&mut cast, &mut random));
        (0..tries(RATES.sharing)).for_each(|_| vehicles::add_sharing(&mut cast, &mut random));
        (0..tries(RATES.through)).for_each(|_| vehicles::add_through(&mut cast, &mut random));
        (0..tries(RATES.walkers)).for_each(|_| people::add_walker(&mut cast, &mut random));
        (0..tries(RATES.standing)).for_each(|_| people::add_standing(&mut cast, &mut random));
        Self { actors: cast.actors }
    }

    /// The actor with an instance number.
    #[cfg(test)]
    pub fn actor(&self, instance: u16) -> Option<&Actor> {
        self.actors.iter().find(|actor| actor.instance == instance)
    }

    /// What is within `reach_m` of a place at a time.
    pub fn presences(&self, town: &Town, time_s: f64, near: Vec3, reach_m: f32) -> Vec<Presence> {
        let ground = town.scene.ground();
        let here = |actor: &Actor| {
            let state = actor.at(time_s)?;
            let offset = state.position.cast::<f32>().coords - near.xy();
            if offset.norm() > reach_m + 6.0 {
                return None;
            }
            let pose: Isometry3<f32> =
                ground.resting_pose(state.position, state.heading, actor.kind.feet_m()).cast();
            let (height, radius_m) = actor.kind.sphere();
            Some(Presence {
                solids: actor.solids(&state).iter().map(|solid| solid.moved(&pose)).collect(),
                centre: pose.translation.vector + Vec3::z() * height,
                radius_m,
            })
        };
        self.actors.iter().filter_map(here).collect()
    }
}

/// Traffic in the making.
struct Casting<'a> {
    town: &'a Town,
    drive: &'a Drive,
    duration_s: f64,
    spacing: Spacing,
    actors: Vec<Actor>,
    next_instance: u16,
}

impl Casting<'_> {
    /// Keeps an actor if there is room for it all the time.
    fn offer(&mut self, kind: actor::Kind, motion: actor::Motion) -> bool {
        let actor = Actor { kind, instance: self.next_instance, motion };
        let kept = self.spacing.admit(&actor);
        if kept {
            self.next_instance = self.next_instance.checked_add(1).unwrap_or(1);
            self.actors.push(actor);
        }
        kept
    }

    /// A time of the drive, the vehicle's place on the plan then, and the nearest crossing.
    fn moment(&self, random: &mut Random) -> (f64, nalgebra::Point2<f32>, [usize; 2]) {
        let time_s = self.duration_s * f64::from(random.unit());
        let p = self.town.plan.plan_from_town(self.drive.at(time_s).0.position).cast();
        (time_s, p, self.town.plan.place(p).crossing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::drive::SCAN_S;

    fn heavy() -> (Town, Drive, Crowd) {
        let options = Options { traffic: Traffic::Heavy, frames: 150, ..Options::demo() };
        let town = Town::build(options.seed, &options.town);
        let drive = Drive::plan(&options, &town.plan);
        let crowd = Crowd::draw(&options, &town, &drive);
        (town, drive, crowd)
    }

    #[test]
    fn nothing_floats_or_sinks() {
        let (town, drive, crowd) = heavy();
        let ground = town.scene.ground();
        for frame in [0, 70, 149] {
            let time_s = frame as f64 * SCAN_S;
            let near = drive.town_from_sensor(ground, time_s).translation.vector.cast();
            for presence in crowd.presences(&town, time_s, near, 80.0) {
                let bounds: Vec<_> = presence.solids.iter().map(|s| s.shape.bounds()).collect();
                let (low, _) = bounds.iter().min_by(|a, b| a.0.z.total_cmp(&b.0.z)).expect("solids");
                let floor = ground.height(presence.centre.xy().cast::<f64>().into()) as f32;
                assert!((low.z - floor).abs() < 0.25, "{} over {floor}", low.z);
                for (low, high) in bounds {
                    let reach = (0.5 * (low + high) - presence.centre).norm() + 0.5 * (high - low).norm();
                    assert!(reach < 1.45 * presence.radius_m, "outside its sphere: {reach}");
                }
            }
        }
    }

    #[test]
    fn nobody_touches_the_vehicle_and_heavy_traffic_is_heavy() {
        let (_, drive, crowd) = heavy();
        let mut moving = 0;
        for actor in &crowd.actors {
            for step in 0..150 {
                let time_s = f64::from(step) * SCAN_S;
                let Some(state) = actor.at(time_s) else { continue };
                let distance = (state.position - drive.at(time_s).0.position).norm();
                assert!(distance > 1.3, "{:?} at {time_s} s", actor.kind);
                moving += usize::from(step == 0 && state.is_moving());
            }
        }
        assert!(moving >= 10, "{moving}");
    }
}
