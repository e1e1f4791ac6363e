//! Handles frames from clients, and decides which clients may take part.

use super::member::{MemberState, PendingRefusal, RoundTrip, TimeRequest};
use super::{Server, ServerEvent, ServerHost};
use crate::frame::ReplicaFrame;
use crate::session::frame::{
    BadSessionFrame, HELLO_LENGTH_MAX, LENGTH_MAX, NAME_BYTES_MAX, SessionHello, SessionMessage, SessionRefusalReason,
};
use crate::session::{ClientIndex, LOOK_EVERY_NS};

/// Time that a refused client has to read the reason.
const LEAVE_WITHIN_NS: u64 = 5 * LOOK_EVERY_NS;

impl Server {
    /// Takes bytes of a client's stream, split anywhere.
    pub fn received(&mut self, now_ns: u64, client: ClientIndex, mut bytes: &[u8], host: &mut impl ServerHost) {
        let Some(member) = self.member_mut(client) else { return };
        member.heard_ns = now_ns;
        if let RoundTrip::Since(welcomed_ns) = member.round_trip {
            member.round_trip = RoundTrip::Takes(now_ns.saturating_sub(welcomed_ns));
        }
        let mut splitter = std::mem::take(&mut member.splitter);
        loop {
            let length_max = match self.member(client).map(|member| member.state) {
                Some(MemberState::Handshake) => HELLO_LENGTH_MAX,
                Some(MemberState::Member) => LENGTH_MAX,
                // What it still says nobody reads.
                Some(MemberState::Leaving { .. }) | None => return,
            };
            let message = match splitter.next(now_ns, length_max, &mut bytes) {
                Ok(None) => break,
                Ok(Some((head, rest))) => SessionMessage::parse(head, rest),
                Err(bad) => Err(bad),
            };
            match message {
                Ok(message) => self.handle(now_ns, client, &message, host),
                Err(bad) => self.refuse_bad(now_ns, client, bad, host),
            }
        }
        if let Some(member) = self.member_mut(client) {
            member.splitter = splitter;
        }
    }

    fn handle(&mut self, now_ns: u64, client: ClientIndex, message: &SessionMessage<'_>, host: &mut impl ServerHost) {
        let Some(member) = self.member_mut(client) else { return };
        match (member.state, message) {
            (MemberState::Handshake, SessionMessage::Hello(hello)) => self.take_hello(now_ns, client, hello, host),
            (MemberState::Member, SessionMessage::Register(ranges)) => self.register(now_ns, client, *ranges, host),
            (MemberState::Member, SessionMessage::Package(carried)) => self.carry(now_ns, client, carried, host),
            (MemberState::Member, SessionMessage::Record(part)) => {
                self.take_part(now_ns, client, &ReplicaFrame::Record(*part), host);
            }
            (MemberState::Member, SessionMessage::Description(part)) => {
                self.take_part(now_ns, client, &ReplicaFrame::Description(*part), host);
            }
            (MemberState::Member, SessionMessage::Ask(asked_ns)) => {
                // Of several questions the last is answered: that bounds what waits.
                let by_hello = member.asked.is_some_and(|asked| asked.by_hello);
                member.asked = Some(TimeRequest { asked_ns: *asked_ns, came_ns: now_ns, by_hello });
                self.is_due(client);
            }
            _ => self.refuse_bad(now_ns, client, BadSessionFrame::Damaged("a frame that is not for now"), host),
        }
    }

    fn take_hello(&mut self, now_ns: u64, client: ClientIndex, hello: &SessionHello<'_>, host: &mut impl ServerHost) {
        if let Some(member) = self.member_mut(client) {
            match member.certified {
                None => hello.name.clone_into(&mut member.name),
                Some(system) if system != hello.system => {
                    let text = format!("its certificate is of system {system}, its hello of {}", hello.system);
                    return self.refuse(now_ns, client, SessionRefusalReason::Certificate, (0, 0), &text, host);
                }
                Some(_) => {}
            }
        }
        if let Some(PendingRefusal { reason, digests, text }) = self.difference(hello) {
            return self.refuse(now_ns, client, reason, digests, &text, host);
        }
        let owner = self.member(client).map(|member| &member.principal);
        let older = owner.and_then(|owner| self.places.of_incarnation(owner, hello.incarnation));
        if let Some((older, attempt)) = older.and_then(|older| Some((older, self.member(older)?.attempt))) {
            if attempt >= hello.attempt {
                return self.refuse(now_ns, client, SessionRefusalReason::Replaced, (0, 0), "", host);
            }
            self.refuse(now_ns, older, SessionRefusalReason::Replaced, (0, 0), "", host);
        }
        if !self.take_in(now_ns, client, hello, host) {
            return self.refuse(now_ns, client, SessionRefusalReason::Full, (0, 0), "", host);
        }
        if let Some(member) = self.member(client) {
            host.event(ServerEvent::Joined { name: &member.name });
        }
        self.is_due(client);
    }

    /// What differs, and the end that has the right one.
    fn difference(&self, hello: &SessionHello<'_>) -> Option<PendingRefusal> {
        let settings = &self.settings;
        let differs = |reason, digests, holder: &str| PendingRefusal { reason, digests, text: holder.to_owned() };
        if hello.common != settings.common {
            return Some(differs(SessionRefusalReason::Common, (hello.common, settings.common), &settings.name));
        }
        let own = settings.system.filter(|(system, _)| *system == hello.system);
        let own = own.map(|(_, digest)| (settings.name.as_str(), digest));
        let first = || self.places.of_system(hello.system).and_then(|first| self.member(first));
        let held = own.or_else(|| first().map(|member| (member.name.as_str(), member.system_digest)));
        let (holder, digest) = held.filter(|(_, digest)| *digest != hello.system_digest)?;
        Some(differs(SessionRefusalReason::System, (hello.system_digest, digest), holder))
    }

    fn refuse_bad(&mut self, now_ns: u64, client: ClientIndex, bad: BadSessionFrame, host: &mut impl ServerHost) {
        let reason = if matches!(bad, BadSessionFrame::Version(_)) {
            SessionRefusalReason::Version
        } else {
            SessionRefusalReason::Damaged
        };
        self.refuse(now_ns, client, reason, (0, 0), &bad.to_string(), host);
    }

    /// Tells a client why it may not take part; then it is closed. What it hosted it hosts no more from now on.
    pub(super) fn refuse(
        &mut self,
        now_ns: u64,
        client: ClientIndex,
        reason: SessionRefusalReason,
        digests: (u64, u64),
        text: &str,
        host: &mut impl ServerHost,
    ) {
        let Some(Some(member)) = self.members.get(usize::from(client.0)) else { return };
        match member.state {
            MemberState::Leaving { .. } => return,
            MemberState::Handshake => {
                self.places.handshake_ends(client, member);
                host.event(ServerEvent::Refused { name: &member.name, reason, digests, text });
            }
            MemberState::Member => self.leave(now_ns, client, Some(reason), host),
        }
        let Some(member) = self.member_mut(client) else { return };
        member.state = MemberState::Leaving { until_ns: now_ns + LEAVE_WITHIN_NS };
        let text = text[..text.floor_char_boundary(NAME_BYTES_MAX)].to_owned();
        member.refused = Some(PendingRefusal { reason, digests, text });
        self.is_due(client);
    }
}
