//! Validates a slot table: overlaps, and room for what must be sent.
//!
//! Each rule is applied to the table with all earlier remedies applied: so the remedy of one slot does not conflict
//! with that of another, and no remedy breaks a rule that was checked before.

mod flows;
mod places;
mod replicas;

use super::{GUARD, TdmaLines};
use crate::installation::Installation;
use crate::plan::plan;
use crate::reader::Reader;
use crate::units::duration_decimal;
use rohrpost_network::{ARRIVES_WITHIN, LATE, Plan, RATE_MAX_PER, Tdma, TimeSlot, round_up};
use std::time::Duration;

/// Clocks of two Linux computers in permanent exchange are known to half of it.
const GUARD_MIN: Duration = Duration::from_micros(40);
/// Peers take a node for silent after a second without a datagram: it has two chances in that time to send a
/// keep-alive.
const SLOT_WITHIN: Duration = Duration::from_millis(500);
/// A check of all cycles of a table must end.
const CYCLES_MAX: u64 = 64;

/// Validates the table, then whether every flow keeps its deadline with it, and whether replicas have room.
pub(crate) fn validate(installation: &Installation, lines: &TdmaLines, reader: &Reader<'_>) {
    let Some(tdma) = &installation.tdma else { return };
    let Some(plan) = plan(installation, tdma) else { return };
    let mut validate = Validator { installation, tdma, lines, fixed: tdma.clone(), plan, reader };
    validate.cycle();
    validate.guard();
    validate.synchronisation();
    validate.lengths();
    validate.places();
    validate.joining();
    validate.collisions();
    validate.silence();
    validate.periods();
    validate.nodes();
    if reader.is_content() {
        validate.periods_of_flows();
    }
    if reader.is_content() {
        validate.flows();
    }
    if reader.is_content() {
        validate.quotas();
        validate.mailboxes();
        validate.replicas();
    }
}

struct Validator<'a> {
    installation: &'a Installation,
    tdma: &'a Tdma,
    lines: &'a TdmaLines,
    /// The table with all remedies applied: its slots have the same order.
    fixed: Tdma,
    plan: Plan,
    reader: &'a Reader<'a>,
}

impl<'a> Validator<'a> {
    fn report(&self, slot: usize, message: impl std::fmt::Display) {
        let TimeSlot { node, offset, .. } = self.tdma.slots[slot];
        let (at, node) = (duration_decimal(offset), self.node_name(node));
        self.reader.report(self.lines.slots[slot], format!("[[slot]] of `{node}` at {at} {message}"));
    }

    fn report_table(&self, message: impl std::fmt::Display) {
        self.reader.report(self.lines.table, format!("[tdma]: {message}"));
    }

    fn described(&self, slot: usize) -> String {
        let (TimeSlot { node, offset, .. }, line) = (self.tdma.slots[slot], self.lines.slots[slot]);
        format!("that of `{}` at {} (line {line})", self.node_name(node), duration_decimal(offset))
    }

    fn node_name(&self, node: u8) -> &'a str {
        &self.installation.nodes[usize::from(node)].name
    }

    fn masters(&self) -> usize {
        self.plan.link.masters()
    }

    fn length_min(&self) -> Duration {
        self.fixed.length_min(&self.plan.link)
    }

    /// A slot comes at most once in a cycle.
    fn cycle(&mut self) {
        if self.fixed.cycle > SLOT_WITHIN {
            let (cycle, most) = (duration_decimal(self.fixed.cycle), duration_decimal(SLOT_WITHIN));
            self.report_table(format!(
                "`cycle` {cycle} is so long that nodes would take each other for silent in between; write `cycle = \
                 \"{most}\"` or less"
            ));
            self.fixed.cycle = SLOT_WITHIN;
        }
    }

    fn guard(&mut self) {
        let guard = self.fixed.guard;
        // From a node to a switch and on. The time in the node before that is left out: of eight frames the fastest
        // counts, and that takes some microseconds from the call to the wire, not the 20 of the bounds.
        let way = Duration::from_nanos(2 * self.plan.link.time_wire_ns());
        let least = round_up(GUARD_MIN.max(way * ARRIVES_WITHIN));
        if guard >= least {
            return self.guard_leaves_room(least);
        }
        let why = if guard < GUARD_MIN {
            "is less than clocks of Linux computers are known to be off each other".into()
        } else {
            let way = duration_decimal(round_up(way));
            format!(
                "is too short for such a link: a joining node assumes that a frame of time passes two links within a \
                 quarter of it, and that takes {way}"
            )
        };
        self.fixed.guard = least;
        let (guard, least) = (duration_decimal(guard), duration_decimal(least));
        self.report_table(format!("`guard` {guard} {why}; write `guard = \"{least}\"` or more"));
    }

    /// The guard is wrong if a slot has no room because of it and cannot grow, and a usual guard would suffice for all.
    fn guard_leaves_room(&mut self, least: Duration) {
        let Tdma { cycle, synchronisation, guard, .. } = self.fixed;
        let (needed, slots) = (self.length_min(), &self.fixed.slots);
        let is_cramped =
            |slot: &&TimeSlot| slot.length < needed && slot.offset < cycle && self.fixed.free_behind(slot) < needed;
        let Some(cramped) = slots.iter().position(|slot| is_cramped(&slot)) else { return };
        let lacking = slots.iter().map(|slot| needed.saturating_sub(slot.length));
        let lacking = lacking.max().max(Some(self.synchronisation_min().saturating_sub(synchronisation)));
        let right = guard.checked_sub(round_up(lacking.unwrap_or_default()));
        let Some(right) = right.filter(|right| *right >= least.max(GUARD)) else { return };
        self.report_table(format!(
            "`guard` {} is too long for such slots: {} has no room for what routers say to each other and one largest \
             datagram, and none to grow; write `guard = \"{}\"`",
            duration_decimal(guard),
            self.described(cramped),
            duration_decimal(right)
        ));
        self.fixed.guard = right;
    }

    fn synchronisation_min(&self) -> Duration {
        let frames = Duration::from_nanos(2 * self.plan.link.others() as u64 * self.plan.link.time_ns());
        round_up(self.fixed.guard + LATE + frames)
    }

    fn synchronisation(&mut self) {
        let needed = self.synchronisation_min();
        if self.fixed.synchronisation < needed {
            self.report_table(format!(
                "`synchronisation` {} has no room for a warm-up and a Sync to each of {} other nodes before its guard; \
                 write `synchronisation = \"{}\"` or more",
                duration_decimal(self.fixed.synchronisation),
                self.plan.link.others(),
                duration_decimal(needed)
            ));
            self.fixed.synchronisation = needed;
        }
        let Tdma { cycle, synchronisation, .. } = self.fixed;
        if self.fixed.windows_end(self.masters()) < cycle {
            return;
        }
        let each = duration_decimal(synchronisation);
        let (windows, or_fewer) = match self.masters() {
            1 => (format!("the synchronisation window of the master, {each}, leaves"), ""),
            masters => (
                format!("the synchronisation windows of {masters} masters, {each} each, leave"),
                ", or fewer `masters` in [time]",
            ),
        };
        let shorter = Tdma { synchronisation: needed, ..self.fixed.clone() };
        let has_room = shorter.windows_end(self.masters()) + shorter.length_min(&self.plan.link) <= cycle;
        let or_shorter = if has_room {
            self.fixed = shorter;
            format!("`synchronisation = \"{}\"`, or ", duration_decimal(needed))
        } else {
            String::new()
        };
        let cycle = duration_decimal(cycle);
        self.report_table(format!(
            "{windows} nothing of the cycle of {cycle}; write {or_shorter}a longer `cycle`{or_fewer}"
        ));
    }

    /// A joining node knows the time well enough until its slot ends.
    fn joining(&mut self) {
        let guard = self.fixed.guard;
        for index in 0..self.fixed.slots.len() {
            let end = self.fixed.slots[index].end();
            if end <= self.fixed.joined_end_max() {
                continue;
            }
            let least = duration_decimal(round_up(round_up(end) / RATE_MAX_PER * ARRIVES_WITHIN));
            let known = duration_decimal(guard / ARRIVES_WITHIN + end / RATE_MAX_PER);
            let or_earlier = self.moved(index).map_or_else(String::new, |place| format!("{place}, or "));
            let (end, once) = (duration_decimal(end), self.once_longer(index));
            self.report(index, format!(
                "ends {end} after the cycle begins{once}, and until then a node that joins knows the time to {known} \
                 only, which is more than half of the guard: it could never send; write {or_earlier}`guard = \
                 \"{least}\"` or more in [tdma]"
            ));
        }
    }

    /// Each node sends so often that no other takes it for silent.
    fn silence(&mut self) {
        let cycle = self.fixed.cycle;
        for node in 0..self.installation.lan_nodes().len() {
            let slots = self.fixed.slots.iter().enumerate();
            let own = slots.filter(|(_, slot)| usize::from(slot.node) == node).min_by_key(|(_, slot)| slot.period);
            let Some((index, slot)) = own.map(|(index, slot)| (index, *slot)) else { continue };
            let pause = cycle * slot.period;
            if pause <= SLOT_WITHIN {
                continue;
            }
            let periods = powers_below(slot.period).filter(|period| cycle * *period <= SLOT_WITHIN);
            let right = if let Some(oftener) = self.oftener(index, periods) {
                self.fixed.slots[index] = oftener;
                format!("write {}", period_text(&oftener, &slot))
            } else {
                "write a shorter `cycle`, or a shorter `period` and another `offset`".into()
            };
            self.report(index, format!(
                "comes once in {}, and none of that node sooner: others would take it for silent in between; {right}",
                duration_decimal(pause)
            ));
        }
    }

    /// The table repeats itself soon enough. A slot with a remedy for its period has such a period already.
    fn periods(&mut self) {
        let cycles = self.fixed.cycles();
        if cycles <= CYCLES_MAX {
            return;
        }
        let why = format!("come together again after {cycles} cycles, and it may be {CYCLES_MAX}");
        let slots = self.fixed.slots.iter().enumerate().filter(|(_, slot)| !slot.period.is_power_of_two());
        let tries = slots.filter_map(|(index, slot)| {
            let repeats = |period: &u32| self.fixed.with(index, slot.with_period(*period)).cycles();
            let periods = powers_below(slot.period).filter(|period| repeats(period) <= CYCLES_MAX);
            Some((index, *slot, self.oftener(index, periods)?))
        });
        if let Some((index, slot, oftener)) = tries.min_by_key(|(_, slot, oftener)| slot.period - oftener.period) {
            let (period, right) = (slot.period, period_text(&oftener, &slot));
            self.report(index, format!("has `period = {period}`, with which all slots {why}; write {right}"));
            self.fixed.slots[index] = oftener;
        } else {
            self.report_table(format!(
                "slots with such periods {why}; write only powers of two up to {CYCLES_MAX} as periods"
            ));
        }
    }

    /// A slot with the first of these periods without overlap.
    fn oftener(&self, index: usize, periods: impl Iterator<Item = u32>) -> Option<TimeSlot> {
        let others = self.fixed.without(index);
        let mut tries = periods.map(|period| self.fixed.slots[index].with_period(period));
        tries.find(|slot| others.has_room(slot, self.masters()))
    }
}

/// Text for the period of a slot, and for its phase if that has changed.
fn period_text(slot: &TimeSlot, was: &TimeSlot) -> String {
    let phase = if slot.phase == was.phase { String::new() } else { format!(" and `phase = {}`", slot.phase) };
    format!("`period = {}`{phase}", slot.period)
}

/// Periods that are powers of two: of any of them the longest is a multiple of all.
fn powers_below(period: u32) -> impl Iterator<Item = u32> {
    (0..u32::BITS).rev().map(|exponent| 1 << exponent).filter(move |power| *power < period)
}
