//! Stage 2, section 3.1.2: instances, by DBSCAN per class with the class's own radius and minimum points.
//!
//! Deviations: the radius grows with range, as the spacing of the beams does; the points of a scan come as cells that
//! weigh as many points as they hold, those of long things in blocks of up to eight; long things are cut into tiles that are fixed in the map, so that a landmark stays
//! local; classes that segmentation confuses within one object (a car's and a truck's, a rider's and a walker's) may be
//! clustered together, the majority naming the instance.

use heapless::Vec;
use heapless::index_map::FnvIndexMap;
use nalgebra::Vector3;

use crate::clustering::dbscan::{self, Scratch};
use crate::clustering::radix::{self, Packing};
use crate::error::ParameterError;
use crate::math::{self, floor_i32};
use crate::pose::Pose;
use crate::scan::{MotionClass, SemanticClass};
use crate::scan_cells::{Cell, ScanCells};

/// DBSCAN's parameters for one group of classes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ClassConfig {
    /// Radius of the neighbourhood, near the sensor [m]. Blocks are twice as large as their cells: less than one and a
    /// half blocks would tear long things apart.
    pub radius_m: f32,
    /// Points that make a core point.
    pub min_points: u32,
    /// Points that make an instance.
    pub min_size: u32,
    /// Side of the tiles that instances are cut into [m]; 0 leaves them whole.
    pub tile_m: f32,
}

/// Parameters of the instances.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Config {
    /// The radius is at least this share of the range.
    pub radius_per_range: f32,
    /// Cluster easily confused movable classes together.
    pub families: bool,
    /// Cluster long things in blocks of 2 x 2 x 2 cells.
    pub blocks: bool,
    /// Trunks, poles, signs, other objects.
    pub small: ClassConfig,
    /// Persons, bicyclists, motorcyclists.
    pub person: ClassConfig,
    /// Bicycles, motorcycles.
    pub two_wheeler: ClassConfig,
    /// Cars.
    pub car: ClassConfig,
    /// Trucks and other vehicles.
    pub large_vehicle: ClassConfig,
    /// Fences.
    pub fence: ClassConfig,
    /// Buildings and other structures.
    pub building: ClassConfig,
    /// Vegetation.
    pub vegetation: ClassConfig,
}

const fn class(radius_m: f32, min_points: u32, min_size: u32, tile_m: f32) -> ClassConfig {
    ClassConfig { radius_m, min_points, min_size, tile_m }
}

impl Config {
    /// Defaults.
    pub const DEFAULT: Self = Self {
        radius_per_range: 0.02,
        families: true,
        blocks: true,
        small: class(0.4, 4, 8, 0.0),
        person: class(0.5, 4, 8, 0.0),
        two_wheeler: class(0.5, 5, 10, 0.0),
        car: class(0.7, 6, 12, 0.0),
        large_vehicle: class(1.0, 8, 20, 0.0),
        fence: class(1.2, 8, 30, 5.0),
        building: class(1.2, 15, 50, 8.0),
        vegetation: class(1.2, 12, 40, 4.0),
    };

    /// Nothing but the paper: one class, one clustering.
    pub const PAPER: Self = Self {
        families: false,
        blocks: false,
        fence: class(0.8, 8, 30, 5.0),
        vegetation: class(0.8, 12, 40, 4.0),
        ..Self::DEFAULT
    };

    /// The parameters of a class.
    pub const fn of(&self, class: SemanticClass) -> &ClassConfig {
        use SemanticClass::*;
        match class {
            Person | Bicyclist | Motorcyclist => &self.person,
            Bicycle | Motorcycle => &self.two_wheeler,
            Car => &self.car,
            Truck | OtherVehicle => &self.large_vehicle,
            Fence => &self.fence,
            Building | OtherStructure => &self.building,
            Vegetation => &self.vegetation,
            _ => &self.small,
        }
    }

    /// The class that stands for all that are clustered with `class`.
    pub const fn family(&self, class: SemanticClass) -> SemanticClass {
        use SemanticClass::*;
        match class {
            Truck | OtherVehicle if self.families => Car,
            Bicyclist | Motorcyclist if self.families => Person,
            Motorcycle if self.families => Bicycle,
            other => other,
        }
    }

    pub(crate) const fn check(&self) -> Result<(), ParameterError> {
        if !(self.radius_per_range >= 0.0 && self.radius_per_range < 0.2) {
            return Err(ParameterError { parameter: "instances.radius_per_range", expected: "0 to 0.2" });
        }
        let all = [
            self.small,
            self.person,
            self.two_wheeler,
            self.car,
            self.large_vehicle,
            self.fence,
            self.building,
            self.vegetation,
        ];
        let mut i = 0;
        while i < all.len() {
            if !(all[i].radius_m > 0.0 && all[i].radius_m <= 5.0) {
                return Err(ParameterError {
                    parameter: "instances.*.radius_m",
                    expected: "above 0 and at most 5 m",
                });
            }
            if all[i].min_points == 0 || all[i].min_size == 0 {
                return Err(ParameterError {
                    parameter: "instances.*.min_points and min_size",
                    expected: "at least 1",
                });
            }
            if !(all[i].tile_m >= 0.0) {
                return Err(ParameterError {
                    parameter: "instances.*.tile_m",
                    expected: "0 or a length in metres",
                });
            }
            i += 1;
        }
        Ok(())
    }
}

/// One instance of the scan.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    /// The class, or the one that stands for its family.
    pub family: SemanticClass,
    /// Points.
    pub points: u32,
    /// Its landmark, once they are chosen, or [`Cell::NO_LANDMARK`].
    pub landmark: u16,
}

/// Instances of a scan, and the memory to find them.
pub struct Instances<const CELLS: usize, const INSTANCES: usize> {
    /// Cells by family, those of long things also by block.
    by_family: Vec<u16, CELLS>,
    members: Vec<dbscan::Point, CELLS>,
    scratch: Scratch<CELLS>,
    /// Instance of (cluster, tile).
    tiles: FnvIndexMap<(u16, i16, i16), u16, INSTANCES>,
    found: Vec<Instance, INSTANCES>,
    refused: u32,
}

impl<const CELLS: usize, const INSTANCES: usize> Instances<CELLS, INSTANCES> {
    /// No instances.
    pub const fn new() -> Self {
        Self {
            by_family: Vec::new(),
            members: Vec::new(),
            scratch: Scratch::new(),
            tiles: FnvIndexMap::new(),
            found: Vec::new(),
            refused: 0,
        }
    }

    /// The instances; a cell's `landmark` field is an index into them after [`Self::find`].
    pub fn all_mut(&mut self) -> &mut [Instance] {
        &mut self.found
    }

    /// Cells whose instance did not fit.
    pub fn refused(&self) -> u32 {
        self.refused
    }

    /// Finds the instances among the cells and writes each cell's. `local_from_sensor`, the predicted pose, places the tiles.
    pub fn find(&mut self, config: &Config, cells: &mut ScanCells<CELLS>, local_from_sensor: &Pose) {
        self.found.clear();
        self.refused = 0;
        self.sort_by_family(config, cells.cells());
        let mut start = 0;
        while let Some(first) = self.by_family.get(start).and_then(|i| cells.cells().get(*i as usize)) {
            let family = config.family(first.class);
            start = self.gather(config, family, start, cells.cells());
            self.find_family(config, family, cells.cells_mut(), local_from_sensor);
        }
    }

    /// Sorts the cells by family; those of long things also by block.
    fn sort_by_family(&mut self, config: &Config, cells: &[Cell]) {
        let families = SemanticClass::ALL.map(|class| config.family(class) as u64);
        self.by_family.clear();
        for (i, cell) in cells.iter().enumerate() {
            if matches!(cell.class.motion(), MotionClass::PureStatic | MotionClass::UnknownMotion) {
                // As many as cells fit.
                let _ = self.by_family.push(i as u16);
            }
        }
        let packing = Packing::of(cells.iter().filter_map(|cell| block(config, cell)));
        let key = |i: u16| {
            let Some(cell) = cells.get(i as usize) else { return 0 };
            let block = block(config, cell).map_or(0, |block| packing.pack(block));
            families[cell.class as usize] << packing.bits() | block
        };
        let bits = packing.bits() + SemanticClass::COUNT.ilog2() + 1;
        radix::sort_by_key(&mut self.by_family, self.scratch.spare(), bits, key);
    }

    /// The cells of a family, which begin at `start` in [`Self::by_family`], as members to cluster; gives their end.
    fn gather(&mut self, config: &Config, family: SemanticClass, start: usize, cells: &[Cell]) -> usize {
        self.members.clear();
        let mut end = start;
        loop {
            let ids = together(config, self.by_family.get(end..).unwrap_or_default(), cells);
            let Some(member) = member(config, family, ids, cells, end) else { return end };
            // As many members as cells fit.
            let _ = self.members.push(member);
            end += ids.len();
        }
    }

    /// Clusters the members and writes the instance of each cell.
    fn find_family(
        &mut self,
        config: &Config,
        family: SemanticClass,
        cells: &mut [Cell],
        local_from_sensor: &Pose,
    ) {
        let class = config.of(family);
        dbscan::cluster(&mut self.members, &mut self.scratch, class.radius_m, class.min_points);
        self.tiles.clear();
        for i in 0..self.members.len() {
            let Some(member) = self.members.get(i).copied() else { break };
            if member.cluster == dbscan::NOISE {
                continue;
            }
            let tile = tile_of(class.tile_m, &member.position, local_from_sensor);
            let instance = self.instance(family, (member.cluster, tile[0], tile[1]));
            let found = instance.and_then(|instance| self.found.get_mut(instance as usize));
            let ids = together(config, self.by_family.get(member.id as usize..).unwrap_or_default(), cells);
            match (instance, found) {
                (Some(instance), Some(found)) => {
                    found.points += member.weight;
                    for id in ids {
                        if let Some(cell) = cells.get_mut(*id as usize) {
                            cell.landmark = instance;
                        }
                    }
                }
                _ => self.refused += ids.len() as u32,
            }
        }
    }

    /// The instance of a cluster and tile, made if it is new; `None` when it does not fit.
    fn instance(&mut self, family: SemanticClass, key: (u16, i16, i16)) -> Option<u16> {
        if let Some(known) = self.tiles.get(&key) {
            return Some(*known);
        }
        let index = self.found.len() as u16;
        self.found.push(Instance { family, points: 0, landmark: Cell::NO_LANDMARK }).ok()?;
        self.tiles.insert(key, index).ok()?;
        Some(index)
    }
}

/// The first of these cells that make one member: those in a block of a long thing, or a single cell.
fn together<'a>(config: &Config, ids: &'a [u16], cells: &[Cell]) -> &'a [u16] {
    let place = |id: &u16| cells.get(*id as usize).map(|cell| (cell.class, block(config, cell)));
    let count = match ids.first().and_then(place) {
        Some(first @ (_, Some(_))) => ids.iter().take_while(|id| place(id) == Some(first)).count(),
        _ => 1,
    };
    ids.get(..count).unwrap_or_default()
}

/// Where the cell of a long thing lies; `None` for other things.
fn block(config: &Config, cell: &Cell) -> Option<[u16; 3]> {
    (config.blocks && config.of(cell.class).tile_m > 0.0).then(|| cell.block())
}

/// Cells as one member; `None` when there are none or they are not of the family.
fn member(
    config: &Config,
    family: SemanticClass,
    ids: &[u16],
    cells: &[Cell],
    index: usize,
) -> Option<dbscan::Point> {
    let class = cells.get(*ids.first()? as usize)?.class;
    if config.family(class) != family {
        return None;
    }
    let (mut sum, mut weight) = (Vector3::zeros(), 0);
    for cell in ids.iter().filter_map(|id| cells.get(*id as usize)) {
        sum += cell.mean() * cell.count() as f32;
        weight += cell.count();
    }
    let mean = sum / weight as f32;
    let range = math::sqrt(mean.norm_squared());
    let radius = config.of(class).radius_m.max(config.radius_per_range * range);
    Some(dbscan::Point::new(mean.into(), radius, weight, index as u16))
}

fn tile_of(tile_m: f32, position: &[f32; 3], local_from_sensor: &Pose) -> [i16; 2] {
    if tile_m <= 0.0 {
        return [0, 0];
    }
    let p = local_from_sensor * nalgebra::Point3::from(*position);
    [floor_i32(p.x / tile_m) as i16, floor_i32(p.y / tile_m) as i16]
}
