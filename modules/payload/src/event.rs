//! Events of the tree, and the bytes of those that go to teammates.

use crate::request::{Report, Request};
use rohrpost_team::Position;
use rohrpost_team::coordination::TrafficMessage;
use rohrpost_team::events::{EventHead, EventType};
use rohrpost_team::group::Hello;
use rohrpost_team::view::Records;

/// What events carry.
#[derive(Clone, Debug)]
pub(crate) enum Event {
    /// Twice a second.
    Beat,
    /// Pose and scan came.
    Pose,
    /// What the scanner sees and no wall explains: middles.
    Obstacle(Vec<Position>),
    /// Obstacles of which nobody knows what they are.
    Object(Vec<Position>),
    /// A teammate's pose.
    Hello(Box<Hello>),
    /// New records of a teammate, or a synchro.
    Records(Box<Records>),
    /// Place and claim of a teammate.
    Traffic(Box<TrafficMessage>),
    /// The route is to be computed anew.
    Move,
    /// Of a station.
    Request(Request),
    /// Of a mobile, for people.
    Report(Report),
}

/// Types of events, as the plan numbers them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Types {
    pub(crate) beat: EventType,
    pub(crate) pose: EventType,
    pub(crate) obstacle: EventType,
    pub(crate) object: EventType,
    pub(crate) heard: EventType,
    pub(crate) synchro: EventType,
    pub(crate) traffic: EventType,
    pub(crate) moved: EventType,
    pub(crate) command: EventType,
    pub(crate) request: EventType,
    pub(crate) report: EventType,
}

impl Types {
    /// All of them.
    pub(crate) fn all(&self) -> impl Iterator<Item = EventType> {
        let Self { beat, pose, obstacle, object, heard, synchro, traffic, moved, command, request, report } = *self;
        [beat, pose, obstacle, object, heard, synchro, traffic, moved, command, request, report].into_iter()
    }
}

impl Event {
    /// The bytes behind the head; `None` of an event that does not leave its robot.
    pub(crate) fn encode(&self) -> Option<Vec<u8>> {
        match self {
            Self::Request(request) => Some(request.encode()),
            Self::Report(report) => Some(report.encode()),
            _ => None,
        }
    }

    /// Reads what stands behind the head of an event; `None` if that is no event of its type.
    pub(crate) fn decode(head: &EventHead, bytes: &[u8], types: Types) -> Option<Self> {
        if head.event_type == types.request.number() {
            return Request::decode(head.from, bytes).map(Self::Request);
        }
        Report::decode(bytes).filter(|_| head.event_type == types.report.number()).map(Self::Report)
    }
}
