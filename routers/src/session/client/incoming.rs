//! What comes from the server.

use super::asking::Asking;
use super::{Client, ClientEvent, ClientHost, ClientPackage, ClientState, REGISTER_AGAIN_NS, Registration, Reported};
use crate::admission::{ArrivalPath, NotAdmitted, capped};
use crate::frame::ReplicaFrame;
use crate::session::counts::Cause;
use crate::session::estimate::ServerClockEstimate;
use crate::session::frame::{
    BadSessionFrame, Carried, LENGTH_MAX, RegistrationVerdict, SessionMessage, SessionRefusal, SessionRefusalReason,
    VERSION, Welcome,
};
use crate::session::{AGE_MAX_NS, answer_to};

impl Client {
    /// Takes bytes of the server's stream, split anywhere.
    pub fn received(&mut self, now_ns: u64, mut bytes: &[u8], host: &mut impl ClientHost) {
        self.heard_ns = now_ns;
        self.asking.heard();
        let mut splitter = std::mem::take(&mut self.splitter);
        while matches!(self.state, ClientState::Handshake { .. } | ClientState::Member) {
            let message = match splitter.next(now_ns, LENGTH_MAX, &mut bytes) {
                Ok(None) => break,
                Ok(Some((head, rest))) => SessionMessage::parse(head, rest),
                Err(bad) => Err(bad),
            };
            match message {
                Ok(message) => self.handle(now_ns, &message, host),
                Err(bad) => self.damaged(now_ns, bad, host),
            }
        }
        self.splitter = splitter;
    }

    fn handle(&mut self, now_ns: u64, message: &SessionMessage<'_>, host: &mut impl ClientHost) {
        match (self.state, message) {
            (_, SessionMessage::Refusal(refusal)) => self.refused(now_ns, refusal, host),
            (ClientState::Handshake { .. }, SessionMessage::Welcome(welcome)) => self.welcomed(now_ns, welcome, host),
            (ClientState::Member, SessionMessage::Registered(verdict)) => self.registered(now_ns, verdict, host),
            (ClientState::Member, SessionMessage::Package(carried)) => self.take(now_ns, carried, host),
            (ClientState::Member, SessionMessage::Record(part)) => {
                self.take_part(now_ns, &ReplicaFrame::Record(*part), host);
            }
            (ClientState::Member, SessionMessage::Description(part)) => {
                self.take_part(now_ns, &ReplicaFrame::Description(*part), host);
            }
            (ClientState::Member, SessionMessage::Answer(answer)) => {
                self.estimate.heard(now_ns, answer);
            }
            _ => self.damaged(now_ns, BadSessionFrame::Damaged("a frame that is not for now"), host),
        }
    }

    fn take_part(&self, now_ns: u64, part: &ReplicaFrame<'_>, host: &mut impl ClientHost) {
        if let Some(replicas) = host.replicas() {
            replicas.take(now_ns, (Some(replicas.server()), self.server_incarnation), part);
        }
    }

    fn welcomed(&mut self, now_ns: u64, welcome: &Welcome, host: &mut impl ClientHost) {
        let (yours, ours) = (self.settings.common, welcome.common);
        if yours != ours {
            let text = "the TCP router";
            let refusal = SessionRefusal { version: VERSION, reason: SessionRefusalReason::Common, yours, ours, text };
            return self.refused(now_ns, &refusal, host);
        }
        if welcome.incarnation != self.server_incarnation {
            self.server_incarnation = welcome.incarnation;
            self.estimate = ServerClockEstimate::default();
        }
        self.estimate.heard(now_ns, &welcome.time);
        self.state = ClientState::Member;
        self.joined_ns = Some(now_ns);
        self.asking = Asking::begin(now_ns);
    }

    fn registered(&mut self, now_ns: u64, verdict: &RegistrationVerdict<'_>, host: &mut impl ClientHost) {
        if verdict.number != self.number || self.registration != Registration::Asked {
            return;
        }
        if verdict.objection.is_none() {
            self.registration = Registration::Holds;
            self.told = Some(Reported::Up);
            self.set_line(now_ns, true, host);
            return host.event(ClientEvent::Up);
        }
        self.registration = Registration::Due(now_ns + REGISTER_AGAIN_NS);
        if self.told != Some(Reported::Objected) {
            self.told = Some(Reported::Objected);
            host.event(ClientEvent::Objected(verdict));
        }
    }

    fn take(&mut self, now_ns: u64, carried: &Carried<'_>, host: &mut impl ClientHost) {
        let head = capped(&carried.head);
        let carried = Carried { head, ..*carried };
        self.inn.came(head.priority);
        let Some(session) = self.estimate.session(now_ns) else { return };
        // As old as it may be at most: a command that came too late must not be run.
        let oldest_ns = session.ns.saturating_add(session.error_ns).saturating_sub(carried.published_ns);
        let shift = i128::from(now_ns) - i128::from(session.ns);
        let published_ns = u64::try_from(i128::from(carried.published_ns) + shift).unwrap_or(0).min(now_ns);
        let delivered = match self.validate(&carried, host) {
            Err(cause) => Err(cause),
            Ok(()) if oldest_ns > AGE_MAX_NS => Err(Cause::Stale),
            Ok(()) => host.deliver(&Carried { published_ns, ..carried }).map_err(Cause::from),
        };
        match delivered {
            Ok(()) => self.inn.passed(head.priority),
            Err(cause) => {
                self.inn.lost(head.priority, cause);
                if let Some((head, body)) = answer_to(&head, carried.body, cause, None, host) {
                    self.send(now_ns, &ClientPackage { head, body: &body, published_ns: now_ns, hops: 0 }, host);
                }
            }
        }
    }

    fn validate(&self, carried: &Carried<'_>, host: &mut impl ClientHost) -> Result<(), Cause> {
        let (head, admission) = (&carried.head, &self.settings.admission);
        // The server knows which client hosts a name, and brings nothing back to the sender.
        let is_our_name = self.ranges.iter().any(|range| range.has(head.from));
        admission.validate(ArrivalPath::Beyond { is_our_name }, head, carried.body).map_err(|why| {
            if why == NotAdmitted::NotAllowed {
                host.not_allowed(admission.rule_against(head).map(|rule| rule.line));
            }
            why.into()
        })
    }

    fn refused(&mut self, now_ns: u64, refusal: &SessionRefusal<'_>, host: &mut impl ClientHost) {
        let reason = refusal.reason;
        if matches!(
            reason,
            SessionRefusalReason::Version
                | SessionRefusalReason::Common
                | SessionRefusalReason::System
                | SessionRefusalReason::Certificate
        ) {
            self.backoff.hopeless();
        }
        self.over(now_ns, Reported::Refused(reason), ClientEvent::Refused(refusal), host);
    }

    fn damaged(&mut self, now_ns: u64, bad: BadSessionFrame, host: &mut impl ClientHost) {
        self.over(now_ns, Reported::Damaged, ClientEvent::Damaged(bad), host);
    }

    /// The connection is to be closed. Why is told last: it is what people are to know.
    fn over(&mut self, now_ns: u64, told: Reported, event: ClientEvent<'_>, host: &mut impl ClientHost) {
        if self.is_up() {
            self.down_ns = now_ns;
            host.event(ClientEvent::Down);
        }
        self.set_line(now_ns, false, host);
        if self.told != Some(told) {
            host.event(event);
        }
        self.told = Some(told);
        self.state = ClientState::Closing;
    }
}
