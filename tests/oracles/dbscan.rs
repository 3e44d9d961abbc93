//! DBSCAN against linfa.

use std::collections::{BTreeMap, BTreeSet};

use linfa::traits::Transformer;
use sdslam_core::clustering::dbscan::{self, NOISE, Scratch};
use sdslam_core::{LabelledPoint, MotionClass};
use sdslam_tests::drive::Drive;
use sdslam_tests::world::unit;

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
        scan.iter().filter(|p| p.class.motion() != MotionClass::Ground).collect();
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
