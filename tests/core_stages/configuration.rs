//! What a configuration may hold, and that the core survives all of it.

use sdslam_core::{Config, LabelledScan, Odometry};
use sdslam_tests::drive::{Drive, pose_on_street};
use sdslam_tests::odometry::on_heap;
use sdslam_tests::street::street;
use sdslam_tests::world::Lidar;

#[test]
fn a_wrong_parameter_is_named() {
    type Spoil = fn(&mut Config);
    let wrong: [(&str, Spoil); 16] = [
        ("label_filter.min_range_m", |c| c.label_filter.min_range_m = 0.0),
        ("label_filter.max_range_m", |c| c.label_filter.max_range_m = 1.0),
        ("label_filter.small_cell_m", |c| c.label_filter.small_cell_m = f32::NAN),
        ("instances.radius_per_range", |c| c.instances.radius_per_range = -0.1),
        ("instances.*.radius_m", |c| c.instances.car.radius_m = 0.0),
        ("instances.*.min_points", |c| c.instances.fence.min_points = 0),
        ("preliminary_pose.enough_quadrants", |c| c.preliminary_pose.enough_quadrants = 5),
        ("motion_state", |c| c.motion_state.vehicle.gate_m = f32::NAN),
        ("precise_pose.horizontal", |c| c.precise_pose.dense.enabled = false),
        ("precise_pose.voxels.voxel_m", |c| c.precise_pose.voxels.voxel_m = 0.01),
        ("precise_pose.dense.max_iterations", |c| c.precise_pose.dense.max_iterations = 0),
        ("loop_closure.column_m", |c| c.loop_closure.column_m = 0.0),
        ("loop_closure.neighbours", |c| c.loop_closure.neighbours = 13),
        ("loop_closure.side_tolerance_m", |c| c.loop_closure.side_tolerance_m = f32::NAN),
        ("loop_closure.bow3d.min_matches", |c| c.loop_closure.bow3d.min_matches = 2),
        ("swarm.particles", |c| c.precise_pose.hulls.swarm.particles = 65),
    ];
    for (name, spoil) in wrong {
        let mut config = Config::accurate();
        spoil(&mut config);
        let error = config.check().expect_err(name);
        assert!(error.parameter.contains(name), "{error} should name {name}");
        assert!(error.to_string().contains(error.expected));
    }
    assert_eq!((Config::accurate().check(), Config::paper().check()), (Ok(()), Ok(())));
    assert_eq!(Config::default(), Config::accurate());
}

/// A number of the configuration: its name, and its place in the table.
fn numbers(table: &toml::Value, path: &str) -> Vec<String> {
    match table {
        toml::Value::Table(table) => {
            table.iter().flat_map(|(key, value)| numbers(value, &format!("{path}.{key}"))).collect()
        }
        toml::Value::Float(_) | toml::Value::Integer(_) => vec![path.trim_start_matches('.').to_owned()],
        _ => Vec::new(),
    }
}

/// The configuration with one number replaced; `None` where the type forbids it.
fn replaced(config: &Config, name: &str, value: &toml::Value) -> Option<Config> {
    let mut table = toml::Value::try_from(config).expect("a configuration is a table");
    let place = name.split('.').fold(&mut table, |at, key| at.get_mut(key).expect("the name is a place"));
    *place = value.clone();
    table.try_into().ok()
}

/// All configurations with one number replaced by `value` that are accepted.
fn accepted(config: &Config, value: &toml::Value) -> Vec<(String, Config)> {
    let table = toml::Value::try_from(config).expect("a configuration is a table");
    let names = numbers(&table, "");
    assert!(names.len() > 80, "{} numbers", names.len());
    let with_value =
        names.into_iter().filter_map(|name| Some((name.clone(), replaced(config, &name, value)?)));
    with_value.filter(|(_, config)| config.check().is_ok()).collect()
}

#[test]
fn no_parameter_may_be_nan() {
    let names: Vec<String> =
        accepted(&Config::accurate(), &f64::NAN.into()).into_iter().map(|(name, _)| name).collect();
    assert!(names.is_empty(), "{names:?}");
}

#[test]
fn the_work_of_a_frame_is_bounded() {
    let endless = accepted(&Config::accurate(), &4_000_000_000i64.into());
    let names: Vec<&String> = endless
        .iter()
        .map(|(name, _)| name)
        .filter(|n| n.contains("iterations") || n.contains("evaluations"))
        .collect();
    assert!(names.is_empty(), "{names:?}");
}

#[test]
fn whatever_is_accepted_does_not_stop_the_core() {
    let poses = [0.0, 0.8, 1.6].map(|x| pose_on_street(x, -1.2, 0.0));
    let lidar = Lidar { columns: 120, beams: 24, noise_m: 0.02 };
    let drive = Drive::record(&street(10.0, 7), &lidar, &poses);
    let values: [toml::Value; 3] = [f64::NAN.into(), (-1.0).into(), 0.into()];
    let mut tried = 0;
    for (value, preset) in values.iter().flat_map(|v| [(v, Config::accurate()), (v, Config::paper())]) {
        for (name, config) in accepted(&preset, value) {
            tried += 1;
            let mut odometry: Box<Odometry<4096, 256, 64, 16, 512, 64>> = on_heap(config);
            for frame in &drive.frames {
                let mut points = frame.points.clone();
                let scan = &mut LabelledScan { stamp_s: frame.stamp_s, points: &mut points };
                let estimate = odometry.process_scan(scan).expect("the stamps are in order");
                let t = estimate.map_from_sensor.translation.vector;
                assert!(t.iter().all(|v| v.is_finite()), "{name} = {value}: {t}");
            }
        }
    }
    assert!(tried > 50, "{tried}");
}
