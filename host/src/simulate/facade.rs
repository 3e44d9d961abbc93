//! Walls with recessed windows: one box carries the whole pattern.

use nalgebra::Vector2;

use super::{
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
}

/// A window as an interval along the wall and one upwards [m].
struct Opening {
    across: [f32; 2],
    upward: [f32; 2],
}

impl Facade {
    /// Follows a ray that met the box into a window, if there is one: onto the glass or a jamb.
    pub fn refine(&self, ray: &Ray, hit: Hit) -> (Hit, Finish) {
        let depth_rate = -hit.normal.dot(&ray.direction);
        if hit.normal.z.abs() > 0.5 || depth_rate < 0.05 {
            return (hit, Finish::Matte);
        }
        let tangent = Vec3::new(-hit.normal.y, hit.normal.x, 0.0);
        let at = ray.at(hit.range_m);
        let across = (at.xy() - self.centre).dot(&tangent.xy());
        let Some(opening) = self.opening(&hit, across, at.z) else { return (hit, Finish::Matte) };
        let to_glass = self.recess_m / depth_rate;
        let to_side = time_inside(across, ray.direction.dot(&tangent), opening.across);
        let to_edge = time_inside(at.z, ray.direction.z, opening.upward);
        let jamb = to_side.min(to_edge);
        if jamb < to_glass {
            let normal = if to_side < to_edge {
                -tangent * ray.direction.dot(&tangent).signum()
            } else {
                -Vec3::z() * ray.direction.z.signum()
            };
            return (Hit { range_m: hit.range_m + jamb, normal }, Finish::Matte);
        }
        (Hit { range_m: hit.range_m + to_glass, ..hit }, Finish::Glass)
    }

    /// The window at a place on a wall.
    fn opening(&self, hit: &Hit, across: f32, z: f32) -> Option<Opening> {
        let faces_along = hit.normal.xy().dot(&self.along).abs() > 0.7;
        let half = self.half_m[usize::from(faces_along)];
        let count = (2.0 * half / self.pitch_m).floor();
        let slot = ((across + 0.5 * count * self.pitch_m) / self.pitch_m).floor();
        let storey = ((z - self.floor_m) / self.storey_m).floor();
        let sill = self.floor_m + storey * self.storey_m + self.sill_m;
        let middle = (slot + 0.5 - 0.5 * count) * self.pitch_m;
        let opening = Opening {
            across: [middle - 0.5 * self.window_m[0], middle + 0.5 * self.window_m[0]],
            upward: [sill, sill + self.window_m[1]],
        };
        let inside = |[low, high]: [f32; 2], c: f32| low < c && c < high;
        let exists = (0.0..count).contains(&slot) && storey >= 0.0 && opening.upward[1] < self.top_m - 0.2;
        (exists && inside(opening.across, across) && inside(opening.upward, z)).then_some(opening)
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
        }
    }

    fn look(x: f32, z: f32, dx: f32) -> (f32, Finish) {
        let direction = Vec3::new(dx, 1.0, 0.0).normalize();
        let ray =
            Ray { origin: Vec3::new(x, 0.0, z) - direction * 4.0 / direction.y + Vec3::y() * 4.0, direction };
        let hit = Hit { range_m: 4.0 / direction.y, normal: -Vec3::y() };
        let (hit, finish) = facade().refine(&ray, hit);
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
