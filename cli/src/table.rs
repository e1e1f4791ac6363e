//! Tables for terminals.

use comfy_table::{CellAlignment, Table, presets};
use rohrpost::output::plain;
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
