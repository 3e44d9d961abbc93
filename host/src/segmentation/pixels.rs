//! What the network says of every pixel: its class and how sure it is.

use super::description::OutputKind;

/// Pixels that are worked on together: all their channels fit into the nearest cache.
const CHUNK: usize = 512;

/// The answer per pixel; without a meaning where the pixel is empty.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelClasses {
    /// Output channel with the largest number; the lowest of equals.
    pub channel: Vec<u8>,
    /// Its probability, 0 to 1.
    pub probability: Vec<f32>,
}

impl PixelClasses {
    /// From the output tensor, channel by channel. A number that is not one never wins.
    pub fn of(output: &[f32], kind: OutputKind, pixels: usize) -> Self {
        let mut classes = Self { channel: vec![0; pixels], probability: vec![0.0; pixels] };
        for start in (0..pixels).step_by(CHUNK) {
            let chunk = start..(start + CHUNK).min(pixels);
            let planes = output.chunks_exact(pixels).map(|plane| &plane[chunk.clone()]);
            let (channel, largest) = largest(planes.clone());
            let probability = match kind {
                OutputKind::Probabilities => largest,
                OutputKind::Logits => softmax_of_largest(planes, &largest),
            };
            let length = chunk.len();
            let narrow = channel.iter().map(|&channel| channel as u8);
            classes.channel[chunk.clone()].iter_mut().zip(narrow).for_each(|(to, from)| *to = from);
            classes.probability[chunk].copy_from_slice(&probability[..length]);
        }
        classes
    }
}

/// Channel and value of the largest number of every pixel of a chunk.
fn largest<'a>(planes: impl Iterator<Item = &'a [f32]>) -> ([u32; CHUNK], [f32; CHUNK]) {
    let (mut channel, mut largest) = ([0; CHUNK], [f32::NEG_INFINITY; CHUNK]);
    for (index, plane) in (0..).zip(planes) {
        for ((&value, largest), channel) in plane.iter().zip(&mut largest).zip(&mut channel) {
            let larger = value > *largest;
            *largest = if larger { value } else { *largest };
            *channel = if larger { index } else { *channel };
        }
    }
    (channel, largest)
}

fn softmax_of_largest<'a>(planes: impl Iterator<Item = &'a [f32]>, largest: &[f32; CHUNK]) -> [f32; CHUNK] {
    let mut sum = [0.0; CHUNK];
    for plane in planes {
        for ((&value, &largest), sum) in plane.iter().zip(largest).zip(&mut sum) {
            *sum += exp_of_negative(value - largest);
        }
    }
    sum.map(|sum| if sum > 0.0 { 1.0 / sum } else { 0.0 })
}

/// `(1 + x / 1024) ^ 1024`, within 3e-4 of exp(x) for x up to 0: fine for a confidence of 8 bits, many pixels at a time,
/// and the same on every machine.
fn exp_of_negative(x: f32) -> f32 {
    let mut power = 1.0 + x.max(-64.0) / 1024.0;
    for _ in 0..10 {
        power *= power;
    }
    power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logits_become_probabilities() {
        let output = [1.0, 0.0, 9.0, 3.0, 0.0, 9.0, f32::NAN, -30.0, 9.0];
        let pixels = PixelClasses::of(&output, OutputKind::Logits, 3);
        assert_eq!(pixels.channel, [1, 0, 0]);
        let expected = [1.0 / (1.0 + (-2.0f32).exp()), 0.5, 1.0 / 3.0];
        for (found, expected) in pixels.probability.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-3, "{found}, expected {expected}");
        }
    }

    #[test]
    fn probabilities_are_taken_as_they_are() {
        let output = [0.2, 0.1, 0.7, 0.1, 0.1, 0.8];
        let pixels = PixelClasses::of(&output, OutputKind::Probabilities, 2);
        assert_eq!((pixels.channel, pixels.probability), (vec![1, 2], vec![0.7, 0.8]));
    }

    #[test]
    fn every_chunk_counts() {
        let pixels = 2 * CHUNK + 7;
        let output: Vec<f32> =
            (0..3 * pixels).map(|k| if k / pixels == k % pixels % 3 { 9.0 } else { 0.0 }).collect();
        let classes = PixelClasses::of(&output, OutputKind::Logits, pixels);
        assert!(classes.channel.iter().enumerate().all(|(pixel, &channel)| channel as usize == pixel % 3));
        assert!(classes.probability.iter().all(|&probability| probability > 0.99));
    }

    #[test]
    fn the_short_exponential_is_close() {
        let largest = (0..3000)
            .map(|k| -0.01 * k as f32)
            .map(|x| (exp_of_negative(x) - x.exp()).abs())
            .fold(0.0, f32::max);
        assert!(largest < 3e-4, "{largest}");
        assert!(exp_of_negative(f32::NEG_INFINITY) < 1e-20 && exp_of_negative(f32::NAN) < 1e-20);
    }
}
