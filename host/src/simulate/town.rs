//! Builds the town: plan, ground, and what stands on it.

use nalgebra::{Isometry3, Point2, Vector2};

use super::{
    facade::Facade,
    ground::Ground,
    houses, kerbside,
    options::TownOptions,
    plan::Plan,
    random::{Domain, Random},
    scene::{Scene, Solid},
    shape::Vec3,
};

/// How far the ground goes beyond the outermost streets [m].
const MARGIN_M: f32 = 60.0;

/// A town: its streets and everything that stands still.
#[derive(Debug)]
pub struct Town {
    /// The street plan.
    pub plan: Plan,
    /// What rays are cast into.
    pub scene: Scene,
    /// First instance number that is free for what moves.
    pub next_instance: u16,
    /// Whether its vehicles are of many kinds.
    pub varied: bool,
}

impl Town {
    /// Builds the town of a seed.
    pub fn build(seed: u64, options: &TownOptions) -> Self {
        let plan = Plan::draw(seed, options);
        let ground = Ground::shape(seed, options, &plan, MARGIN_M);
        let mut site =
            Site { plan: &plan, ground: &ground, options, solids: vec![], facades: vec![], next_instance: 1 };
        let [avenues, streets] = plan.size();
        for (i, j) in (0..avenues - 1).flat_map(|i| (0..streets - 1).map(move |j| (i, j))) {
            let random = &mut Random::keyed(seed, Domain::Block, &[i as u64, j as u64]);
            houses::build_up_block(&mut site, [i, j], random);
        }
        kerbside::furnish_streets(&mut site, seed);
        let Site { solids, facades, next_instance, .. } = site;
        let scene = Scene::new(ground, solids, facades);
        Self { plan, scene, next_instance, varied: options.varied }
    }
}

/// A town under construction.
pub struct Site<'a> {
    /// The street plan.
    pub plan: &'a Plan,
    /// The ground.
    pub ground: &'a Ground,
    /// What the town is to be like.
    pub options: &'a TownOptions,
    /// What stands on the ground so far.
    pub solids: Vec<Solid>,
    /// Window patterns so far.
    pub facades: Vec<Facade>,
    /// Next free instance number.
    pub next_instance: u16,
}

impl Site<'_> {
    /// Adds a body on four feet at a place of the plan, facing a direction of the plan.
    pub fn park(&mut self, body: &[Solid], at: Point2<f64>, direction: Vector2<f64>, feet_m: [f64; 2]) {
        let pose =
            self.ground.resting_pose(self.plan.town_from_plan(at), self.plan.heading(at, direction), feet_m);
        self.put(body, &pose.cast());
    }

    /// Adds an upright body at a place of the plan, facing a direction of the plan.
    pub fn stand(&mut self, body: &[Solid], at: Point2<f64>, direction: Vector2<f64>) {
        let foot = self.foot(at);
        let yaw = self.plan.heading(at, direction) as f32;
        self.put(body, &Isometry3::new(foot, Vec3::z() * yaw));
    }

    fn put(&mut self, body: &[Solid], pose: &Isometry3<f32>) {
        self.solids.extend(body.iter().map(|solid| solid.moved(pose)));
    }

    /// The point of the ground at a place of the plan.
    pub fn foot(&self, at: Point2<f64>) -> Vec3 {
        let q = self.plan.town_from_plan(at);
        Vec3::new(q.x as f32, q.y as f32, self.ground.height(q) as f32)
    }

    /// How far a ray gets into low leaves [m]: `usual_m`, or in a varied town anything from trimmed to shaggy.
    pub fn free_path_m(&self, usual_m: f32, random: &mut Random) -> f32 {
        if self.options.varied { random.pick(&[0.03, 0.06, 0.12, 0.25]) } else { usual_m }
    }

    /// A new instance number. A town that runs out of numbers starts again.
    pub fn instance(&mut self) -> u16 {
        let instance = self.next_instance;
        self.next_instance = self.next_instance.checked_add(1).unwrap_or(1);
        instance
    }
}
