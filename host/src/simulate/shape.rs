//! Shapes that a ray can hit: convex hulls, capsules and clumps of leaves.

use nalgebra::{Isometry3, Point3, Vector3};

use super::random::Random;

/// Vector [m] in the town's frame, or a body's.
pub type Vec3 = Vector3<f32>;

/// A ray with a unit direction.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Start [m].
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
}

impl Ray {
    /// The point at this range [m].
    pub fn at(&self, range_m: f32) -> Vec3 {
        self.origin + self.direction * range_m
    }
}

/// Where a ray meets a shape.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Range along the ray [m].
    pub range_m: f32,
    /// Outward unit normal there.
    pub normal: Vec3,
}

/// The points `x` with `normal . x <= offset`.
#[derive(Clone, Copy, Debug)]
pub struct HalfSpace {
    normal: Vec3,
    offset: f32,
}

/// A convex solid.
#[derive(Clone, Debug)]
pub struct Hull {
    faces: Box<[HalfSpace]>,
    corners: Box<[Vec3]>,
}

/// A rectangle in a horizontal plane of a body's frame.
#[derive(Clone, Copy, Debug)]
pub struct Slab {
    /// From and to along x [m].
    pub x: [f32; 2],
    /// From and to along y [m].
    pub y: [f32; 2],
    /// Height [m].
    pub z: f32,
}

impl Hull {
    /// The solid between two horizontal rectangles; the upper one may shrink to a ridge.
    pub fn between(bottom: Slab, top: Slab) -> Self {
        let corners: Vec<Vec3> = [bottom, top]
            .iter()
            .flat_map(|s| [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| Vec3::new(s.x[i], s.y[j], s.z)))
            .collect();
        let mut faces = vec![
            HalfSpace { normal: Vec3::z(), offset: top.z },
            HalfSpace { normal: -Vec3::z(), offset: -bottom.z },
        ];
        for side in 0..4 {
            let (a, b) = (corners[side], corners[(side + 1) % 4]);
            let up = 0.5 * (corners[4 + side] + corners[4 + (side + 1) % 4]) - 0.5 * (a + b);
            let normal = (b - a).cross(&up).normalize();
            faces.push(HalfSpace { normal, offset: normal.dot(&a) });
        }
        Self { faces: faces.into(), corners: corners.into() }
    }

    /// An upright box.
    pub fn cuboid(x: [f32; 2], y: [f32; 2], z: [f32; 2]) -> Self {
        Self::between(Slab { x, y, z: z[0] }, Slab { x, y, z: z[1] })
    }

    /// A disc with a horizontal axis along y: an octagonal wheel.
    pub fn wheel(centre: Vec3, radius_m: f32, half_width_m: f32) -> Self {
        let mut faces = Vec::with_capacity(10);
        let mut corners = Vec::with_capacity(16);
        for k in 0..8 {
            let angle = std::f32::consts::FRAC_PI_4 * k as f32;
            let normal = Vec3::new(angle.cos(), 0.0, angle.sin());
            faces.push(HalfSpace { normal, offset: normal.dot(&centre) + radius_m });
            let tip = centre + normal * (radius_m * 1.083);
            corners.extend([tip + Vec3::y() * half_width_m, tip - Vec3::y() * half_width_m]);
        }
        for normal in [Vec3::y(), -Vec3::y()] {
            faces.push(HalfSpace { normal, offset: normal.dot(&centre) + half_width_m });
        }
        Self { faces: faces.into(), corners: corners.into() }
    }

    fn hit(&self, ray: &Ray) -> Option<Hit> {
        let (range_m, _, normal) = self.cross(ray)?;
        normal.map(|normal| Hit { range_m, normal })
    }

    /// Ranges at which the ray enters and leaves, and the normal where it enters; none if it starts inside.
    fn cross(&self, ray: &Ray) -> Option<(f32, f32, Option<Vec3>)> {
        let (mut enter, mut leave, mut normal) = (0.0f32, f32::INFINITY, None);
        for face in &self.faces {
            let gap = face.offset - face.normal.dot(&ray.origin);
            let rate = face.normal.dot(&ray.direction);
            if rate.abs() < 1e-9 {
                if gap < 0.0 {
                    return None;
                }
            } else if rate < 0.0 {
                if gap / rate > enter {
                    enter = gap / rate;
                    normal = Some(face.normal);
                }
            } else {
                leave = leave.min(gap / rate);
            }
            if enter > leave {
                return None;
            }
        }
        Some((enter, leave, normal))
    }

    fn moved(&self, pose: &Isometry3<f32>) -> Self {
        let turn = |face: &HalfSpace| {
            let normal = pose.rotation * face.normal;
            HalfSpace { normal, offset: face.offset + normal.dot(&pose.translation.vector) }
        };
        Self {
            faces: self.faces.iter().map(turn).collect(),
            corners: self.corners.iter().map(|c| (pose * Point3::from(*c)).coords).collect(),
        }
    }
}

/// What a ray can hit.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A convex solid.
    Hull(Hull),
    /// A rounded rod from `a` to `b`.
    Capsule {
        /// One end of the axis [m].
        a: Vec3,
        /// The other end [m].
        b: Vec3,
        /// Radius [m].
        radius_m: f32,
    },
    /// What lies both in an upright cylinder and in a convex solid.
    Drum {
        /// A point of the axis [m].
        axis: Vec3,
        /// Radius [m].
        radius_m: f32,
        /// The solid.
        hull: Hull,
    },
    /// A spheroid full of leaves or twigs: a ray gets some way into it, or through.
    Clump {
        /// Centre [m].
        centre: Vec3,
        /// Horizontal radius [m].
        radius_m: f32,
        /// Vertical radius [m].
        half_height_m: f32,
        /// Mean way of a ray inside before it meets something [m].
        free_path_m: f32,
    },
}

impl Shape {
    /// Where the ray first meets this shape. Only clumps use the random numbers.
    pub fn hit(&self, ray: &Ray, random: impl FnOnce() -> Random) -> Option<Hit> {
        match self {
            Self::Hull(hull) => hull.hit(ray),
            Self::Capsule { a, b, radius_m } => hit_capsule(ray, *a, *b, *radius_m),
            Self::Drum { axis, radius_m, hull } => hit_drum(ray, *axis, *radius_m, hull),
            Self::Clump { centre, radius_m, half_height_m, free_path_m } => {
                let (enter, leave) = cross_spheroid(ray, *centre, *radius_m, *half_height_m)?;
                let range_m = enter + free_path_m * random().exponential();
                (range_m < leave).then_some(Hit { range_m, normal: -ray.direction })
            }
        }
    }

    /// This shape moved from a body's frame into the town's. Clumps and drums keep their axis upright.
    pub fn moved(&self, pose: &Isometry3<f32>) -> Self {
        let place = |p: &Vec3| (pose * Point3::from(*p)).coords;
        match self {
            Self::Hull(hull) => Self::Hull(hull.moved(pose)),
            Self::Capsule { a, b, radius_m } => {
                Self::Capsule { a: place(a), b: place(b), radius_m: *radius_m }
            }
            Self::Drum { axis, radius_m, hull } => {
                Self::Drum { axis: place(axis), radius_m: *radius_m, hull: hull.moved(pose) }
            }
            Self::Clump { centre, radius_m, half_height_m, free_path_m } => Self::Clump {
                centre: place(centre),
                radius_m: *radius_m,
                half_height_m: *half_height_m,
                free_path_m: *free_path_m,
            },
        }
    }

    /// Lowest and highest corner of the upright box around this shape.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        match self {
            Self::Hull(hull) | Self::Drum { hull, .. } => hull
                .corners
                .iter()
                .skip(1)
                .fold((hull.corners[0], hull.corners[0]), |(low, high), c| (low.inf(c), high.sup(c))),
            Self::Capsule { a, b, radius_m } => {
                let r = Vec3::repeat(*radius_m);
                (a.inf(b) - r, a.sup(b) + r)
            }
            Self::Clump { centre, radius_m, half_height_m, .. } => {
                let r = Vec3::new(*radius_m, *radius_m, *half_height_m);
                (centre - r, centre + r)
            }
        }
    }
}

fn hit_drum(ray: &Ray, axis: Vec3, radius_m: f32, hull: &Hull) -> Option<Hit> {
    let (mut enter, leave, mut normal) = hull.cross(ray)?;
    let (from, rate) = (ray.origin.xy() - axis.xy(), ray.direction.xy());
    let rate2 = rate.norm_squared().max(1e-9);
    let closest = -from.dot(&rate) / rate2;
    let half = ((radius_m * radius_m - (from + rate * closest).norm_squared()) / rate2).sqrt();
    // Not a number if the ray misses the cylinder: then no comparison holds.
    if !(closest - half < leave && closest + half > enter) {
        return None;
    }
    if closest - half > enter {
        enter = closest - half;
        let out = (from + rate * enter) / radius_m;
        normal = Some(Vec3::new(out.x, out.y, 0.0));
    }
    normal.map(|normal| Hit { range_m: enter, normal })
}

fn hit_capsule(ray: &Ray, a: Vec3, b: Vec3, radius_m: f32) -> Option<Hit> {
    let axis = b - a;
    let reach = 0.5 * axis.norm() + radius_m;
    // Starting near the capsule keeps single precision exact far from the sensor.
    let start = start_near(ray, 0.5 * (a + b), reach)?;
    let from_a = ray.at(start) - a;
    let (axis2, along, lift) = (axis.norm_squared(), axis.dot(&ray.direction), axis.dot(&from_a));
    let qa = axis2 - along * along;
    let qb = axis2 * ray.direction.dot(&from_a) - lift * along;
    let qc = axis2 * (from_a.norm_squared() - radius_m * radius_m) - lift * lift;
    let root = qb * qb - qa * qc;
    if root < 0.0 {
        return None;
    }
    let t = (-qb - root.sqrt()) / qa.max(1e-9);
    let at = lift + t * along;
    if qa > 1e-6 && at > 0.0 && at < axis2 {
        let normal = (from_a + ray.direction * t - axis * (at / axis2)) / radius_m;
        return (start + t > 0.0).then_some(Hit { range_m: start + t, normal });
    }
    let end = if at <= 0.0 { a } else { b };
    let (range_m, _) = cross_spheroid(ray, end, radius_m, radius_m)?;
    Some(Hit { range_m, normal: (ray.at(range_m) - end) / radius_m })
}

/// Range at which the ray comes within `reach` of a point, or `None` if it never does.
fn start_near(ray: &Ray, centre: Vec3, reach: f32) -> Option<f32> {
    let to = centre - ray.origin;
    let closest = to.dot(&ray.direction);
    let miss = (to - ray.direction * closest).norm_squared();
    (closest > -reach && miss <= reach * reach).then_some((closest - reach).max(0.0))
}

fn cross_spheroid(ray: &Ray, centre: Vec3, radius_m: f32, half_height_m: f32) -> Option<(f32, f32)> {
    let start = start_near(ray, centre, radius_m.max(half_height_m))?;
    let scale = Vec3::new(1.0 / radius_m, 1.0 / radius_m, 1.0 / half_height_m);
    let from = (ray.at(start) - centre).component_mul(&scale);
    let direction = ray.direction.component_mul(&scale);
    let (qa, qb) = (direction.norm_squared(), from.dot(&direction));
    let root = qb * qb - qa * (from.norm_squared() - 1.0);
    if root <= 0.0 {
        return None;
    }
    let (enter, leave) = ((-qb - root.sqrt()) / qa, (-qb + root.sqrt()) / qa);
    (start + enter > 0.0).then_some((start + enter, start + leave))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::random::Domain;

    fn ray(origin: [f32; 3], direction: [f32; 3]) -> Ray {
        Ray { origin: Vec3::from(origin), direction: Vec3::from(direction).normalize() }
    }

    fn range(shape: &Shape, ray: &Ray) -> Option<f32> {
        shape.hit(ray, || Random::keyed(1, Domain::Ray, &[])).map(|hit| hit.range_m)
    }

    #[test]
    fn box_is_hit_on_the_near_face_or_missed() {
        let cuboid = Shape::Hull(Hull::cuboid([4.0, 6.0], [-1.0, 1.0], [0.0, 2.0]));
        assert_eq!(range(&cuboid, &ray([0.0, 0.0, 1.0], [1.0, 0.0, 0.0])), Some(4.0));
        assert_eq!(range(&cuboid, &ray([10.0, 0.0, 1.0], [-1.0, 0.0, 0.0])), Some(4.0));
        assert_eq!(range(&cuboid, &ray([0.0, 1.5, 1.0], [1.0, 0.0, 0.0])), None);
        assert_eq!(range(&cuboid, &ray([0.0, 0.0, 1.0], [-1.0, 0.0, 0.0])), None);
    }

    #[test]
    fn drum_is_round_where_the_hull_does_not_cut_it() {
        let hull = Hull::cuboid([-9.0, 9.0], [-3.0, 3.0], [0.0, 2.0]);
        let drum = Shape::Drum { axis: Vec3::zeros(), radius_m: 5.0, hull };
        let from_left = |y: f32, z: f32| range(&drum, &ray([-20.0, y, z], [1.0, 0.0, 0.0]));
        assert!((from_left(0.0, 1.0).expect("hit") - 15.0).abs() < 1e-4);
        assert!((from_left(-2.99, 1.0).expect("hit") - 15.99).abs() < 0.02);
        assert_eq!((from_left(3.1, 1.0), from_left(0.0, 2.1)), (None, None));
        let front = range(&drum, &ray([1.0, -20.0, 1.0], [0.0, 1.0, 0.0]));
        assert!((front.expect("hit") - 17.0).abs() < 1e-4);
    }

    #[test]
    fn far_thin_pole_keeps_its_radius() {
        let pole =
            Shape::Capsule { a: Vec3::new(0.0, 0.0, -1.0), b: Vec3::new(0.0, 0.0, 5.0), radius_m: 0.06 };
        for distance in [5.0, 40.0, 79.0] {
            let seen = range(&pole, &ray([-distance, 0.0, 1.0], [1.0, 0.0, 0.0])).expect("hit");
            assert!((seen - distance + 0.06).abs() < 1e-4, "{distance}: {seen}");
            assert_eq!(range(&pole, &ray([-distance, 0.07, 1.0], [1.0, 0.0, 0.0])), None);
        }
    }

    #[test]
    fn moving_body_and_ray_together_changes_nothing() {
        let pose = Isometry3::new(Vec3::new(30.0, -12.0, 1.0), Vec3::new(0.0, 0.1, 0.8));
        let shapes = [
            Shape::Hull(Hull::wheel(Vec3::new(3.0, 0.0, 0.0), 0.4, 0.1)),
            Shape::Capsule { a: Vec3::new(3.0, -1.0, 0.2), b: Vec3::new(4.0, 1.0, 0.4), radius_m: 0.3 },
        ];
        for shape in shapes {
            for k in 0..20 {
                let local = ray([0.0, 0.0, 0.1], [1.0, 0.02 * (k - 10) as f32, 0.0]);
                let moved = Ray {
                    origin: (pose * Point3::from(local.origin)).coords,
                    direction: pose.rotation * local.direction,
                };
                match (range(&shape, &local), range(&shape.moved(&pose), &moved)) {
                    (Some(a), Some(b)) => assert!((a - b).abs() < 1e-3),
                    (a, b) => assert_eq!(a.is_some(), b.is_some()),
                }
            }
        }
    }

    #[test]
    fn share_of_rays_through_a_clump_follows_its_free_path() {
        let clump =
            Shape::Clump { centre: Vec3::zeros(), radius_m: 0.5, half_height_m: 0.5, free_path_m: 0.5 };
        let through = ray([-3.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        let passed = (0..4000)
            .filter(|i| clump.hit(&through, || Random::keyed(1, Domain::Ray, &[*i])).is_none())
            .count();
        let expected = (-2.0f32).exp();
        assert!((passed as f32 / 4000.0 - expected).abs() < 0.02, "{passed}");
    }

    #[test]
    fn corners_lie_inside_the_bounds_and_on_no_outer_side() {
        let hull = Hull::between(
            Slab { x: [0.0, 4.0], y: [-1.0, 1.0], z: 0.0 },
            Slab { x: [1.0, 3.0], y: [0.0, 0.0], z: 1.0 },
        );
        for corner in &hull.corners {
            assert!(hull.faces.iter().all(|f| f.normal.dot(corner) <= f.offset + 1e-5));
        }
        let (low, high) = Shape::Hull(hull).bounds();
        assert_eq!((low, high), (Vec3::new(0.0, -1.0, 0.0), Vec3::new(4.0, 1.0, 1.0)));
    }
}
