//! SemanticKITTI's label ids.

use sdslam_core::SemanticClass::{self, *};

/// Class of a raw label, whose low half is the id; a moving thing has the class it has at rest. Ids that SemanticKITTI
/// does not define are unlabelled.
pub fn class_of(raw: u32) -> SemanticClass {
    match raw & 0xffff {
        1 => Outlier,
        10 | 252 => Car,
        11 => Bicycle,
        13 | 16 | 20 | 256 | 257 | 259 => OtherVehicle,
        15 => Motorcycle,
        18 | 258 => Truck,
        30 | 254 => Person,
        31 | 253 => Bicyclist,
        32 | 255 => Motorcyclist,
        40 => Road,
        44 => Parking,
        48 => Sidewalk,
        49 => OtherGround,
        50 => Building,
        51 => Fence,
        52 => OtherStructure,
        60 => LaneMarking,
        70 => Vegetation,
        71 => Trunk,
        72 => Terrain,
        80 => Pole,
        81 => TrafficSign,
        99 => OtherObject,
        _ => Unlabelled,
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn classes_are_those_of_the_host() {
        for raw in 0..=u32::from(u16::MAX) {
            let labelled = raw | 7 << 16;
            assert_eq!(super::class_of(labelled), sdslam::dataset::labels::class_of(labelled), "id {raw}");
        }
    }
}
