//! The Kalman filter and rotations against double precision.

use nalgebra::{Matrix2, Matrix4, UnitQuaternion, Vector2, Vector3, Vector4, Vector6};
use proptest::prelude::*;
use sdslam_core::estimation::kalman::{self, PlanarMotion};
use sdslam_core::pose;
use sdslam_tests::world::unit;

fn as_f64(m: &nalgebra::Matrix4<f32>) -> Matrix4<f64> {
    m.cast()
}

fn turning_rate_matrix(omega: f64) -> Matrix4<f64> {
    Matrix4::new(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -omega, 0.0, 0.0, 0.0, 1.0, 0.0, omega, 0.0, 0.0)
}

proptest! {
    #[test]
    fn transition_is_the_matrix_exponential(omega in -3.0f32..3.0, shrink in 0i32..8, tau in 0.02f32..2.0) {
        let omega = omega * 10f32.powi(-shrink);
        let exact = (turning_rate_matrix(f64::from(omega)) * f64::from(tau)).exp();
        let error = (as_f64(&kalman::transition(omega, tau)) - exact).amax();
        prop_assert!(error <= 1e-4 * f64::from(tau), "omega {omega}, tau {tau}: {error}");
    }

    #[test]
    fn filter_follows_one_in_double_precision(
        omega in -0.6f32..0.6, seed in 0u64..1_000_000, start in [-100.0f32..100.0, -100.0f32..100.0],
    ) {
        let mut filter = PlanarMotion::new(Vector2::from(start), 0.04, 90.0);
        let mut state: Vector4<f64> = filter.state.cast();
        let mut covariance = as_f64(&filter.covariance);
        for step in 0..60u64 {
            let (tau, acceleration) = (0.05 + 0.1 * unit(seed, step, 0), 3.0);
            filter.predict(omega, tau as f32, acceleration as f32);
            let f = (turning_rate_matrix(f64::from(omega)) * tau).exp();
            let h = 0.5 * tau * tau;
            let gamma = nalgebra::Matrix4x2::new(h, 0.0, tau, 0.0, 0.0, h, 0.0, tau);
            state = f * state;
            covariance = f * covariance * f.transpose() + gamma * gamma.transpose() * (acceleration * acceleration);
            let noise = Matrix2::from_diagonal(&Vector2::new(0.05, 0.1));
            let measured = Vector2::new(
                f64::from(start[0]) + 0.6 * step as f64 + unit(seed, step, 1),
                f64::from(start[1]) - 0.2 * step as f64 + unit(seed, step, 2),
            );
            filter.update(measured.cast(), &noise.cast());
            let pick = nalgebra::Matrix2x4::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0);
            let gain = covariance * pick.transpose()
                * (pick * covariance * pick.transpose() + noise).try_inverse().expect("positive");
            state += gain * (measured - pick * state);
            covariance = (Matrix4::identity() - gain * pick) * covariance;
        }
        let found: Vector4<f64> = filter.state.cast();
        prop_assert!((found - state).amax() < 5e-3, "{found} instead of {state}");
        prop_assert!((as_f64(&filter.covariance) - covariance).amax() < 1e-3 * covariance.amax());
    }

    #[test]
    fn covariance_stays_symmetric_and_positive(
        steps in prop::collection::vec((0.01f32..1.0, -0.6f32..0.6, -1e3f32..1e3, 1e-3f32..10.0, any::<bool>()), 1..200),
    ) {
        let mut filter = PlanarMotion::new(Vector2::zeros(), 0.04, 90.0);
        for (tau, omega, at, noise, seen) in steps {
            filter.predict(omega, tau, 3.0);
            if seen {
                let gain = filter.update(Vector2::new(at, -at), &(Matrix2::identity() * noise));
                prop_assert!(gain >= 0.0 && gain.is_finite());
            }
            let p = filter.covariance;
            let scale = p.amax();
            prop_assert!((p - p.transpose()).amax() <= 1e-4 * scale, "not symmetric: {p}");
            let p = 0.5 * (as_f64(&p) + as_f64(&p.transpose()));
            let smallest = p.symmetric_eigenvalues().min();
            prop_assert!(smallest > -1e-6 * f64::from(scale), "not positive: {smallest} of {scale}");
        }
    }
}

#[test]
fn transition_is_continuous_where_the_series_takes_over() {
    for tau in [0.05f32, 0.1, 0.3] {
        let edge = 1e-3 / tau;
        let (below, above) = (kalman::transition(edge * 0.9999, tau), kalman::transition(edge * 1.0001, tau));
        assert!((below - above).amax() < 2e-4 * tau, "tau {tau}: {}", below - above);
        let straight = kalman::transition(0.0, tau);
        assert_eq!((straight[(0, 1)], straight[(0, 3)], straight[(1, 1)]), (tau, 0.0, 1.0));
    }
}

#[test]
fn an_update_with_an_impossible_covariance_changes_nothing() {
    let mut filter = PlanarMotion::new(Vector2::new(1.0, 2.0), 0.0, 0.0);
    let before = filter;
    assert_eq!(filter.update(Vector2::new(5.0, 5.0), &Matrix2::zeros()), 0.0);
    assert_eq!(filter, before);
}

fn rotation_vector() -> impl Strategy<Value = Vector3<f32>> {
    let direction = [-1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0];
    (direction, 0.0f32..3.1, 0i32..6).prop_map(|(d, angle, shrink)| {
        Vector3::from(d).try_normalize(1e-3).unwrap_or(Vector3::x()) * angle * 10f32.powi(-shrink)
    })
}

proptest! {
    #[test]
    fn rotations_are_nalgebras(w in rotation_vector()) {
        let q = pose::exp_so3(w);
        let expected = UnitQuaternion::from_scaled_axis(w.cast::<f64>());
        prop_assert!(q.cast::<f64>().angle_to(&expected) < 1e-6);
        prop_assert!((pose::log_so3(&q) - w).norm() <= 1e-6 + 2e-6 * w.norm());
        // The quaternion of the other sign is the same rotation.
        let other = UnitQuaternion::new_unchecked(-q.into_inner());
        prop_assert!((pose::log_so3(&other) - w).norm() <= 1e-6 + 2e-6 * w.norm());
    }

    #[test]
    fn exp_and_log_of_a_pose_are_inverse(w in rotation_vector(), t in [-5.0f32..5.0, -5.0f32..5.0, -5.0f32..5.0]) {
        let twist = Vector6::new(t[0], t[1], t[2], w.x, w.y, w.z);
        let back = pose::log(&pose::exp(&twist));
        prop_assert!((back - twist).norm() < 1e-5, "{back} instead of {twist}");
    }

    #[test]
    fn euler_angles_are_nalgebras(roll in -3.1f32..3.1, pitch in -1.5f32..1.5, yaw in -3.1f32..3.1) {
        let q = pose::from_roll_pitch_yaw(roll, pitch, yaw);
        let expected = UnitQuaternion::from_euler_angles(f64::from(roll), f64::from(pitch), f64::from(yaw));
        prop_assert!(q.cast::<f64>().angle_to(&expected) < 2e-6);
        let (r, p, y) = pose::roll_pitch_yaw(&q);
        let back = UnitQuaternion::from_euler_angles(f64::from(r), f64::from(p), f64::from(y));
        prop_assert!(back.angle_to(&expected) < 3e-6 / f64::from(pitch.cos()).max(0.01));
    }
}
