//! Planes against a singular value decomposition.

use nalgebra::{DMatrix, DVector, Vector3};
use proptest::prelude::*;
use sdslam_core::geometry::plane::{LevelPlane, PlaneFit, fit_level};
use sdslam_tests::world::unit;

fn plane_points(seed: u64, plane: &LevelPlane, noise_m: f32) -> Vec<Vector3<f32>> {
    let at = |i: u64| {
        let (x, y) = (40.0 * unit(seed, i, 0) as f32 - 20.0, 10.0 * unit(seed, i, 1) as f32 - 5.0);
        let z =
            plane.slope_x * x + plane.slope_y * y + plane.offset + noise_m * (unit(seed, i, 2) as f32 - 0.5);
        Vector3::new(x, y, z)
    };
    (0..200).map(at).collect()
}

fn plane_by_svd(points: &[Vector3<f32>]) -> LevelPlane {
    let rows = points.iter().flat_map(|p| [f64::from(p.x), f64::from(p.y), 1.0]);
    let a = DMatrix::from_row_iterator(points.len(), 3, rows);
    let b = DVector::from_iterator(points.len(), points.iter().map(|p| f64::from(p.z)));
    let s = a.svd(true, true).solve(&b, 1e-12).expect("both bases were asked for");
    LevelPlane { slope_x: s[0] as f32, slope_y: s[1] as f32, offset: s[2] as f32 }
}

fn some_plane() -> impl Strategy<Value = LevelPlane> {
    (-0.2f32..0.2, -0.2f32..0.2, -3.0f32..3.0).prop_map(|(slope_x, slope_y, offset)| LevelPlane {
        slope_x,
        slope_y,
        offset,
    })
}

fn assert_planes_agree(a: &LevelPlane, b: &LevelPlane, tolerance: f32) -> Result<(), TestCaseError> {
    prop_assert!((a.slope_x - b.slope_x).abs() < tolerance, "{a:?} instead of {b:?}");
    prop_assert!((a.slope_y - b.slope_y).abs() < tolerance, "{a:?} instead of {b:?}");
    prop_assert!((a.offset - b.offset).abs() < 10.0 * tolerance, "{a:?} instead of {b:?}");
    Ok(())
}

proptest! {
    #[test]
    fn plane_is_the_least_squares_solution(plane in some_plane(), seed in 0u64..1_000_000) {
        let points = plane_points(seed, &plane, 0.3);
        let mut fit = PlaneFit::default();
        points.iter().for_each(|p| fit.add(p, 2.0));
        assert_planes_agree(&fit.solve().expect("they span a plane"), &plane_by_svd(&points), 2e-5)?;
    }

    #[test]
    fn a_robust_plane_ignores_a_fifth_of_outliers(plane in some_plane(), seed in 0u64..1_000_000) {
        let mut points = plane_points(seed, &plane, 0.02);
        points.iter_mut().step_by(5).for_each(|p| p.z += 0.5 + unit(seed, p.x.to_bits().into(), 9) as f32);
        let start = LevelPlane { offset: plane.offset, ..LevelPlane::default() };
        let robust = fit_level(|| points.iter().copied(), 0.2, 4, start)
            .and_then(|p| fit_level(|| points.iter().copied(), 0.05, 4, p))
            .expect("they span a plane");
        assert_planes_agree(&robust, &plane, 3e-3)?;
        let plain = plane_by_svd(&points);
        prop_assert!((plain.offset - plane.offset).abs() > 0.1, "the outliers matter: {plain:?}");
    }
}

#[test]
fn points_on_a_line_span_no_plane() {
    let mut fit = PlaneFit::default();
    (0..50).for_each(|k| fit.add(&Vector3::new(k as f32, 0.0, 1.0), 1.0));
    assert_eq!(fit.solve(), None);
    assert_eq!(PlaneFit::default().solve(), None);
}
