//! Hulls and intersections against geo.

use std::collections::BTreeSet;

use geo::{Area, BooleanOps, Contains, LineString, Polygon};
use proptest::prelude::*;
use sdslam_core::geometry::convex_hull::convex_hull;
use sdslam_core::geometry::polygon;
use sdslam_core::pose::PlanarPose;

type Point2 = [f32; 2];

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
    let circle = |k: usize| PlanarPose { yaw: k as f32 * 0.4, ..Default::default() };
    let mut points: Vec<Point2> =
        (0..15).map(|k| circle(k).apply(circle(k).yaw.sin_cos(), [10.0, 0.0])).collect();
    let mut small = heapless::Vec::<Point2, 14>::new();
    assert!(!convex_hull(&mut points, &mut small));
    let mut enough = heapless::Vec::<Point2, 15>::new();
    assert!(convex_hull(&mut points, &mut enough));
    assert_eq!(enough.len(), 15);
}

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
    fn a_polygon_covers_itself_and_overlap_falls_with_distance(a in convex_polygon(), direction in -3.0f32..3.0) {
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

#[test]
fn an_inner_polygon_is_covered_whole() {
    let square = |r: f32| vec![[-r, -r], [r, -r], [r, r], [-r, r]];
    assert!(polygon_of_geo(&square(3.0)).contains(&polygon_of_geo(&square(1.0))));
    assert_eq!(polygon::intersection_area(&square(1.0), &square(3.0)), 4.0);
    assert_eq!(polygon::intersection_area(&square(3.0), &square(1.0)), 4.0);
    assert_eq!(polygon::intersection_area(&square(1.0), &moved(&square(1.0), [2.0, 0.0])), 0.0);
}
