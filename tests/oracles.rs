//! The mathematics of the core against other people's: geo for hulls and clipping, linfa for DBSCAN, nalgebra in double
//! precision for filters, rotations and planes.

use std::collections::{BTreeMap, BTreeSet};

use geo::{Area, BooleanOps, Contains, LineString, Polygon};
use linfa::traits::Transformer;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix4, UnitQuaternion, Vector2, Vector3, Vector4, Vector6};
use proptest::prelude::*;
use sdslam_core::clustering::dbscan::{self, NOISE, Scratch};
use sdslam_core::estimation::kalman::{self, PlanarMotion};
use sdslam_core::geometry::convex_hull::convex_hull;
use sdslam_core::geometry::plane::{LevelPlane, PlaneFit, fit_level};
use sdslam_core::geometry::polygon;
use sdslam_core::{LabelledPoint, pose};
use sdslam_tests::drive::Drive;
use sdslam_tests::world::unit;

type Point2 = [f32; 2];

// ---- convex hulls ----

fn hull_of(points: &[Point2]) -> Vec<Point2> {
    let mut hull = heapless::Vec::<Point2, 128>::new();
    assert!(convex_hull(&mut points.to_vec(), &mut hull), "the hull fits");
    hull.to_vec()
}

fn vertex_set(points: impl IntoIterator<Item = Point2>) -> BTreeSet<[u32; 2]> {
    // + 0.0 makes -0 the same as 0.
    points.into_iter().map(|p| p.map(|v| (v + 0.0).to_bits())).collect()
}

fn hull_of_geo(points: &[Point2]) -> BTreeSet<[u32; 2]> {
    let mut coordinates: Vec<geo::Coord<f64>> =
        points.iter().map(|p| geo::coord! { x: f64::from(p[0]), y: f64::from(p[1]) }).collect();
    let ring = geo::convex_hull::graham_hull(&mut coordinates, false);
    vertex_set(ring.coords().map(|c| [c.x as f32, c.y as f32]))
}

fn scattered_points() -> impl Strategy<Value = Vec<Point2>> {
    prop::collection::vec([-50.0f32..50.0, -50.0f32..50.0], 3..80)
}

/// Points on a coarse lattice: many are equal, many lie on one line.
fn lattice_points() -> impl Strategy<Value = Vec<Point2>> {
    let step = (-4i8..=4).prop_map(|k| 0.25 * f32::from(k));
    prop::collection::vec([step.clone(), step], 3..60)
}

proptest! {
    #[test]
    fn hull_has_the_vertices_of_geos(points in prop_oneof![scattered_points(), lattice_points()]) {
        let hull = hull_of(&points);
        let expected = hull_of_geo(&points);
        // With all points on one line, the libraries differ in what they return; there is no area then.
        prop_assume!(expected.len() >= 3);
        prop_assert_eq!(vertex_set(hull.iter().copied()), expected);
        prop_assert!(polygon::area(&hull) > 0.0, "counter-clockwise");
    }

    #[test]
    fn collinear_points_have_no_hull_with_area(
        from in [-20i8..20, -20i8..20], step in [-3i8..=3, -3i8..=3], places in prop::collection::vec(0i8..6, 1..40),
    ) {
        let at = |k: i8| [0, 1].map(|d| f32::from(from[d]) + f32::from(step[d]) * f32::from(k));
        let points: Vec<Point2> = places.into_iter().map(at).collect();
        prop_assert!(hull_of(&points).len() < 3);
    }
}

#[test]
fn a_hull_that_does_not_fit_is_refused() {
    let circle = |k: usize| pose::PlanarPose { yaw: k as f32 * 0.4, ..Default::default() };
    let mut points: Vec<Point2> =
        (0..15).map(|k| circle(k).apply(circle(k).yaw.sin_cos(), [10.0, 0.0])).collect();
    let mut small = heapless::Vec::<Point2, 14>::new();
    assert!(!convex_hull(&mut points, &mut small));
    let mut enough = heapless::Vec::<Point2, 15>::new();
    assert!(convex_hull(&mut points, &mut enough));
    assert_eq!(enough.len(), 15);
}

// ---- intersections ----

fn convex_polygon() -> impl Strategy<Value = Vec<Point2>> {
    let centre = [-30.0f32..30.0, -30.0f32..30.0];
    let offsets = prop::collection::vec([-4.0f32..4.0, -4.0f32..4.0], 3..40);
    (centre, offsets, 0.1f32..1.0).prop_filter_map("a polygon of 3 to 32 corners", |(c, offsets, size)| {
        let points: Vec<Point2> = offsets.iter().map(|o| [c[0] + size * o[0], c[1] + size * o[1]]).collect();
        let hull = hull_of(&points);
        (3..=32).contains(&hull.len()).then_some(hull)
    })
}

fn moved(polygon: &[Point2], by: Point2) -> Vec<Point2> {
    polygon.iter().map(|p| [p[0] + by[0], p[1] + by[1]]).collect()
}

fn polygon_of_geo(points: &[Point2]) -> Polygon<f64> {
    let corners = points.iter().map(|p| (f64::from(p[0]), f64::from(p[1])));
    Polygon::new(LineString::from_iter(corners), Vec::new())
}

fn perimeter(points: &[Point2]) -> f32 {
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).sum()
}

/// Single precision places a corner 40 m away to about 4e-6 m; an error of area is that times the perimeter.
fn area_tolerance(a: &[Point2], b: &[Point2]) -> f64 {
    2e-5 * f64::from(perimeter(a) + perimeter(b))
}

proptest! {
    #[test]
    fn intersection_has_geos_area(
        a in convex_polygon(), shape in convex_polygon(), offset in [-3.0f32..3.0, -3.0f32..3.0],
    ) {
        // The second polygon is brought near the first, or they would hardly ever meet.
        let to = [0, 1].map(|k| a[0][k] - shape[0][k] + offset[k]);
        let b = moved(&shape, to);
        let b = hull_of(&b);
        prop_assume!(b.len() >= 3);
        let expected = polygon_of_geo(&a).intersection(&polygon_of_geo(&b)).unsigned_area();
        let found = f64::from(polygon::intersection_area(&a, &b));
        prop_assert!((found - expected).abs() <= area_tolerance(&a, &b), "{found} instead of {expected}");
        let swapped = f64::from(polygon::intersection_area(&b, &a));
        prop_assert!((found - swapped).abs() <= area_tolerance(&a, &b), "{found}, swapped {swapped}");
    }

    #[test]
    fn area_is_geos(a in convex_polygon()) {
        let expected = polygon_of_geo(&a).signed_area();
        prop_assert!((f64::from(polygon::area(&a)) - expected).abs() <= area_tolerance(&a, &a));
    }

    #[test]
    fn a_polygon_covers_itself_and_overlap_falls_with_distance(a in convex_polygon(), direction in 0.0f32..6.28) {
        let area = polygon::area(&a);
        let overlap = |shift: f32| {
            let by = [shift * direction.cos(), shift * direction.sin()];
            polygon::intersection_area(&moved(&a, by), &a)
        };
        let tolerance = area_tolerance(&a, &a) as f32;
        prop_assert!((overlap(0.0) - area).abs() <= tolerance);
        let falling: Vec<f32> = (0..12).map(|k| overlap(0.25 * k as f32)).collect();
        prop_assert!(falling.windows(2).all(|w| w[1] <= w[0] + 2.0 * tolerance), "{falling:?}");
        prop_assert!(overlap(30.0) == 0.0);
    }
}

// ---- DBSCAN ----

const MEMBERS: usize = 4096;

/// Cluster of each point in the order given, from the core with unit weights and one radius.
fn clusters_of_core(points: &[[f32; 3]], radius: f32, min_points: usize) -> Vec<Option<u16>> {
    let mut members: Vec<dbscan::Point> =
        points.iter().enumerate().map(|(i, p)| dbscan::Point::new(*p, radius, 1, i as u16)).collect();
    let mut scratch = Box::new(Scratch::<MEMBERS>::new());
    let clusters = dbscan::cluster(&mut members, &mut scratch, radius, min_points as u32);
    let mut result = vec![None; points.len()];
    for member in members {
        result[member.id as usize] = (member.cluster != NOISE).then_some(member.cluster);
    }
    assert!(result.iter().flatten().all(|c| *c < clusters));
    result
}

fn clusters_of_linfa(points: &[[f32; 3]], radius: f32, min_points: usize) -> Vec<Option<usize>> {
    let flat: Vec<f64> = points.iter().flatten().map(|v| f64::from(*v)).collect();
    let array = ndarray::Array2::from_shape_vec((points.len(), 3), flat).expect("three columns");
    // A hair more than the radius: linfa's is exclusive, the core's inclusive.
    let tolerance = f64::from(radius) * (1.0 + 1e-6);
    linfa_clustering::Dbscan::params(min_points)
        .tolerance(tolerance)
        .transform(&array)
        .expect("valid")
        .to_vec()
}

fn distance2(a: &[f32; 3], b: &[f32; 3]) -> f64 {
    (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).powi(2)).sum()
}

fn neighbours(points: &[[f32; 3]], i: usize, radius: f32) -> impl Iterator<Item = usize> {
    let r2 = f64::from(radius).powi(2) * (1.0 + 1e-6);
    (0..points.len()).filter(move |j| distance2(&points[i], &points[*j]) <= r2)
}

/// Core points must be parted in the same way; a border point must be in the cluster of one of its core points, the
/// nearest; noise must be the same.
fn assert_same_clusters(points: &[[f32; 3]], radius: f32, min_points: usize) -> usize {
    let (ours, theirs) =
        (clusters_of_core(points, radius, min_points), clusters_of_linfa(points, radius, min_points));
    let is_core: Vec<bool> =
        (0..points.len()).map(|i| neighbours(points, i, radius).count() >= min_points).collect();
    let (mut to_theirs, mut to_ours) = (BTreeMap::new(), BTreeMap::new());
    for i in 0..points.len() {
        assert_eq!(ours[i].is_some(), theirs[i].is_some(), "point {i}: noise for one only");
        if is_core[i] {
            let (a, b) = (ours[i].expect("in a cluster"), theirs[i].expect("in a cluster"));
            assert_eq!(*to_theirs.entry(a).or_insert(b), b, "point {i}: two of theirs joined");
            assert_eq!(*to_ours.entry(b).or_insert(a), a, "point {i}: one of theirs split");
        } else if let Some(own) = ours[i] {
            let cores = neighbours(points, i, radius).filter(|j| is_core[*j]);
            let nearest = cores.min_by(|a, b| {
                distance2(&points[i], &points[*a]).total_cmp(&distance2(&points[i], &points[*b]))
            });
            let nearest = nearest.expect("a border point has a core point");
            let tie = distance2(&points[i], &points[nearest]) * (1.0 + 1e-5);
            let candidates = neighbours(points, i, radius)
                .filter(|j| is_core[*j] && distance2(&points[i], &points[*j]) <= tie);
            assert!(
                candidates.into_iter().any(|j| ours[j] == Some(own)),
                "border point {i}: not its nearest"
            );
        }
    }
    to_theirs.len()
}

/// Blobs and scattered points, each third one twice.
fn blobs(seed: u64, count: usize) -> Vec<[f32; 3]> {
    let mut points = Vec::new();
    for i in 0..count as u64 {
        let draw = |k: u64| unit(seed, i, k) as f32;
        let blob = i % 7;
        let centre = [0, 1, 2].map(|k| 6.0 * unit(seed, 1000 + blob, k) as f32 - 3.0);
        let spread = if blob == 6 { 12.0 } else { 1.2 };
        let point =
            [0, 1, 2].map(|k: usize| centre[k] + spread * (draw(k as u64) + draw(3 + k as u64) - 1.0));
        points.push(point);
        if i % 3 == 0 {
            points.push(point);
        }
    }
    points
}

#[test]
fn dbscan_parts_random_points_as_linfa_does() {
    let mut clusters = 0;
    for seed in 0..40 {
        let points = blobs(seed, 60 + 5 * seed as usize);
        clusters += assert_same_clusters(&points, 0.3 + 0.02 * seed as f32, 3 + (seed % 6) as usize);
    }
    assert!(clusters > 100, "the cases must be interesting: {clusters} clusters");
}

#[test]
fn dbscan_parts_a_scan_as_linfa_does() {
    let scan = Drive::down_the_street(1, 8.0).frames.remove(0).points;
    let things: Vec<&LabelledPoint> =
        scan.iter().filter(|p| p.class.motion() != sdslam_core::MotionClass::Ground).collect();
    let thin = things.len() / 3000 + 1;
    let points: Vec<[f32; 3]> = things.iter().step_by(thin).map(|p| p.position).collect();
    for (radius, min_points) in [(0.5, 4), (0.8, 6), (1.5, 10)] {
        let clusters = assert_same_clusters(&points, radius, min_points);
        assert!(clusters > 10, "{clusters} clusters of radius {radius}");
    }
}

#[test]
fn dbscan_takes_any_number_of_equal_points() {
    let points = vec![[3.0, -2.0, 0.5]; 500];
    assert_eq!(assert_same_clusters(&points, 0.5, 500), 1);
    assert_eq!(assert_same_clusters(&points[..499], 0.5, 500), 0);
}

#[test]
fn dbscan_counts_a_weight_as_that_many_points() {
    for seed in 0..20 {
        let points = blobs(seed, 90);
        let weights: Vec<u32> =
            (0..points.len()).map(|i| 1 + (unit(seed, i as u64, 77) * 3.0) as u32).collect();
        let repeated: Vec<[f32; 3]> =
            points.iter().zip(&weights).flat_map(|(p, w)| vec![*p; *w as usize]).collect();
        let mut members: Vec<dbscan::Point> =
            (0..points.len()).map(|i| dbscan::Point::new(points[i], 0.5, weights[i], i as u16)).collect();
        let mut scratch = Box::new(Scratch::<MEMBERS>::new());
        let count = dbscan::cluster(&mut members, &mut scratch, 0.5, 9);
        let of_repeated = clusters_of_core(&repeated, 0.5, 9);
        let expected: BTreeSet<u16> = of_repeated.iter().flatten().copied().collect();
        assert_eq!(count as usize, expected.len(), "seed {seed}");
        let noise = members.iter().filter(|m| m.cluster == NOISE).map(|m| m.weight as usize).sum::<usize>();
        assert_eq!(noise, of_repeated.iter().filter(|c| c.is_none()).count(), "seed {seed}");
    }
}

// ---- the Kalman filter ----

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
        steps in prop::collection::vec((0.001f32..5.0, -0.6f32..0.6, -1e3f32..1e3, 1e-4f32..10.0, any::<bool>()), 1..200),
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
            prop_assert!((p - p.transpose()).amax() <= 1e-5 * scale, "not symmetric: {p}");
            let p = 0.5 * (as_f64(&p) + as_f64(&p.transpose()));
            let smallest = p.symmetric_eigenvalues().min();
            prop_assert!(smallest > -1e-5 * f64::from(scale), "not positive: {smallest} of {scale}");
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

// ---- rotations and poses ----

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

// ---- planes ----

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

#[test]
fn an_inner_polygon_is_covered_whole() {
    let square = |r: f32| vec![[-r, -r], [r, -r], [r, r], [-r, r]];
    assert!(polygon_of_geo(&square(3.0)).contains(&polygon_of_geo(&square(1.0))));
    assert_eq!(polygon::intersection_area(&square(1.0), &square(3.0)), 4.0);
    assert_eq!(polygon::intersection_area(&square(3.0), &square(1.0)), 4.0);
    assert_eq!(polygon::intersection_area(&square(1.0), &moved(&square(1.0), [2.0, 0.0])), 0.0);
}
