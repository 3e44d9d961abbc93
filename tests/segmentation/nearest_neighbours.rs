//! The votes against RangeNet++'s rule written down plainly: sort the window, count, first of equals.

use proptest::prelude::*;
use sdslam::segmentation::description::ImageGeometry;
use sdslam::segmentation::knn::{KnnConfig, PointVote, vote};
use sdslam::segmentation::pixels::PixelClasses;
use sdslam::segmentation::projection::RangeImage;

const GEOMETRY: ImageGeometry = ImageGeometry { height: 6, width: 12, fov_up_deg: 20.0, fov_down_deg: -20.0 };

fn plain_vote(config: &KnnConfig, image: &RangeImage, classes: &[u8], votes: &[bool], point: usize) -> u8 {
    let half = config.window as i64 / 2;
    let (height, width) = (GEOMETRY.height as i64, GEOMETRY.width as i64);
    let pixel = image.pixel[point] as i64;
    let gauss =
        |dx: i64, dy: i64| (-0.5 * (dx * dx + dy * dy) as f64 / f64::from(config.sigma).powi(2)).exp();
    let offsets = || (-half..=half).flat_map(|dy| (-half..=half).map(move |dx| (dx, dy)));
    let sum: f64 = offsets().map(|(dx, dy)| gauss(dx, dy)).sum();
    let mut candidates: Vec<(f64, u8)> = offsets()
        .filter_map(|(dx, dy)| {
            let (x, y) = (pixel % width + dx, pixel / width + dy);
            let there = (0..width).contains(&x) && (0..height).contains(&y);
            let there = there.then(|| (y * width + x) as usize)?;
            let weight = if config.sigma == 0.0 { 1.0 } else { 1.0 - gauss(dx, dy) / sum };
            let difference = f64::from((image.range_m[there] - image.point_range_m[point]).abs()) * weight;
            Some((if dx == 0 && dy == 0 { 0.0 } else { difference }, classes[there]))
        })
        .collect();
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut counts = [0; 8];
    for &(difference, class) in &candidates[..config.neighbours.min(candidates.len())] {
        counts[class as usize] +=
            usize::from(difference <= f64::from(config.cutoff_m) && votes[class as usize]);
    }
    let most = *counts.iter().max().expect("counts");
    if most == 0 {
        PointVote::NONE
    } else {
        counts.iter().position(|&count| count == most).expect("it is there") as u8
    }
}

proptest! {
    #[test]
    fn every_point_gets_the_class_that_the_rule_gives(
        spots in prop::collection::vec((0.0f32..std::f32::consts::TAU, -0.4f32..0.4, 1usize..5), 1..200),
        classes in prop::collection::vec(0u8..3, 72),
        (window, neighbours) in prop::sample::select(vec![(1, 1), (3, 4), (5, 5), (7, 7), (5, 25)]),
        sigma in prop::sample::select(vec![0.0f32, 1.0]),
        cutoff_m in prop::sample::select(vec![0.0f32, 0.5, 1.0, 4.0]),
        patchy in any::<bool>(),
    ) {
        let point = |&(azimuth, elevation, range): &(f32, f32, usize)| {
            // Ranges a third of a metre apart: no difference lies within rounding of another or of a cutoff.
            let range_m = 5.0 + range as f32 / 3.0;
            let flat = range_m * elevation.cos();
            [flat * azimuth.cos(), flat * azimuth.sin(), range_m * elevation.sin(), 0.0]
        };
        let points: Vec<_> = spots.iter().map(point).collect();
        let mut image = RangeImage::project(GEOMETRY, &points);
        let thirds = |range_m: &mut f32| *range_m = (*range_m * 3.0).round() / 3.0;
        image.range_m.iter_mut().chain(&mut image.point_range_m).for_each(thirds);
        // Patches of one class take the short way, single pixels the long one.
        let class = |pixel: usize| if patchy { classes[pixel] } else { classes[pixel / 36] };
        let classes: Vec<u8> = (0..72).map(class).collect();
        let votes = [false, true, true];
        let probability = vec![0.5; 72];
        let pixels = PixelClasses { channel: classes.clone(), probability };
        let config = KnnConfig { neighbours, window, sigma, cutoff_m };
        for (index, found) in vote(&config, &image, &pixels, &votes).into_iter().enumerate() {
            let expected = plain_vote(&config, &image, &classes, &votes, index);
            prop_assert_eq!(found.channel, expected, "point {}", index);
            prop_assert!((0.0..=0.5).contains(&found.confidence));
            prop_assert_eq!(found.confidence > 0.0, expected != PointVote::NONE);
        }
    }
}

/// A row of pixels, one point each, drawn as range in metres and class.
fn row(ranges: &str, classes: &str) -> (RangeImage, PixelClasses) {
    let geometry = ImageGeometry { height: 1, width: ranges.len(), fov_up_deg: 10.0, fov_down_deg: -10.0 };
    let point = |(column, range): (usize, char)| {
        let azimuth = std::f32::consts::PI * (1.0 - (2.0 * column as f32 + 1.0) / ranges.len() as f32);
        let range_m = range.to_digit(10).expect("a digit") as f32;
        [range_m * azimuth.cos(), range_m * azimuth.sin(), 0.0, 0.0]
    };
    let image = RangeImage::project(geometry, &ranges.chars().enumerate().map(point).collect::<Vec<_>>());
    let channel = classes.chars().map(|class| class.to_digit(10).expect("a digit") as u8).collect();
    (image, PixelClasses { channel, probability: vec![1.0; ranges.len()] })
}

#[test]
fn a_point_at_the_edge_of_a_thing_takes_the_class_of_what_is_as_far() {
    let (image, pixels) = row("5555599999", "1111122222");
    let config = KnnConfig::default();
    let classes = |pixels: &PixelClasses| -> Vec<u8> {
        vote(&config, &image, pixels, &[false, true, true]).iter().map(|vote| vote.channel).collect()
    };
    assert_eq!(classes(&pixels), [1, 1, 1, 1, 1, 2, 2, 2, 2, 2]);
    // One column of the far wall was taken for the thing before it.
    let (_, bleeding) = row("5555599999", "1111112222");
    assert_eq!(classes(&bleeding), [1, 1, 1, 1, 1, 2, 2, 2, 2, 2]);
}

#[test]
fn confidence_is_the_probability_times_the_cube_of_the_share_of_the_votes() {
    let (image, mut pixels) = row("555555555", "111112222");
    pixels.probability = vec![0.9, 0.9, 0.9, 0.9, 0.8, 0.7, 0.6, 0.6, 0.6];
    let votes = vote(&KnnConfig::default(), &image, &pixels, &[false, true, true]);
    let [four, three] = [0.8, 0.6].map(|share: f32| share.powi(3));
    let expected = [0.9, 0.9, 0.9, four * 0.9, three * 0.9, three * 0.7, four * 0.7, 0.6, 0.6];
    for (found, expected) in votes.iter().zip(expected) {
        assert!((found.confidence - expected).abs() < 1e-6, "{found:?}, expected {expected}");
    }
}

#[test]
fn where_nothing_votes_the_point_stays_unlabelled() {
    let (image, pixels) = row("5555", "0000");
    let votes = vote(&KnnConfig::default(), &image, &pixels, &[false, true]);
    assert!(votes.iter().all(|vote| vote.channel == PointVote::NONE && vote.confidence == 0.0));
}
