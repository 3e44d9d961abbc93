//! Randomness that is keyed, not shared: the same key gives the same numbers on any thread and in any order.

use oorandom::Rand32;

/// What a stream of random numbers is for: two uses of one seed never share numbers.
#[derive(Clone, Copy, Debug)]
pub enum Domain {
    /// Street plan and relief.
    Plan = 1,
    /// Content of a block.
    Block,
    /// Content along a street.
    Kerb,
    /// Route of the drive.
    Route,
    /// Traffic.
    Traffic,
    /// Motion of the body on its springs.
    Ride,
    /// One scan as a whole.
    Scan,
    /// One ray of a scan.
    Ray,
    /// A device.
    Device,
    /// Options that are drawn.
    Options,
}

/// A small seeded generator.
#[derive(Clone, Debug)]
pub struct Random(Rand32);

impl Random {
    /// The stream of this seed, use and key.
    pub fn keyed(seed: u64, domain: Domain, key: &[u64]) -> Self {
        Self::hashed(key.iter().fold(mix(seed ^ mix(domain as u64)), |hash, part| combine(hash, *part)))
    }

    /// The stream of a hash made with [`combine`].
    pub fn hashed(hash: u64) -> Self {
        Self(Rand32::new_inc(hash, hash >> 17))
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f32 {
        self.0.rand_float()
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform in 0..count.
    pub fn below(&mut self, count: usize) -> usize {
        self.0.rand_range(0..count as u32) as usize
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    /// One of the items.
    pub fn pick<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.below(items.len())]
    }

    /// Standard normal (Box-Muller).
    pub fn normal(&mut self) -> f32 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f32::consts::TAU * self.unit()).cos()
    }

    /// Exponential with mean 1.
    pub fn exponential(&mut self) -> f32 {
        -(1.0 - self.unit()).ln()
    }
}

/// Adds one part of a key to a hash.
pub fn combine(hash: u64, part: u64) -> u64 {
    mix(hash.rotate_left(23) ^ part)
}

/// The splitmix64 finaliser.
fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_decides_the_numbers() {
        let draw = |seed, key: &[u64]| Random::keyed(seed, Domain::Ray, key).unit();
        assert_eq!(draw(1, &[2, 3]), draw(1, &[2, 3]));
        assert_ne!(draw(1, &[2, 3]), draw(1, &[3, 2]));
        assert_ne!(draw(1, &[2, 3]), draw(2, &[2, 3]));
    }

    #[test]
    fn moments_of_neighbouring_streams_are_right() {
        let n = 20_000;
        let normals: Vec<f32> =
            (0..n).map(|i| Random::keyed(7, Domain::Ray, &[0, i as u64]).normal()).collect();
        let mean = normals.iter().sum::<f32>() / n as f32;
        let variance = normals.iter().map(|x| (x - mean) * (x - mean)).sum::<f32>() / n as f32;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "mean {mean}, variance {variance}");
    }
}
