//! A killed master, and the reaction of the others, as the capture and their pages show it.

use super::capture::{Capture, Crossed, FrameKind};
use super::plan::Plan;
use super::routers::Routers;
use super::stage::NODES;
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{interrupted, look_for};
use rohrpost_mailbox::{SystemClock, TimeRecord, monotonic_ns};
use rohrpost_routers::tdma::{SlotTable, Window, WindowKind};
use std::collections::HashSet;
use std::time::{Duration, Instant};

/// So many cycles before and after it are examined.
const CYCLES: u32 = 20;
const SYNCHRONISED_WITHIN: Duration = Duration::from_secs(10);
const TAKEN_OVER_WITHIN: Duration = Duration::from_secs(10);
/// How often pages are read meanwhile.
const LOOK_EACH: Duration = Duration::from_micros(500);

/// The result.
#[derive(Clone, Copy, Debug)]
pub struct TakenOver {
    /// The killed node.
    pub dead: u8,
    /// From the last synchronisation of the old master to the first one in its place, cycles.
    pub replaced_cycles: f64,
    /// To the first one of the new master.
    pub new_master_cycles: f64,
    /// Slots of the others that went by without a frame.
    pub slots_lost: u64,
    /// How much a page has moved against the old master's time, µs.
    pub step_us: f64,
}

/// The node that synchronised last as the master.
fn master(frames: &[Crossed]) -> Option<u8> {
    frames.iter().rev().find(|frame| frame.what == FrameKind::Sync).map(|frame| frame.from)
}

/// How often another node than before synchronised as the master.
pub fn changes_of_master(frames: &[Crossed]) -> usize {
    let masters = || frames.iter().filter(|frame| frame.what == FrameKind::Sync).map(|frame| frame.from);
    masters().zip(masters().skip(1)).filter(|(before, after)| before != after).count()
}

/// Share of so many cycles without a master's synchronisation, percent.
pub fn without_sync_percent(frames: &[Crossed], cycle: Duration, cycles: f64) -> f64 {
    let syncs = || frames.iter().filter(|frame| frame.what == FrameKind::Sync).map(|frame| frame.at_ns);
    // Frames within half a cycle belong to one cycle: each slave gets one.
    let half_ns = cycle.as_nanos() as u64 / 2;
    let begun = syncs().zip(syncs().skip(1)).filter(|(before, at)| at - before > half_ns).count() + 1;
    (cycles - begun as f64).max(0.0) * 100.0 / cycles
}

/// Kills the master after some part of a cycle, and waits until another node is the master.
///
/// # Errors
/// When none takes its place.
pub fn kill_master(
    routers: &mut Routers<'_>,
    capture: &mut Capture,
    plan: &Plan,
    part_of_cycle: f64,
) -> Result<TakenOver, Failure> {
    let cycle = Duration::from_micros(plan.cycle_us);
    let first = capture.len();
    std::thread::sleep(cycle * CYCLES + cycle.mul_f64(part_of_cycle));
    let dead = look_for(SYNCHRONISED_WITHIN, cycle, || Ok(master(&capture.since(first))))?;
    let dead = dead.ok_or_else(|| Failure::Failed("nobody synchronises".into()))?;
    let others: Vec<u8> = (0..NODES).filter(|node| *node != dead).collect();
    let clocks = others.iter().map(|node| routers.clock(*node)).collect::<Result<Vec<_>, Failure>>()?;
    let time = routers.clock(dead)?.record().ok_or_else(|| Failure::Failed("the master has no time".into()))?;
    let mut pages = Pages::begin(clocks, time)?;
    let killed_ns = time.at(monotonic_ns()).ns;
    routers.kill(dead);
    await_new_master(capture, first, dead, cycle, &mut pages)?;
    let frames = capture.since(first);
    let never = || Failure::Failed("nobody synchronised in a dead master's place".into());
    let last =
        frames.iter().rposition(|frame| frame.what == FrameKind::Sync && frame.from == dead).ok_or_else(never)?;
    let cycles_until = |is: &[FrameKind]| {
        let next = frames[last..].iter().find(|frame| frame.from != dead && is.contains(&frame.what))?;
        Some((next.at_ns - frames[last].at_ns) as f64 / cycle.as_nanos() as f64)
    };
    let looked_at = killed_ns..killed_ns + (cycle * CYCLES).as_nanos() as u64;
    let mut slots_lost = 0;
    for node in others {
        slots_lost += unused(&frames, &plan.table(node)?, &time, &looked_at);
    }
    Ok(TakenOver {
        dead,
        replaced_cycles: cycles_until(&[FrameKind::Sync, FrameKind::Replacement]).ok_or_else(never)?,
        new_master_cycles: cycles_until(&[FrameKind::Sync]).ok_or_else(never)?,
        slots_lost,
        step_us: pages.moved_ns as f64 / 1000.0,
    })
}

/// Waits until another node than the dead master has synchronised as the master for some cycles; pages are read all the
/// time.
fn await_new_master(
    capture: &mut Capture,
    first: usize,
    dead: u8,
    cycle: Duration,
    pages: &mut Pages,
) -> Result<(), Failure> {
    let give_up = Instant::now() + TAKEN_OVER_WITHIN;
    let mut over = None;
    while over.is_none_or(|over| Instant::now() < over) {
        if interrupted() || Instant::now() > give_up {
            return Err(Failure::Failed(format!("nobody takes the place of node {dead}")));
        }
        std::thread::sleep(LOOK_EACH);
        pages.look()?;
        capture.check()?;
        if over.is_none() && master(&capture.since(first)).is_some_and(|master| master != dead) {
            over = Some(Instant::now() + cycle * CYCLES);
        }
    }
    Ok(())
}

/// Slots of a node that begin in this part of system time, in which it sent nothing.
fn unused(frames: &[Crossed], table: &SlotTable, time: &TimeRecord, of: &std::ops::Range<u64>) -> u64 {
    let its = frames.iter().filter(|frame| frame.from == table.own());
    let window = |frame: &Crossed| -> Option<Window> {
        let at_ns = time.at(frame.at_ns).ns;
        let owners = [at_ns, at_ns + table.allowance_ns()].map(|ns| table.owner(ns));
        owners.into_iter().flatten().find(|owner| owner.node == table.own()).map(|owner| owner.window)
    };
    let is_meant = |window: &Window| matches!(window.kind, WindowKind::Slot { .. }) && of.contains(&window.begin_ns);
    let used: HashSet<Window> = its.filter_map(window).filter(is_meant).collect();
    table.slots_between(of.start, of.end).saturating_sub(used.len() as u64)
}

/// The pages of the living nodes, compared with the time of the dead one.
struct Pages {
    time: TimeRecord,
    /// Each with its initial lead, ns.
    pages: Vec<(SystemClock, i64)>,
    moved_ns: u64,
}

impl Pages {
    fn begin(clocks: Vec<SystemClock>, time: TimeRecord) -> Result<Self, Failure> {
        let pages = clocks.into_iter().map(|clock| Ok((ahead_ns(&clock, &time)?, clock)));
        let pages = pages.map(|page| page.map(|(ahead_ns, clock)| (clock, ahead_ns)));
        Ok(Self { time, pages: pages.collect::<Result<_, Failure>>()?, moved_ns: 0 })
    }

    fn look(&mut self) -> Result<(), Failure> {
        for (clock, before_ns) in &self.pages {
            self.moved_ns = self.moved_ns.max(ahead_ns(clock, &self.time)?.abs_diff(*before_ns));
        }
        Ok(())
    }
}

/// Lead of a page over a time.
fn ahead_ns(clock: &SystemClock, time: &TimeRecord) -> Result<i64, Failure> {
    let record = clock.record().ok_or_else(|| Failure::Failed("a node has no time".into()))?;
    let now_ns = monotonic_ns();
    Ok(record.at(now_ns).ns.wrapping_sub(time.at(now_ns).ns).cast_signed())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cycle_has_a_sync_however_many_slaves_get_one() {
        let cycle = Duration::from_millis(5);
        let sync = |at_us: u64| Crossed { at_ns: at_us * 1_000, from: 0, what: FrameKind::Sync };
        let all = [0, 5_000, 15_200, 20_000].map(|at_us| [sync(at_us), sync(at_us + 20)]);
        assert_eq!(without_sync_percent(all.as_flattened(), cycle, 5.0), 20.0);
        assert_eq!(without_sync_percent(&all.as_flattened()[..4], cycle, 2.0), 0.0);
        assert_eq!(without_sync_percent(&[], cycle, 100.0), 99.0, "one cannot be told");
    }
}
