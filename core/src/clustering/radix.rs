//! A stable radix sort that cannot panic, not even in the eyes of the linker, and costs the same whatever the keys are.

use heapless::Vec;

/// Values of a digit.
const DIGITS: usize = 256;

/// Sorts `order` by ascending key, equal keys as they were. Keys are below 2^`bits`; `spare` is overwritten.
pub fn sort_by_key<const N: usize>(
    order: &mut Vec<u16, N>,
    spare: &mut Vec<u16, N>,
    bits: u32,
    key: impl Fn(u16) -> u64,
) {
    spare.clear();
    // As long as the order, which fits.
    let _ = spare.resize(order.len(), 0);
    let (mut from, mut to) = (order.as_mut_slice(), spare.as_mut_slice());
    let shifts = (0..bits).step_by(8);
    let passes = shifts.clone().count();
    for shift in shifts {
        scatter(from, to, |n| (key(n) >> shift) as usize & (DIGITS - 1));
        core::mem::swap(&mut from, &mut to);
    }
    if passes % 2 == 1 {
        to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
    }
}

/// One pass: `from` into `to`, by a digit.
fn scatter(from: &[u16], to: &mut [u16], digit: impl Fn(u16) -> usize) {
    let mut places = [0_u32; DIGITS];
    for n in from {
        if let Some(count) = places.get_mut(digit(*n)) {
            *count += 1;
        }
    }
    let mut before = 0;
    for place in &mut places {
        before += core::mem::replace(place, before);
    }
    for n in from {
        let Some(place) = places.get_mut(digit(*n)) else { continue };
        if let Some(to) = to.get_mut(*place as usize) {
            *to = *n;
        }
        *place += 1;
    }
}

/// Packs the coordinates of cubes into as few bits as their extent needs. In the order of x, y, z.
pub struct Packing {
    low: [u16; 3],
    bits: [u32; 3],
}

impl Packing {
    /// For these cubes.
    pub fn of(cubes: impl Iterator<Item = [u16; 3]>) -> Self {
        let (mut low, mut high) = ([u16::MAX; 3], [0; 3]);
        for cube in cubes {
            for k in 0..3 {
                (low[k], high[k]) = (low[k].min(cube[k]), high[k].max(cube[k]));
            }
        }
        let bits = |k: usize| u16::BITS - high[k].saturating_sub(low[k]).leading_zeros();
        Self { low, bits: [bits(0), bits(1), bits(2)] }
    }

    /// Bits of a packed cube.
    pub fn bits(&self) -> u32 {
        self.bits.iter().sum()
    }

    /// One of the cubes, packed.
    pub fn pack(&self, cube: [u16; 3]) -> u64 {
        let [x, y, z] = [0, 1, 2].map(|k| u64::from(cube[k].wrapping_sub(self.low[k])));
        (x << self.bits[1] | y) << self.bits[2] | z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sorts_as_the_core_library_does_and_keeps_equal_keys_as_they_were() {
        let hash = |n: u16| u64::from(n).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 43;
        for (count, bits) in [(500, 21), (500, 16), (333, 8), (0, 21), (1, 21)] {
            let key = |n: u16| hash(n) & ((1 << bits) - 1);
            let mut order: Vec<u16, 512> = (0..count).rev().collect();
            let mut expected = order.clone();
            sort_by_key(&mut order, &mut Vec::new(), bits, key);
            // It began in descending order.
            expected.sort_unstable_by_key(|n| (key(*n), u16::MAX - n));
            assert_eq!(order, expected);
        }
    }

    #[test]
    fn packed_cubes_are_in_the_order_of_their_coordinates_and_short() {
        let cubes = [[32760, 40, 7], [32760, 41, 0], [32761, 40, 0], [32775, 43, 1]];
        let packing = Packing::of(cubes.into_iter());
        assert_eq!(packing.bits(), 4 + 2 + 3);
        let packed = cubes.map(|cube| packing.pack(cube));
        assert!(packed.is_sorted_by(|a, b| a < b) && packed.iter().all(|p| *p < 1 << 9), "{packed:?}");
        assert_eq!(Packing::of(core::iter::empty()).bits(), 0);
    }
}
