//! The table from words to places (BoW3D's hash table), with what is needed to verify a place.
//!
//! Invariant: `count <= PLACES`; the places in use are the first `count`; every entry of a place in use hangs in the
//! chain of its word's bucket exactly once, newest place first.

use heapless::Vec;

use super::features::{Features, Keypoint};
use crate::capacity::{KEYPOINTS, WORDS};
use crate::scan::SemanticClass;

const NONE: u32 = u32::MAX;

/// A word of a place, and the keypoints it is made of: 12 bytes.
#[derive(Clone, Copy, Debug)]
struct Entry {
    word: u32,
    next: u32,
    corners: [u8; 3],
}

/// A keypoint in whole centimetres: 8 bytes.
#[derive(Clone, Copy, Debug)]
struct StoredKeypoint {
    position_cm: [i16; 3],
    class: SemanticClass,
}

/// A place: a keyframe that was added.
#[derive(Clone, Debug)]
pub struct Place {
    /// The caller's number.
    pub id: u32,
    /// The caller's time [s].
    pub stamp_s: f64,
    words: u16,
    reach_m: f32,
    keypoints: Vec<StoredKeypoint, KEYPOINTS>,
}

impl Place {
    /// Keypoints, rounded to centimetres.
    pub fn keypoints(&self) -> impl Iterator<Item = ([f32; 3], SemanticClass)> {
        self.keypoints.iter().map(|k| (k.position_cm.map(|v| f32::from(v) * 0.01), k.class))
    }

    /// Horizontal range up to which the keypoints are complete [m].
    pub fn reach_m(&self) -> f32 {
        self.reach_m
    }

    /// Position [m] of a keypoint.
    pub fn position(&self, keypoint: u8) -> [f32; 3] {
        self.keypoints[keypoint as usize].position_cm.map(|v| f32::from(v) * 0.01)
    }
}

/// Places and their words: at most `PLACES` places (at most 65535). `BUCKETS` is a power of two, best a quarter of all
/// words or more.
pub struct PlaceTable<const PLACES: usize, const BUCKETS: usize> {
    first: [u32; BUCKETS],
    lengths: [u32; BUCKETS],
    entries: [[Entry; WORDS]; PLACES],
    places: Vec<Place, PLACES>,
    /// Where the next place goes when all are taken: the oldest.
    oldest: usize,
    words: u32,
    used_buckets: u32,
    forgotten: u32,
}

impl<const PLACES: usize, const BUCKETS: usize> PlaceTable<PLACES, BUCKETS> {
    /// No places.
    pub const fn new() -> Self {
        const {
            assert!(BUCKETS.is_power_of_two(), "BUCKETS must be a power of two");
            assert!(PLACES > 0 && PLACES <= 65535, "PLACES must be 1 to 65535");
        };
        let entry = Entry { word: 0, next: NONE, corners: [0; 3] };
        Self {
            first: [NONE; BUCKETS],
            lengths: [0; BUCKETS],
            entries: [[entry; WORDS]; PLACES],
            places: Vec::new(),
            oldest: 0,
            words: 0,
            used_buckets: 0,
            forgotten: 0,
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.first.fill(NONE);
        self.lengths.fill(0);
        self.places.clear();
        (self.oldest, self.words, self.used_buckets, self.forgotten) = (0, 0, 0, 0);
    }

    /// The places, in no order.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// Places that were dropped for newer ones.
    pub fn forgotten(&self) -> u32 {
        self.forgotten
    }

    fn bucket(word: u32) -> usize {
        word as usize & (BUCKETS - 1)
    }

    /// Adds a place. When the table is full, the place that was added first is forgotten.
    pub fn add(
        &mut self,
        id: u32,
        stamp_s: f64,
        reach_m: f32,
        features: &Features,
        words: &[(u32, [u8; 3])],
    ) {
        let mut place =
            Place { id, stamp_s, words: words.len().min(WORDS) as u16, reach_m, keypoints: Vec::new() };
        place.keypoints.extend(features.keypoints.iter().map(store));
        let at = if self.places.is_full() { self.forget_oldest() } else { self.places.len() };
        if at < self.places.len() {
            self.places[at] = place;
        } else {
            // There is room: the table is not full.
            let _ = self.places.push(place);
        }
        for (k, (word, corners)) in words.iter().take(WORDS).enumerate() {
            let bucket = Self::bucket(*word);
            let first = &mut self.first[bucket];
            self.used_buckets += u32::from(*first == NONE);
            self.lengths[bucket] += 1;
            self.entries[at][k] = Entry { word: *word, next: *first, corners: *corners };
            *first = (at * WORDS + k) as u32;
            self.words += 1;
        }
    }

    /// Takes the words of the oldest place out of their chains; gives its index.
    fn forget_oldest(&mut self) -> usize {
        let at = self.oldest;
        for k in 0..self.places[at].words as usize {
            self.unlink(at, k);
        }
        self.words -= u32::from(self.places[at].words);
        self.forgotten += 1;
        self.oldest = (at + 1) % PLACES;
        at
    }

    fn unlink(&mut self, place: usize, word: usize) {
        let entry = self.entries[place][word];
        let index = (place * WORDS + word) as u32;
        let bucket = Self::bucket(entry.word);
        self.lengths[bucket] -= 1;
        let mut at = self.first[bucket];
        if at == index {
            self.first[bucket] = entry.next;
            self.used_buckets -= u32::from(entry.next == NONE);
            return;
        }
        while at != NONE {
            let before = &mut self.entries[at as usize / WORDS][at as usize % WORDS];
            if before.next == index {
                before.next = entry.next;
                return;
            }
            at = before.next;
        }
    }

    /// Entries that a bucket holds at most to be looked up: `ratio` times the mean of those in use.
    pub fn entry_limit(&self, ratio: f32) -> u32 {
        (ratio * self.words as f32 / self.used_buckets.max(1) as f32) as u32
    }

    /// The word's bucket holds at most `limit` entries (BoW3D's ratio test).
    #[inline]
    pub fn is_rare(&self, word: u32, limit: u32) -> bool {
        self.lengths[Self::bucket(word)] <= limit
    }

    /// Calls `visit` with the place's index and the corners of every entry of a word.
    #[inline]
    pub fn for_entries(&self, word: u32, mut visit: impl FnMut(usize, [u8; 3])) {
        let mut at = self.first[Self::bucket(word)];
        while at != NONE {
            let place = at as usize / WORDS;
            let entry = &self.entries[place][at as usize % WORDS];
            if entry.word == word {
                visit(place, entry.corners);
            }
            at = entry.next;
        }
    }
}

fn store(keypoint: &Keypoint) -> StoredKeypoint {
    let round = |v: f32| crate::math::floor_i32((v * 100.0 + 0.5).clamp(-32768.0, 32767.0)) as i16;
    StoredKeypoint { position_cm: keypoint.position.map(round), class: keypoint.class }
}
