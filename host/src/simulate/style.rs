//! Styles of blocks: what a block is for, how it is built up, and how its ground lies.

use super::{options::TownOptions, random::Random};

/// Height of an ordinary kerb [m].
pub const KERB_M: f32 = 0.12;

/// How a block is built up.
#[derive(Clone, Copy, Debug)]
pub struct BlockStyle {
    /// Sidewalk to house front [m].
    pub setback_m: f32,
    /// Width of the paved strip inside the sidewalk [m]; beyond it is grass.
    pub paved_m: f32,
    /// Width of the grass from the kerb inwards [m], 0 = none; may be wider than the sidewalk.
    pub verge_m: f32,
    /// What the block is for.
    pub purpose: Purpose,
    /// Storeys of an ordinary house.
    pub storeys: f32,
    /// Gap between neighbours [m].
    pub gap_m: f32,
    /// Trees at the kerb instead of in the gardens.
    pub avenue_trees: bool,
    /// No sidewalk: grass from the kerb on.
    pub is_open: bool,
    /// Height of the kerb [m].
    pub kerb_m: f32,
    /// Slope beside the road.
    pub bank: Bank,
    /// Factor on the bumps of grass.
    pub bumps: f32,
    /// Height of the blades of grass in the mean [m].
    pub fuzz_m: f32,
}

/// What a block is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Houses along its edges.
    Houses,
    /// Grass and trees.
    Park,
    /// A paved place with people, beds and furniture.
    Square,
    /// Rows of parked vehicles.
    CarPark,
    /// Bushes and undergrowth.
    Thicket,
    /// Open grass land from the kerb on.
    Field,
}

/// The ground beside a road rises or falls to another level; widths are measured from where the grass begins.
#[derive(Clone, Copy, Debug)]
pub struct Bank {
    /// Height of its top above its foot [m]; negative below an embankment.
    pub height_m: f32,
    /// Foot and top [m].
    pub slope_m: [f32; 2],
    /// Where the ground begins to go back to its old level [m].
    pub back_m: f32,
    /// Depth and width of the ditch at the foot [m].
    pub ditch_m: [f32; 2],
}

impl Bank {
    const NONE: Self =
        Self { height_m: 0.0, slope_m: [0.0, 1.0], back_m: f32::INFINITY, ditch_m: [0.0, 1.0] };

    /// Whether there is neither bank nor ditch.
    pub fn is_flat(&self) -> bool {
        self.height_m == 0.0 && self.ditch_m[0] == 0.0
    }

    /// Height [m] at a depth inside the grass [m].
    pub fn rise(&self, depth_m: f32) -> f32 {
        let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
        let [foot, top] = self.slope_m;
        let done = |from: f32| smooth(((depth_m - from) / (top - foot)).clamp(0.0, 1.0));
        let [deep, width] = self.ditch_m;
        let across = ((depth_m - foot + width) / width).clamp(0.0, 1.0);
        let ditch = 4.0 * across * (1.0 - across);
        self.height_m * (done(foot) - done(self.back_m)) - deep * ditch * ditch
    }

    /// Draws the bank of a block; half of the blocks have none, nor do paved ones.
    fn draw(purpose: Purpose, setback_m: f32, random: &mut Random) -> Self {
        let highest = match purpose {
            Purpose::Field | Purpose::Park | Purpose::Thicket => 2.5,
            Purpose::Houses if setback_m >= 3.0 => 0.6,
            _ => return Self::NONE,
        };
        if random.chance(0.5) {
            return Self::NONE;
        }
        let height_m =
            highest * if random.chance(0.3) { -random.between(0.1, 0.4) } else { random.between(0.1, 1.0) };
        let is_open = purpose != Purpose::Houses;
        let ditch_m = if is_open && random.chance(0.35) {
            [random.between(0.1, 0.3), random.between(1.0, 2.0)]
        } else {
            [0.0, 1.0]
        };
        let foot = random.between(0.5, 1.2) + if ditch_m[0] > 0.0 { ditch_m[1] } else { 0.0 };
        let top = foot + 1.2 * height_m.abs() + random.between(0.8, 4.0);
        let back_m =
            if is_open && random.chance(0.4) { top + random.between(2.0, 6.0) } else { f32::INFINITY };
        Self { height_m, slope_m: [foot, top], back_m, ditch_m }
    }
}

/// What lies around the town.
pub const OUTSIDE: BlockStyle = BlockStyle {
    setback_m: 0.0,
    paved_m: 0.0,
    verge_m: 0.0,
    purpose: Purpose::Park,
    storeys: 0.0,
    gap_m: 0.0,
    avenue_trees: false,
    is_open: false,
    kerb_m: KERB_M,
    bank: Bank::NONE,
    bumps: 1.0,
    fuzz_m: 0.0,
};

impl BlockStyle {
    /// How far the ground may lie below and above the plain bumps of a lawn [m], between places 1 m apart.
    pub fn roughness_m(&self) -> [f32; 2] {
        let tufts = 0.075 * (self.bumps - 1.0).max(0.0);
        let curved = if self.bank.is_flat() { 0.0 } else { 0.15 };
        [tufts + curved + self.bank.ditch_m[0] + KERB_M - self.kerb_m, tufts + curved + 1.5 * self.fuzz_m]
    }
}

/// What blocks are for; any two neighbours differ.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Closed rows of high houses.
    Centre,
    /// Houses with gardens.
    Homes,
    /// Grass and trees.
    Park,
}

impl Kind {
    /// The order in which they follow each other.
    pub const ALL: [Self; 5] = [Self::Centre, Self::Homes, Self::Park, Self::Homes, Self::Homes];
}

/// A block of a varied town: its properties are drawn one by one.
pub fn draw_varied_style(town: &TownOptions, random: &mut Random) -> BlockStyle {
    let is_country = random.chance(town.country);
    let purpose = if is_country {
        random.pick(&[Purpose::Field, Purpose::Field, Purpose::Field, Purpose::Thicket, Purpose::Park])
    } else if random.chance(town.centre) {
        return draw_centre_style(random);
    } else {
        match random.below(20) {
            0..9 => Purpose::Houses,
            9..11 => Purpose::Park,
            11..14 => Purpose::Square,
            14 => Purpose::CarPark,
            15..18 => Purpose::Thicket,
            _ => Purpose::Field,
        }
    };
    let setback_m = random.pick(&[0.1, 0.3, 1.5, 3.0, 4.5, 7.0]) + random.between(0.0, 1.5);
    let paved_m = match purpose {
        Purpose::Square | Purpose::CarPark => 200.0,
        Purpose::Houses if setback_m < 2.0 || random.chance(0.25) => 60.0,
        Purpose::Field => 0.0,
        _ if is_country => 0.0,
        _ => random.between(0.0, 0.6),
    };
    let (bumps, fuzz_m) = draw_grass(purpose, random);
    let is_open = is_country || purpose == Purpose::Field;
    BlockStyle {
        setback_m,
        paved_m,
        verge_m: if is_open { 8.0 } else { random.pick(&[0.0, 0.95, 1.2, 8.0, 8.0]) },
        purpose,
        storeys: random.pick(&[1.0, 2.0, 2.5, 3.0, 4.0, 5.0]),
        gap_m: random.pick(&[0.2, 0.3, 2.0, 4.0, 7.0]),
        avenue_trees: random.chance(0.45),
        is_open,
        kerb_m: if is_open { random.pick(&[0.0, 0.04, KERB_M]) } else { KERB_M },
        bank: Bank::draw(purpose, setback_m, random),
        bumps,
        fuzz_m,
    }
}

/// Factor on the bumps and height of the blades [m]: lawns are mown, open land is not.
fn draw_grass(purpose: Purpose, random: &mut Random) -> (f32, f32) {
    let (roughest, highest) = match purpose {
        Purpose::Field | Purpose::Park | Purpose::Thicket => (3.5, 0.2),
        _ => (2.0, 0.08),
    };
    let fuzz_m = if random.chance(0.6) { random.between(0.0, highest) } else { 0.0 };
    (random.between(0.5, roughest), fuzz_m)
}

fn draw_centre_style(random: &mut Random) -> BlockStyle {
    BlockStyle {
        setback_m: random.pick(&[0.0, 0.1, 0.8, 2.0]) + random.between(0.0, 0.5),
        storeys: random.pick(&[2.0, 3.0, 4.0, 5.0]),
        gap_m: random.pick(&[0.05, 0.05, 0.2, 3.5]),
        paved_m: 60.0,
        avenue_trees: random.chance(0.4),
        purpose: if random.chance(0.7) { Purpose::Houses } else { Purpose::Square },
        ..OUTSIDE
    }
}

/// A block of a town that is not varied.
pub fn draw_style(kind: Kind, random: &mut Random) -> BlockStyle {
    if kind == Kind::Centre {
        return BlockStyle {
            setback_m: random.between(0.2, 1.2),
            paved_m: 30.0,
            purpose: Purpose::Houses,
            storeys: random.between(3.0, 4.9),
            gap_m: 0.3,
            avenue_trees: random.chance(0.6),
            ..OUTSIDE
        };
    }
    BlockStyle {
        setback_m: random.between(2.1, 4.0),
        paved_m: random.between(0.0, 0.4),
        verge_m: if random.chance(0.5) { 0.95 } else { 0.0 },
        purpose: if kind == Kind::Homes { Purpose::Houses } else { Purpose::Park },
        storeys: random.between(1.6, 2.9),
        gap_m: random.between(3.0, 6.0),
        avenue_trees: random.chance(0.45),
        ..OUTSIDE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::random::Domain;

    #[test]
    fn banks_start_at_the_edge_of_the_grass_and_have_no_cliffs() {
        let mut random = Random::keyed(6, Domain::Plan, &[]);
        for _ in 0..300 {
            let bank = Bank::draw(Purpose::Field, 0.0, &mut random);
            assert_eq!([bank.rise(-1.0), bank.rise(0.3)], [0.0; 2]);
            for k in 0..400 {
                let [a, b] = [0.05 * k as f32, 0.05 * (k + 1) as f32].map(|depth| bank.rise(depth));
                assert!((-1.35..=2.5).contains(&b) && (b - a).abs() < 0.12, "{bank:?} at {k}");
            }
        }
    }
}
