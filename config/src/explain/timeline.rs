//! The cycle, drawn: a row for synchronisation and one for each node.
//!
//! ```text
//!            0 ms         1            2            3            4            5 ms
//!            |            |            |            |            |            |
//!  sync      ████▒░░████▒░░··················································
//!  base      ·············███████████░░······································
//! ```

use crate::node::Node;
use crate::units::duration_decimal;
use rohrpost_network::Tdma;
use std::time::Duration;

/// Cells of a row.
const CELLS: usize = 64;
/// Least width of the label before a row.
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

    /// At least a cell for the sending part and, if there is room, one for the guard.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::Reach;
    use rohrpost_network::TimeSlot;

    #[test]
    fn whatever_the_cycle_is_each_window_is_seen_and_a_row_fits() {
        for cycle_us in [1_000, 1_234, 5_000, 7_300, 16_000, 100_000, 999_999, 1_000_000] {
            let cycle = Duration::from_micros(cycle_us);
            let slot = |node: u8| {
                let (offset, length) = (cycle * (2 + u32::from(node)) / 8, cycle / 100);
                TimeSlot { node, offset, length, period: 1 + u32::from(node), phase: 0 }
            };
            let (synchronisation, guard) = (cycle / 100, cycle / 200);
            let slots: Vec<_> = (0..6).map(slot).collect();
            let tdma = Tdma { cycle, synchronisation, guard, link_bytes_s: 12_500_000, slots, tunnel: None };
            let node = |index: u8| Node {
                name: format!("node-{index}"),
                reach: Reach::Lan,
                address: None,
                mode: 0o700,
                tools: index..=index,
                line: 0,
            };
            let nodes: Vec<_> = (0..6).map(node).collect();
            let rows = rows(&tdma, &nodes, &[0, 1]);
            let wide: Vec<_> = rows.iter().take(9).filter(|row| row.chars().count() > 80).collect();
            assert!(wide.is_empty(), "{cycle:?}: {wide:#?}");
            for (row, sends) in rows[2..9].iter().zip([SENDS, SENDS].into_iter().chain([SENDS_SOMETIMES; 5])) {
                assert!(row.contains(sends), "{cycle:?}: {row}");
            }
            let last = duration_decimal(cycle);
            assert!(rows[0].contains('0') && (rows[0].contains("us") || rows[0].contains("ms")), "{last}: {}", rows[0]);
        }
    }

    #[test]
    fn ticks_stand_below_their_numbers_and_windows_below_the_ticks() {
        let ms = Duration::from_millis;
        let (numbers, ticks) = scale(ms(8));
        assert_eq!(numbers, "0       1 ms    2 ms    3 ms    4 ms    5 ms    6 ms    7 ms 8 ms");
        assert_eq!(ticks, format!("{}|", "|       ".repeat(8)));
        let slots = vec![TimeSlot { node: 0, offset: ms(2), length: ms(2), period: 1, phase: 0 }];
        let tdma = Tdma {
            cycle: ms(8),
            synchronisation: ms(1),
            guard: Duration::from_micros(500),
            link_bytes_s: 12_500_000,
            slots,
            tunnel: None,
        };
        let mut row = Row::new(&tdma);
        row.window(ms(2), ms(2), SENDS);
        let expected = [(FREE, 16), (SENDS, 12), (GUARD, 4), (FREE, 32)];
        let expected: String = expected.map(|(cell, count)| cell.to_string().repeat(count)).concat();
        assert_eq!(row.text(), expected);
    }
}
