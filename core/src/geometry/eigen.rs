//! Eigenvalues and eigenvectors of symmetric 3 x 3 matrices, by Jacobi's rotations: a bounded number of steps, and no
//! panic, which nalgebra's decomposition of any size cannot promise.

use nalgebra::{Matrix3, Vector3};

use crate::math;

/// Rounds over the three elements beside the diagonal: single precision converges in four or five.
const SWEEPS: usize = 8;

/// Eigenvalues, ascending, each with its eigenvector of length one.
pub fn symmetric(matrix: &Matrix3<f32>) -> [(f32, Vector3<f32>); 3] {
    let (mut a, mut v) = (*matrix, Matrix3::identity());
    for _ in 0..SWEEPS {
        rotate::<0, 1, 2>(&mut a, &mut v);
        rotate::<0, 2, 1>(&mut a, &mut v);
        rotate::<1, 2, 0>(&mut a, &mut v);
        if a[(0, 1)] == 0.0 && a[(0, 2)] == 0.0 && a[(1, 2)] == 0.0 {
            break;
        }
    }
    let mut pairs = [0, 1, 2].map(|i| (a[(i, i)], v.column(i).into_owned()));
    for (i, k) in [(0, 1), (1, 2), (0, 1)] {
        if pairs[k].0 < pairs[i].0 {
            pairs.swap(i, k);
        }
    }
    pairs
}

/// Turns the plane of axes `P` and `Q` so that their element becomes zero; `R` is the third axis.
#[inline]
fn rotate<const P: usize, const Q: usize, const R: usize>(a: &mut Matrix3<f32>, v: &mut Matrix3<f32>) {
    let apq = a[(P, Q)];
    // Too small to change the diagonal: done.
    if math::abs(apq) <= 1e-9 * math::sqrt(math::abs(a[(P, P)] * a[(Q, Q)])) || !apq.is_finite() {
        (a[(P, Q)], a[(Q, P)]) = (0.0, 0.0);
        return;
    }
    let theta = (a[(Q, Q)] - a[(P, P)]) / (2.0 * apq);
    let sign = if theta < 0.0 { -1.0 } else { 1.0 };
    let tangent = sign / (math::abs(theta) + math::sqrt(theta * theta + 1.0));
    let cos = 1.0 / math::sqrt(tangent * tangent + 1.0);
    let sin = tangent * cos;
    a[(P, P)] -= tangent * apq;
    a[(Q, Q)] += tangent * apq;
    (a[(P, Q)], a[(Q, P)]) = (0.0, 0.0);
    let (arp, arq) = (a[(R, P)], a[(R, Q)]);
    (a[(R, P)], a[(R, Q)]) = (cos * arp - sin * arq, sin * arp + cos * arq);
    (a[(P, R)], a[(Q, R)]) = (a[(R, P)], a[(R, Q)]);
    for row in 0..3 {
        let (vp, vq) = (v[(row, P)], v[(row, Q)]);
        (v[(row, P)], v[(row, Q)]) = (cos * vp - sin * vq, sin * vp + cos * vq);
    }
}
