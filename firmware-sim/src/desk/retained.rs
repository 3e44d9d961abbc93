//! The desk's memory that outlives a loss of power.

use crate::link::PowerCycle;

/// Scans between two saved states.
const SAVE_EVERY: u32 = 3;

/// Room for two saved states: the newest whole one stays until the next is whole.
pub struct Retained {
    places: [Vec<u8>; 2],
    /// The newest whole one: place and bytes.
    newest: Option<(usize, usize)>,
    scans: u32,
    power_was_lost: bool,
}

impl Retained {
    /// Nothing saved; room for states of `bytes`.
    pub fn new(bytes: usize) -> Self {
        Self { places: [vec![0; bytes], vec![0; bytes]], newest: None, scans: 0, power_was_lost: false }
    }

    /// The power went and came back.
    pub fn lose_power(&mut self, leaves: PowerCycle) {
        (self.power_was_lost, self.scans) = (true, 0);
        match (leaves, self.newest) {
            (PowerCycle::Nothing, _) => self.newest = None,
            (PowerCycle::DamagedState, Some((place, bytes))) => self.places[place][bytes / 2] ^= 0x10,
            _ => {}
        }
    }

    /// What was saved before the power was lost.
    pub fn saved(&self) -> Option<&[u8]> {
        let (place, bytes) = self.newest.filter(|_| self.power_was_lost)?;
        Some(&self.places[place][..bytes])
    }

    /// The other place, every few scans.
    pub fn room(&mut self) -> Option<&mut [u8]> {
        self.scans += 1;
        self.scans
            .is_multiple_of(SAVE_EVERY)
            .then(|| self.other_place())
            .map(|place| &mut *self.places[place])
    }

    /// The other place holds a whole state.
    pub fn saved_in_room(&mut self, bytes: usize) {
        self.newest = Some((self.other_place(), bytes));
    }

    fn other_place(&self) -> usize {
        self.newest.map_or(0, |(place, _)| 1 - place)
    }
}
