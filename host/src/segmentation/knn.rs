//! From pixels to points: RangeNet++'s nearest neighbours in the range image.
//!
//! Points that share a pixel, and points behind an edge, would else take the class of what hides them. Every point asks
//! the pixels around its own; those with the most similar range vote.
//!
//! Deviation: where nobody votes, the point stays unlabelled (RangeNet++ calls it a car).

use serde::Deserialize;

use super::error::DescriptionFault;
use super::pixels::PixelClasses;
use super::projection::RangeImage;

const MAX_WINDOW: usize = 15;
const MAX_NEIGHBOURS: usize = 25;

/// Parameters of the nearest neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct KnnConfig {
    /// Pixels that vote; 0 gives every point the class of its pixel.
    pub neighbours: usize,
    /// Side of the window around the point's pixel, odd.
    pub window: usize,
    /// Standard deviation of the weights in the window, which prefer near pixels \[pixels\]; 0 for none.
    pub sigma: f32,
    /// Pixels whose weighted range differs more from the point's do not vote \[m\].
    pub cutoff_m: f32,
}

impl Default for KnnConfig {
    fn default() -> Self {
        Self { neighbours: 5, window: 5, sigma: 1.0, cutoff_m: 1.0 }
    }
}

impl KnnConfig {
    pub(super) fn fault(&self) -> Option<DescriptionFault> {
        let fault = |key, expected| Some(DescriptionFault { key, expected });
        if self.window.is_multiple_of(2) || self.window > MAX_WINDOW {
            fault("knn.window", "odd, and 15 at most")
        } else if self.neighbours > MAX_NEIGHBOURS.min(self.window * self.window) {
            fault("knn.neighbours", "at most 25, and not more than the window has pixels")
        } else if !(self.sigma >= 0.0 && self.sigma.is_finite()) {
            fault("knn.sigma", "a number of pixels, 0 for no weights")
        } else if !(self.cutoff_m >= 0.0 && self.cutoff_m.is_finite()) {
            fault("knn.cutoff_m", "a number of metres, 0 or more")
        } else {
            None
        }
    }

    /// `1 - G` of eq. 3 of RangeNet++ over the window, row by row: differences of range are multiplied by it.
    fn weights(&self) -> Vec<f32> {
        let half = (self.window / 2) as i32;
        let offsets = (-half..=half).flat_map(|dy| (-half..=half).map(move |dx| (dx * dx + dy * dy) as f32));
        if self.sigma == 0.0 {
            return offsets.map(|_| 1.0).collect();
        }
        let scale = -0.5 / (self.sigma * self.sigma);
        let gauss: Vec<f32> = offsets.map(|squared| libm::expf(scale * squared)).collect();
        let sum: f32 = gauss.iter().sum();
        gauss.iter().map(|value| 1.0 - value / sum).collect()
    }
}

/// Output channel of a point and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointVote {
    /// The channel; [`PointVote::NONE`] where no pixel votes.
    pub channel: u8,
    /// Probability that the most similar of the voters has times the cube of the share of the votes, 0 to 1: one vote of
    /// five against it halves the confidence, since most errors lie where neighbours do not agree.
    pub confidence: f32,
}

impl PointVote {
    /// Value of `channel` where no pixel votes.
    pub const NONE: u8 = u8::MAX;
    const NOTHING: Self = Self { channel: Self::NONE, confidence: 0.0 };
}

/// The vote of every point. `votes` tells for every channel whether it may win.
pub fn vote(config: &KnnConfig, image: &RangeImage, pixels: &PixelClasses, votes: &[bool]) -> Vec<PointVote> {
    let voting = Voting {
        config,
        image,
        pixels,
        votes,
        weights: config.weights(),
        alone: classes_alone_in_window(config, image, pixels),
    };
    let points = image.pixel.iter().zip(&image.point_range_m);
    points.map(|(&pixel, &range_m)| voting.of_point(pixel, range_m)).collect()
}

struct Voting<'a> {
    config: &'a KnnConfig,
    image: &'a RangeImage,
    pixels: &'a PixelClasses,
    votes: &'a [bool],
    weights: Vec<f32>,
    /// Per pixel the one channel that occurs in its window, or [`SEVERAL`].
    alone: Vec<u8>,
}

impl Voting<'_> {
    fn of_point(&self, pixel: u32, range_m: f32) -> PointVote {
        if pixel == RangeImage::NONE {
            return PointVote::NOTHING;
        }
        let pixel = pixel as usize;
        // The point's own pixel always votes: where there is one channel only, it wins with all votes.
        let alone = if self.config.neighbours == 0 { self.pixels.channel[pixel] } else { self.alone[pixel] };
        if alone == SEVERAL {
            return self.of_window(pixel, range_m);
        }
        if !self.votes[alone as usize] {
            return PointVote::NOTHING;
        }
        PointVote { channel: alone, confidence: self.pixels.probability[pixel] }
    }

    fn of_window(&self, pixel: usize, range_m: f32) -> PointVote {
        let nearest = self.nearest(pixel, range_m);
        let (mut voters, mut count) = ([(0, 0); MAX_NEIGHBOURS], 0);
        for pixel in nearest.sorted() {
            let channel = self.pixels.channel[pixel];
            voters[count] = (channel, pixel);
            count += usize::from(self.votes[channel as usize]);
        }
        let voters = &voters[..count];
        let votes_for = |channel| voters.iter().filter(|voter| voter.0 == channel).count();
        // Most votes, the lowest channel of equals; of its pixels the most similar one comes first.
        let most = voters.iter().map(|&(channel, _)| (votes_for(channel), std::cmp::Reverse(channel))).max();
        let Some((votes, std::cmp::Reverse(channel))) = most else { return PointVote::NOTHING };
        let similar = voters.iter().find(|voter| voter.0 == channel);
        let probability = similar.map_or(0.0, |&(_, pixel)| self.pixels.probability[pixel]);
        let share = votes as f32 / count as f32;
        PointVote { channel, confidence: share * share * share * probability }
    }

    /// The most similar pixels of the window.
    fn nearest(&self, pixel: usize, range_m: f32) -> Nearest {
        let (height, width) = (self.image.geometry.height, self.image.geometry.width);
        let (row, column) = (pixel / width, pixel % width);
        let half = self.config.window / 2;
        let mut nearest = Nearest::up_to(self.config.cutoff_m);
        // Windows end at the image: they do not go on behind the sensor.
        let (left, right) = (column.saturating_sub(half), (column + half + 1).min(width));
        for y in row.saturating_sub(half)..(row + half + 1).min(height) {
            let weights = &self.weights[(y + half - row) * self.config.window + left + half - column..];
            let ranges = &self.image.range_m[y * width + left..y * width + right];
            for (x, (&other_m, &weight)) in ranges.iter().zip(weights).enumerate() {
                let there = y * width + left + x;
                let difference_m = if there == pixel { 0.0 } else { (other_m - range_m).abs() * weight };
                nearest.offer(self.config.neighbours, difference_m, there as u32);
            }
        }
        nearest
    }
}

/// Pixels with the smallest differences, in ascending order; of equals, the first in row order.
struct Nearest {
    /// Difference and pixel in one number, so that both are compared at once.
    keys: [u64; MAX_NEIGHBOURS],
    /// What `keys` holds where fewer were seen: none beyond the cutoff is nearer.
    beyond: u64,
}

impl Nearest {
    fn up_to(cutoff_m: f32) -> Self {
        let beyond = key(cutoff_m, u32::MAX);
        Self { keys: [beyond; MAX_NEIGHBOURS], beyond }
    }

    /// Keeps the smallest. Without a branch: which pixels are near is nothing that a processor could guess.
    fn offer(&mut self, neighbours: usize, difference_m: f32, pixel: u32) {
        let mut key = key(difference_m, pixel);
        for kept in &mut self.keys[..neighbours] {
            (*kept, key) = ((*kept).min(key), (*kept).max(key));
        }
    }

    /// The pixels.
    fn sorted(&self) -> impl Iterator<Item = usize> + Clone {
        self.keys.iter().take_while(|&&key| key < self.beyond).map(|&key| key as u32 as usize)
    }
}

/// Numbers that are not negative are ordered as their bits are.
fn key(difference_m: f32, pixel: u32) -> u64 {
    u64::from(difference_m.to_bits()) << 32 | u64::from(pixel)
}

/// An empty pixel.
const NOTHING: u8 = 254;
/// More than one channel.
const SEVERAL: u8 = 255;

/// For every pixel the channel of the occupied pixels in its window, if they all have the same. Most windows lie on one
/// surface, and this is cheaper than their votes.
fn classes_alone_in_window(config: &KnnConfig, image: &RangeImage, pixels: &PixelClasses) -> Vec<u8> {
    let (width, half) = (image.geometry.width, config.window / 2);
    let occupied = |(&channel, &point)| if point == RangeImage::NONE { NOTHING } else { channel };
    let own: Vec<u8> = pixels.channel.iter().zip(&image.point).map(occupied).collect();
    let mut rows = own.clone();
    for (row, own) in rows.chunks_exact_mut(width).zip(own.chunks_exact(width)) {
        for shift in 1..=half.min(width - 1) {
            join(&mut row[shift..], &own[..width - shift]);
            join(&mut row[..width - shift], &own[shift..]);
        }
    }
    let mut windows = rows.clone();
    for shift in (1..=half.min(image.geometry.height - 1)).map(|rows| rows * width) {
        let others = windows.len() - shift;
        join(&mut windows[shift..], &rows[..others]);
        join(&mut windows[..others], &rows[shift..]);
    }
    windows
}

fn join(these: &mut [u8], those: &[u8]) {
    for (this, &that) in these.iter_mut().zip(those) {
        let different = if *this == NOTHING { that } else { SEVERAL };
        *this = if *this == that || that == NOTHING { *this } else { different };
    }
}
