//! One thing that moves: what it is, how it moves, what it looks like at a moment.

use nalgebra::Point2;

use crate::simulate::{
    bodies::{self, Car},
    fleet,
    path::{Path, TimeTable},
    random::Random,
    scene::Solid,
};

/// A thing is called moving above this speed [m/s].
const MOVING_MPS: f64 = 0.3;

/// What an actor is.
#[derive(Clone, Debug)]
pub enum Kind {
    /// A car or van.
    Car(Car),
    /// A delivery van; its shape follows from this number.
    Van(u64),
    /// A box truck of this length [m].
    Truck(f32),
    /// A cyclist, with the reflectance of the clothes.
    Cyclist(f32),
    /// A person of this height [m], with the reflectance of the clothes.
    Person(f32, f32),
}

impl Kind {
    /// SemanticKITTI ids when standing and when moving.
    fn labels(&self) -> [u16; 2] {
        match self {
            Self::Car(_) | Self::Van(_) => [10, 252],
            Self::Truck(_) => [18, 258],
            Self::Cyclist(_) => [31, 253],
            Self::Person(..) => [30, 254],
        }
    }

    /// Half distances of the points that rest on the ground, along and across [m].
    pub fn feet_m(&self) -> [f64; 2] {
        match self {
            Self::Car(_) => [1.3, 0.75],
            Self::Van(_) => [1.7, 0.85],
            Self::Truck(length) => [0.35 * f64::from(*length), 0.95],
            Self::Cyclist(_) => [0.5, 0.1],
            // Someone who walks uphill stays upright: the pose's slope is that of a wide base.
            Self::Person(..) => [0.15, 0.15],
        }
    }

    /// Height of the middle and radius of a sphere around the body [m].
    pub fn sphere(&self) -> (f32, f32) {
        match self {
            Self::Car(car) => (0.8, 0.5 * car.size_m[0] + 0.8),
            Self::Van(_) => (1.3, 3.9),
            Self::Truck(length) => (1.6, 0.5 * length + 1.6),
            Self::Cyclist(_) => (0.9, 1.4),
            Self::Person(height, _) => (0.5 * height, 0.5 * height + 0.4),
        }
    }

    /// The discs that its outline is made of: places along its axis and their radius [m].
    pub fn discs(&self) -> (Vec<f64>, f64) {
        match self {
            Self::Car(_) => (vec![-1.55, 0.0, 1.55], 1.0),
            Self::Van(_) => (vec![-2.4, -1.2, 0.0, 1.2, 2.4], 1.2),
            Self::Truck(length) => {
                let half = 0.5 * f64::from(*length) - 1.0;
                (vec![-half, -0.5 * half, 0.0, 0.5 * half, half], 1.25)
            }
            Self::Cyclist(_) => (vec![-0.5, 0.5], 0.38),
            Self::Person(..) => (vec![0.0], 0.35),
        }
    }
}

/// How an actor moves.
#[derive(Clone, Debug)]
pub enum Motion {
    /// Along a path once, from this time on [s].
    Through {
        /// The path.
        path: Path,
        /// When it is where, after the start.
        table: TimeTable,
        /// Time at the start of the path [s].
        start_s: f64,
    },
    /// Up and down a path, with a pause at each end.
    Pacing {
        /// The path.
        path: Path,
        /// Speed [m/s].
        speed_mps: f64,
        /// Pause at each end [s].
        pause_s: f64,
        /// Time into the first round at time 0 [s].
        phase_s: f64,
    },
    /// At a place.
    Standing {
        /// The place in the town.
        position: Point2<f64>,
        /// Heading [rad].
        heading: f64,
    },
}

/// Where an actor is at a moment.
#[derive(Clone, Copy, Debug)]
pub struct State {
    /// Position in the town [m].
    pub position: Point2<f64>,
    /// Heading [rad].
    pub heading: f64,
    /// Speed [m/s].
    pub speed_mps: f64,
    /// Way since the start of the path [m].
    pub way_m: f64,
}

impl State {
    /// Whether the actor counts as moving.
    pub fn is_moving(&self) -> bool {
        self.speed_mps > MOVING_MPS
    }
}

impl Motion {
    /// Where the actor is at a time [s], if it is there.
    pub fn at(&self, time_s: f64) -> Option<State> {
        match self {
            Self::Through { path, table, start_s } => {
                let (way_m, speed_mps) = table.at(time_s - start_s)?;
                let point = path.at(way_m);
                Some(State { position: point.position, heading: point.heading, speed_mps, way_m })
            }
            Self::Pacing { path, speed_mps, pause_s, phase_s } => {
                let leg_s = path.length_m() / speed_mps;
                let into = (time_s + phase_s).rem_euclid(2.0 * (leg_s + pause_s));
                let back = into >= leg_s + pause_s;
                let walked_s = if back { into - leg_s - pause_s } else { into };
                let way_m = speed_mps * walked_s.min(leg_s);
                let point = path.at(if back { path.length_m() - way_m } else { way_m });
                Some(State {
                    position: point.position,
                    heading: if back { point.heading + std::f64::consts::PI } else { point.heading },
                    speed_mps: if walked_s < leg_s { *speed_mps } else { 0.0 },
                    way_m,
                })
            }
            Self::Standing { position, heading } => {
                Some(State { position: *position, heading: *heading, speed_mps: 0.0, way_m: 0.0 })
            }
        }
    }
}

/// One thing that moves, or could.
#[derive(Clone, Debug)]
pub struct Actor {
    /// What it is.
    pub kind: Kind,
    /// Instance number in the labels.
    pub instance: u16,
    /// How it moves.
    pub motion: Motion,
}

impl Actor {
    /// Where it is at a time [s], if it is there.
    pub fn at(&self, time_s: f64) -> Option<State> {
        self.motion.at(time_s)
    }

    /// Its solids in its own frame.
    pub fn solids(&self, state: &State) -> Vec<Solid> {
        let label = self.kind.labels()[usize::from(state.is_moving())];
        let swing = if state.is_moving() { 0.55 } else { 0.0 };
        match &self.kind {
            Kind::Car(car) => car.solids(label, self.instance),
            Kind::Van(shape) => fleet::van(label, self.instance, &mut Random::hashed(*shape)),
            Kind::Truck(length) => bodies::truck(*length, label, self.instance),
            Kind::Cyclist(cloth) => bodies::cyclist((state.way_m / 0.8) as f32, *cloth, label, self.instance),
            Kind::Person(height, cloth) => {
                let stride = (state.way_m * std::f64::consts::PI / 0.72) as f32;
                bodies::person(*height, stride, swing, *cloth, label, self.instance)
            }
        }
    }
}
