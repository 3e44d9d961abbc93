//! Stage 3: landmarks, what an instance is reduced to: centre, extent, and a bounded choice of its points from which
//! the two layers' hulls are made (sections 3.2.1 and 3.2.2).

mod extract;
mod hulls;

use heapless::Vec;

pub use extract::extract;
pub use hulls::{HULL_VERTICES, Hull, Layers, layers};

use crate::scan::SemanticClass;

/// Directions in which a layer's outermost points are kept.
pub const OUTLINE: usize = 16;
/// Points kept from all over the surface.
pub const SAMPLES: usize = 24;

/// Motion state of a landmark (section 3.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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

/// One landmark of a scan.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct Landmark {
    /// Class: that of most of its points.
    pub class: SemanticClass,
    /// Landmarks are matched within a family: the class itself, or the one standing for those easily confused with it.
    pub family: SemanticClass,
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
    pub(crate) cells: u32,
    votes: [u32; SemanticClass::COUNT],
    /// Outermost points [m, sensor frame] below and above the mean height, per direction.
    pub(crate) outline: [[Option<[f32; 3]>; OUTLINE]; 2],
    /// Points [m, sensor frame] from all over the surface.
    pub(crate) samples: Vec<[f32; 3], SAMPLES>,
}
