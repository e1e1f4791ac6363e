//! The table's columns: their text, their sort order, and which ones a narrow terminal drops first.

use super::model::Row;
use crate::terminal::units;
use rohrpost::output::plain;
use rohrpost_launch::survey::Standing;
use std::cmp::Ordering;

/// What a column shows of a module.
enum Content {
    /// Text, sorted as such.
    Text(fn(&Row) -> String),
    /// Text, sorted by a rank.
    Ranked(fn(&Row) -> String, fn(&Row) -> usize),
    /// A number, if it is known, and its text; the greatest comes first.
    Number(fn(&Row) -> Option<f64>, fn(f64) -> String),
}

use Content::{Number, Ranked, Text};

/// All that is known of a column.
struct About {
    head: &'static str,
    text: &'static str,
    /// Fixed, so that nothing moves as numbers change.
    width: u16,
    /// Narrow terminals drop the greatest first; 0 is always shown.
    rank: u8,
    content: Content,
}

/// Declares the columns from left to right: head, width, rank, content, and the text for help and book.
macro_rules! columns {
    ($($name:ident: $head:literal, $width:expr, $rank:literal, $content:expr, $text:literal;)+) => {
        #[derive(Clone, Copy, PartialEq, Eq, Debug)]
        pub(super) enum Column {
            $($name,)+
        }

        impl Column {
            /// From left to right.
            pub(super) const ALL: [Self; [$($rank),+].len()] = [$(Self::$name),+];

            const fn about(self) -> About {
                match self {
                    $(Self::$name => About {
                        head: $head,
                        text: $text,
                        width: $width,
                        rank: $rank,
                        content: $content,
                    },)+
                }
            }
        }
    };
}

columns! {
    Module: "module", NAME_MIN, 0, Text(|row| row.line.module.clone()),
        "name, and with + the number of its further names";
    Node: "node", 8, 2, Text(|row| row.line.node.clone()), "where it runs; shown when there are several nodes";
    State: "state", 8, 1,
        Ranked(|row| row.line.account.state.to_string(), |row| row.line.account.state.severity()),
        "starting, on, off, stopped; standby: another node runs it; error; busy: its code does not return; restarting; \
         failed: given up; unreachable";
    Class: "class", 7, 16, Text(|row| row.class.clone()), "its class, which gives its importance";
    Priority: "prio", 4, 11, Number(|row| Some(row.line.priority.into()), whole),
        "class id = priority of its commands, 255 most urgent";
    Scheduling: "sched", 7, 10, Text(|row| row.line.scheduling.clone()),
        "as the kernel has it: fifo 1..99, or nice";
    In: "in/s", 6, 3, Number(|row| row.line.received_per_s, short), "packages received a second";
    Out: "out/s", 6, 6, Number(|row| row.sent_per_s, short), "packages sent a second";
    Waiting: "wait", 5, 5, Number(|row| Some(row.line.waiting.into()), whole),
        "packages that wait in its mailboxes now";
    Lost: "lost", 6, 4, Number(|row| Some(row.line.losses.lost as f64), short),
        "packages lost in its mailboxes so far";
    P50: "p50", 7, 13, Number(|row| row.waited_p50_s, units::short),
        "half of the packages of the interval waited at most this long";
    P99: "p99", 7, 7, Number(|row| row.waited_p99_s, units::short), "99 of 100 waited at most this long";
    Restarts: "rst", 4, 9, Number(|row| Some(row.line.account.restarts.into()), whole),
        "how often launch has restarted it";
    Cpu: "cpu%", 6, 8, Number(|row| row.cpu_percent, |percent| format!("{percent:.1}")), "of one processor";
    Memory: "memory", 6, 12, Number(|row| row.memory_bytes.map(|bytes| bytes as f64), memory),
        "resident, mailboxes included";
    Pid: "pid", 7, 15, Number(|row| row.line.pid.map(f64::from), whole), "process";
    Why: "why", 16, 14, Text(why), "the last error, or the causes of losses";
}

/// Space between columns.
const GAP: u16 = 1;
/// Narrowest and widest column of names.
const NAME_MIN: u16 = 12;
const NAME_MAX: u16 = 34;

impl Column {
    pub(super) const fn head(self) -> &'static str {
        self.about().head
    }

    /// Its meaning, for the help and the book.
    pub(super) const fn text(self) -> &'static str {
        self.about().text
    }

    const fn width(self) -> u16 {
        self.about().width
    }

    /// Numbers are aligned to the right.
    pub(super) const fn is_number(self) -> bool {
        matches!(self.about().content, Number(..))
    }

    /// In order of importance; the first is always shown.
    fn by_importance() -> [Self; Self::ALL.len()] {
        let mut all = Self::ALL;
        all.sort_by_key(|column| column.about().rank);
        all
    }

    /// Its text for a module.
    pub(super) fn cell(self, row: &Row) -> String {
        match self.about().content {
            Text(text) | Ranked(text, _) => text(row),
            Number(number, text) => number(row).map_or("-".into(), text),
        }
    }

    /// The order of two modules by this column: what needs attention comes first.
    pub(super) fn compare(self, a: &Row, b: &Row) -> Ordering {
        match self.about().content {
            Text(text) => text(a).cmp(&text(b)),
            Ranked(_, rank) => rank(a).cmp(&rank(b)),
            Number(number, _) => number(b).unwrap_or(-1.0).total_cmp(&number(a).unwrap_or(-1.0)),
        }
    }
}

fn whole(number: f64) -> String {
    format!("{number:.0}")
}

/// Why it does not work; else the causes of its losses, or the last error. Replaced packages are no loss.
fn why(row: &Row) -> String {
    let account = &row.line.account;
    let losses = row.line.losses.lost_by_cause.iter().map(|(cause, lost)| format!("{lost} {cause}"));
    let losses = losses.collect::<Vec<_>>().join(", ");
    let is_well = matches!(account.state, Standing::On | Standing::Off);
    if is_well && !losses.is_empty() {
        losses
    } else {
        account.error.as_deref().map_or(losses, |error| plain::line(error).into_owned())
    }
}

/// A number in at most five characters.
pub(super) fn short(number: f64) -> String {
    match number {
        n if n <= 0.0 => "0".into(),
        n if n < 9.95 => format!("{n:.1}").replace(".0", ""),
        n if n < 99_999.5 => format!("{n:.0}"),
        n if n < 9_999_500.0 => format!("{:.0}k", n / 1e3),
        n => format!("{:.0}M", n / 1e6),
    }
}

/// Bytes in at most six characters.
pub(super) fn memory(bytes: f64) -> String {
    let mib = bytes / f64::from(1 << 20);
    match mib {
        mib if mib < 99.95 => format!("{mib:.1}M"),
        mib if mib < 9_999.5 => format!("{mib:.0}M"),
        mib => format!("{:.0}G", mib / 1024.0),
    }
}

/// The columns that fit into this width, with their widths, from left to right. `names` is the length of the longest
/// name; `nodes`: whether there are several.
pub(super) fn fit(room: u16, names: u16, nodes: bool) -> Vec<(Column, u16)> {
    let names = names.clamp(NAME_MIN, NAME_MAX);
    let mut chosen = Vec::new();
    let mut used = 0;
    for column in Column::by_importance().into_iter().filter(|column| nodes || *column != Column::Node) {
        let width = column.width() + if chosen.is_empty() { 0 } else { GAP };
        // The first column that does not fit ends the list: a less important one never replaces a more important one.
        if used + width > room && !chosen.is_empty() {
            break;
        }
        used += width;
        chosen.push(column);
    }
    let spare = room.saturating_sub(used);
    let for_names = spare.min(names - NAME_MIN);
    let width = |column| match column {
        Column::Module => (NAME_MIN + for_names).min(room),
        Column::Why => column.width() + spare - for_names,
        _ => column.width(),
    };
    Column::ALL.into_iter().filter(|column| chosen.contains(column)).map(|column| (column, width(column))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_short_at_every_size() {
        for (number, text) in [
            (-1.0, "0"),
            (0.0, "0"),
            (0.04, "0"),
            (0.5, "0.5"),
            (3.0, "3"),
            (9.94, "9.9"),
            (9.96, "10"),
            (99_999.0, "99999"),
            (100_000.0, "100k"),
            (9_999_499.0, "9999k"),
            (9_999_500.0, "10M"),
            (9.9e9, "9900M"),
        ] {
            assert_eq!(short(number), text);
        }
        for (bytes, text) in [(0, "0.0M"), (12_345_678, "11.8M"), (512 << 20, "512M"), (64_u64 << 30, "64G")] {
            assert_eq!(memory(bytes as f64), text);
        }
    }

    #[test]
    fn narrow_terminals_keep_the_important_columns() {
        for room in 0..200 {
            let columns = fit(room, 20, true);
            let used: u16 = columns.iter().map(|(_, width)| width + GAP).sum::<u16>() - GAP;
            assert!(used <= room.max(1), "{used} in {room}: {columns:?}");
            let kept = columns.len();
            let most_important = &Column::by_importance()[..kept];
            assert!(columns.iter().all(|(column, _)| most_important.contains(column)), "{room}: {columns:?}");
        }
        assert_eq!(fit(21, 20, true).iter().map(|(c, _)| *c).collect::<Vec<_>>(), [Column::Module, Column::State]);
        assert_eq!(fit(168, 20, true).len(), Column::ALL.len());
        assert_eq!(fit(160, 20, false).len(), Column::ALL.len() - 1);
    }
    #[test]
    fn each_rank_is_given_once() {
        let ranks: Vec<usize> = Column::by_importance().iter().map(|column| column.about().rank.into()).collect();
        assert_eq!(ranks, (0..Column::ALL.len()).collect::<Vec<_>>());
    }
}
