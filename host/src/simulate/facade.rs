//! Walls with recessed windows: one box carries the whole pattern.

use nalgebra::Vector2;

use super::{
    random::{Random, combine},
    scene::Finish,
    shape::{Hit, Ray, Vec3},
};

/// Window pattern on the four walls of an upright box.
#[derive(Clone, Copy, Debug)]
pub struct Facade {
    /// Middle of the box on the ground plane [m].
    pub centre: Vector2<f32>,
    /// Unit vector along the box.
    pub along: Vector2<f32>,
    /// Half length and half width of the box [m].
    pub half_m: [f32; 2],
    /// Height of the ground floor [m].
    pub floor_m: f32,
    /// Distance of the floors [m].
    pub storey_m: f32,
    /// Top of the wall [m].
    pub top_m: f32,
    /// Distance of the windows [m].
    pub pitch_m: f32,
    /// Width and height of a window [m].
    pub window_m: [f32; 2],
    /// Sill above the floor [m].
    pub sill_m: f32,
    /// Wall to glass [m].
    pub recess_m: f32,
    /// Windows differ from each other, by this number; 0 = all alike.
    pub irregular: u64,
    /// Radius of a round wall [m], 0 = the four walls of the box.
    pub round_m: f32,
    /// Width, height and largest depth of panels that lie back in the wall [m].
    pub panel_m: [f32; 3],
}

/// Where a ray ends on a facade.
#[derive(Clone, Copy, Debug)]
pub struct Detail {
    /// On the wall, a jamb or the glass.
    pub hit: Hit,
    /// What is there.
    pub finish: Finish,
    /// Factor on the reflectance.
    pub shade: f32,
}

/// Farthest way of a ray behind a window [m].
const FARTHEST_M: f32 = 7.0;

/// A window as an interval along the wall and one upwards [m], and what is behind it.
struct Opening {
    across: [f32; 2],
    upward: [f32; 2],
    recess_m: f32,
    finish: Finish,
    /// Of the wall's own stone.
    is_panel: bool,
    /// How deep its jambs go [m]: a room is wider than its window.
    jamb_m: f32,
}

/// Where a place on a wall lies in the pattern of windows.
struct Slot {
    number: f32,
    storey: f32,
    count: f32,
    /// Half length of the wall [m].
    half_m: f32,
}

impl Facade {
    /// Draws the windows of a wall that stands at `foot`; `half_m` as in the struct, `wall_m` is its height.
    pub fn draw(foot: Vec3, along: Vector2<f32>, half_m: [f32; 2], wall_m: f32, random: &mut Random) -> Self {
        Self {
            centre: foot.xy(),
            along,
            half_m,
            floor_m: foot.z + 0.4,
            storey_m: random.between(2.75, 3.1),
            top_m: foot.z + wall_m,
            pitch_m: random.between(1.9, 3.4),
            window_m: [random.between(0.9, 1.5), random.between(1.1, 1.7)],
            sill_m: random.between(0.7, 1.0),
            recess_m: random.between(0.10, 0.28),
            irregular: 0,
            round_m: 0.0,
            panel_m: [1.0, 1.0, 0.0],
        }
    }

    /// Shop windows, narrow windows, many or few of them, or none; smooth walls and rough ones.
    pub fn vary(&mut self, random: &mut Random) {
        self.window_m = [random.pick(&[0.7, 1.1, 1.8, 2.8]), random.pick(&[0.8, 1.3, 1.9, 2.3])];
        self.pitch_m = self.window_m[0] + random.pick(&[0.3, 0.4, 0.6, 0.8, 1.5, 4.0, 60.0]);
        self.sill_m = random.between(0.15, 1.1);
        self.recess_m = random.pick(&[0.03, 0.1, 0.2, 0.35, 0.6]);
        self.irregular = u64::from(random.chance(0.9)) * (1 + random.below(1 << 30) as u64);
        if self.irregular != 0 && random.chance(0.75) {
            let tall = if random.chance(0.25) { self.storey_m } else { random.between(0.3, 1.2) };
            self.panel_m = [
                random.pick(&[0.2, 0.35, 0.6, 1.1]) * random.between(0.8, 1.3),
                tall,
                random.pick(&[0.08, 0.2, 0.35, 0.6]) * random.between(0.6, 1.2),
            ];
        }
    }

    /// Follows a ray that met the box into a window, if there is one: onto the glass or a jamb.
    pub fn refine(&self, ray: &Ray, hit: Hit) -> Detail {
        let depth_rate = -hit.normal.dot(&ray.direction);
        let plain = Detail { hit, finish: Finish::Matte, shade: 1.0 };
        if hit.normal.z.abs() > 0.5 || depth_rate < 0.05 {
            return plain;
        }
        let tangent = Vec3::new(-hit.normal.y, hit.normal.x, 0.0);
        let at = ray.at(hit.range_m);
        let Some(across) = self.across(tangent.xy(), at.xy()) else { return plain };
        let slot = self.slot(&hit, across, at.z);
        let plain = Detail { shade: self.shade(&slot, across, at.z), ..plain };
        let Some(opening) = self.opening(&slot, across, at.z).or_else(|| self.panel(&slot, across, at.z))
        else {
            return plain;
        };
        let to_glass = opening.recess_m / depth_rate;
        let to_side = time_inside(across, ray.direction.dot(&tangent), opening.across);
        let to_edge = time_inside(at.z, ray.direction.z, opening.upward);
        let jamb = to_side.min(to_edge);
        if jamb < to_glass.min(opening.jamb_m / depth_rate) {
            let normal = if to_side < to_edge {
                -tangent * ray.direction.dot(&tangent).signum()
            } else {
                -Vec3::z() * ray.direction.z.signum()
            };
            return Detail { hit: Hit { range_m: hit.range_m + jamb, normal }, ..plain };
        }
        let shade = if opening.is_panel { plain.shade } else { 1.0 };
        let to_glass = to_glass.min(FARTHEST_M);
        Detail { hit: Hit { range_m: hit.range_m + to_glass, ..hit }, finish: opening.finish, shade }
    }

    /// Way along the wall from its middle [m]; `None` on a flat part of a round building.
    fn across(&self, tangent: Vector2<f32>, at: Vector2<f32>) -> Option<f32> {
        let from = at - self.centre;
        if self.round_m == 0.0 {
            return Some(from.dot(&tangent));
        }
        let angle = self.along.perp(&from).atan2(self.along.dot(&from));
        ((from.norm() - self.round_m).abs() < 0.02).then_some(self.round_m * angle)
    }

    /// Length of a wall [m].
    fn length_m(&self, faces_along: bool) -> f32 {
        if self.round_m > 0.0 {
            return std::f32::consts::TAU * self.round_m;
        }
        2.0 * self.half_m[usize::from(faces_along)]
    }

    fn slot(&self, hit: &Hit, across: f32, z: f32) -> Slot {
        let faces_along = hit.normal.xy().dot(&self.along).abs() > 0.7;
        let length_m = self.length_m(faces_along);
        let count = (length_m / self.pitch_m).floor();
        Slot {
            half_m: 0.5 * length_m,
            number: ((across + 0.5 * count * self.pitch_m) / self.pitch_m).floor(),
            storey: ((z - self.floor_m) / self.storey_m).floor(),
            count,
        }
    }

    /// The window at a place on a wall.
    fn opening(&self, slot: &Slot, across: f32, z: f32) -> Option<Opening> {
        let sill = self.floor_m + slot.storey * self.storey_m + self.sill_m;
        let middle = (slot.number + 0.5 - 0.5 * slot.count) * self.pitch_m;
        let mut opening = Opening {
            across: [middle - 0.5 * self.window_m[0], middle + 0.5 * self.window_m[0]],
            upward: [sill, sill + self.window_m[1]],
            recess_m: self.recess_m,
            finish: Finish::Glass,
            is_panel: false,
            jamb_m: f32::INFINITY,
        };
        if self.irregular != 0 {
            self.vary_opening(&mut opening, slot, [across, z])?;
        }
        let inside = |[low, high]: [f32; 2], c: f32| low < c && c < high;
        let exists = (0.0..slot.count).contains(&slot.number)
            && slot.storey >= 0.0
            && opening.upward[1] < self.top_m - 0.2;
        (exists && inside(opening.across, across) && inside(opening.upward, z)).then_some(opening)
    }

    /// The panel at a place on a wall, if it lies back; those at the corners do not.
    fn panel(&self, slot: &Slot, across: f32, z: f32) -> Option<Opening> {
        let [width, height, depth] = self.panel_m;
        if depth == 0.0 {
            return None;
        }
        let cell = [(across / width).floor(), ((z - self.floor_m) / height).floor()];
        let across = [cell[0] * width, (cell[0] + 1.0) * width];
        let key = cell[0] as i64 * 4096 + cell[1] as i64;
        let random = &mut Random::hashed(combine(self.irregular ^ 0x50, key as u64));
        let is_inside = across[0] > -slot.half_m && across[1] < slot.half_m;
        (is_inside && random.chance(0.55)).then(|| Opening {
            across,
            upward: [cell[1], cell[1] + 1.0].map(|k| self.floor_m + k * height),
            recess_m: depth * random.between(0.2, 1.0),
            finish: Finish::Matte,
            is_panel: true,
            jamb_m: f32::INFINITY,
        })
    }

    /// Walled up, a door, behind curtains or shutters, open, or a balcony inside the wall.
    fn vary_opening(&self, opening: &mut Opening, slot: &Slot, at: [f32; 2]) -> Option<()> {
        let key = combine(self.irregular, (slot.number as i64 * 64 + slot.storey as i64) as u64);
        let random = &mut Random::hashed(key);
        let ground_floor = slot.storey == 0.0;
        // Arcades and shop windows, down to the pavement.
        let arcade = self.irregular % 12;
        if ground_floor && matches!(arcade, 0 | 1 | 6) {
            opening.upward[0] -= self.sill_m + 0.4;
            opening.upward[1] += 0.4;
            opening.recess_m += if arcade < 2 { random.between(1.0, 4.0) } else { 0.0 };
            opening.finish = if arcade == 1 { Finish::Matte } else { opening.finish };
        }
        match random.below(16) {
            0 | 1 => return None,
            2 => opening.upward[0] -= self.sill_m,
            3 | 4 => opening.finish = Finish::Matte,
            6 | 7 => opening.recess_m += random.between(0.5, 2.0),
            8..15 => {
                opening.jamb_m = opening.recess_m + 0.1;
                opening.recess_m += self.room_share(at) * random.between(0.5, 4.0);
                opening.finish = Finish::Matte;
            }
            _ => {}
        }
        opening.recess_m *= random.between(0.5, 1.5);
        Some(())
    }

    /// Share of a room's depth that is free behind a place of its window: frames, curtains, furniture, a far wall.
    fn room_share(&self, [across, z]: [f32; 2]) -> f32 {
        let cell = (across / 0.3).floor() as i64 * 4096 + (z / 0.5).floor() as i64;
        let random = &mut Random::hashed(combine(self.irregular ^ 0x52, cell as u64));
        if random.chance(0.4) { 1.0 } else { random.unit() }
    }

    /// Ground floors, bands and panels of other stone.
    fn shade(&self, slot: &Slot, across: f32, z: f32) -> f32 {
        if self.irregular == 0 {
            return 1.0;
        }
        let draw = |key: f32, salt: u64| {
            Random::hashed(combine(self.irregular ^ salt, (key + 1000.0) as u64)).between(0.75, 1.2)
        };
        // Shops with dark fronts.
        let front = if slot.storey <= 0.0 && self.irregular.is_multiple_of(4) { 0.15 } else { 1.0 };
        front * draw(slot.storey, 1) * draw(across / 0.9, 2) * draw(z / 0.35, 3)
    }
}

/// Way along the ray until a coordinate leaves an interval that it lies in.
fn time_inside(at: f32, rate: f32, [low, high]: [f32; 2]) -> f32 {
    if rate.abs() < 1e-6 {
        return f32::INFINITY;
    }
    (if rate > 0.0 { high - at } else { low - at }) / rate
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box from y = 4 on; one storey of 3 m, windows 1 m wide every 2 m, sill 1 m, recess 0.2 m.
    fn facade() -> Facade {
        Facade {
            centre: Vector2::new(0.0, 8.0),
            along: Vector2::x(),
            half_m: [4.0, 4.0],
            floor_m: 0.0,
            storey_m: 3.0,
            top_m: 3.0,
            pitch_m: 2.0,
            window_m: [1.0, 1.2],
            sill_m: 1.0,
            recess_m: 0.2,
            irregular: 0,
            round_m: 0.0,
            panel_m: [1.0, 1.0, 0.0],
        }
    }

    fn look(x: f32, z: f32, dx: f32) -> (f32, Finish) {
        let direction = Vec3::new(dx, 1.0, 0.0).normalize();
        let ray =
            Ray { origin: Vec3::new(x, 0.0, z) - direction * 4.0 / direction.y + Vec3::y() * 4.0, direction };
        let hit = Hit { range_m: 4.0 / direction.y, normal: -Vec3::y() };
        let Detail { hit, finish, .. } = facade().refine(&ray, hit);
        (ray.at(hit.range_m).y, finish)
    }

    #[test]
    fn panels_lie_back_by_no_more_than_their_depth_and_leave_the_corners() {
        let facade = Facade { panel_m: [0.7, 0.5, 0.3], irregular: 5, pitch_m: 60.0, ..facade() };
        let depth = |x: f32| {
            let ray = Ray { origin: Vec3::new(x, 0.0, 1.3), direction: Vec3::y() };
            facade.refine(&ray, Hit { range_m: 4.0, normal: -Vec3::y() }).hit.range_m - 4.0
        };
        let depths: Vec<f32> = (-39..=39).map(|k| depth(0.1 * k as f32 + 0.01)).collect();
        assert!(depths.iter().all(|d| (-1e-4..0.3).contains(d)) && depths[0] == 0.0);
        let deep = depths.iter().filter(|d| **d > 0.05).count();
        assert!((15..70).contains(&deep), "{deep}");
    }

    #[test]
    fn windows_of_a_round_wall_go_round() {
        let facade = Facade { round_m: 4.0, centre: Vector2::zeros(), ..facade() };
        let glass = (0..360).filter(|k| {
            let angle = (*k as f32).to_radians();
            let out = Vec3::new(angle.cos(), angle.sin(), 0.0);
            let ray = Ray { origin: out * 9.0 + Vec3::z() * 1.5, direction: -out };
            let detail = facade.refine(&ray, Hit { range_m: 5.0, normal: out });
            detail.finish == Finish::Glass && (detail.hit.range_m - 5.2).abs() < 1e-3
        });
        // Twelve windows of 1 m on a wall of 25 m.
        assert!((160..185).contains(&glass.count()));
    }

    #[test]
    fn glass_lies_behind_the_wall_and_jambs_between() {
        let near = |a: f32, b: f32| (a - b).abs() < 1e-4;
        let (glass, finish) = look(1.0, 1.5, 0.0);
        assert!(near(glass, 4.2) && finish == Finish::Glass, "{glass}");
        let (wall, finish) = look(2.0, 1.5, 0.0);
        assert!(near(wall, 4.0) && finish == Finish::Matte);
        let (below_sill, _) = look(1.0, 0.5, 0.0);
        assert!(near(below_sill, 4.0));
        let (jamb, finish) = look(1.45, 1.5, 1.0);
        assert!(near(jamb, 4.05) && finish == Finish::Matte, "{jamb}");
    }
}
