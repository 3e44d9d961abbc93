//! Landmarks: what an instance is reduced to (sections 3.2.1 and 3.2.2).

use crate::scan::SemanticClass;

/// Motion state of a landmark (section 3.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MotionState {
    /// Its class never moves.
    #[default]
    PureStatic,
    /// Its class may move; it stands still.
    SemiStatic,
    /// It moves.
    Dynamic,
    /// Its class may move; not seen long enough to say.
    Undecided,
}

/// One landmark of the current scan.
#[derive(Clone, Debug)]
pub struct Landmark {
    /// Class.
    pub class: SemanticClass,
    /// Geometric centre [m], sensor frame.
    pub centre: [f32; 3],
    /// Smallest coordinates [m], sensor frame.
    pub min: [f32; 3],
    /// Largest coordinates [m], sensor frame.
    pub max: [f32; 3],
    /// Points of the scan in this landmark.
    pub point_count: u32,
    /// Motion state.
    pub state: MotionState,
    /// Identity of its track, if its class may move.
    pub track: Option<u32>,
}
