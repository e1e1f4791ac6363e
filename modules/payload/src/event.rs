//! Events of the tree, and the bytes of those that go to teammates.

use rohrpost_team::Position;
use rohrpost_team::coordination::TrafficMessage;
use rohrpost_team::events::EventType;
use rohrpost_team::group::Hello;
use rohrpost_team::view::Records;

/// Characters of a report at most.
const REPORT_MAX: usize = 1000;

/// What a station asks of all mobiles (seed 000, 4.5.3).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Request {
    /// Each mobile is to send its view as a text.
    Info,
    /// Each mobile is to end.
    Quit,
}

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
    Report(String),
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
            Self::Request(Request::Info) => Some(vec![1]),
            Self::Request(Request::Quit) => Some(vec![2]),
            Self::Report(text) => Some(text.chars().take(REPORT_MAX).collect::<String>().into_bytes()),
            _ => None,
        }
    }

    /// Reads what stands behind the head of an event with this number; `None` if that is no event of this type.
    pub(crate) fn decode(number: u8, bytes: &[u8], types: Types) -> Option<Self> {
        if number == types.request.number() {
            let request = match bytes {
                [1] => Request::Info,
                [2] => Request::Quit,
                _ => return None,
            };
            return Some(Self::Request(request));
        }
        let text = str::from_utf8(bytes).ok().filter(|text| text.chars().count() <= REPORT_MAX);
        text.filter(|_| number == types.report.number()).map(|text| Self::Report(text.into()))
    }
}
