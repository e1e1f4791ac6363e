//! Registrations: of each client the last one, and of all together no more than leaves the others their time.
//!
//! ```text
//!  register ─┬─ its turn, and work is left ──────────▶ Table ─▶ verdict
//!            └─ else it waits; a later one takes its place ──▲ at each look, in turn
//! ```

use super::{Event, Host, Server};
use crate::broken::broken;
use crate::session::frame::{Range, Ranges, Verdict};
use crate::session::server::member::{Judged, Member};
use crate::session::table::ENTRIES_MAX;
use crate::session::{ClientIndex, LOOK_EVERY_NS};
use rohrpost_mailbox::Name;

/// Of one client's registrations one is looked at in so long.
const REGISTER_EVERY_NS: u64 = LOOK_EVERY_NS;
/// Ranges that registrations may go through from one look to the next; each goes through those of all clients.
const WORK_MAX: usize = 2 * ENTRIES_MAX;

/// What registering costs all others, and what was spared them.
#[derive(Debug)]
pub(super) struct Registering {
    /// Ranges that may still be gone through before the next look.
    left: usize,
    /// Whose turn is the first at the next look.
    first: u16,
    /// Registrations that a later one of the same client took the place of.
    pub(super) overtaken: u64,
}

impl Default for Registering {
    fn default() -> Self {
        Self { left: WORK_MAX, first: 0, overtaken: 0 }
    }
}

/// Of one client.
#[derive(Debug, Default)]
pub(super) struct Registrations {
    /// The next one is not looked at before, ns.
    next_ns: u64,
    waiting: Option<Waiting>,
    /// Ranges that it hosts.
    pub(super) ranges: usize,
}

#[derive(Debug)]
struct Waiting {
    number: u32,
    ranges: Vec<Range>,
}

impl Registrations {
    pub(super) fn bytes(&self) -> usize {
        self.waiting.as_ref().map_or(0, |waiting| waiting.ranges.capacity() * size_of::<Range>())
    }
}

impl Server {
    /// Whether a name is to be a client's: its registration waits for its turn, it may host the name, and nobody else does.
    pub(super) fn is_to_host(&self, client: ClientIndex, name: Name) -> bool {
        let waiting = |member: &Member| {
            let waiting = member.registrations.waiting.as_ref();
            let has = |waiting: &Waiting| waiting.ranges.iter().any(|range| range.has(name));
            let may = member.may_host.as_deref().is_none_or(|may| may.iter().any(|range| range.has(name)));
            may && name.system() == member.system && waiting.is_some_and(has)
        };
        self.member(client).is_some_and(waiting) && self.table.client_of(name).is_none()
    }

    /// A client says what it hosts from now on.
    pub(super) fn register(&mut self, now_ns: u64, client: ClientIndex, ranges: Ranges<'_>, host: &mut impl Host) {
        let work = self.work_of(ranges.len());
        let left = self.registering.left;
        let Some(member) = self.member_mut(client) else { return };
        let of_client = &mut member.registrations;
        let is_its_turn = now_ns >= of_client.next_ns && of_client.waiting.is_none() && work <= left;
        if is_its_turn || broken!(RegistersAtOnce) {
            return self.judge(now_ns, client, ranges.number, ranges, host);
        }
        let waiting = Waiting { number: ranges.number, ranges: ranges.collect() };
        if of_client.waiting.replace(waiting).is_some() {
            self.registering.overtaken += 1;
        }
    }

    /// Looks at what waits, beginning where the work ended last time.
    pub(super) fn look_at_registrations(&mut self, now_ns: u64, host: &mut impl Host) {
        self.registering.left = WORK_MAX;
        let places = self.members.len() as u16;
        let first = self.registering.first.min(places);
        for index in (first..places).chain(0..first) {
            let client = ClientIndex(index);
            let Some(member) = self.member(client).filter(|member| now_ns >= member.registrations.next_ns) else {
                continue;
            };
            let Some(count) = member.registrations.waiting.as_ref().map(|waiting| waiting.ranges.len()) else {
                continue;
            };
            if self.work_of(count) > self.registering.left {
                self.registering.first = index;
                return;
            }
            let waiting = self.member_mut(client).and_then(|member| member.registrations.waiting.take());
            if let Some(Waiting { number, ranges }) = waiting {
                self.judge(now_ns, client, number, ranges.into_iter(), host);
            }
        }
    }

    fn work_of(&self, ranges: usize) -> usize {
        self.table.len() + ranges
    }

    fn judge(
        &mut self,
        now_ns: u64,
        client: ClientIndex,
        number: u32,
        ranges: impl ExactSizeIterator<Item = Range>,
        host: &mut impl Host,
    ) {
        let Some(member) = self.member(client).filter(|member| member.is_member()) else { return };
        let (system, may_host) = (member.system, member.may_host.clone());
        let count = ranges.len();
        self.registering.left = self.registering.left.saturating_sub(self.work_of(count));
        let nothing = Range { first: Name::NONE, last: Name::NONE };
        let mut verdict = Verdict { number, objection: None, range: nothing, holder: "" };
        let mut holder = String::new();
        let conflict = self.table.register(client, (system, may_host.as_deref()), ranges).err();
        if let Some(conflict) = &conflict {
            verdict = Verdict { objection: Some(conflict.objection), range: conflict.range, ..verdict };
            let held_by = conflict.holder.and_then(|holder| self.member(holder));
            holder = held_by.map(|member| member.name.clone()).unwrap_or_default();
        }
        if let Some(member) = self.member_mut(client) {
            member.registrations.next_ns = now_ns + REGISTER_EVERY_NS;
            if conflict.is_none() {
                member.registrations.ranges = count;
            } else {
                host.event(Event::Objected { name: &member.name, verdict: &Verdict { holder: &holder, ..verdict } });
            }
            member.judged = Some(Judged { verdict, holder });
        }
        self.is_due(client);
    }
}
