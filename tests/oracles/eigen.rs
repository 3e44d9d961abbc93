//! Eigenvalues of symmetric matrices against nalgebra's in double precision.

use nalgebra::{Matrix3, SymmetricEigen};
use proptest::prelude::*;
use sdslam_core::geometry::eigen::symmetric;

/// Covariances of points: of any shape (balls, planes, rods, nothing), size and attitude.
fn covariance() -> impl Strategy<Value = Matrix3<f32>> {
    let axes = prop::array::uniform9(-1.0f32..1.0).prop_map(|v| Matrix3::from_row_slice(&v));
    let sizes = prop::array::uniform3(prop_oneof![Just(0.0f32), 1e-4f32..1e-2, 1e-2f32..1.0]);
    (axes, sizes).prop_map(|(axes, sizes)| axes * Matrix3::from_diagonal(&sizes.into()) * axes.transpose())
}

proptest! {
    #[test]
    fn eigenvalues_and_vectors_are_nalgebras(matrix in covariance()) {
        let symmetrised = (matrix + matrix.transpose()) * 0.5;
        let found = symmetric(&symmetrised);
        let mut expected: Vec<f64> =
            SymmetricEigen::new(symmetrised.cast::<f64>()).eigenvalues.iter().copied().collect();
        expected.sort_by(f64::total_cmp);
        let scale = expected[2].abs().max(1e-12);
        for ((value, vector), expected) in found.iter().zip(&expected) {
            prop_assert!((f64::from(*value) - expected).abs() < 2e-6 * scale, "{value} for {expected} of {scale}");
            prop_assert!((vector.norm() - 1.0).abs() < 1e-5);
            let off = symmetrised * vector - vector * *value;
            prop_assert!(f64::from(off.norm()) < 4e-6 * scale, "{off} of {scale}");
        }
        prop_assert!(found[0].1.dot(&found[1].1).abs() < 1e-5 && found[1].1.dot(&found[2].1).abs() < 1e-5);
    }
}
