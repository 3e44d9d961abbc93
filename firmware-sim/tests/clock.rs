//! The sensor's clock: set, late, paused, counting anew.

use sdslam_firmware_sim::{ScanHeader, SensorClock};

/// A scan as it arrives: its number, its stamp \[s\], when \[ms\].
type Arrival = (u32, f64, u64);

/// The stamps used, and how far the clock was found to be set.
fn steady(arrivals: &[Arrival]) -> Vec<(f64, Option<f64>)> {
    let mut clock = SensorClock::default();
    let scan = |&(sequence, stamp_s, at_ms): &Arrival| {
        clock.steady(&ScanHeader { sequence, stamp_s, points: 0 }, at_ms * 1000)
    };
    arrivals.iter().map(scan).collect()
}

fn assert_untouched(arrivals: &[Arrival]) {
    let untouched: Vec<_> = arrivals.iter().map(|(_, stamp_s, _)| (*stamp_s, None)).collect();
    assert_eq!(steady(arrivals), untouched);
}

fn assert_steps(arrivals: &[Arrival], steps_s: &[f64]) {
    let stamps_s: Vec<f64> = steady(arrivals).iter().map(|(stamp_s, _)| *stamp_s).collect();
    let found: Vec<f64> = stamps_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(found.iter().zip(steps_s).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
    assert_eq!(found.len(), steps_s.len());
}

#[test]
fn late_and_bunched_scans_keep_their_stamps() {
    assert_untouched(&[(0, 5.0, 0), (1, 5.1, 290), (2, 5.2, 290), (3, 5.3, 300), (4, 5.4, 620)]);
}

#[test]
fn a_pause_and_missing_scans_keep_their_stamps() {
    assert_untouched(&[(0, 5.0, 0), (1, 5.1, 100), (2, 6.3, 1300), (3, 6.4, 1400), (7, 6.8, 1800)]);
    let wraps = u32::MAX;
    assert_untouched(&[(wraps - 1, 5.0, 0), (wraps, 5.1, 100), (0, 5.2, 200), (1, 5.3, 300)]);
}

#[test]
fn a_clock_that_is_set_is_found_however_little() {
    for by_s in [-1000.0, -0.3, -0.15, -0.08, 0.08, 0.15, 0.3, 1000.0] {
        let set = |stamp_s: f64| stamp_s + by_s;
        let arrivals = [(0, 5.0, 0), (1, 5.1, 100), (2, 5.2, 200), (3, set(5.3), 310), (5, set(5.5), 480)];
        assert_steps(&arrivals, &[0.1, 0.1, 0.1, 0.2]);
        let found: Vec<f64> = steady(&arrivals).iter().filter_map(|(_, set_s)| *set_s).collect();
        assert!(matches!(found[..], [found] if (found - by_s).abs() < 1e-6), "{by_s}: {found:?}");
    }
}

#[test]
fn set_while_scans_were_missing_or_the_sensor_paused() {
    assert_steps(&[(0, 5.0, 0), (1, 5.1, 100), (5, 9.0, 520)], &[0.1, 0.4]);
    assert_steps(&[(0, 5.0, 0), (1, 5.1, 100), (2, 9.0, 1300)], &[0.1, 1.2]);
}

#[test]
fn a_sensor_that_starts_anew_goes_on_by_the_boards_clock() {
    assert_steps(&[(70, 99.0, 0), (71, 99.1, 100), (0, 0.0, 900), (1, 0.1, 1000)], &[0.1, 0.8, 0.1]);
}

#[test]
fn a_late_scan_is_never_newer_whatever_its_stamp() {
    // The clock was set back before scan 3; scan 2, which comes behind it, still has a stamp of before.
    let arrivals = [(0, 50.0, 0), (1, 50.1, 100), (3, 0.3, 300), (2, 50.2, 300), (4, 0.4, 400)];
    let stamps_s: Vec<f64> = steady(&arrivals).iter().map(|(stamp_s, _)| *stamp_s).collect();
    assert!(stamps_s[3] <= stamps_s[2], "{stamps_s:?}");
    assert!((stamps_s[4] - stamps_s[2] - 0.1).abs() < 1e-6, "{stamps_s:?}");
}
