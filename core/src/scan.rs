//! The boundary to the caller: one scan with a semantic class per point (section 3.1.1 gives the classes).

/// What a landmark of a class can do (section 3.1.2, figure 2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MotionClass {
    /// No use: unlabelled points and outliers.
    Dropped,
    /// Structures on the ground: roads, sidewalks, lane markings, terrain.
    Ground,
    /// Never moves: buildings, fences, vegetation, trunks, poles, signs, other structures.
    PureStatic,
    /// May move: vehicles, people, cyclists. The Kalman filters decide (section 3.3).
    UnknownMotion,
}

/// Semantic class of a point: the SemanticKITTI classes without their moving variants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(u8)]
#[allow(missing_docs, reason = "the names are the data set's own")]
pub enum SemanticClass {
    Unlabelled = 0,
    Car,
    Bicycle,
    Motorcycle,
    Truck,
    OtherVehicle,
    Person,
    Bicyclist,
    Motorcyclist,
    Road,
    Parking,
    Sidewalk,
    OtherGround,
    Building,
    Fence,
    Vegetation,
    Trunk,
    Terrain,
    Pole,
    TrafficSign,
    LaneMarking,
    OtherStructure,
    OtherObject,
    Outlier,
}

impl SemanticClass {
    /// Number of classes.
    pub const COUNT: usize = 24;

    /// All classes, in the order of their values.
    pub const ALL: [SemanticClass; Self::COUNT] = {
        use SemanticClass::*;
        [
            Unlabelled,
            Car,
            Bicycle,
            Motorcycle,
            Truck,
            OtherVehicle,
            Person,
            Bicyclist,
            Motorcyclist,
            Road,
            Parking,
            Sidewalk,
            OtherGround,
            Building,
            Fence,
            Vegetation,
            Trunk,
            Terrain,
            Pole,
            TrafficSign,
            LaneMarking,
            OtherStructure,
            OtherObject,
            Outlier,
        ]
    };

    /// Motion class of this semantic class (section 3.1.2).
    pub const fn motion(self) -> MotionClass {
        use SemanticClass::*;
        match self {
            Unlabelled | Outlier => MotionClass::Dropped,
            Road | Parking | Sidewalk | OtherGround | Terrain | LaneMarking => MotionClass::Ground,
            Building | Fence | Vegetation | Trunk | Pole | TrafficSign | OtherStructure | OtherObject => {
                MotionClass::PureStatic
            }
            Car | Bicycle | Motorcycle | Truck | OtherVehicle | Person | Bicyclist | Motorcyclist => {
                MotionClass::UnknownMotion
            }
        }
    }

    /// Lower-case name as SemanticKITTI writes it.
    pub const fn name(self) -> &'static str {
        use SemanticClass::*;
        match self {
            Unlabelled => "unlabelled",
            Car => "car",
            Bicycle => "bicycle",
            Motorcycle => "motorcycle",
            Truck => "truck",
            OtherVehicle => "other-vehicle",
            Person => "person",
            Bicyclist => "bicyclist",
            Motorcyclist => "motorcyclist",
            Road => "road",
            Parking => "parking",
            Sidewalk => "sidewalk",
            OtherGround => "other-ground",
            Building => "building",
            Fence => "fence",
            Vegetation => "vegetation",
            Trunk => "trunk",
            Terrain => "terrain",
            Pole => "pole",
            TrafficSign => "traffic-sign",
            LaneMarking => "lane-marking",
            OtherStructure => "other-structure",
            OtherObject => "other-object",
            Outlier => "outlier",
        }
    }
}

/// One LiDAR return with its class, 16 bytes.
///
/// Sensor frame: x forward, y left, z up, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct LabelledPoint {
    /// Position [m] in the sensor frame. Non-finite points are counted and dropped.
    pub position: [f32; 3],
    /// Semantic class.
    pub class: SemanticClass,
    /// Confidence of the class, 255 = certain.
    pub confidence: u8,
    /// Written by the core: index into [`crate::Odometry::landmarks`], or [`LabelledPoint::NO_LANDMARK`].
    pub landmark: u16,
}

impl LabelledPoint {
    /// Value of [`LabelledPoint::landmark`] for a point that belongs to no landmark.
    pub const NO_LANDMARK: u16 = u16::MAX;

    /// A point with a certain class.
    pub const fn new(position: [f32; 3], class: SemanticClass) -> Self {
        Self { position, class, confidence: u8::MAX, landmark: Self::NO_LANDMARK }
    }
}

/// One scan, owned by the caller. The order of the points is kept.
#[derive(Debug)]
pub struct LabelledScan<'a> {
    /// Time of the scan [s], on any clock that does not go back.
    pub stamp_s: f64,
    /// Points; the core writes their `landmark` field.
    pub points: &'a mut [LabelledPoint],
}
