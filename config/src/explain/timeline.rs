//! The cycle, drawn: a row for synchronisation and one for each node.
//!
//! ```text
//!            0 ms         1            2            3            4            5 ms
//!            |            |            |            |            |            |
//!  sync      ████▒░░████▒░░··················································
//!  base      ·············███████████░░······································
//! ```

use crate::node::Node;
use crate::tdma::Tdma;
use crate::units::duration_decimal;
use std::time::Duration;

/// Cells of a row.
const CELLS: usize = 64;
/// What the page is wide in which a row begins.
const LABEL_MIN: usize = 10;

const SENDS: char = '█';
const SENDS_SOMETIMES: char = '▒';
const GUARD: char = '░';
const FREE: char = '·';

/// Rows of at most 80 characters, if no node's name is longer than eight.
pub(super) fn rows(tdma: &Tdma, nodes: &[Node], masters: &[u8]) -> Vec<String> {
    let width = nodes.iter().map(|node| node.name.chars().count() + 2).max().unwrap_or(0).max(LABEL_MIN);
    let row = |label: &str, cells: &str| format!("  {label:width$}{cells}");
    let (numbers, ticks) = scale(tdma.cycle);
    let mut rows = vec![row("", &numbers), row("", &ticks)];

    let mut synchronisation = Row::new(tdma);
    for rank in 0..masters.len() as u32 {
        synchronisation.window(tdma.synchronisation * rank, tdma.synchronisation, SENDS);
    }
    rows.push(row("sync", &synchronisation.text()));
    for (node, index) in nodes.iter().zip(0..) {
        let mut cells = Row::new(tdma);
        for slot in tdma.slots.iter().filter(|slot| slot.node == index) {
            cells.window(slot.offset, slot.length, if slot.period == 1 { SENDS } else { SENDS_SOMETIMES });
        }
        rows.push(row(&node.name, &cells.text()));
    }
    let cell = duration_decimal(Duration::from_micros((tdma.cycle / CELLS as u32).as_micros() as u64));
    let sometimes = if tdma.slots.iter().any(|slot| slot.period > 1) {
        format!("   {SENDS_SOMETIMES} in some cycles")
    } else {
        String::new()
    };
    rows.push(String::new());
    rows.push(format!(
        "  {SENDS} sends{sometimes}   {GUARD} guard: nobody sends   {FREE} others' or free   a column: {cell}"
    ));
    rows
}

struct Row<'t> {
    tdma: &'t Tdma,
    cells: Vec<char>,
}

impl<'t> Row<'t> {
    fn new(tdma: &'t Tdma) -> Self {
        Self { tdma, cells: vec![FREE; CELLS] }
    }

    /// At least a cell for what is sent and, if there is room, one for the guard.
    fn window(&mut self, begin: Duration, length: Duration, sends: char) {
        let cell = |at: Duration| {
            let cells = (at.as_nanos() * CELLS as u128 + self.tdma.cycle.as_nanos() / 2) / self.tdma.cycle.as_nanos();
            (cells as usize).min(CELLS)
        };
        let first = cell(begin).min(CELLS - 1);
        let end = cell(begin + length).max(first + 1);
        let guard = cell(begin + length.saturating_sub(self.tdma.guard)).clamp(first + 1, (end - 1).max(first + 1));
        self.cells[first..guard].fill(sends);
        self.cells[guard..end].fill(GUARD);
    }

    fn text(self) -> String {
        self.cells.into_iter().collect()
    }
}

/// Numbers, and ticks below them, at round times.
fn scale(cycle: Duration) -> (String, String) {
    let step = step(cycle);
    let (mut numbers, mut ticks) = (String::new(), vec![' '; CELLS + 1]);
    let count = cycle.as_nanos() / step.as_nanos();
    for tick in 0..=count {
        let at = step * tick as u32;
        let cell = (at.as_nanos() * CELLS as u128 / cycle.as_nanos()) as usize;
        ticks[cell] = '|';
        let text = if tick == 0 { "0".into() } else { duration_decimal(at) };
        let begin = cell.saturating_sub(if cell > CELLS - text.len() { text.len() - 1 } else { 0 });
        if begin >= numbers.len() {
            numbers = format!("{numbers:begin$}{text} ");
        }
    }
    (numbers.trim_end().into(), ticks.into_iter().collect::<String>().trim_end().into())
}

/// The shortest of 1, 2, 5, 10, … that gives at most eight ticks.
fn step(cycle: Duration) -> Duration {
    let mut unit = Duration::from_micros(1);
    loop {
        for times in [1, 2, 5] {
            if unit * times * 8 >= cycle {
                return unit * times;
            }
        }
        unit *= 10;
    }
}
