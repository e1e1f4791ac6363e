//! Registrations: of each client the last one, of each principal a share of the work, and of all together no more than
//! leaves the others their time.
//!
//! ```text
//!  register ─┬─ its turn, and work is left for it ───▶ RoutingTable ─▶ verdict
//!            └─ else it waits; a later one takes its place ──▲ at each look, in turn
//! ```

use super::work::{PendingRegistration, RANGES_SHARE, REGISTER_EVERY_NS, WORK_MAX, WORK_OF_ONE};
use super::{Server, ServerEvent, ServerHost};
use crate::session::ClientIndex;
use crate::session::frame::{Objection, Range, Ranges, RegistrationVerdict, SessionRefusalReason};
use crate::session::server::member::{Member, PendingVerdict};
use rohrpost_mailbox::Name;

impl Server {
    /// Whether a name is to be a client's: its registration waits for its turn, it may host the name, and nobody else
    /// does.
    pub(super) fn is_to_host(&self, client: ClientIndex, name: Name) -> bool {
        let waiting = |member: &Member| {
            let waiting = member.registrations.waiting.as_ref();
            let has = |waiting: &PendingRegistration| waiting.ranges.iter().any(|range| range.has(name));
            name.system() == member.system && member.rights.may_host(name) && waiting.is_some_and(has)
        };
        self.member(client).is_some_and(waiting) && self.table.client_of(name).is_none()
    }

    /// A client says what it hosts from now on.
    pub(super) fn register(
        &mut self,
        now_ns: u64,
        client: ClientIndex,
        ranges: Ranges<'_>,
        host: &mut impl ServerHost,
    ) {
        let is_left = self.is_left(client, ranges.len());
        let Some(member) = self.member_mut(client) else { return };
        let of_client = &mut member.registrations;
        let is_its_turn = now_ns >= of_client.next_ns && of_client.waiting.is_none() && is_left;
        if is_its_turn {
            return self.validate(now_ns, client, ranges.number, ranges, host);
        }
        let waiting = PendingRegistration { number: ranges.number, ranges: ranges.collect() };
        if of_client.waiting.replace(waiting).is_some() {
            self.registering.superseded += 1;
        }
    }

    /// Looks at what waits, beginning where the work ended last time.
    pub(super) fn look_at_registrations(&mut self, now_ns: u64, host: &mut impl ServerHost) {
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
            if self.work_of(client, count) > self.registering.left {
                self.registering.first = index;
                return;
            }
            if !self.is_left(client, count) {
                continue;
            }
            let waiting = self.member_mut(client).and_then(|member| member.registrations.waiting.take());
            if let Some(PendingRegistration { number, ranges }) = waiting {
                self.validate(now_ns, client, number, ranges.into_iter(), host);
            }
        }
    }

    /// Work on a registration, in ranges.
    fn work_of(&self, client: ClientIndex, ranges: usize) -> usize {
        ranges + self.table.count_of(client) + WORK_OF_ONE
    }

    /// Whether so much work is left before the next look, for all and for this client's principal.
    fn is_left(&self, client: ClientIndex, ranges: usize) -> bool {
        let principal = self.member(client).and_then(|member| self.places.principals.uses(member.principal_id));
        let left = principal.map_or(0, |uses| uses.work_left);
        self.work_of(client, ranges) <= self.registering.left.min(left)
    }

    /// The present holder, if it loses its names: the new client connects from the address in the file; the holder has
    /// neither that address nor a certificate.
    fn impostor(&self, client: ClientIndex, holder: ClientIndex) -> Option<ClientIndex> {
        let is_known = |index| self.member(index).is_some_and(|member| member.certified.is_some() || member.is_at_home);
        let comes_home = self.member(client).is_some_and(|member| member.is_at_home);
        (comes_home && !is_known(holder) && client != holder).then_some(holder)
    }

    fn validate(
        &mut self,
        now_ns: u64,
        client: ClientIndex,
        number: u32,
        ranges: impl ExactSizeIterator<Item = Range>,
        host: &mut impl ServerHost,
    ) {
        let Some(member) = self.member(client).filter(|member| member.is_member()) else { return };
        let (system, rights, principal) = (member.system, member.rights.clone(), member.principal_id);
        let may = |range: &Range| range.first.system() == system && range.last.system() == system && rights.may(range);
        let (before, work) = (self.table.count_of(client), self.work_of(client, ranges.len()));
        let used = self.places.principals.uses(principal).map_or(0, |uses| uses.ranges);
        let room = (RANGES_SHARE + before).saturating_sub(used);
        let ranges: Vec<Range> = ranges.collect();
        let mut conflict = self.table.register(client, room, may, ranges.iter().copied()).err();
        while let Some(impostor) = conflict.and_then(|conflict| self.impostor(client, conflict.holder?)) {
            let text = "the node of that name has come, from its own address";
            self.refuse(now_ns, impostor, SessionRefusalReason::Replaced, (0, 0), text, host);
            conflict = self.table.register(client, room, may, ranges.iter().copied()).err();
        }
        let count = self.table.count_of(client);
        self.registering.left = self.registering.left.saturating_sub(work);
        if let Some(uses) = self.places.principals.uses_mut(principal) {
            uses.work_left = uses.work_left.saturating_sub(work);
            uses.ranges = (uses.ranges + count).saturating_sub(before);
        }
        let nothing = Range { first: Name::NONE, last: Name::NONE };
        let mut verdict = RegistrationVerdict { number, objection: None, range: nothing, holder: "" };
        let mut holder = String::new();
        if let Some(conflict) = &conflict {
            verdict = RegistrationVerdict { objection: Some(conflict.objection), range: conflict.range, ..verdict };
            let held_by = conflict.holder.and_then(|holder| self.member(holder));
            holder = held_by.map(|member| member.name.clone()).unwrap_or_default();
            self.places.crowded.ranges += u64::from(conflict.objection == Objection::TooMany);
        }
        if let Some(member) = self.member_mut(client) {
            member.registrations.next_ns = now_ns + REGISTER_EVERY_NS;
            member.registrations.ranges = count;
            if conflict.is_some() {
                host.event(ServerEvent::Objected {
                    name: &member.name,
                    verdict: &RegistrationVerdict { holder: &holder, ..verdict },
                });
            }
            member.verdict = Some(PendingVerdict { verdict, holder });
        }
        self.look_at_node(now_ns, client, host);
        self.is_due(client);
    }
}
