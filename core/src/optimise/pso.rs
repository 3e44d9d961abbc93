//! Particle swarm (section 3.2.4), seeded and bounded, with a pattern search to polish the best particle.
//!
//! Velocity first, position second: v = w v + c1 r1 (own best - x) + c2 r2 (swarm's best - x); x = x + v. The paper's
//! "optimised PSO" is not specified; this one lets the inertia fall and shifts the pull from the own best to the
//! swarm's best over the iterations (time-varying acceleration), starts one particle at the prediction, and polishes.

use oorandom::Rand32;

use crate::error::{self, ParameterError};

/// Most particles of a swarm.
pub const MAX_PARTICLES: usize = 64;

/// Parameters of the swarm.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// Particles, 2 to 64.
    pub particles: u32,
    /// Most iterations.
    pub iterations: u32,
    /// Inertia w at the first iteration.
    pub inertia_start: f32,
    /// Inertia w at the last iteration.
    pub inertia_end: f32,
    /// Pull c1 of the own best at the first iteration.
    pub own_start: f32,
    /// Pull c1 at the last iteration.
    pub own_end: f32,
    /// Pull c2 of the swarm's best at the first iteration.
    pub swarm_start: f32,
    /// Pull c2 at the last iteration.
    pub swarm_end: f32,
    /// Largest velocity as a share of the half width of the search box.
    pub max_velocity: f32,
    /// Iterations without a gain before the swarm stops.
    pub patience: u32,
    /// Evaluations of the pattern search that polishes the result; 0 leaves it out.
    pub polish_evaluations: u32,
}

impl Config {
    /// Defaults: the swarm of the literature (30 particles, 50 iterations), stopped when it stalls.
    pub const PAPER: Self = Self {
        particles: 30,
        iterations: 50,
        inertia_start: 0.9,
        inertia_end: 0.4,
        own_start: 2.5,
        own_end: 0.5,
        swarm_start: 0.5,
        swarm_end: 2.5,
        max_velocity: 0.5,
        patience: 10,
        polish_evaluations: 60,
    };

    /// A small swarm: enough to escape a bad prediction, the polish does the rest.
    pub const SMALL: Self =
        Self { particles: 10, iterations: 5, patience: 3, polish_evaluations: 48, ..Self::PAPER };

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if self.particles < 2 || self.particles as usize > MAX_PARTICLES {
            return Err(ParameterError { parameter: "swarm.particles", expected: "2 to 64" });
        }
        if self.iterations > 1000 || self.polish_evaluations > 10_000 || self.patience > 1000 {
            let parameter = "swarm.iterations, patience and polish_evaluations";
            return Err(ParameterError { parameter, expected: "at most 1000, 1000 and 10000" });
        }
        let pulls = [
            self.own_start,
            self.own_end,
            self.swarm_start,
            self.swarm_end,
            self.inertia_start,
            self.inertia_end,
        ];
        if !error::all_within(&pulls, 0.0, 10.0) {
            let parameter = "swarm.inertia_*, own_* and swarm_*";
            return Err(ParameterError { parameter, expected: "0 to 10" });
        }
        if !(self.max_velocity > 0.0 && self.max_velocity <= 1.0) {
            return Err(ParameterError {
                parameter: "swarm.max_velocity",
                expected: "above 0 and at most 1",
            });
        }
        Ok(())
    }
}

/// What the search found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optimum<const D: usize> {
    /// Position.
    pub position: [f32; D],
    /// Objective there.
    pub value: f32,
    /// Evaluations of the objective.
    pub evaluations: u32,
}

#[derive(Clone, Copy)]
struct Particle<const D: usize> {
    position: [f32; D],
    velocity: [f32; D],
    best: [f32; D],
    best_value: f32,
}

/// Maximises `objective` in the box `centre` +- `half_width`. The first particle starts at `centre`.
pub fn maximise<const D: usize>(
    config: &Config,
    seed: u64,
    centre: [f32; D],
    half_width: [f32; D],
    mut objective: impl FnMut(&[f32; D]) -> f32,
) -> Optimum<D> {
    let mut random = Rand32::new(seed);
    let mut found = Optimum { position: centre, value: objective(&centre), evaluations: 1 };
    let start = Particle { position: centre, velocity: [0.0; D], best: centre, best_value: found.value };
    let mut swarm = [start; MAX_PARTICLES];
    let swarm = swarm.get_mut(..config.particles as usize).unwrap_or_default();
    for particle in swarm.iter_mut().skip(1) {
        for d in 0..D {
            particle.position[d] = centre[d] + half_width[d] * (2.0 * random.rand_float() - 1.0);
            particle.velocity[d] = config.max_velocity * half_width[d] * (2.0 * random.rand_float() - 1.0);
        }
        particle.best_value = objective(&particle.position);
        particle.best = particle.position;
        found.evaluations += 1;
        found.keep(particle.best, particle.best_value);
    }
    let mut stalled = 0;
    for iteration in 0..config.iterations {
        let share = iteration as f32 / config.iterations.max(2).saturating_sub(1) as f32;
        let before = found.value;
        for particle in swarm.iter_mut() {
            advance(config, share, &mut random, particle, &found.position, &centre, &half_width);
            let value = objective(&particle.position);
            found.evaluations += 1;
            if value > particle.best_value {
                (particle.best, particle.best_value) = (particle.position, value);
                found.keep(particle.position, value);
            }
        }
        stalled = if found.value > before { 0 } else { stalled + 1 };
        if stalled >= config.patience {
            break;
        }
    }
    polish(config.polish_evaluations, &centre, &half_width, &mut found, objective);
    found
}

impl<const D: usize> Optimum<D> {
    fn keep(&mut self, position: [f32; D], value: f32) {
        if value > self.value {
            (self.position, self.value) = (position, value);
        }
    }
}

/// One step of a particle; the walls of the box reflect it at half speed.
fn advance<const D: usize>(
    config: &Config,
    share: f32,
    random: &mut Rand32,
    particle: &mut Particle<D>,
    swarm_best: &[f32; D],
    centre: &[f32; D],
    half_width: &[f32; D],
) {
    let blend = |start: f32, end: f32| start + share * (end - start);
    let inertia = blend(config.inertia_start, config.inertia_end);
    let (own, swarm) = (blend(config.own_start, config.own_end), blend(config.swarm_start, config.swarm_end));
    for d in 0..D {
        let x = particle.position[d];
        let limit = config.max_velocity * half_width[d];
        let pull = own * random.rand_float() * (particle.best[d] - x)
            + swarm * random.rand_float() * (swarm_best[d] - x);
        // Not `clamp`, which panics where a limit is no number.
        let mut v = (inertia * particle.velocity[d] + pull).max(-limit).min(limit);
        let (low, high) = (centre[d] - half_width[d], centre[d] + half_width[d]);
        let mut next = x + v;
        if next < low || next > high {
            next = next.max(low).min(high);
            v *= -0.5;
        }
        (particle.position[d], particle.velocity[d]) = (next, v);
    }
}

/// Pattern search around the best position: steps along each axis, halved when none helps.
fn polish<const D: usize>(
    budget: u32,
    centre: &[f32; D],
    half_width: &[f32; D],
    found: &mut Optimum<D>,
    mut objective: impl FnMut(&[f32; D]) -> f32,
) {
    let end = found.evaluations + budget;
    let mut step = half_width.map(|h| 0.1 * h);
    while found.evaluations + 2 * D as u32 <= end {
        let before = found.value;
        for d in 0..D {
            for sign in [1.0, -1.0] {
                let mut trial = found.position;
                let (low, high) = (centre[d] - half_width[d], centre[d] + half_width[d]);
                trial[d] = (trial[d] + sign * step[d]).max(low).min(high);
                let value = objective(&trial);
                found.evaluations += 1;
                if value > found.value {
                    found.keep(trial, value);
                    break;
                }
            }
        }
        if found.value <= before {
            step = step.map(|s| 0.5 * s);
        }
    }
}
