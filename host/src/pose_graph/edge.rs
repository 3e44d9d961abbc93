//! One measurement between two keyframes: its error and how the error follows the poses.

use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3, Vector6};
use sdslam_core::MapPose;

use super::GraphError;

/// Where an edge comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeKind {
    /// From one keyframe to the next: always believed.
    Odometry,
    /// Between two visits of a place: may be wrong.
    Loop,
}

/// A measured relative pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Keyframe whose frame the measurement is in.
    pub from: usize,
    /// Keyframe that was measured.
    pub to: usize,
    /// Pose of `to` in the frame of `from`.
    pub from_from_to: MapPose,
    /// Inverse covariance of the measurement's error in the frame of `to`: x, y, z \[m\], rotation vector \[rad\].
    pub information: Matrix6<f64>,
    /// Where it comes from.
    pub kind: EdgeKind,
}

/// An edge linearised at two poses: error, and its derivatives by a small motion of either keyframe in its own frame.
pub(super) struct Linearised {
    pub error: Vector6<f64>,
    pub by_from: Matrix6<f64>,
    pub by_to: Matrix6<f64>,
}

impl Edge {
    pub(super) fn check(&self, keyframes: usize) -> Result<(), GraphError> {
        let Self { from, to, .. } = *self;
        if from == to || from.max(to) >= keyframes {
            return Err(GraphError::Ends { from, to, keyframes });
        }
        let pose = &self.from_from_to;
        let finite = pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|v| v.is_finite());
        if !finite || !self.information.iter().all(|v| v.is_finite()) {
            return Err(GraphError::Measurement { from, to, fault: "a number is not finite" });
        }
        if self.information.cholesky().is_none() {
            let fault = "the information matrix is not positive definite";
            return Err(GraphError::Measurement { from, to, fault });
        }
        Ok(())
    }

    /// Measured against estimated pose: translation \[m\] and rotation vector \[rad\] in the frame of `to`.
    pub(super) fn error(&self, from: &MapPose, to: &MapPose) -> Vector6<f64> {
        let off = self.from_from_to.inv_mul(&from.inv_mul(to));
        let (t, w) = (off.translation.vector, off.rotation.scaled_axis());
        Vector6::new(t.x, t.y, t.z, w.x, w.y, w.z)
    }

    pub(super) fn squared_error(&self, from: &MapPose, to: &MapPose) -> f64 {
        let error = self.error(from, to);
        error.dot(&(self.information * error))
    }

    pub(super) fn linearise(&self, from: &MapPose, to: &MapPose) -> Linearised {
        let error = self.error(from, to);
        let matrix = |q: &UnitQuaternion<f64>| q.to_rotation_matrix().into_inner();
        let measured_to = matrix(&self.from_from_to.rotation).transpose();
        let from_from_to = from.inv_mul(to);
        let rotation = matrix(&from_from_to.rotation);
        let by_rotation = inverse_right_jacobian(&error.fixed_rows::<3>(3).into_owned());

        let (mut by_from, mut by_to) = (Matrix6::zeros(), Matrix6::zeros());
        let turned = measured_to * from_from_to.translation.vector.cross_matrix();
        by_from.fixed_view_mut::<3, 3>(0, 0).copy_from(&-measured_to);
        by_from.fixed_view_mut::<3, 3>(0, 3).copy_from(&turned);
        by_from.fixed_view_mut::<3, 3>(3, 3).copy_from(&(-by_rotation * rotation.transpose()));
        by_to.fixed_view_mut::<3, 3>(0, 0).copy_from(&(measured_to * rotation));
        by_to.fixed_view_mut::<3, 3>(3, 3).copy_from(&by_rotation);
        Linearised { error, by_from, by_to }
    }
}

/// Moves a pose by a small step in its own frame: translation \[m\] and rotation vector \[rad\].
pub(super) fn moved(pose: &MapPose, step: &Vector6<f64>) -> MapPose {
    let translation = pose.translation.vector + pose.rotation * Vector3::new(step[0], step[1], step[2]);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[3], step[4], step[5]));
    let rotation = UnitQuaternion::new_normalize((pose.rotation * turn).into_inner());
    MapPose::from_parts(translation.into(), rotation)
}

/// Derivative of `log(R exp(w))` by `w` at zero, with `axis` = `log(R)`.
fn inverse_right_jacobian(axis: &Vector3<f64>) -> Matrix3<f64> {
    let cross = axis.cross_matrix();
    let angle2 = axis.norm_squared();
    let angle = angle2.sqrt();
    // The series is exact to double precision where the quotient loses digits.
    let factor = match angle < 1e-3 {
        true => 1.0 / 12.0 + angle2 / 720.0,
        false => 1.0 / angle2 - (1.0 + angle.cos()) / (2.0 * angle * angle.sin()),
    };
    Matrix3::identity() + cross * 0.5 + cross * cross * factor
}
