//! SemanticKITTI's label ids: raw id to class, moving variants, colours.
//!
//! A raw label is 32 bits: the class id in the low half, an instance number in the high half. Functions that take a
//! raw label look at the low half only; those that return one keep the instance.

use sdslam_core::SemanticClass;
use sdslam_core::SemanticClass::*;

const ID_MASK: u32 = 0xffff;

/// Id, class, colour (r g b). The first row of a class is the id that is written for it.
const CLASSES: [(u32, SemanticClass, [u8; 3]); 26] = [
    (0, Unlabelled, [0, 0, 0]),
    (1, Outlier, [255, 0, 0]),
    (10, Car, [100, 150, 245]),
    (11, Bicycle, [100, 230, 245]),
    (15, Motorcycle, [30, 60, 150]),
    (18, Truck, [80, 30, 180]),
    (20, OtherVehicle, [0, 0, 255]),
    (13, OtherVehicle, [100, 80, 250]),
    (16, OtherVehicle, [0, 0, 255]),
    (30, Person, [255, 30, 30]),
    (31, Bicyclist, [255, 40, 200]),
    (32, Motorcyclist, [150, 30, 90]),
    (40, Road, [255, 0, 255]),
    (44, Parking, [255, 150, 255]),
    (48, Sidewalk, [75, 0, 75]),
    (49, OtherGround, [175, 0, 75]),
    (50, Building, [255, 200, 0]),
    (51, Fence, [255, 120, 50]),
    (52, OtherStructure, [255, 150, 0]),
    (60, LaneMarking, [150, 255, 170]),
    (70, Vegetation, [0, 175, 0]),
    (71, Trunk, [135, 60, 0]),
    (72, Terrain, [150, 240, 80]),
    (80, Pole, [255, 240, 150]),
    (81, TrafficSign, [255, 0, 0]),
    (99, OtherObject, [50, 255, 255]),
];

/// Static id and the id of the same class when it moves. 9 and 251 are the two ids of moving-object segmentation.
const MOVING: [(u32, u32); 9] =
    [(9, 251), (10, 252), (31, 253), (30, 254), (32, 255), (16, 256), (13, 257), (18, 258), (20, 259)];

/// Classes whose moving form is named after the rider: id standing, id moving.
const RIDDEN: [(u32, u32); 2] = [(11, 253), (15, 255)];

/// Class by id, the moving ones included: every point of every scan is looked up.
const CLASS_BY_ID: [SemanticClass; 260] = {
    let mut table = [Unlabelled; 260];
    let mut row = 0;
    while row < CLASSES.len() {
        table[CLASSES[row].0 as usize] = CLASSES[row].1;
        row += 1;
    }
    row = 0;
    while row < MOVING.len() {
        table[MOVING[row].1 as usize] = table[MOVING[row].0 as usize];
        row += 1;
    }
    table
};

/// Class of a raw label; ids that SemanticKITTI does not define are unlabelled.
pub fn class_of(raw: u32) -> SemanticClass {
    CLASS_BY_ID.get((raw & ID_MASK) as usize).copied().unwrap_or(Unlabelled)
}

/// Whether a raw label says that the thing moves (ids 251 to 259).
pub fn is_moving(raw: u32) -> bool {
    (251..=259).contains(&(raw & ID_MASK))
}

/// The label of the same thing moving; unchanged where there is none, as for a building.
pub fn moving_id(raw: u32) -> u32 {
    let id = raw & ID_MASK;
    let moving = MOVING.iter().chain(&RIDDEN).find(|row| row.0 == id).map_or(id, |row| row.1);
    raw & !ID_MASK | moving
}

/// The label of the same thing standing still.
pub fn static_id(raw: u32) -> u32 {
    let id = raw & ID_MASK;
    let still = MOVING.iter().find(|row| row.1 == id).map_or(id, |row| row.0);
    raw & !ID_MASK | still
}

/// The id that is written for a class (standing, without instance).
pub fn raw_id(class: SemanticClass) -> u32 {
    row_of(class).0
}

/// SemanticKITTI's colour of a class, red green blue.
pub fn colour(class: SemanticClass) -> [u8; 3] {
    row_of(class).2
}

fn row_of(class: SemanticClass) -> (u32, SemanticClass, [u8; 3]) {
    CLASSES.into_iter().find(|row| row.1 == class).unwrap_or(CLASSES[0])
}

/// The class index of SemanticKITTI's single-scan benchmark, 0 (ignored) to 19.
pub fn benchmark_class(raw: u32) -> SemanticClass {
    match class_of(raw) {
        Outlier | OtherStructure | OtherObject => Unlabelled,
        LaneMarking => Road,
        class => class,
    }
}
