//! The floor of time slots: threads that wake up for them as routers do, and send nothing. How late these are no router can better.

use super::plan::Plan;
use super::stage::{NODES, Stage};
use crate::Failure;
use crate::harness::{Child, Gate, Samples, Shared, rest};
use rohrpost_config::LATE;
use rohrpost_mailbox::{monotonic_ns, sys};
use rohrpost_routers::shell::spin_ns;
use std::time::Duration;

/// So much of a cycle is reserved for each.
const SHARE: u64 = 4;
/// Until reservations are granted and the load is there.
const SETTLES: Duration = Duration::from_secs(1);

/// How late bare threads were.
#[derive(Clone, Debug)]
pub struct Bare {
    /// Of each slot of each node: how long after its beginning, µs.
    pub late_us: Vec<f64>,
}

impl Bare {
    /// One process for each node, for so long.
    ///
    /// # Errors
    /// [`Failure::Skipped`] where the kernel reserves no time.
    pub fn turn(stage: &Stage, plan: &Plan, loaded: bool, watched: Duration) -> Result<Self, Failure> {
        let ready = Shared::<Gate>::new()?;
        let samples = (0..NODES).map(|_| Shared::<Samples>::new()).collect::<Result<Vec<_>, Failure>>()?;
        let _load = loaded.then(|| stage.load()).transpose()?;
        let child = |(own, samples): (u8, &Shared<Samples>)| Child::start(|| wake_up(plan, own, &ready, samples));
        let mut children = (0..NODES).zip(&samples).map(child).collect::<Result<Vec<_>, Failure>>()?;
        ready.meet_children(&mut children)?;
        rest(SETTLES)?;
        let before: Vec<usize> = samples.iter().map(|samples| samples.len()).collect();
        rest(watched)?;
        let since = samples.iter().zip(before).map(|(samples, before)| samples.all().split_off(before));
        Ok(Self { late_us: since.flatten().collect() })
    }

    /// Slots for which it was too late, percent: a router leaves these out.
    pub fn omitted_percent(&self) -> f64 {
        let late = self.late_us.iter().filter(|late_us| **late_us > LATE.as_nanos() as f64 / 1000.0).count();
        late as f64 * 100.0 / self.late_us.len().max(1) as f64
    }
}

/// The monotonic clock is system time here: a slot is anywhere in the cycle, but where the others are it is not.
fn wake_up(plan: &Plan, own: u8, ready: &Gate, samples: &Samples) -> Result<(), Failure> {
    let table = plan.table(own)?;
    let period_ns = table.cycle_ns();
    let reservation = sys::Reservation { runtime_ns: period_ns / SHARE, deadline_ns: period_ns, period_ns };
    sys::reserve(reservation).map_err(|error| Failure::Skipped(error.to_string()))?;
    ready.meet(u32::from(NODES) + 1)?;
    let spin_ns = spin_ns(period_ns);
    let mut from_ns = monotonic_ns();
    loop {
        let Some(slot) = table.next_slot(from_ns) else { return Err(Failure::Failed("a node without slot".into())) };
        from_ns = slot.begin_ns + 1;
        let sleeps_ns = slot.begin_ns.saturating_sub(spin_ns).saturating_sub(monotonic_ns());
        std::thread::sleep(Duration::from_nanos(sleeps_ns));
        while monotonic_ns() < slot.begin_ns {
            std::hint::spin_loop();
        }
        samples.push(monotonic_ns().saturating_sub(slot.begin_ns) as f64 / 1000.0);
    }
}
