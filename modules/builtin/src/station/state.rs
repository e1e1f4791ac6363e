//! What a station publishes of what it has asked and heard.

use rohrpost_modules::interfaces::{
    StationAnswer, StationMessage, StationRequest, StationRequestKind, StationRobot, StationState,
};
use rohrpost_payload::{Asked, Asking, RequestKind, Said, Station};

/// Bytes of messages that are published.
const MESSAGES_BYTES_MAX: usize = 24 << 10;
/// Most bytes of a message, besides its text.
const MESSAGE_BYTES: usize = 24;

pub(super) fn of(station: &Station, now_ns: u64) -> StationState {
    let group = station.team().group();
    let said: Vec<&Said> = station.said().collect();
    let mut bytes = 0;
    let fits = |said: &&&Said| {
        bytes += MESSAGE_BYTES + said.text.len();
        bytes <= MESSAGES_BYTES_MAX
    };
    let newest = said.iter().rev().take_while(fits).count();
    let told = &said[said.len() - newest..];
    StationState {
        robot: group.me().get(),
        incarnation: group.version().incarnation,
        requests: station.asked().map(|asked| request(now_ns, asked)).collect(),
        messages: told.iter().map(|said| message(now_ns, said)).collect(),
        more_messages: (said.len() - newest) as u32,
    }
}

fn request(now_ns: u64, asked: &Asked) -> StationRequest {
    let kind = match asked.kind {
        RequestKind::Info => StationRequestKind::Info,
        RequestKind::Quit => StationRequestKind::Quit,
    };
    let robots = asked.robots.iter().map(|(robot, (_, asking))| {
        let answer = match asking {
            Asking::Waiting => StationAnswer::Waiting,
            Asking::Done => StationAnswer::Done,
            Asking::Refused => StationAnswer::Refused,
            Asking::Station => StationAnswer::Station,
            Asking::Restarted => StationAnswer::Restarted,
            Asking::GivenUp => StationAnswer::GivenUp,
        };
        StationRobot { robot: robot.get(), answer }
    });
    StationRequest {
        number: asked.number,
        kind,
        age_ms: ms(now_ns, asked.at_ns),
        tries: asked.tries,
        over: asked.is_over(),
        robots: robots.collect(),
    }
}

fn message(now_ns: u64, said: &Said) -> StationMessage {
    StationMessage {
        robot: said.from.get(),
        age_ms: ms(now_ns, said.at_ns),
        answers: said.answers,
        text: said.text.clone(),
    }
}

fn ms(now_ns: u64, since_ns: u64) -> u64 {
    now_ns.saturating_sub(since_ns) / 1_000_000
}
