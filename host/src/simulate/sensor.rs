//! The Velodyne HDL-64E: where its rays go, and what it makes of their echoes.

use super::{
    options::{Flaws, SensorOptions},
    random::{Domain, Random},
    scene::{Echo, Finish},
    shape::Vec3,
};

/// Number of lasers.
pub const RINGS: usize = 64;

/// One laser.
#[derive(Clone, Copy, Debug)]
pub struct Laser {
    /// Elevation of its rays [deg].
    pub elevation_deg: f32,
    /// Height of its origin in the sensor frame [m].
    pub origin_m: f32,
    /// Factor on its remissions: no two lasers are alike.
    pub gain: f32,
    /// What it measures too far [m].
    pub bias_m: f32,
    /// What the own vehicle hides is shifted by this angle [deg]: the lasers sit side by side.
    pub shadow_deg: f32,
}

/// The lasers from top to bottom: two blocks, 1/3 and 1/2 deg apart, mounted one above the other.
pub fn lasers(flaws: &Flaws) -> [Laser; RINGS] {
    let random = &mut Random::keyed(flaws.device, Domain::Device, &[]);
    std::array::from_fn(|ring| {
        let (elevation_deg, origin_m) = if ring < 32 {
            (2.0 - ring as f32 / 3.0, 0.20)
        } else {
            (-8.83 - 0.506 * (ring - 32) as f32, 0.11)
        };
        let spread = (2.4 * ring as f32).sin();
        let gain = 1.0 + 0.15 * (5.3 * ring as f32).sin();
        Laser {
            elevation_deg: elevation_deg + flaws.elevation_deg * random.normal(),
            origin_m,
            gain: gain * flaws.remission * (flaws.gain * random.normal()).exp(),
            bias_m: flaws.range_bias_m * random.normal(),
            shadow_deg: 2.5 * spread,
        }
    })
}

/// A part of the own vehicle in the way of the rays: a sector that widens downwards.
struct Shadow {
    azimuth_deg: f32,
    half_width_deg: f32,
    below_deg: f32,
    widening: f32,
}

/// Roof at the back, bonnet, an aerial at the right, a rail at the left: about what KITTI's car hides.
const OWN_VEHICLE: [Shadow; 4] = [
    Shadow { azimuth_deg: 185.0, half_width_deg: 4.0, below_deg: -16.3, widening: 4.5 },
    Shadow { azimuth_deg: 0.0, half_width_deg: 2.0, below_deg: -21.8, widening: 6.0 },
    Shadow { azimuth_deg: 294.0, half_width_deg: 7.0, below_deg: -16.0, widening: 0.0 },
    Shadow { azimuth_deg: 136.0, half_width_deg: 4.0, below_deg: -20.0, widening: 0.0 },
];

/// True if the own vehicle is in the way of a ray of this laser at this azimuth (from x to y) [deg].
pub fn is_masked(azimuth_deg: f32, laser: &Laser) -> bool {
    OWN_VEHICLE.iter().any(|shadow| {
        let depth = shadow.below_deg - laser.elevation_deg;
        let off = (azimuth_deg + laser.shadow_deg - shadow.azimuth_deg + 180.0).rem_euclid(360.0) - 180.0;
        depth > 0.0 && off.abs() < shadow.half_width_deg + shadow.widening * depth
    })
}

/// What the sensor reports for an echo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Return {
    /// Measured range [m].
    pub range_m: f32,
    /// Remission, 0 to 0.99 in hundredths.
    pub remission: f32,
}

/// Measures an echo; `None` if it is lost or out of range. `streak` draws what a streak of rays has in common.
pub fn measure(
    options: &SensorOptions,
    laser: &Laser,
    direction: Vec3,
    echo: &Echo,
    random: &mut Random,
    streak: Option<f32>,
) -> Option<Return> {
    let slant = echo.hit.normal.dot(&direction).abs().clamp(0.0, 1.0);
    let (true_m, reflectance) = through_glass(echo, random, streak)?;
    if streak.is_some_and(|draw| is_swallowed(echo, slant, draw)) {
        return None;
    }
    if random.chance(loss(options, true_m, reflectance, slant)) {
        return None;
    }
    let spread = 1.0 + 0.5 * true_m / 80.0 + 0.4 * (1.0 - slant);
    let blades = if echo.surface.label == TERRAIN { 0.015 * random.normal() } else { 0.0 };
    // The time of a weak echo is uncertain, for a whole streak of a ring.
    let walk_m = streak.map_or(0.0, |draw| 0.14 * (draw - 0.5) * (-reflectance / 0.06).exp());
    let range_m = true_m + walk_m + laser.bias_m + options.range_noise_m * spread * random.normal() + blades;
    let seen = (options.min_range_m..options.max_range_m).contains(&range_m);
    let speckle = match echo.surface.label {
        VEGETATION => (0.5 + options.flaws.speckle).min(1.0),
        _ => options.flaws.speckle,
    };
    let remission = remission(echo.surface.finish, laser.gain * reflectance, slant, speckle, random);
    let remission = fade(options.flaws.fading, echo, remission, reflectance, slant, random);
    seen.then_some(Return { range_m, remission })
}

/// SemanticKITTI ids of grass and leaves.
const TERRAIN: u16 = 72;
const VEGETATION: u16 = 70;

/// Range [m] and reflectance of what sends the echo back; through glass it is often nothing.
fn through_glass(echo: &Echo, random: &mut Random, streak: Option<f32>) -> Option<(f32, f32)> {
    let plain = (echo.hit.range_m, echo.surface.reflectance);
    if echo.surface.finish != Finish::Glass {
        return Some(plain);
    }
    // Rooms are deeper than cars.
    let is_window = streak.is_some() && echo.surface.instance == 0;
    match streak.unwrap_or_else(|| random.unit()) {
        draw if is_window && (0.40..0.70).contains(&draw) => {
            Some((plain.0 + random.between(0.1, 1.8) * random.between(0.1, 1.8), 0.15))
        }
        draw if draw < 0.45 => None,
        draw if draw < 0.60 => Some((plain.0 + random.between(0.2, 1.4), 0.15)),
        _ => Some((plain.0, 0.12)),
    }
}

/// Dark, smooth paint mirrors most of the light away, for whole streaks of a ring.
fn is_swallowed(echo: &Echo, slant: f32, streak: f32) -> bool {
    const DARK: f32 = 0.05;
    echo.surface.instance != 0 && echo.surface.reflectance < DARK && streak > 0.5 + 0.5 * slant
}

/// Probability that an echo is too weak: it falls with the square of the range and with the slant.
fn loss(options: &SensorOptions, range_m: f32, reflectance: f32, slant: f32) -> f32 {
    let strength = reflectance * slant + 0.008;
    let weakness = 0.011 * (range_m / 50.0).powi(2) / strength;
    options.dropout * (0.012 + 1.0 - (-weakness).exp())
}

fn remission(finish: Finish, reflectance: f32, slant: f32, speckle: f32, random: &mut Random) -> f32 {
    let exact = if finish == Finish::Retro { 1.2 * reflectance } else { reflectance * (0.6 + 0.4 * slant) };
    let noisy = exact + random.normal() * speckle * (0.02 + 0.2 * exact);
    let quantised = (100.0 * noisy).round() / 100.0;
    let nothing = 0.02 + 0.8 * (-exact / 0.06).exp();
    if exact == 0.0 || random.chance(nothing) { 0.0 } else { quantised.clamp(0.0, 0.99) }
}

/// A remission as a device reports it that has little to spare for weak echoes.
fn fade(fading: f32, echo: &Echo, remission: f32, reflectance: f32, slant: f32, random: &mut Random) -> f32 {
    if fading == 0.0 {
        return remission;
    }
    let far = echo.hit.range_m / 50.0;
    // A leaf fills a part of the beam, as does what is thin and far.
    let filled = match echo.surface.label {
        VEGETATION => random.between(0.1, 1.0),
        // Ground, houses and fences.
        40..=51 | 60 | TERRAIN => 1.0,
        _ => random.between((1.0 - 1.5 * far).max(0.1), 1.0),
    };
    let weakness = fading * far * far / (reflectance * filled * (slant + 0.03) + 1e-3) / 8.0;
    if random.chance(1.0 - (-weakness.powi(3)).exp()) {
        return 0.0;
    }
    let share = 1.0 - fading.min(1.5) * (0.7 - 0.3 * filled) * (2.0 * far - 0.8).clamp(0.0, 1.0);
    (100.0 * remission * share).round().max(0.0) / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{random::Domain, scene::Surface, shape::Hit};

    fn echo(range_m: f32, reflectance: f32) -> Echo {
        Echo { hit: Hit { range_m, normal: -Vec3::x() }, surface: Surface::matte(50, reflectance) }
    }

    fn returns(range_m: f32, reflectance: f32) -> Vec<Return> {
        let options = SensorOptions::default();
        let shoot = |k| {
            let random = &mut Random::keyed(3, Domain::Ray, &[k]);
            let laser = Laser { gain: 1.0, ..lasers(&options.flaws)[0] };
            measure(&options, &laser, Vec3::x(), &echo(range_m, reflectance), random, None)
        };
        (0..4000).filter_map(shoot).collect()
    }

    #[test]
    fn elevations_fall_from_2_to_minus_25_degrees() {
        let lasers = lasers(&Flaws::default());
        assert!(lasers.windows(2).all(|pair| pair[0].elevation_deg > pair[1].elevation_deg + 0.3));
        assert_eq!(lasers[0].elevation_deg, 2.0);
        assert!((lasers[63].elevation_deg + 24.5).abs() < 0.4);
    }

    #[test]
    fn range_noise_has_the_size_of_the_options_and_no_bias() {
        let ranges: Vec<f32> = returns(10.0, 0.5).iter().map(|r| r.range_m - 10.0).collect();
        let mean = ranges.iter().sum::<f32>() / ranges.len() as f32;
        let sd = (ranges.iter().map(|e| (e - mean).powi(2)).sum::<f32>() / ranges.len() as f32).sqrt();
        assert!(mean.abs() < 0.002 && (0.019..0.024).contains(&sd), "mean {mean}, sd {sd}");
    }

    #[test]
    fn weak_and_far_echoes_are_lost_more_often() {
        let [near, far, dark] =
            [returns(10.0, 0.4), returns(70.0, 0.4), returns(70.0, 0.03)].map(|r| r.len());
        assert!(near > far && far > dark && dark > 0, "{near} {far} {dark}");
        assert!(returns(85.0, 0.5).is_empty());
    }

    #[test]
    fn own_vehicle_hides_only_low_rays() {
        let lasers = lasers(&Flaws::default());
        let hidden = |ring: usize| (0..360).filter(|a| is_masked(*a as f32, &lasers[ring])).count();
        assert_eq!(hidden(40), 0);
        assert!((10..60).contains(&hidden(50)), "{}", hidden(50));
        assert!((80..170).contains(&hidden(63)), "{}", hidden(63));
    }
}
