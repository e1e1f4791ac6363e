//! Quantities of data as text: names, units and meanings come from the fields of their types.

use crate::terminal::table::time;
use crate::terminal::units::{bytes, fine};
use rohrpost::schema::{Field, Schema, counters, quantities, quantity_fields};
use serde::Serialize;
use std::time::Duration;

/// The non-zero counters of a value in one cell: `3 lost, 1 damaged`.
pub(crate) fn counted<T: Schema + Serialize>(value: &T) -> String {
    let counted = counters(value).into_iter().filter(|(_, count)| *count > 0);
    let words: Vec<String> = counted.map(|(field, count)| format!("{count} {}", field.name)).collect();
    if words.is_empty() { "none".into() } else { words.join(", ") }
}

/// Heads for the quantities of a type, one word below the other, between those of other columns.
pub(crate) fn heads<T: Schema>(before: &[&str], after: &[&str]) -> Vec<String> {
    let quantities = quantity_fields::<T>().into_iter().map(|field| format!(">{}", words(&field).replace(' ', "\n")));
    let owned = |heads: &[&str]| heads.iter().map(ToString::to_string).collect::<Vec<_>>();
    owned(before).into_iter().chain(quantities).chain(owned(after)).collect()
}

/// The cells below such heads.
pub(crate) fn cells<T: Schema + Serialize>(
    before: impl IntoIterator<Item = String>,
    value: &T,
    after: impl IntoIterator<Item = String>,
) -> Vec<String> {
    let quantities = quantities(value).into_iter().map(|(field, value)| cell(&field, value));
    before.into_iter().chain(quantities).chain(after).collect()
}

/// What the quantities of a type mean, one a line.
pub(crate) fn legend<T: Schema>() -> String {
    let lines = quantity_fields::<T>().into_iter();
    lines.map(|field| format!("  {}: {}\n", words(&field), field.text)).collect()
}

/// A row for each quantity that is not 0 everywhere, and a column for each named value.
pub(crate) fn by_quantity<T: Schema + Serialize>(values: &[(&str, &T)]) -> Vec<Vec<String>> {
    let all: Vec<Vec<_>> = values.iter().map(|(_, value)| quantities(*value)).collect();
    let row = |(place, field): (usize, Field)| {
        let numbers: Vec<Option<u64>> = all.iter().map(|quantities| quantities.get(place)?.1).collect();
        let is_any = numbers.iter().any(|number| number.is_some_and(|number| number > 0));
        is_any.then(|| [words(&field)].into_iter().chain(numbers.into_iter().map(|n| cell(&field, n))).collect())
    };
    quantity_fields::<T>().into_iter().enumerate().filter_map(row).collect()
}

/// A field's name in words, without the unit of a time, which its cells have.
fn words(field: &Field) -> String {
    let name = ["_ns", "_ms"].iter().find_map(|unit| field.name.strip_suffix(unit)).unwrap_or(&field.name);
    name.replace('_', " ")
}

fn cell(field: &Field, value: Option<u64>) -> String {
    let Some(value) = value else { return "-".into() };
    match field.unit.as_str() {
        "ns" => fine(value as f64 * 1e-9),
        "ms" => time(Duration::from_millis(value)),
        "bytes" => bytes(value as f64),
        _ => value.to_string(),
    }
}
