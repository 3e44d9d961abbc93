//! One voxel of the static map: 56 bytes, however often it is seen.

use sdslam_core::SemanticClass;

/// Classes counted at once in a voxel; one more takes the place of the rarest (the space-saving method).
pub(crate) const CLASSES_PER_VOXEL: usize = 4;

/// Parts of a voxel along each edge.
const PARTS: u8 = 4;

/// What was seen in one voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Voxel {
    /// Points.
    pub count: u32,
    /// Sum of the points' offsets from the voxel's corner \[m\].
    pub offset: [f32; 3],
    /// Sum of the points' intensities.
    pub intensity: f32,
    /// Class and its points; unused places have none.
    pub classes: [(u8, u16); CLASSES_PER_VOXEL],
    /// Number of the scan that hit it last.
    pub last_scan: u32,
    /// Scans that hit it.
    pub hits: u16,
    /// Keyframes that have seen something behind it since it was hit last.
    pub seen_through: u16,
    /// Its parts that were hit, one bit each ([`part`]).
    pub parts: u64,
}

const _: () = assert!(size_of::<Voxel>() == 56);

/// The part of a voxel in which an offset from its corner lies: a cube of a quarter of the edge, counted along x, then y, then z.
pub(crate) fn part(offset: [f32; 3], edge: f32) -> u8 {
    let [x, y, z] = offset.map(|v| ((v / edge * f32::from(PARTS)) as u8).min(PARTS - 1));
    x + PARTS * (y + PARTS * z)
}

impl Voxel {
    /// Counts a point; `part` is where its offset lies.
    pub(crate) fn add(
        &mut self,
        offset: [f32; 3],
        part: u8,
        class: SemanticClass,
        intensity: f32,
        scan: u32,
    ) {
        if self.count == 0 || self.last_scan != scan {
            self.hits = self.hits.saturating_add(1);
            (self.last_scan, self.seen_through) = (scan, 0);
        }
        self.count = self.count.saturating_add(1);
        for (sum, value) in self.offset.iter_mut().zip(offset) {
            *sum += value;
        }
        self.intensity += intensity;
        self.parts |= 1 << part;
        self.count_class(class as u8, 1);
    }

    /// Takes in what another voxel knows about the same place.
    pub(crate) fn merge(&mut self, other: &Self) {
        for (sum, other) in self.offset.iter_mut().zip(other.offset) {
            *sum += other;
        }
        self.count = self.count.saturating_add(other.count);
        self.intensity += other.intensity;
        for &(class, points) in other.classes.iter().filter(|(_, points)| *points > 0) {
            self.count_class(class, points);
        }
        self.parts |= other.parts;
        self.hits = self.hits.saturating_add(other.hits);
        if other.last_scan >= self.last_scan {
            (self.last_scan, self.seen_through) = (other.last_scan, other.seen_through);
        }
    }

    fn count_class(&mut self, class: u8, points: u16) {
        let place = self.classes.iter().position(|&(known, n)| n > 0 && known == class);
        let rarest = || (0..CLASSES_PER_VOXEL).min_by_key(|&i| self.classes[i].1).unwrap_or(0);
        let place = place.unwrap_or_else(rarest);
        self.classes[place] = (class, self.classes[place].1.saturating_add(points));
    }

    /// The commonest class, and its share of the points, 0..1; of two as common, the one with the smaller number.
    pub(crate) fn class(&self) -> (SemanticClass, f32) {
        let most = self.classes.iter().max_by_key(|&&(class, n)| (n, u8::MAX - class));
        let Some(&(class, points)) = most else { return (SemanticClass::Unlabelled, 0.0) };
        let all: u32 = self.classes.iter().map(|&(_, n)| u32::from(n)).sum();
        let class = SemanticClass::ALL.get(usize::from(class)).copied().unwrap_or(SemanticClass::Unlabelled);
        (class, f32::from(points) / all.max(1) as f32)
    }

    /// Where its points lie, from its corner \[m\]: a place for each part that was hit, spread about their mean.
    pub(crate) fn places(&self, edge: f32) -> impl Iterator<Item = [f32; 3]> {
        let (mean, parts) = (self.mean_offset(), self.parts);
        let hit = move |part: &u8| parts >> part & 1 == 1;
        let step = edge / f32::from(PARTS);
        let place = move |part: u8| {
            [part % PARTS, part / PARTS % PARTS, part / PARTS / PARTS].map(|n| f32::from(n) * step)
        };
        let mut middle = [0.0; 3];
        for part in (0..u64::BITS as u8).filter(hit) {
            (0..3).for_each(|i| middle[i] += place(part)[i] / parts.count_ones() as f32);
        }
        (0..u64::BITS as u8).filter(hit).map(move |part| {
            let place = place(part);
            std::array::from_fn(|i| mean[i] + place[i] - middle[i])
        })
    }

    /// What falls to `parts` of its `of` parts, whose points have this mean offset \[m\] in their new voxel; no fewer than
    /// `least` points, if it has so many.
    pub(crate) fn share(&self, parts: u32, of: u32, least: u32, mean: [f32; 3]) -> Self {
        let scaled = |n: u32| (u64::from(n) * u64::from(parts)).div_ceil(u64::from(of.max(1))) as u32;
        let count = scaled(self.count).max(least.min(self.count));
        Self {
            count,
            offset: mean.map(|v| v * count as f32),
            intensity: self.intensity * count as f32 / self.count.max(1) as f32,
            classes: self.classes.map(|(class, points)| (class, scaled(u32::from(points)) as u16)),
            ..*self
        }
    }

    /// Mean of the points from the voxel's corner \[m\].
    pub(crate) fn mean_offset(&self) -> [f32; 3] {
        self.offset.map(|sum| sum / self.count.max(1) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_majority_names_the_voxel_whatever_the_order() {
        use SemanticClass::{Building, Pole};
        let mut classes = [Pole, Building, Building];
        for _ in 0..3 {
            classes.rotate_left(1);
            let mut voxel = Voxel::default();
            classes.iter().for_each(|&class| voxel.add([0.1; 3], 42, class, 0.5, 0));
            assert_eq!(voxel.class(), (Building, 2.0 / 3.0));
            assert_eq!((voxel.count, voxel.hits), (3, 1));
        }
    }

    #[test]
    fn merging_is_as_good_as_adding_at_once() {
        let (mut parts, mut whole) = ([Voxel::default(); 2], Voxel::default());
        for k in 0..10u32 {
            let class = SemanticClass::ALL[9 + k as usize % 3];
            let offset = [0.01 * k as f32, 0.1, 0.05];
            parts[usize::from(k > 5)].add(offset, part(offset, 0.2), class, 0.25, k);
            whole.add(offset, part(offset, 0.2), class, 0.25, k);
        }
        let [mut first, second] = parts;
        first.merge(&second);
        let apart = first.offset.iter().zip(whole.offset).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(apart < 1e-6);
        assert_eq!(first.class(), whole.class());
        assert_eq!((first.count, first.hits, first.intensity), (whole.count, whole.hits, whole.intensity));
        assert_eq!(first.parts, whole.parts);
    }
}
