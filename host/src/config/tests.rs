use std::path::Path;

use super::*;

const FILE: &str = "my.toml";

fn parse(text: &str) -> Result<HostConfig, ConfigError> {
    HostConfig::parse(text, Path::new(FILE), None)
}

fn refusal(text: &str) -> String {
    let error = parse(text).expect_err("must be refused");
    let cause = std::error::Error::source(&error).map_or_else(String::new, |cause| format!(": {cause}"));
    format!("{error}{cause}")
}

#[test]
fn the_file_that_is_printed_holds_the_defaults() {
    let printed = HostConfig::default().render();
    let pairs = printed.lines().zip(DEFAULT_FILE.lines());
    let stale: Vec<_> = pairs.filter(|(now, file)| now != file).collect();
    let remake = "sdslam config > new.toml && mv new.toml host/src/config/default.toml";
    assert!(stale.is_empty(), "default.toml is stale (now, file): {stale:#?}; remake it with\n{remake}");
    assert_eq!(parse(DEFAULT_FILE).expect("valid"), HostConfig::default());
}

#[test]
fn the_file_holds_every_key_and_each_has_a_comment() {
    fn keys(prefix: &str, table: &Table) -> Vec<String> {
        let key = |(name, value): (&String, &toml::Value)| match value.as_table() {
            Some(inner) => keys(&format!("{prefix}{name}."), inner),
            None => vec![format!("{prefix}{name}")],
        };
        table.iter().flat_map(key).collect()
    }
    let mut commented = Vec::new();
    let (mut table, mut previous) = (String::new(), "");
    for line in DEFAULT_FILE.lines() {
        if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            table = format!("{name}.");
        } else if let Some((key, _)) = line.split_once(" = ").filter(|_| !line.starts_with('#')) {
            assert!(previous.starts_with("# "), "{table}{key} has no comment");
            commented.push(format!("{table}{key}"));
        }
        previous = line;
    }
    let all = keys("", &HostConfig::default().to_table());
    let missing: Vec<_> = all.iter().filter(|key| !commented.contains(key)).collect();
    let gone: Vec<_> = commented.iter().filter(|key| !all.contains(key)).collect();
    assert!(missing.is_empty() && gone.is_empty(), "default.toml lacks {missing:?} and has still {gone:?}");
}

#[test]
fn what_is_printed_for_a_preset_reads_back_as_the_preset() {
    for preset in [Preset::Accurate, Preset::Paper] {
        let config = HostConfig::of_preset(preset);
        assert_eq!(parse(&config.render()).expect("valid"), config);
    }
}

#[test]
fn a_partial_file_changes_what_it_names_only() {
    let config = parse("[map]\nvoxel_m = 1\n").expect("valid");
    let expected = MapConfig { voxel_m: 1.0, ..MapConfig::default() };
    assert_eq!(config, HostConfig { map: expected, ..HostConfig::default() });
    assert_eq!(parse("").expect("valid"), HostConfig::default());
}

#[test]
fn the_preset_comes_from_the_command_line_then_the_file_then_the_default() {
    let file = "preset = \"paper\"\n";
    assert_eq!(parse(file).expect("valid").preset, Preset::Paper);
    let asked = HostConfig::parse(file, Path::new(FILE), Some(Preset::Accurate));
    assert_eq!(asked.expect("valid"), HostConfig::default());
}

#[test]
fn unknown_keys_are_refused_with_file_key_and_what_is_known() {
    let text = refusal("[map]\nvoxels = 3\n");
    assert!(text.contains(FILE) && text.contains("`map.voxels`") && text.contains("voxel_m"), "{text}");
    let text = refusal("[mapp]\nvoxel_m = 0.3\n");
    assert!(text.contains("`mapp`") && text.contains("input"), "{text}");
}

#[test]
fn values_that_do_not_fit_are_refused_with_file_and_key() {
    for (text, key, said) in [
        ("[map]\nvoxel_m = \"big\"", "map.voxel_m", "of type float, not string"),
        ("[input]\ndeskew = 1", "input.deskew", "of type boolean, not integer"),
        ("map = 3", "map", "of type table, not integer"),
        ("[map]\nmin_points = -1", "map.min_points", "-1"),
        ("[map]\nvoxel_m = 0.0", "map.voxel_m", "between 0.01 and 10, found 0.0"),
        ("[map]\nvoxel_m = nan", "map.voxel_m", "found NaN"),
        ("[input]\nelevation_correction_deg = 90", "input.elevation_correction_deg", "found 90.0"),
        ("preset = \"best\"", "preset", "best"),
        ("[map", "map", "line 1"),
    ] {
        let refusal = refusal(text);
        let named = [FILE, key, said].iter().all(|part| refusal.contains(part));
        assert!(named, "{text} gives {refusal}");
    }
}
