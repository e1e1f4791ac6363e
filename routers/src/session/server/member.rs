//! One connection, as the server knows it.

use super::principal::{Principal, PrincipalId};
use super::rights::Rights;
use super::work::Registrations;
use crate::frame::NodeIndex;
use crate::session::frame::{RegistrationVerdict, SessionHello, SessionRefusalReason};
use crate::session::outgoing::Outgoing;
use crate::session::splitter::Splitter;

/// How far a connection has come.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum MemberState {
    /// It has not said hello.
    Handshake,
    /// It takes part.
    Member,
    /// It is told why it may not any more, and then closed.
    Leaving {
        /// When it is closed whether it has read that or not, ns.
        until_ns: u64,
    },
}

/// A request for the time that waits for its response.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeRequest {
    pub(super) asked_ns: u64,
    pub(super) came_ns: u64,
    /// It came with the hello: the answer is the welcome.
    pub(super) by_hello: bool,
}

/// A verdict that is not sent yet.
#[derive(Debug)]
pub(super) struct PendingVerdict {
    /// But for the holder.
    pub(super) verdict: RegistrationVerdict<'static>,
    pub(super) holder: String,
}

/// A refusal that is not sent yet.
#[derive(Debug)]
pub(super) struct PendingRefusal {
    pub(super) reason: SessionRefusalReason,
    pub(super) digests: (u64, u64),
    pub(super) text: String,
}

/// The round trip: a client says something as soon as it reads its welcome.
#[derive(Clone, Copy, Default, Debug)]
pub(super) enum RoundTrip {
    /// There was no welcome.
    #[default]
    Unknown,
    /// It left then, ns.
    Since(u64),
    /// It takes so long, ns.
    Takes(u64),
}

#[derive(Debug)]
pub(super) struct Member {
    pub(super) state: MemberState,
    /// Its name for people; until the hello, where it comes from.
    pub(super) name: String,
    pub(super) system: u8,
    /// The system that it has proven to be of; none: it need not.
    pub(super) certified: Option<u8>,
    /// It has shown no certificate, says that it is a node of the file, and comes from where the file says that is.
    pub(super) is_at_home: bool,
    /// Which names of its system it may host.
    pub(super) rights: Rights,
    /// Where it comes from.
    pub(super) address: Principal,
    /// The owner: that, or its certificate's.
    pub(super) principal: Principal,
    /// The same by its number, as long as it takes part.
    pub(super) principal_id: PrincipalId,
    /// The party that it takes turns as: the nodes of a system, which trust each other, are one party, and anybody
    /// else is one by itself.
    pub(super) party: u32,
    pub(super) system_digest: u64,
    pub(super) reaches_own: bool,
    pub(super) incarnation: u64,
    pub(super) attempt: u64,
    pub(super) splitter: Splitter,
    pub(super) outgoing: Outgoing,
    pub(super) asked: Option<TimeRequest>,
    pub(super) registrations: Registrations,
    pub(super) verdict: Option<PendingVerdict>,
    pub(super) refused: Option<PendingRefusal>,
    pub(super) round_trip: RoundTrip,
    /// When the connection began, ns.
    pub(super) began_ns: u64,
    /// When something came last, ns.
    pub(super) heard_ns: u64,
    /// When the stream last took something, or there was nothing to take, ns.
    pub(super) moved_ns: u64,
    /// The stream takes nothing for now.
    pub(super) is_blocked: bool,
    /// It stands in the list of those for which something is to be done.
    pub(super) is_due: bool,
    /// The node that it is the client of, where that has replicas by it.
    pub(super) node: Option<NodeIndex>,
    /// Parts of replicas wait for it.
    pub(super) has_parts: bool,
    /// The turn in which it got one last.
    pub(super) part_turn: u64,
}

impl Member {
    pub(super) fn new(now_ns: u64, name: String, address: Principal, quota_bytes: usize) -> Self {
        Self {
            state: MemberState::Handshake,
            name,
            system: 0,
            certified: None,
            is_at_home: false,
            rights: Rights::any(),
            principal: address.clone(),
            address,
            principal_id: 0,
            party: 0,
            system_digest: 0,
            reaches_own: false,
            incarnation: 0,
            attempt: 0,
            splitter: Splitter::default(),
            outgoing: Outgoing::new(quota_bytes),
            asked: None,
            registrations: Registrations::default(),
            verdict: None,
            refused: None,
            round_trip: RoundTrip::default(),
            began_ns: now_ns,
            heard_ns: now_ns,
            moved_ns: now_ns,
            is_blocked: false,
            is_due: false,
            node: None,
            has_parts: false,
            part_turn: 0,
        }
    }

    /// It said hello, and may take part.
    pub(super) fn joins(&mut self, now_ns: u64, hello: &SessionHello<'_>) {
        self.state = MemberState::Member;
        if self.certified.is_none() {
            hello.name.clone_into(&mut self.name);
        }
        self.system = hello.system;
        self.system_digest = hello.system_digest;
        self.reaches_own = hello.reaches_own;
        self.incarnation = hello.incarnation;
        self.attempt = hello.attempt;
        self.asked = Some(TimeRequest { asked_ns: hello.asked_ns, came_ns: now_ns, by_hello: true });
    }

    /// Whether it had its time to read why it must leave.
    pub(super) fn is_over(&self, now_ns: u64) -> bool {
        matches!(self.state, MemberState::Leaving { until_ns } if now_ns >= until_ns)
    }

    pub(super) fn is_member(&self) -> bool {
        self.state == MemberState::Member
    }

    /// Whether there is more to be written than what is ready.
    pub(super) fn has_more(&self) -> bool {
        let is_leaving = matches!(self.state, MemberState::Leaving { .. });
        let says = self.asked.is_some() || self.verdict.is_some() || self.refused.is_some();
        is_leaving || says || self.outgoing.has_waiting() || self.has_parts
    }

    pub(super) fn bytes(&self) -> usize {
        let waiting = self.splitter.bytes() + self.registrations.bytes() + self.outgoing.bytes();
        size_of::<Self>() + self.name.capacity() + waiting
    }
}
