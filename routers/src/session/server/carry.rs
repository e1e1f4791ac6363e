//! Packages: from the client that sends to the one that hosts the name.

use super::member::{Member, RoundTrip, TimeRequest};
use super::{Server, ServerHost};
use crate::admission::capped;
use crate::queue::QueueShare;
use crate::session::counts::Cause;
use crate::session::frame::{
    Carried, HOPS_MAX, RegistrationVerdict, SessionMessage, SessionRefusal, TimeAnswer, VERSION, Welcome,
};
use crate::session::ledger::Ledger;
use crate::session::outgoing::{Outgoing, Parcel, is_stale};
use crate::session::{ClientIndex, answer_to, in_system};
use rohrpost_mailbox::{ALL_SYSTEMS, ERROR_UNKNOWN_NS, Head, TimeRecord};

impl Server {
    /// Hands a package of a client on.
    pub(super) fn carry(&mut self, now_ns: u64, from: ClientIndex, carried: &Carried<'_>, host: &mut impl ServerHost) {
        let head = capped(&carried.head);
        // A sender without a publishing time, or with one in the future, has published it now.
        let published_ns = if carried.published_ns == 0 { now_ns } else { carried.published_ns.min(now_ns) };
        let hops = carried.hops.saturating_add(1);
        let carried = Carried { head, published_ns, hops, ..*carried };
        let hosts = self.host_of(head.from) == Some(from);
        let is_own = hosts || self.is_to_host(from, head.from);
        let objection = if !is_own {
            Some(Cause::Foreign)
        } else if carried.hops > HOPS_MAX {
            Some(Cause::Hops)
        } else {
            is_stale(now_ns, published_ns).then_some(Cause::Stale)
        };
        match objection {
            Some(cause) => self.lose(now_ns, &carried, cause, host),
            None if head.to.system() == ALL_SYSTEMS => self.carry_to_all(now_ns, from, &carried, host),
            None => self.carry_to_one(now_ns, from, &carried, host),
        }
    }

    fn carry_to_one(&mut self, now_ns: u64, from: ClientIndex, carried: &Carried<'_>, host: &mut impl ServerHost) {
        // What a client cannot deliver itself does not come back to it.
        let to = self.host_of(carried.head.to).filter(|to| *to != from);
        match to {
            Some(to) => {
                self.counts.came(carried.head.priority);
                self.hand_over(now_ns, from, to, carried, host);
            }
            None => self.lose(now_ns, carried, Cause::NoRoute, host),
        }
    }

    /// Each system gets it once, by the client that hosts the name there. A client that reaches its own system's other
    /// nodes does that itself.
    fn carry_to_all(&mut self, now_ns: u64, from: ClientIndex, carried: &Carried<'_>, host: &mut impl ServerHost) {
        let Some((own, reaches_own)) = self.member(from).map(|member| (member.system, member.reaches_own)) else {
            return;
        };
        let systems: Vec<u8> = self.table.systems().collect();
        // A client that hosts the name in its own system knows whether a receiver is there: that is counted at its end.
        let mut is_reached = false;
        for system in systems {
            let to = in_system(carried.head.to, system);
            let Some(client) = self.host_of(to) else { continue };
            is_reached = true;
            let reaches_itself = client == from || system == own && reaches_own;
            if reaches_itself {
                continue;
            }
            self.counts.came(carried.head.priority);
            let copy = Carried { head: Head { to, ..carried.head }, ..*carried };
            self.hand_over(now_ns, from, client, &copy, host);
        }
        if !is_reached {
            self.lose(now_ns, carried, Cause::NoRoute, host);
        }
    }

    /// A package that came is lost before it waits for anybody.
    fn lose(&mut self, now_ns: u64, carried: &Carried<'_>, cause: Cause, host: &mut impl ServerHost) {
        self.counts.came(carried.head.priority);
        self.counts.lost(carried.head.priority, cause);
        let answer = answer_to(&carried.head, carried.body, cause, None, host);
        self.say_all(now_ns, answer.into_iter().collect(), host);
    }

    /// `from`: the share of the queue that it takes up.
    fn hand_over(
        &mut self,
        now_ns: u64,
        from: ClientIndex,
        to: ClientIndex,
        carried: &Carried<'_>,
        host: &mut impl ServerHost,
    ) {
        let share = self.member(from).map(|member| QueueShare { sender: member.principal_id, party: member.party });
        let share = share.unwrap_or_default();
        let level = self.settings.levels[usize::from(carried.head.priority.0)];
        // Behind a stream that stands still all waits in the queue, where the most important goes first.
        let shift_ns = self.member(to).filter(|member| !member.is_blocked).map(|_| 0);
        self.with_ledger(now_ns, to, host, |outgoing, ledger| {
            let Carried { hops, published_ns, ref head, body } = *carried;
            outgoing.accept(shift_ns, &Parcel { head, body, published_ns, hops, level, share }, ledger);
        });
        self.is_due(to);
    }

    /// Makes ready what is to be written next.
    pub(super) fn refill(&mut self, now_ns: u64, client: ClientIndex, host: &mut impl ServerHost) {
        let (time, incarnation, common) = (self.time, self.settings.incarnation, self.settings.common);
        let Some(member) = self.member_mut(client) else { return };
        if let Some(asked) = member.asked.take() {
            let time = time_answer(now_ns, &asked, time);
            let welcome = SessionMessage::Welcome(Welcome { common, incarnation, time });
            if asked.by_hello {
                member.round_trip = RoundTrip::Since(now_ns);
            }
            member.outgoing.hurry(&if asked.by_hello { welcome } else { SessionMessage::Answer(time) });
        }
        if let Some(pending) = member.verdict.take() {
            member
                .outgoing
                .hurry(&SessionMessage::Registered(RegistrationVerdict { holder: &pending.holder, ..pending.verdict }));
        }
        if let Some(refused) = member.refused.take() {
            let ((yours, ours), text) = (refused.digests, refused.text.as_str());
            let refusal = SessionRefusal { version: VERSION, reason: refused.reason, yours, ours, text };
            member.outgoing.say(&SessionMessage::Refusal(refusal));
        }
        // What is ready leaves first where parts wait: behind it they would not be the newest any more.
        let is_rest = self.member(client).is_some_and(|member| member.has_parts && !member.outgoing.ready().is_empty());
        if !is_rest && !self.add_part(now_ns, client, host) {
            self.with_ledger(now_ns, client, host, |outgoing, ledger| outgoing.refill(now_ns, 0, ledger));
        }
    }

    /// Does something with what leaves by a client's connection, and answers the commands that are lost thereby.
    pub(super) fn with_ledger<H: ServerHost>(
        &mut self,
        now_ns: u64,
        client: ClientIndex,
        host: &mut H,
        work: impl FnOnce(&mut Outgoing, &mut Ledger<'_, H>),
    ) {
        let Some(Some(member)) = self.members.get_mut(usize::from(client.0)) else { return };
        let Member { outgoing, name, .. } = &mut **member;
        let mut ledger = Ledger::new(&self.counts, &mut *host, Some((name, &mut self.places.principals)));
        work(outgoing, &mut ledger);
        let answers = ledger.into_answers();
        self.say_all(now_ns, answers, host);
    }

    /// Sends answers on their way. Answers are not answered; what gives way to one is less important, so this ends.
    fn say_all(&mut self, now_ns: u64, answers: Vec<(Head, Vec<u8>)>, host: &mut impl ServerHost) {
        for (head, body) in answers {
            let carried = Carried { hops: 0, published_ns: now_ns, head, body: &body };
            match self.host_of(head.to) {
                Some(to) => {
                    self.counts.came(head.priority);
                    // The sender of the command has caused it.
                    self.hand_over(now_ns, to, to, &carried, host);
                }
                None => self.lose(now_ns, &carried, Cause::NoRoute, host),
            }
        }
    }
}

fn time_answer(now_ns: u64, asked: &TimeRequest, time: Option<TimeRecord>) -> TimeAnswer {
    let TimeRequest { asked_ns, came_ns, .. } = *asked;
    let unknown = TimeAnswer { asked_ns, came_ns, left_ns: now_ns, system_ns: 0, error_ns: ERROR_UNKNOWN_NS, epoch: 0 };
    time.map_or(unknown, |record| {
        let system = record.at(now_ns);
        let error_ns = u64::try_from(system.error.as_nanos()).unwrap_or(ERROR_UNKNOWN_NS).min(ERROR_UNKNOWN_NS);
        TimeAnswer { system_ns: system.ns, error_ns, epoch: system.epoch, ..unknown }
    })
}
