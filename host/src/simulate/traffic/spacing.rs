//! Keeps actors apart: outlines of discs, compared at every fifth of a second.

use nalgebra::{Point2, Vector2};

use super::actor::{Actor, Kind, Motion};
use crate::simulate::{bodies::Car, drive::Drive, random::Random};

/// Time between two comparisons [s].
const STEP_S: f64 = 0.2;
/// Room between two outlines [m].
const ROOM_M: f64 = 0.2;
/// Nothing appears or vanishes nearer to the vehicle than this [m].
const HORIZON_M: f64 = 75.0;

/// Position and direction at each time step, where the actor is there.
struct Track {
    places: Vec<Option<(Point2<f64>, Vector2<f64>)>>,
    discs: Vec<f64>,
    radius_m: f64,
}

impl Track {
    fn of(actor: &Actor, steps: usize) -> Self {
        let place = |k: usize| {
            let state = actor.at(k as f64 * STEP_S)?;
            Some((state.position, Vector2::new(state.heading.cos(), state.heading.sin())))
        };
        let (discs, radius_m) = actor.kind.discs();
        Self { places: (0..steps).map(place).collect(), discs, radius_m }
    }

    fn reach_m(&self) -> f64 {
        self.discs.iter().fold(0.0, |reach: f64, d| reach.max(d.abs())) + self.radius_m
    }

    fn touches(&self, other: &Self) -> bool {
        let near = self.reach_m() + other.reach_m() + ROOM_M;
        let limit = self.radius_m + other.radius_m + ROOM_M;
        self.places.iter().zip(&other.places).any(|pair| {
            let (Some((p, dp)), Some((q, dq))) = pair else { return false };
            (p - q).norm_squared() < near * near
                && self.discs.iter().any(|a| {
                    other.discs.iter().any(|b| ((p + dp * *a) - (q + dq * *b)).norm_squared() < limit * limit)
                })
        })
    }
}

/// All outlines over the time of the drive; the first is the vehicle's own.
pub struct Spacing {
    tracks: Vec<Track>,
    steps: usize,
}

impl Spacing {
    /// Only the vehicle itself.
    pub fn new(drive: &Drive, duration_s: f64) -> Self {
        let steps = (duration_s / STEP_S).ceil() as usize + 1;
        let own = Actor {
            kind: Kind::Car(Car::draw(&mut Random::hashed(0))),
            instance: 0,
            motion: Motion::Through {
                path: drive.path().clone(),
                table: drive.table().clone(),
                start_s: 0.0,
            },
        };
        // The vehicle keeps some more distance ahead and behind.
        let track = Track { discs: vec![-2.6, -1.3, 0.0, 1.3, 2.6], ..Track::of(&own, steps) };
        Self { tracks: vec![track], steps }
    }

    /// Adds an actor unless it would touch another, or appear or vanish in sight.
    pub fn admit(&mut self, actor: &Actor) -> bool {
        let track = Track::of(actor, self.steps);
        let present = track.places.iter().any(Option::is_some);
        let admitted =
            present && !self.pops(&track) && !self.tracks.iter().any(|other| other.touches(&track));
        if admitted {
            self.tracks.push(track);
        }
        admitted
    }

    fn pops(&self, track: &Track) -> bool {
        let own = &self.tracks[0].places;
        track.places.windows(2).zip(own.windows(2)).any(|(pair, own)| {
            let (seen, from) = match (pair[0], pair[1]) {
                (None, Some(here)) => (here.0, own[1]),
                (Some(here), None) => (here.0, own[0]),
                _ => return false,
            };
            from.is_some_and(|(own, _)| (own - seen).norm() < HORIZON_M)
        })
    }
}
