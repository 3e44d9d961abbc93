//! Traffic: things that move, drawn at random and kept only if they touch neither the vehicle nor each other.

mod actor;
mod people;
mod spacing;
mod vehicles;

use nalgebra::Isometry3;

use actor::Actor;
use spacing::Spacing;

use super::{
    drive::{Drive, SCAN_S},
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
        let duration_s = options.frames as f64 * SCAN_S;
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
