//! What to simulate: one struct for the whole, one for the sensor, one for the town.

use super::{drive::SCAN_S, error::SimulateError};

/// How many things move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Traffic {
    /// Nothing moves.
    None,
    /// An ordinary street: a leading car, oncoming and crossing cars, some cyclists and people.
    #[default]
    Normal,
    /// Rush hour: two to three times as many.
    Heavy,
}

/// Where the drive goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Route {
    /// Round one block, again and again: the loop closes after about 190 m.
    #[default]
    Block,
    /// Round two blocks first, then anywhere in the town.
    Town,
}

/// A simulated drive. [`Options::demo`] and [`Options::town`] are the presets; the default is the demo.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Everything random follows from this number.
    pub seed: u64,
    /// Number of scans.
    pub frames: usize,
    /// Time between two scans [s], 0.05 to 10.
    pub interval_s: f64,
    /// Name of the sequence folder: two digits as KITTI has them, or any other file name.
    pub sequence: String,
    /// Number of threads; the files do not depend on it. 0 = as many as the machine has.
    pub threads: usize,
    /// Write into an existing sequence folder. Refused if it holds scans that would not be replaced.
    pub overwrite: bool,
    /// How many things move.
    pub traffic: Traffic,
    /// Where the drive goes.
    pub route: Route,
    /// Speed on a straight street [m/s], 1 to 20; corners are taken slower.
    pub speed_mps: f64,
    /// Speed of the first scan [m/s], at most `speed_mps`.
    pub start_speed_mps: f64,
    /// The sensor.
    pub sensor: SensorOptions,
    /// The town.
    pub town: TownOptions,
}

/// The LiDAR: a Velodyne HDL-64E on a car roof.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorOptions {
    /// Azimuth columns of a turn, 64 to 8192; the real device has about 2083 at 10 Hz.
    pub columns: usize,
    /// Height of the sensor frame above the ground [m].
    pub height_m: f64,
    /// Mounting pitch [deg], nose down positive.
    pub pitch_deg: f64,
    /// Standard deviation of a range near the sensor [m]; grows with range and slant.
    pub range_noise_m: f32,
    /// Farthest return [m].
    pub max_range_m: f32,
    /// Nearest return [m].
    pub min_range_m: f32,
    /// Factor on the loss of weak echoes: 0 keeps every echo.
    pub dropout: f32,
    /// What this one device does differently from the ideal one.
    pub flaws: Flaws,
}

/// Flaws of one device; the default has none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flaws {
    /// The device: the errors of its lasers follow from this number.
    pub device: u64,
    /// Standard deviation of a laser's elevation [deg].
    pub elevation_deg: f32,
    /// Standard deviation of a laser's range bias [m].
    pub range_bias_m: f32,
    /// Standard deviation of the logarithm of a laser's gain.
    pub gain: f32,
    /// Factor on all remissions; 0 = the device reports none.
    pub remission: f32,
    /// Share of the echoes at an edge that lie between the two surfaces.
    pub mixed: f32,
    /// Glass and dark paint swallow whole streaks of a ring, not single rays.
    pub streaks: bool,
    /// The encoder adds half steps, so that no two rings are sampled at the same azimuths.
    pub half_steps: bool,
    /// The own vehicle hides nothing.
    pub unmasked: bool,
    /// How much the remission of far and slanted surfaces fades: 0 = not at all, 1 = about as KITTI's device.
    pub fading: f32,
    /// Factor on the noise of the remissions of all but leaves, which fill a part of the beam only.
    pub speckle: f32,
}

impl Default for Flaws {
    fn default() -> Self {
        Self {
            device: 0,
            elevation_deg: 0.0,
            range_bias_m: 0.0,
            gain: 0.0,
            remission: 1.0,
            mixed: 0.0,
            streaks: false,
            half_steps: false,
            unmasked: false,
            fading: 0.0,
            speckle: 1.0,
        }
    }
}

/// The town.
#[derive(Clone, Debug, PartialEq)]
pub struct TownOptions {
    /// Blocks along x and y, each 4 to 24.
    pub blocks: [usize; 2],
    /// Shortest and longest distance of parallel streets [m], at least 36.
    pub block_length_m: [f32; 2],
    /// Height of the hills [m], 0 to 12.
    pub hill_m: f32,
    /// How far streets swing from straight lines [m], 0 to 5.
    pub bend_m: f32,
    /// Factor on the number of trees, bushes and hedges.
    pub vegetation: f32,
    /// Share of the kerbside slots that are taken, 0 to 1.
    pub parked: f32,
    /// More kinds of streets, blocks, houses, plants, vehicles and street furniture, with wider spreads.
    pub varied: bool,
    /// Share of the blocks of a varied town that are those of a city centre, 0 to 1: closed rows of high houses.
    pub centre: f32,
    /// Share of the blocks of a varied town that are open land, 0 to 1; its streets are wide and have no sidewalks.
    pub country: f32,
}

impl Default for Options {
    fn default() -> Self {
        Self::demo()
    }
}

impl Options {
    /// A short drive through traffic, over a hill and once round a block: the loop closes before the end.
    pub fn demo() -> Self {
        Self {
            seed: 1,
            frames: 260,
            interval_s: SCAN_S,
            sequence: "80".into(),
            threads: 0,
            overwrite: false,
            traffic: Traffic::Normal,
            route: Route::Block,
            speed_mps: 9.0,
            start_speed_mps: 7.0,
            sensor: SensorOptions::default(),
            town: TownOptions::default(),
        }
    }

    /// A long drive through a larger town, with several loops.
    pub fn town() -> Self {
        Self {
            frames: 1200,
            sequence: "81".into(),
            route: Route::Town,
            speed_mps: 10.0,
            town: TownOptions { blocks: [9, 9], block_length_m: [48.0, 90.0], ..TownOptions::default() },
            ..Self::demo()
        }
    }

    /// Refuses values that make no drive.
    pub fn check(&self) -> Result<(), SimulateError> {
        let (sensor, town) = (&self.sensor, &self.town);
        let refuse = |parameter, expected| Err(SimulateError::Parameter { parameter, expected });
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        match () {
            () if self.frames == 0 || self.frames > 1_000_000 => refuse("frames", "1 to 1000000"),
            () if self.sequence.is_empty() || !self.sequence.chars().all(plain) => {
                refuse("sequence", "letters, digits, - or _")
            }
            () if !(0.05..=10.0).contains(&self.interval_s) => refuse("interval_s", "0.05 to 10"),
            () if !(1.0..=20.0).contains(&self.speed_mps) => refuse("speed_mps", "1 to 20"),
            () if !(0.0..=self.speed_mps).contains(&self.start_speed_mps) => {
                refuse("start_speed_mps", "0 to speed_mps")
            }
            () => sensor.check().and_then(|()| town.check()),
        }
    }
}

impl SensorOptions {
    fn check(&self) -> Result<(), SimulateError> {
        let refuse = |parameter, expected| Err(SimulateError::Parameter { parameter, expected });
        match () {
            () if !(64..=8192).contains(&self.columns) => refuse("sensor.columns", "64 to 8192"),
            () if !(0.5..=4.0).contains(&self.height_m) => refuse("sensor.height_m", "0.5 to 4"),
            () if !(-10.0..=10.0).contains(&self.pitch_deg) => refuse("sensor.pitch_deg", "-10 to 10"),
            () if !(0.0..=0.5).contains(&self.range_noise_m) => refuse("sensor.range_noise_m", "0 to 0.5"),
            () if !(5.0..=120.0).contains(&self.max_range_m) => refuse("sensor.max_range_m", "5 to 120"),
            () if !(0.0..5.0).contains(&self.min_range_m) => refuse("sensor.min_range_m", "0 to 5"),
            () if !(0.0..=10.0).contains(&self.dropout) => refuse("sensor.dropout", "0 to 10"),
            () => Ok(()),
        }
    }
}

impl TownOptions {
    fn check(&self) -> Result<(), SimulateError> {
        let refuse = |parameter, expected| Err(SimulateError::Parameter { parameter, expected });
        let [short, long] = self.block_length_m;
        match () {
            () if self.blocks.iter().any(|n| !(4..=24).contains(n)) => {
                refuse("town.blocks", "4 to 24 in each direction")
            }
            () if !(short >= 36.0 && long >= short && long <= 200.0) => {
                refuse("town.block_length_m", "36 to 200, the shorter one first")
            }
            () if !(0.0..=12.0).contains(&self.hill_m) => refuse("town.hill_m", "0 to 12"),
            () if !(0.0..=5.0).contains(&self.bend_m) => refuse("town.bend_m", "0 to 5"),
            () if !(0.0..=5.0).contains(&self.vegetation) => refuse("town.vegetation", "0 to 5"),
            () if !(0.0..=1.0).contains(&self.parked) => refuse("town.parked", "0 to 1"),
            () if !(0.0..=1.0).contains(&self.centre) => refuse("town.centre", "0 to 1"),
            () if !(0.0..=1.0).contains(&self.country) => refuse("town.country", "0 to 1"),
            () => Ok(()),
        }
    }
}

impl Default for SensorOptions {
    fn default() -> Self {
        Self {
            columns: 2083,
            height_m: 1.73,
            pitch_deg: 0.3,
            range_noise_m: 0.02,
            max_range_m: 80.0,
            min_range_m: 1.0,
            dropout: 1.0,
            flaws: Flaws::default(),
        }
    }
}

impl Default for TownOptions {
    fn default() -> Self {
        Self {
            blocks: [7, 7],
            block_length_m: [38.0, 44.0],
            hill_m: 3.0,
            bend_m: 2.5,
            vegetation: 1.0,
            parked: 0.5,
            varied: false,
            centre: 0.0,
            country: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_accepted_and_nonsense_is_named() {
        assert!(Options::demo().check().is_ok() && Options::town().check().is_ok());
        let wrong = |change: fn(&mut Options)| {
            let mut options = Options::demo();
            change(&mut options);
            options.check().expect_err("must be refused").to_string()
        };
        assert!(wrong(|o| o.frames = 0).contains("frames"));
        assert!(wrong(|o| o.sequence = "../x".into()).contains("sequence"));
        assert!(wrong(|o| o.speed_mps = f64::NAN).contains("speed_mps"));
        assert!(wrong(|o| o.sensor.columns = 1).contains("sensor.columns"));
        assert!(wrong(|o| o.town.blocks = [1, 5]).contains("town.blocks"));
        assert!(wrong(|o| o.town.country = 1.5).contains("town.country"));
    }
}
