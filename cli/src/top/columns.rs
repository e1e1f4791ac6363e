//! The table's columns: their text, their sort order, and which ones a narrow terminal drops first.

use super::super::units;
use super::model::Row;
use rohrpost::output::plain;
use rohrpost::survey::Standing;
use std::cmp::Ordering;

/// A column.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Column {
    Module,
    Node,
    State,
    Class,
    Priority,
    Scheduling,
    In,
    Out,
    Waiting,
    Lost,
    P50,
    P99,
    Restarts,
    Cpu,
    Memory,
    Pid,
    Why,
}

/// Space between columns.
const GAP: u16 = 1;
/// Narrowest and widest column of names.
const NAME_MIN: u16 = 12;
const NAME_MAX: u16 = 34;

impl Column {
    /// From left to right.
    pub(super) const ALL: [Self; 17] = [
        Self::Module,
        Self::Node,
        Self::State,
        Self::Class,
        Self::Priority,
        Self::Scheduling,
        Self::In,
        Self::Out,
        Self::Waiting,
        Self::Lost,
        Self::P50,
        Self::P99,
        Self::Restarts,
        Self::Cpu,
        Self::Memory,
        Self::Pid,
        Self::Why,
    ];

    /// In order of importance; the first is always shown.
    const BY_IMPORTANCE: [Self; 17] = [
        Self::Module,
        Self::State,
        Self::Node,
        Self::In,
        Self::Lost,
        Self::Waiting,
        Self::Out,
        Self::P99,
        Self::Cpu,
        Self::Restarts,
        Self::Scheduling,
        Self::Priority,
        Self::Memory,
        Self::P50,
        Self::Why,
        Self::Pid,
        Self::Class,
    ];

    pub(super) const fn head(self) -> &'static str {
        match self {
            Self::Module => "module",
            Self::Node => "node",
            Self::State => "state",
            Self::Class => "class",
            Self::Priority => "prio",
            Self::Scheduling => "sched",
            Self::In => "in/s",
            Self::Out => "out/s",
            Self::Waiting => "wait",
            Self::Lost => "lost",
            Self::P50 => "p50",
            Self::P99 => "p99",
            Self::Restarts => "rst",
            Self::Cpu => "cpu%",
            Self::Memory => "memory",
            Self::Pid => "pid",
            Self::Why => "why",
        }
    }

    /// Its meaning, for the help.
    pub(super) const fn text(self) -> &'static str {
        match self {
            Self::Module => "name, and with + the number of its further names",
            Self::Node => "where it runs; shown when there are several nodes",
            Self::State => {
                "starting, on, off, stopped; error; busy: its code does not return; restarting; failed: given up; \
                 unreachable"
            }
            Self::Class => "its class, which gives its importance",
            Self::Priority => "class id = priority of its commands, 255 most urgent",
            Self::Scheduling => "as the kernel has it: fifo 1..99, or nice",
            Self::In => "packages received a second",
            Self::Out => "packages sent a second",
            Self::Waiting => "packages that wait in its mailboxes now",
            Self::Lost => "packages lost in its mailboxes so far",
            Self::P50 => "half of the packages of the interval waited at most this long",
            Self::P99 => "99 of 100 waited at most this long",
            Self::Restarts => "how often launch has restarted it",
            Self::Cpu => "of one processor",
            Self::Memory => "resident, mailboxes included",
            Self::Pid => "process",
            Self::Why => "the last error, or the causes of losses",
        }
    }

    /// Its width. Fixed, so that nothing moves as numbers change.
    const fn width(self) -> u16 {
        match self {
            Self::Module => NAME_MIN,
            Self::State | Self::Node => 8,
            Self::Class | Self::Pid => 7,
            Self::Priority | Self::Restarts => 4,
            Self::Scheduling => 7,
            Self::In | Self::Out | Self::Lost | Self::Cpu => 6,
            Self::Waiting => 5,
            Self::Memory => 6,
            Self::P50 | Self::P99 => 7,
            Self::Why => 16,
        }
    }

    /// Numbers are aligned to the right.
    pub(super) const fn is_number(self) -> bool {
        !matches!(self, Self::Module | Self::Node | Self::State | Self::Class | Self::Scheduling | Self::Why)
    }

    /// Its text for a module.
    pub(super) fn cell(self, row: &Row) -> String {
        let number = |number: Option<f64>| number.map_or("-".into(), short);
        let waited = |seconds: Option<f64>| seconds.map_or("-".into(), units::short);
        match self {
            Self::Module => row.line.module.clone(),
            Self::Node => row.line.node.clone(),
            Self::State => row.line.account.state.to_string(),
            Self::Class => row.class.clone(),
            Self::Priority => row.line.priority.to_string(),
            Self::Scheduling => row.line.scheduling.clone(),
            Self::In => number(row.line.received_per_s),
            Self::Out => number(row.sent_per_s),
            Self::Waiting => row.line.waiting.to_string(),
            Self::Lost => short(row.line.losses.lost as f64),
            Self::P50 => waited(row.waited_p50_s),
            Self::P99 => waited(row.waited_p99_s),
            Self::Restarts => row.line.account.restarts.to_string(),
            Self::Cpu => row.cpu_percent.map_or("-".into(), |percent| format!("{percent:.1}")),
            Self::Memory => row.memory_bytes.map_or("-".into(), memory),
            Self::Pid => row.line.pid.map_or("-".into(), |pid| pid.to_string()),
            Self::Why => why(row),
        }
    }

    /// The order of two modules by this column: what needs attention comes first.
    pub(super) fn compare(self, a: &Row, b: &Row) -> Ordering {
        let state = |row: &Row| row.line.account.state;
        let number = |of: fn(&Row) -> Option<f64>| of(b).unwrap_or(-1.0).total_cmp(&of(a).unwrap_or(-1.0));
        match self {
            Self::State => state(a).severity().cmp(&state(b).severity()),
            Self::Module | Self::Node | Self::Class | Self::Scheduling | Self::Why => self.cell(a).cmp(&self.cell(b)),
            Self::Priority => b.line.priority.cmp(&a.line.priority),
            Self::In => number(|row| row.line.received_per_s),
            Self::Out => number(|row| row.sent_per_s),
            Self::Waiting => b.line.waiting.cmp(&a.line.waiting),
            Self::Lost => b.line.losses.lost.cmp(&a.line.losses.lost),
            Self::P50 => number(|row| row.waited_p50_s),
            Self::P99 => number(|row| row.waited_p99_s),
            Self::Restarts => b.line.account.restarts.cmp(&a.line.account.restarts),
            Self::Cpu => number(|row| row.cpu_percent),
            Self::Memory => b.memory_bytes.cmp(&a.memory_bytes),
            Self::Pid => a.line.pid.cmp(&b.line.pid),
        }
    }
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
pub(super) fn memory(bytes: u64) -> String {
    let mib = bytes as f64 / f64::from(1 << 20);
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
    for column in Column::BY_IMPORTANCE.into_iter().filter(|column| nodes || *column != Column::Node) {
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
        for (bytes, text) in [(0, "0.0M"), (12_345_678, "11.8M"), (512 << 20, "512M"), (64 << 30, "64G")] {
            assert_eq!(memory(bytes), text);
        }
    }

    #[test]
    fn narrow_terminals_keep_the_important_columns() {
        for room in 0..200 {
            let columns = fit(room, 20, true);
            let used: u16 = columns.iter().map(|(_, width)| width + GAP).sum::<u16>() - GAP;
            assert!(used <= room.max(1), "{used} in {room}: {columns:?}");
            let kept = columns.len();
            let most_important = &Column::BY_IMPORTANCE[..kept];
            assert!(columns.iter().all(|(column, _)| most_important.contains(column)), "{room}: {columns:?}");
        }
        assert_eq!(fit(21, 20, true).iter().map(|(c, _)| *c).collect::<Vec<_>>(), [Column::Module, Column::State]);
        assert_eq!(fit(168, 20, true).len(), Column::ALL.len());
        assert_eq!(fit(160, 20, false).len(), Column::ALL.len() - 1);
    }
}
