//! Tables for terminals.

use crate::terminal::{columns, folded};
use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Table, Width, presets};
use rohrpost::output::plain;
use std::time::Duration;

/// A plain table: a line of heads, then rows; a head that begins with `>` aligns its column to the right.
pub(crate) fn table<const N: usize>(heads: [&str; N], rows: impl IntoIterator<Item = [String; N]>) -> String {
    table_of(&heads, rows)
}

/// A plain table with a number of columns known at run time. Foreign text stays in its line; on a terminal it fits.
pub(crate) fn table_of<R: Into<Vec<String>>>(heads: &[impl AsRef<str>], rows: impl IntoIterator<Item = R>) -> String {
    fitted(heads, rows, columns())
}

/// A table at most so wide: texts are broken into several lines, numbers never; if that does not suffice, each row is a
/// paragraph. Nothing is left out.
fn fitted<R: Into<Vec<String>>>(
    heads: &[impl AsRef<str>],
    rows: impl IntoIterator<Item = R>,
    width: Option<usize>,
) -> String {
    let plain = |row: R| row.into().iter().map(|cell| plain::line(cell).into_owned()).collect::<Vec<_>>();
    let rows: Vec<Vec<String>> = rows.into_iter().map(plain).collect();
    let heads: Vec<Head<'_>> = heads.iter().map(|head| Head::of(head.as_ref())).collect();
    let content = |at: usize| rows.iter().filter_map(move |row| row.get(at)).map(|cell| cell.chars().count());
    let widths: Vec<usize> =
        heads.iter().enumerate().map(|(at, head)| head.width().max(content(at).max().unwrap_or(0))).collect();
    let whole = widths.iter().sum::<usize>() + GAP * heads.len().saturating_sub(1);
    let Some(excess) = width.map(|width| whole.saturating_sub(width)).filter(|excess| *excess > 0) else {
        return drawn(&heads, rows, &widths);
    };
    match narrowed(&heads, widths, excess) {
        Some(widths) => drawn(&heads, rows, &widths),
        None => paragraphs(&heads, &rows, width.unwrap_or(whole)),
    }
}

/// Blanks between columns.
const GAP: usize = 2;
/// A broken text has at least this width.
const TEXT_MIN: usize = 12;

struct Head<'a> {
    text: &'a str,
    is_number: bool,
}

impl<'a> Head<'a> {
    fn of(head: &'a str) -> Self {
        Self { text: head.trim_start_matches('>'), is_number: head.starts_with('>') }
    }

    fn width(&self) -> usize {
        self.text.chars().count()
    }
}

/// Takes so much from the widest texts; none if they would become too narrow.
fn narrowed(heads: &[Head<'_>], mut widths: Vec<usize>, excess: usize) -> Option<Vec<usize>> {
    for _ in 0..excess {
        let texts = widths.iter_mut().zip(heads).filter(|(_, head)| !head.is_number).map(|(width, _)| width);
        let widest = texts.max().filter(|width| **width > TEXT_MIN)?;
        *widest -= 1;
    }
    Some(widths)
}

fn drawn(heads: &[Head<'_>], rows: Vec<Vec<String>>, widths: &[usize]) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING).set_content_arrangement(ContentArrangement::Dynamic).set_width(u16::MAX);
    table.set_header(heads.iter().map(|head| head.text));
    table.add_rows(rows);
    for ((column, head), width) in table.column_iter_mut().zip(heads).zip(widths) {
        let (gap, width) = (GAP as u16, u16::try_from(*width).unwrap_or(u16::MAX));
        column.set_padding((0, gap));
        column.set_constraint(ColumnConstraint::Absolute(Width::Fixed(width.saturating_add(gap))));
        if head.is_number {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.lines().map(|line| format!("{}\n", line.trim_end())).collect()
}

/// Each row as its first cell, then the others with their heads.
fn paragraphs(heads: &[Head<'_>], rows: &[Vec<String>], width: usize) -> String {
    let mut text = String::new();
    for row in rows {
        let Some((first, others)) = row.split_first() else { continue };
        text += &format!("{first}\n");
        let others = others.iter().zip(heads.iter().skip(1)).filter(|(cell, _)| !cell.is_empty());
        let others: Vec<String> = others.map(|(cell, head)| format!("{} {cell}", head.text)).collect();
        text += &format!("{}\n", folded(&format!("  {}", others.join("  ")), Some(width)));
    }
    text
}

/// A short time in the unit that suits it.
pub(crate) fn time(time: Duration) -> String {
    let us = time.as_secs_f64() * 1e6;
    match us {
        us if us < 999.5 => format!("{us:.0} µs"),
        us if us < 9_995.0 => format!("{:.2} ms", us / 1e3),
        us if us < 999_500.0 => format!("{:.0} ms", us / 1e3),
        us => format!("{:.1} s", us / 1e6),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADS: [&str; 4] = ["module", ">waiting", "state", "last error"];

    fn rows() -> [Vec<String>; 2] {
        let long = "no answer from motor.0 within 20 ms, after three attempts, of which one was late";
        [["drive.0", "12", "error", long], ["motor.0", "0", "on", ""]].map(|row| row.map(String::from).to_vec())
    }

    fn words(text: &str) -> Vec<&str> {
        let mut words: Vec<&str> = text.split_whitespace().collect();
        words.sort_unstable();
        words
    }

    #[test]
    fn without_a_terminal_each_row_is_a_line() {
        let text = fitted(&HEADS, rows(), None);
        assert_eq!(text.lines().count(), 3, "{text}");
        assert!(text.lines().nth(1).unwrap().starts_with("drive.0       12  error  no answer"), "{text}");
        assert_eq!(fitted(&HEADS, rows(), Some(200)), text);
    }

    #[test]
    fn at_every_width_a_table_fits_and_loses_no_word() {
        let whole = fitted(&HEADS, rows(), None);
        for width in 14..130 {
            let text = fitted(&HEADS, rows(), Some(width));
            let widest = text.lines().map(|line| line.chars().count()).max().unwrap();
            assert!(widest <= width, "{widest} in {width}:\n{text}");
            if width >= 45 {
                assert_eq!(words(&text), words(&whole), "{width}:\n{text}");
            }
        }
    }

    #[test]
    fn a_very_narrow_terminal_gets_paragraphs() {
        let text = fitted(&HEADS, rows(), Some(36));
        assert!(text.starts_with("drive.0\n  waiting 12  state error  last\n"), "{text}");
    }
}
