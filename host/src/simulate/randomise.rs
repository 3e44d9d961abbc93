//! Draws drives that differ from each other as sensors and places do: what a network is to be trained on.

use super::{
    options::{Flaws, Options, Route, SensorOptions, TownOptions, Traffic},
    random::{Domain, Random},
};

impl Options {
    /// A drive of a seed's own: sensor, mount, streets, buildings, plants and traffic are drawn from wide ranges.
    ///
    /// The scans are a second apart, so that each of them shows another place.
    pub fn randomised(seed: u64) -> Self {
        let random = &mut Random::keyed(seed, Domain::Options, &[]);
        let speed_mps = f64::from(random.between(5.0, 10.0));
        Self {
            seed,
            frames: 12,
            interval_s: 1.0,
            sequence: format!("{seed:02}"),
            traffic: random.pick(&[Traffic::None, Traffic::Normal, Traffic::Heavy, Traffic::Heavy]),
            route: Route::Town,
            speed_mps,
            start_speed_mps: speed_mps,
            sensor: randomised_sensor(seed, random),
            town: randomised_town(random),
            ..Self::demo()
        }
    }
}

fn randomised_sensor(seed: u64, random: &mut Random) -> SensorOptions {
    SensorOptions {
        height_m: f64::from(random.between(1.5, 2.0)),
        pitch_deg: f64::from(random.between(-0.8, 1.0)),
        range_noise_m: random.pick(&[0.004, 0.006, 0.008, 0.012, 0.02]),
        dropout: random.pick(&[0.05, 0.15, 0.3, 1.0]),
        flaws: Flaws {
            device: seed,
            elevation_deg: random.between(0.0, 0.06),
            range_bias_m: random.between(0.0, 0.06),
            gain: random.between(0.0, 0.3),
            remission: random.between(0.7, 1.3),
            mixed: random.between(0.0, 0.4),
            streaks: random.chance(0.85),
            half_steps: random.chance(0.85),
            unmasked: random.chance(0.15),
            fading: random.between(0.0, 1.6),
            speckle: random.between(0.2, 0.6),
        },
        ..SensorOptions::default()
    }
}

fn randomised_town(random: &mut Random) -> TownOptions {
    let shortest = random.between(42.0, 80.0);
    let country = if random.chance(0.1) { random.between(0.85, 1.0) } else { 0.0 };
    TownOptions {
        blocks: [4, 4],
        block_length_m: [shortest, shortest + random.between(10.0, 50.0)],
        hill_m: random.between(0.0, 6.0),
        bend_m: random.between(0.0, 5.0),
        vegetation: random.pick(&[0.15, 0.3, 0.6, 1.0, 2.0]),
        parked: random.between(0.05, 0.8) * (1.0 - country),
        varied: true,
        centre: random.pick(&[0.0, 0.0, 0.1, 0.5, 0.8, 0.95, 1.0]),
        country,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_seed_makes_a_valid_drive_and_no_two_are_alike() {
        let drives: Vec<Options> = (0..200).map(Options::randomised).collect();
        for options in &drives {
            options.check().expect("valid");
        }
        for pair in drives.windows(2) {
            assert_ne!(pair[0].sensor, pair[1].sensor);
            assert_ne!(pair[0].town, pair[1].town);
        }
    }
}
