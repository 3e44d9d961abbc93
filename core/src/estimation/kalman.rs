//! The constant-turn-rate Kalman filter of section 3.3.1, state [x, vx, y, vy].

use nalgebra::{Matrix2, Matrix2x4, Matrix4, Matrix4x2, Vector2, Vector4};

use crate::math;

/// Mean and covariance of a landmark centre's motion in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct PlanarMotion {
    /// [x m, vx m/s, y m, vy m/s].
    pub state: Vector4<f32>,
    /// Its covariance.
    pub covariance: Matrix4<f32>,
}

/// sin(w t)/w and (1 - cos(w t))/w, with their limits for w to 0 (the paper's F divides by w).
fn turn_terms(omega: f32, tau: f32) -> (f32, f32) {
    let angle = omega * tau;
    if math::abs(angle) < 1e-3 {
        (tau * (1.0 - angle * angle / 6.0), 0.5 * omega * tau * tau)
    } else {
        (math::sin(angle) / omega, (1.0 - math::cos(angle)) / omega)
    }
}

/// F of eq. 3 for a turn rate `omega` [rad/s] and a period `tau` [s].
pub fn transition(omega: f32, tau: f32) -> Matrix4<f32> {
    let (a, b) = turn_terms(omega, tau);
    let (s, c) = (math::sin(omega * tau), math::cos(omega * tau));
    Matrix4::new(1.0, a, 0.0, -b, 0.0, c, 0.0, -s, 0.0, b, 1.0, a, 0.0, s, 0.0, c)
}

/// Gamma of eq. 3.
pub fn noise_input(tau: f32) -> Matrix4x2<f32> {
    let h = 0.5 * tau * tau;
    Matrix4x2::new(h, 0.0, tau, 0.0, 0.0, h, 0.0, tau)
}

/// H of eq. 4.
pub fn measurement() -> Matrix2x4<f32> {
    Matrix2x4::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
}

impl PlanarMotion {
    /// A centre seen for the first time at `position` [m], with the variance of a measurement [m2] and of an unknown
    /// velocity [m2/s2].
    pub fn new(position: Vector2<f32>, position_variance: f32, velocity_variance: f32) -> Self {
        let (p, v) = (position_variance, velocity_variance);
        Self {
            state: Vector4::new(position.x, 0.0, position.y, 0.0),
            covariance: Matrix4::from_diagonal(&Vector4::new(p, v, p, v)),
        }
    }

    /// Position [m].
    pub fn position(&self) -> Vector2<f32> {
        Vector2::new(self.state[0], self.state[2])
    }

    /// Velocity [m/s].
    pub fn velocity(&self) -> Vector2<f32> {
        Vector2::new(self.state[1], self.state[3])
    }

    /// Speed [m/s], and the same in units of its standard deviation.
    pub fn speed(&self) -> (f32, f32) {
        let v = self.velocity();
        let speed = math::sqrt(v.norm_squared());
        let p = &self.covariance;
        let along = Matrix2::new(p[(1, 1)], p[(1, 3)], p[(3, 1)], p[(3, 3)]);
        let variance = (v.transpose() * along * v)[0] / v.norm_squared().max(1e-6);
        (speed, speed / math::sqrt(variance.max(1e-6)))
    }

    /// Eq. 3: the state `tau` seconds later, turning at `omega` [rad/s], under white acceleration of the given
    /// standard deviation [m/s2].
    pub fn predict(&mut self, omega: f32, tau: f32, acceleration: f32) {
        let f = transition(omega, tau);
        let gamma = noise_input(tau);
        self.state = f * self.state;
        self.covariance =
            f * self.covariance * f.transpose() + gamma * gamma.transpose() * (acceleration * acceleration);
    }

    /// Eq. 4: takes in a measured position [m] with its covariance [m2]; gives the squared normalised innovation.
    /// The state is left alone when the innovation's covariance cannot be inverted.
    pub fn update(&mut self, position: Vector2<f32>, noise: &Matrix2<f32>) -> f32 {
        let h = measurement();
        let innovation = position - h * self.state;
        let Some(inverse) = (h * self.covariance * h.transpose() + noise).try_inverse() else { return 0.0 };
        let gain = self.covariance * h.transpose() * inverse;
        self.state += gain * innovation;
        let keep = Matrix4::identity() - gain * h;
        // Joseph form: stays symmetric and positive in single precision.
        self.covariance = keep * self.covariance * keep.transpose() + gain * noise * gain.transpose();
        (innovation.transpose() * inverse * innovation)[0]
    }
}
