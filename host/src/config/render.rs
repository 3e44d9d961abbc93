//! Writes values into the commented file, so that what a run used reads like the defaults.

use toml::{Table, Value};

use super::merge::lookup;

/// `template` with the value behind each `key =` replaced by that of `values`; comments and order stay.
pub(super) fn fill(template: &str, values: &Table) -> String {
    let mut table = String::new();
    let mut text = String::new();
    for line in template.lines() {
        if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            table = format!("{name}.");
        }
        match key_of(line).and_then(|key| Some((key, lookup(values, &format!("{table}{key}"))?))) {
            Some((key, value)) => text.push_str(&format!("{key} = {}", literal(value))),
            None => text.push_str(line),
        }
        text.push('\n');
    }
    text
}

/// The key of a `key = value` line.
fn key_of(line: &str) -> Option<&str> {
    let (key, _) = line.split_once(" = ")?;
    key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_').then_some(key)
}

/// A value as TOML. Single-precision parameters are written with the digits that single precision has.
pub(super) fn literal(value: &Value) -> String {
    match value {
        Value::Float(v) if f64::from(*v as f32) == *v => format!("{:?}", *v as f32),
        Value::Float(v) => format!("{v:?}"),
        Value::Array(items) => format!("[{}]", items.iter().map(literal).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}
