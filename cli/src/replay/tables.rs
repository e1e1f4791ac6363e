//! Parts of a configuration, as TOML.

use rohrpost_config::StreamSpec;
use std::path::Path;
use toml::{Table, Value};

/// A stream, as a configuration says it.
pub(super) fn stream(spec: &StreamSpec) -> Table {
    let late = if spec.late.is_zero() { "refuse".into() } else { format!("{} ns", spec.late.as_nanos()) };
    table([
        ("record", format!("{} B", spec.record_bytes).into()),
        ("keep", Value::Integer(spec.keep.into())),
        ("readers", Value::Integer(spec.readers.into())),
        ("late", late.into()),
    ])
}

/// A section of which one list has only the entries that are kept.
pub(super) fn entries(section: &Table, key: &str, is_kept: impl Fn(&Value) -> bool) -> Table {
    let mut section = section.clone();
    if let Some(list) = section.get_mut(key).and_then(Value::as_array_mut) {
        list.retain(is_kept);
    }
    section
}

/// A section, or an empty one.
pub(super) fn table_of(source: &Table, key: &str) -> Table {
    source.get(key).and_then(Value::as_table).cloned().unwrap_or_default()
}

pub(super) fn table<const N: usize>(entries: [(&str, Value); N]) -> Table {
    entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

pub(super) fn text_of(path: &Path) -> Value {
    path.display().to_string().into()
}
