//! Lays a partial table over a complete one.

use toml::{Table, Value};

use super::error::KeyFault;

/// Replaces the values of `base` by those of `user`; every key of `user` must exist in `base` with the same type.
pub(super) fn lay_over(base: &mut Table, user: &Table) -> Result<(), KeyFault> {
    lay_over_at("", base, user)
}

fn lay_over_at(path: &str, base: &mut Table, user: &Table) -> Result<(), KeyFault> {
    for (name, value) in user {
        let key = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        if !base.contains_key(name) {
            return Err(KeyFault::Unknown { key, siblings: base.keys().cloned().collect() });
        }
        match (&mut base[name], value) {
            (Value::Table(base), Value::Table(user)) => lay_over_at(&key, base, user)?,
            (slot @ Value::Float(_), Value::Integer(whole)) => *slot = Value::Float(*whole as f64),
            (slot, value) if slot.same_type(value) => *slot = value.clone(),
            (slot, value) => {
                return Err(KeyFault::WrongType { key, expected: slot.type_str(), found: value.type_str() });
            }
        }
    }
    Ok(())
}

/// The value of a dotted key.
pub(super) fn lookup<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    match key.split_once('.') {
        Some((name, rest)) => lookup(table.get(name)?.as_table()?, rest),
        None => table.get(key),
    }
}
