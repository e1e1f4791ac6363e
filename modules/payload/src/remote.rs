//! Leaves of the branch remote control (seed 000, 4.5.3): what a station asks, and what mobiles answer.

use crate::event::{Event, Request, Types};
use crate::state::{News, State};
use rohrpost_team::RobotId;
use rohrpost_team::events::Turn;
use std::fmt::Write;

/// A person at this station asks something of all mobiles.
pub(crate) fn command(event: &Event, turn: &mut Turn<'_, Event>, types: Types) {
    turn.send(types.request, event.clone());
}

/// A mobile does what a station of its team asks.
pub(crate) fn obey(state: &mut State, event: &Event, turn: &mut Turn<'_, Event>, types: Types) {
    let (Event::Request(request), Some(from)) = (event, turn.from) else { return };
    if !state.settings.stations.contains(&from) {
        return state.tell(News::Refused(from));
    }
    match request {
        Request::Info => drop(turn.send(types.report, Event::Report(report(state)))),
        Request::Quit => {
            state.has_quit = true;
            state.tell(News::Quit(from));
        }
    }
}

/// A report has come.
pub(crate) fn read(state: &mut State, event: &Event, from: Option<RobotId>) {
    if let (Event::Report(text), Some(from)) = (event, from) {
        state.tell(News::Report { from, text: text.clone() });
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
