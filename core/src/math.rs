//! The only door to libm: the same functions, hence the same bits, on the host and on the target.

pub use libm::{atan2f as atan2, cosf as cos, fabsf as abs, sinf as sin, sqrtf as sqrt};

/// Largest integer not above `v`, as an integer; `v` must fit an i32.
#[inline]
pub fn floor_i32(v: f32) -> i32 {
    let i = v as i32;
    i - i32::from((i as f32) > v)
}

/// Angle wrapped to (-pi, pi]; 0 for one that is not finite or so large that its last bit is more than a milliradian.
pub fn wrap(angle: f32) -> f32 {
    use core::f32::consts::PI;
    if !(abs(angle) <= 1e4) {
        return 0.0;
    }
    let mut a = angle;
    while a > PI {
        a -= 2.0 * PI;
    }
    while a <= -PI {
        a += 2.0 * PI;
    }
    a
}
