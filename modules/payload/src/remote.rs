//! Leaves of the branch remote control (seed 000, 4.5.3): what a station asks, and what mobiles answer.

use crate::event::{Event, Types};
use crate::request::{Answer, Report, RequestKind};
use crate::state::{News, State};
use rohrpost_team::events::Turn;
use rohrpost_team::{RobotId, Run};
use std::fmt::Write;

/// A robot that is to end acknowledges repetitions for so many beats, and stands meanwhile.
const QUIT_BEATS: u8 = 6;

/// A person at this robot or station has something to say to all others.
pub(crate) fn command(event: &Event, turn: &mut Turn<'_, Event>, types: Types) {
    let event_type = if matches!(event, Event::Report(_)) { types.report } else { types.request };
    turn.send(event_type, event.clone());
}

/// A mobile does what a station of its team asks.
pub(crate) fn obey(state: &mut State, event: &Event, turn: &mut Turn<'_, Event>, types: Types) {
    let (Event::Request(request), Some(from)) = (event, turn.from) else { return };
    let group = state.team.group();
    let own = Run { robot: group.me(), incarnation: group.version().incarnation };
    if !request.to.contains(&own) {
        return;
    }
    let (answer, text) = if state.settings.is_station {
        (Answer::Station, "a station".into())
    } else if !state.settings.stations.contains(&from) {
        if state.refused.replace(request.id) != Some(request.id) {
            state.tell(News::Refused(from));
        }
        (Answer::Refused, refusal(state))
    } else {
        let text = match request.kind {
            RequestKind::Info => report(state),
            RequestKind::Quit => quit(state, from),
        };
        (Answer::Done, text)
    };
    turn.send(types.report, Event::Report(Report { answers: Some((request.id, answer)), text }));
}

fn quit(state: &mut State, from: RobotId) -> String {
    if state.quit_beats.is_none() {
        state.quit_beats = Some(QUIT_BEATS);
        state.tell(News::Quit(from));
    }
    "ends".into()
}

fn refusal(state: &State) -> String {
    let stations: Vec<String> = state.settings.stations.iter().map(RobotId::to_string).collect();
    if stations.is_empty() { "obeys no station".into() } else { format!("obeys {} alone", stations.join(", ")) }
}

/// A report has come. What answers other stations is theirs.
pub(crate) fn read(state: &mut State, event: &Event, from: Option<RobotId>) {
    let (Event::Report(report), Some(from)) = (event, from) else { return };
    let me = state.team.group().me();
    if report.answers.is_none_or(|(id, _)| id.station.robot == me) {
        state.tell(News::Report { from, report: report.clone() });
    }
}

/// Mode, cell and view of this robot.
fn report(state: &State) -> String {
    let mut text = state.mode.to_string();
    let _ = match (state.cell(), state.lost) {
        (Some(cell), _) => write!(text, " at {cell}"),
        (None, Some(cause)) => write!(text, ", lost: {cause}"),
        (None, None) => Ok(()),
    };
    for object in state.team.view().objects() {
        let certain = if object.certain { "certain" } else { "uncertain" };
        let fake = if object.is_fake { ", fake" } else { "" };
        let at = object.position;
        let _ = write!(text, "; intruder at {} mm, {} mm, {certain}{fake}", at.x_mm, at.y_mm);
    }
    text
}
