//! Rigid transforms, named by their frames: `map_from_sensor * point_in_sensor` is a point in the map.

use nalgebra::{Matrix3, UnitQuaternion, Vector3, Vector6};

use crate::math;

/// Six-degree-of-freedom rigid transform in single precision, for use near the origin of its target frame.
pub type Pose = nalgebra::Isometry3<f32>;

/// Six-degree-of-freedom rigid transform in double precision: poses in the map, which may be kilometres long.
pub type MapPose = nalgebra::Isometry3<f64>;

/// The transform that moves nothing, for statics.
pub const IDENTITY: Pose = Pose {
    rotation: nalgebra::Unit::new_unchecked(nalgebra::Quaternion {
        coords: nalgebra::Vector4::new(0.0, 0.0, 0.0, 1.0),
    }),
    translation: nalgebra::Translation3 { vector: Vector3::new(0.0, 0.0, 0.0) },
};

/// Planar motion (section 3.2): translation [m] in x and y, rotation [rad] about z.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PlanarPose {
    /// Translation along x [m].
    pub x: f32,
    /// Translation along y [m].
    pub y: f32,
    /// Rotation about z [rad], in (-pi, pi].
    pub yaw: f32,
}

impl PlanarPose {
    /// The horizontal part of a 6-DoF pose.
    pub fn from_pose(pose: &Pose) -> Self {
        let r = pose.rotation.to_rotation_matrix();
        let m = r.matrix();
        Self { x: pose.translation.x, y: pose.translation.y, yaw: math::atan2(m[(1, 0)], m[(0, 0)]) }
    }

    /// Moves a point of the source frame into the target frame; `sin_cos` is that of the yaw.
    pub fn apply(&self, sin_cos: (f32, f32), p: [f32; 2]) -> [f32; 2] {
        let (s, c) = sin_cos;
        [c * p[0] - s * p[1] + self.x, s * p[0] + c * p[1] + self.y]
    }
}

/// Rotation vector [rad] to unit quaternion.
pub fn exp_so3(w: Vector3<f32>) -> UnitQuaternion<f32> {
    let angle2 = w.norm_squared();
    let angle = math::sqrt(angle2);
    // sin(a/2)/a: series near zero keeps full precision.
    let (k, c) = if angle < 1e-3 {
        (0.5 - angle2 / 48.0, 1.0 - angle2 / 8.0)
    } else {
        (math::sin(0.5 * angle) / angle, math::cos(0.5 * angle))
    };
    UnitQuaternion::new_normalize(nalgebra::Quaternion::new(c, k * w.x, k * w.y, k * w.z))
}

/// Unit quaternion to rotation vector [rad], angle in [0, pi].
pub fn log_so3(q: &UnitQuaternion<f32>) -> Vector3<f32> {
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let v = Vector3::new(q.i, q.j, q.k) * sign;
    let n = v.norm();
    if n < 1e-6 { v * 2.0 } else { v * (2.0 * math::atan2(n, q.w * sign) / n) }
}

/// Product of two poses, with the rotation renormalised: products of products leave the unit sphere exponentially fast.
pub fn compose(a: &Pose, b: &Pose) -> Pose {
    let mut product = a * b;
    product.rotation = UnitQuaternion::new_normalize(product.rotation.into_inner());
    product
}

/// Small motion as [translation; rotation vector] to a pose (translation and rotation taken separately).
pub fn exp(twist: &Vector6<f32>) -> Pose {
    Pose::from_parts(
        Vector3::new(twist[0], twist[1], twist[2]).into(),
        exp_so3(Vector3::new(twist[3], twist[4], twist[5])),
    )
}

/// The inverse of [`exp`].
pub fn log(pose: &Pose) -> Vector6<f32> {
    let (t, w) = (pose.translation.vector, log_so3(&pose.rotation));
    Vector6::new(t.x, t.y, t.z, w.x, w.y, w.z)
}

/// Roll, pitch, yaw [rad] of a rotation `Rz(yaw) Ry(pitch) Rx(roll)`.
pub fn roll_pitch_yaw(q: &UnitQuaternion<f32>) -> (f32, f32, f32) {
    let r = q.to_rotation_matrix();
    let m = r.matrix();
    let horizontal = math::sqrt(m[(0, 0)] * m[(0, 0)] + m[(1, 0)] * m[(1, 0)]);
    (
        math::atan2(m[(2, 1)], m[(2, 2)]),
        math::atan2(-m[(2, 0)], horizontal),
        math::atan2(m[(1, 0)], m[(0, 0)]),
    )
}

/// Rotation `Rz(yaw) Ry(pitch) Rx(roll)` [rad].
pub fn from_roll_pitch_yaw(roll: f32, pitch: f32, yaw: f32) -> UnitQuaternion<f32> {
    let axis = |x: f32, y: f32, z: f32, a: f32| exp_so3(Vector3::new(x, y, z) * a);
    axis(0.0, 0.0, 1.0, yaw) * axis(0.0, 1.0, 0.0, pitch) * axis(1.0, 0.0, 0.0, roll)
}

/// Cross-product matrix of `v`.
pub fn skew(v: &Vector3<f32>) -> Matrix3<f32> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}
