//! The floor of time slots: threads that wake up for them as routers do, and send nothing. No router can be earlier
//! than these.
//!
//! A master that is silent in three cycles in a row has a successor. So a master that misses all windows of three
//! cycles is taken for dead, even if it runs.

use super::plan::Plan;
use super::stage::{NODES, Stage};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, Gate, Samples, Shared, rest};
use rohrpost_mailbox::{monotonic_ns, sys};
use rohrpost_routers::driver::spin_ns;
use rohrpost_routers::tdma::{GATE_NS, Window, WindowKind};
use rohrpost_routers::time::TIME_BYTES;
use std::time::Duration;

/// Time of each cycle that is reserved for a thread.
const SHARE: u64 = 4;
/// Until reservations are granted and the load is there.
const SETTLES: Duration = Duration::from_secs(1);
/// A master that is not heard for so many cycles has a successor.
const STANDSTILL_CYCLES: u64 = 3;

/// How late bare threads were.
#[derive(Clone, Debug)]
pub struct BareThreads {
    /// Wake-up after the beginning of each slot of each node, µs.
    pub late_us: Vec<f64>,
    /// How often a possible master missed all its windows of three cycles in a row.
    pub standstills: usize,
}

/// Results of a thread.
struct Said {
    late_us: Shared<Samples>,
    /// Cycles that each standstill took.
    standstills: Shared<Samples>,
}

impl BareThreads {
    /// One process for each node, for so long.
    ///
    /// # Errors
    /// [`Failure::Skipped`] where the kernel reserves no time.
    pub fn turn(stage: &Stage, plan: &Plan, loaded: bool, watched: Duration) -> Result<Self, Failure> {
        Self::beside(plan, || loaded.then(|| stage.load()).transpose(), watched)
    }

    /// The same beside whatever `load` starts, until that is dropped.
    ///
    /// # Errors
    /// As for [`Self::turn`], and what starting that failed with.
    pub fn beside<L>(
        plan: &Plan,
        load: impl FnOnce() -> Result<L, Failure>,
        watched: Duration,
    ) -> Result<Self, Failure> {
        let ready = Shared::<Gate>::new()?;
        let said = || Ok(Said { late_us: Shared::new()?, standstills: Shared::new()? });
        let all = (0..NODES).map(|_| said()).collect::<Result<Vec<_>, Failure>>()?;
        let _load = load()?;
        let child = |(own, said): (u8, &Said)| Child::start(|| wake_up(plan, own, &ready, said));
        let mut children = (0..NODES).zip(&all).map(child).collect::<Result<Vec<_>, Failure>>()?;
        ready.meet_children(&mut children)?;
        rest(SETTLES)?;
        let lengths = |said: &Said| (said.late_us.len(), said.standstills.len());
        let before: Vec<(usize, usize)> = all.iter().map(lengths).collect();
        rest(watched)?;
        let late_us = all.iter().zip(&before).flat_map(|(said, before)| said.late_us.all().split_off(before.0));
        let of_masters = all.iter().zip(&before).take(plan.masters.into());
        let standstills = of_masters.map(|(said, before)| said.standstills.len() - before.1).sum();
        Ok(Self { late_us: late_us.collect(), standstills })
    }

    /// Slots with a wake-up too late to send, percent: a router omits these.
    pub fn omitted_percent(&self) -> f64 {
        self.later_percent(GATE_NS as f64 / 1000.0)
    }

    /// Slots with a wake-up later than this, percent.
    pub fn later_percent(&self, than_us: f64) -> f64 {
        let late = self.late_us.iter().filter(|late_us| **late_us > than_us).count();
        late as f64 * 100.0 / self.late_us.len().max(1) as f64
    }
}

/// The monotonic clock is system time here: the phase of a slot in the cycle is arbitrary, but not its distance from
/// others.
fn wake_up(plan: &Plan, own: u8, ready: &Gate, said: &Said) -> Result<(), Failure> {
    let table = plan.table(own)?;
    let period_ns = table.cycle_ns();
    let reservation = sys::Reservation { runtime_ns: period_ns / SHARE, deadline_ns: period_ns, period_ns };
    sys::reserve(reservation).map_err(|error| Failure::Skipped(error.to_string()))?;
    ready.meet(u32::from(NODES) + 1)?;
    let (spin_ns, frame_ns) = (spin_ns(period_ns), table.wire().ns(TIME_BYTES));
    let (mut from_ns, mut used_cycle) = (monotonic_ns(), None);
    loop {
        let Some(window) = table.next_window(from_ns) else {
            return Err(Failure::Failed("a node without slot".into()));
        };
        from_ns = window.begin_ns + 1;
        let late_ns = late_ns(&window, spin_ns);
        let is_slot = matches!(window.kind, WindowKind::Slot { .. });
        if is_slot {
            said.late_us.push(late_ns as f64 / 1000.0);
        }
        if if is_slot { late_ns <= GATE_NS } else { window.begin_ns + late_ns + frame_ns <= window.end_ns } {
            let missed = used_cycle.replace(window.cycle).map_or(0, |used| window.cycle.saturating_sub(used + 1));
            if missed >= STANDSTILL_CYCLES {
                said.standstills.push(missed as f64);
            }
        }
    }
}

/// Waits for a window as a router does; returns how long after its beginning the wake-up came.
fn late_ns(window: &Window, spin_ns: u64) -> u64 {
    let sleeps_ns = window.begin_ns.saturating_sub(spin_ns).saturating_sub(monotonic_ns());
    std::thread::sleep(Duration::from_nanos(sleeps_ns));
    while monotonic_ns() < window.begin_ns {
        std::hint::spin_loop();
    }
    monotonic_ns().saturating_sub(window.begin_ns)
}
