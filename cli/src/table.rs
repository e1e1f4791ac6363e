//! Tables for terminals.

use super::units::{bytes, fine};
use comfy_table::{CellAlignment, Table, presets};
use rohrpost::output::plain;
use rohrpost::schema::{Field, Schema, counters, quantities, quantity_fields};
use serde::Serialize;
use std::time::Duration;

/// A plain table: a line of heads, then rows; a head that begins with `>` aligns its column to the right.
pub(super) fn table<const N: usize>(heads: [&str; N], rows: impl IntoIterator<Item = [String; N]>) -> String {
    table_of(&heads, rows)
}

/// The same with a number of columns known at run time. Foreign text stays in its line.
pub(super) fn table_of<R: Into<Vec<String>>>(heads: &[impl AsRef<str>], rows: impl IntoIterator<Item = R>) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(heads.iter().map(|head| head.as_ref().trim_start_matches('>')));
    let plain = |row: R| row.into().iter().map(|cell| plain::line(cell).into_owned()).collect::<Vec<_>>();
    table.add_rows(rows.into_iter().map(plain));
    for (column, head) in table.column_iter_mut().zip(heads) {
        column.set_padding((0, 2));
        if head.as_ref().starts_with('>') {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.lines().map(|line| format!("{}\n", line.trim_end())).collect()
}

/// The non-zero counters of a value in one cell: `3 lost, 1 damaged`.
pub(super) fn counted<T: Schema + Serialize>(value: &T) -> String {
    let counted = counters(value).into_iter().filter(|(_, count)| *count > 0);
    let words: Vec<String> = counted.map(|(field, count)| format!("{count} {}", field.name)).collect();
    if words.is_empty() { "none".into() } else { words.join(", ") }
}

/// Heads for the quantities of a type, one word below the other, between those of other columns.
pub(super) fn heads<T: Schema>(before: &[&str], after: &[&str]) -> Vec<String> {
    let quantities = quantity_fields::<T>().into_iter().map(|field| format!(">{}", words(&field).replace(' ', "\n")));
    let owned = |heads: &[&str]| heads.iter().map(ToString::to_string).collect::<Vec<_>>();
    owned(before).into_iter().chain(quantities).chain(owned(after)).collect()
}

/// The cells below such heads.
pub(super) fn cells<T: Schema + Serialize>(
    before: impl IntoIterator<Item = String>,
    value: &T,
    after: impl IntoIterator<Item = String>,
) -> Vec<String> {
    let quantities = quantities(value).into_iter().map(|(field, value)| cell(&field, value));
    before.into_iter().chain(quantities).chain(after).collect()
}

/// What the quantities of a type mean, one a line.
pub(super) fn legend<T: Schema>() -> String {
    let lines = quantity_fields::<T>().into_iter();
    lines.map(|field| format!("  {}: {}\n", words(&field), field.text)).collect()
}

/// A row for each quantity that is not 0 everywhere, and a column for each named value.
pub(super) fn by_quantity<T: Schema + Serialize>(values: &[(&str, &T)]) -> Vec<Vec<String>> {
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

/// A short time in the unit that suits it.
pub(super) fn time(time: Duration) -> String {
    let us = time.as_secs_f64() * 1e6;
    match us {
        us if us < 999.5 => format!("{us:.0} µs"),
        us if us < 9_995.0 => format!("{:.2} ms", us / 1e3),
        us if us < 999_500.0 => format!("{:.0} ms", us / 1e3),
        us => format!("{:.1} s", us / 1e6),
    }
}
