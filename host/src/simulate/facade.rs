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

/// A window as an interval along the wall and one upwards [m], and what is behind it.
struct Opening {
    across: [f32; 2],
    upward: [f32; 2],
    recess_m: f32,
    finish: Finish,
}

/// Where a place on a wall lies in the pattern of windows.
struct Slot {
    number: f32,
    storey: f32,
    count: f32,
}

impl Facade {
    /// Follows a ray that met the box into a window, if there is one: onto the glass or a jamb.
    pub fn refine(&self, ray: &Ray, hit: Hit) -> Detail {
        let depth_rate = -hit.normal.dot(&ray.direction);
        let plain = Detail { hit, finish: Finish::Matte, shade: 1.0 };
        if hit.normal.z.abs() > 0.5 || depth_rate < 0.05 {
            return plain;
        }
        let tangent = Vec3::new(-hit.normal.y, hit.normal.x, 0.0);
        let at = ray.at(hit.range_m);
        let across = (at.xy() - self.centre).dot(&tangent.xy());
        let slot = self.slot(&hit, across, at.z);
        let plain = Detail { shade: self.shade(&slot, across, at.z), ..plain };
        let Some(opening) = self.opening(&slot, across, at.z) else { return plain };
        let to_glass = opening.recess_m / depth_rate;
        let to_side = time_inside(across, ray.direction.dot(&tangent), opening.across);
        let to_edge = time_inside(at.z, ray.direction.z, opening.upward);
        let jamb = to_side.min(to_edge);
        if jamb < to_glass {
            let normal = if to_side < to_edge {
                -tangent * ray.direction.dot(&tangent).signum()
            } else {
                -Vec3::z() * ray.direction.z.signum()
            };
            return Detail { hit: Hit { range_m: hit.range_m + jamb, normal }, ..plain };
        }
        Detail { hit: Hit { range_m: hit.range_m + to_glass, ..hit }, finish: opening.finish, shade: 1.0 }
    }

    fn slot(&self, hit: &Hit, across: f32, z: f32) -> Slot {
        let faces_along = hit.normal.xy().dot(&self.along).abs() > 0.7;
        let count = (2.0 * self.half_m[usize::from(faces_along)] / self.pitch_m).floor();
        Slot {
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
        };
        if self.irregular != 0 {
            self.vary(&mut opening, slot)?;
        }
        let inside = |[low, high]: [f32; 2], c: f32| low < c && c < high;
        let exists = (0.0..slot.count).contains(&slot.number)
            && slot.storey >= 0.0
            && opening.upward[1] < self.top_m - 0.2;
        (exists && inside(opening.across, across) && inside(opening.upward, z)).then_some(opening)
    }

    /// Walled up, a door, behind curtains or shutters, open, or a balcony inside the wall.
    fn vary(&self, opening: &mut Opening, slot: &Slot) -> Option<()> {
        let key = combine(self.irregular, (slot.number as i64 * 64 + slot.storey as i64) as u64);
        let random = &mut Random::hashed(key);
        let ground_floor = slot.storey == 0.0;
        if ground_floor && self.irregular.is_multiple_of(6) {
            // Arcades and shop windows, down to the pavement.
            opening.upward[0] -= self.sill_m + 0.4;
            opening.upward[1] += 0.4;
            opening.recess_m +=
                if self.irregular.is_multiple_of(12) { random.between(1.0, 3.5) } else { 0.0 };
        }
        match random.below(16) {
            0 | 1 => return None,
            2 => opening.upward[0] -= self.sill_m,
            3..6 => opening.finish = Finish::Matte,
            6 | 7 => opening.recess_m += random.between(0.5, 2.0),
            _ => {}
        }
        opening.recess_m *= random.between(0.5, 1.5);
        Some(())
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
