//! The screen of a station, drawn into a buffer of any size. Colour is never the only mark.
//!
//! ```text
//! station 6: group 6 of 3 robots, led by robot 1; views are equal      head
//! ######                                                               map: # wall, . path, a robot's number,
//! #1.F4#                                                               F fake, I intruder, ? uncertain
//! robot  way     silent  place                                         tables: robots, objects, messages
//! arrows, f m x i Q q                                                  keys, or what came of the last one
//! ```

use super::ground::StationGround;
use crate::team::members;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};
use rohrpost::interfaces::{StationAnswer, StationRequest, StationRequestKind, StationState, TeamState};
use rohrpost::output::plain;
use rohrpost_team::grid::{Cell, Square};

const KEYS: &str = "arrows move the mark   f fake  m move it  x remove   i info  Q quit all   q end";

pub(super) struct Watched<'a> {
    pub(super) ground: &'a StationGround,
    pub(super) team: &'a TeamState,
    pub(super) station: &'a StationState,
    pub(super) mark: Cell,
    pub(super) said: &'a str,
}

impl Watched<'_> {
    pub(super) fn draw(&self, area: Rect, to: &mut Buffer) {
        let map = (self.ground.grid().rows() as u16).min(area.height / 2);
        let [head, middle, below, foot] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Length(map),
            Constraint::Min(0),
            Constraint::Length(1),
        ])
        .areas(area);
        let reversed = Style::new().add_modifier(Modifier::REVERSED);
        put(to, head, &format!("station {}: {}", self.team.robot, members::verdict(self.team)), reversed);
        self.map(middle, to);
        let mut lines: Vec<String> = members::tables(self.team).lines().map(str::to_owned).collect();
        lines.extend(self.station.requests.last().map(asked));
        lines.extend(self.station.messages.iter().rev().map(|it| format!("robot {}: {}", it.robot, it.text)));
        for (place, line) in below.rows().zip(lines) {
            put(to, place, &line, Style::new());
        }
        put(to, foot, if self.said.is_empty() { KEYS } else { self.said }, Style::new().add_modifier(Modifier::BOLD));
    }

    /// The part of the map around the mark.
    fn map(&self, area: Rect, to: &mut Buffer) {
        let grid = self.ground.grid();
        let first = |mark: u32, room: u16, all: u32| {
            let room = u32::from(room);
            mark.saturating_sub(room / 2).min(all.saturating_sub(room))
        };
        let column = first(self.mark.column, area.width, grid.columns());
        let row = first(self.mark.row, area.height, grid.rows());
        let place = |cell: Cell| {
            let (x, y) = (cell.column.checked_sub(column)? as u16, cell.row.checked_sub(row)? as u16);
            (x < area.width && y < area.height).then_some((area.x + x, area.y + y))
        };
        let mut draw = |cell: Cell, symbol: char| {
            if let Some(it) = place(cell).and_then(|at| to.cell_mut(at)) {
                it.set_char(symbol);
            }
        };
        for (cell, square) in grid.cells() {
            draw(
                cell,
                match square {
                    Square::Wall => '#',
                    Square::Path => '.',
                    Square::Blank => ' ',
                },
            );
        }
        for object in &self.team.objects {
            let symbol = match (object.fake, object.certain) {
                (true, _) => 'F',
                (false, true) => 'I',
                (false, false) => '?',
            };
            self.ground.cell(object.x_m, object.y_m).into_iter().for_each(|cell| draw(cell, symbol));
        }
        for member in self.team.members.iter().filter(|member| member.fresh) {
            let cell = member.pose.and_then(|pose| self.ground.cell(pose.x_m, pose.y_m));
            let symbol = char::from_digit(u32::from(member.robot) % 36, 36).unwrap_or('*');
            cell.into_iter().for_each(|cell| draw(cell, symbol));
        }
        if let Some(it) = place(self.mark).and_then(|at| to.cell_mut(at)) {
            it.set_style(Style::new().add_modifier(Modifier::REVERSED));
        }
    }
}

/// How it stands with a request: robots by answer.
fn asked(request: &StationRequest) -> String {
    let kind = match request.kind {
        StationRequestKind::Info => "info",
        StationRequestKind::Quit => "quit",
    };
    let of = |answer: StationAnswer, word: &str| {
        let robots = request.robots.iter().filter(|it| it.answer == answer);
        let robots: Vec<String> = robots.map(|it| it.robot.to_string()).collect();
        (!robots.is_empty()).then(|| format!("{word} {}", robots.join(" ")))
    };
    let parts = [
        of(StationAnswer::Done, "done by"),
        of(StationAnswer::Waiting, "waits for"),
        of(StationAnswer::Refused, "REFUSED by"),
        of(StationAnswer::GivenUp, "NOT ANSWERED by"),
        of(StationAnswer::Restarted, "restarted:"),
        of(StationAnswer::Station, "stations:"),
    ];
    format!("request {} {kind}: {}", request.number, parts.into_iter().flatten().collect::<Vec<_>>().join(", "))
}

fn put(to: &mut Buffer, place: Rect, text: &str, style: Style) {
    to.set_style(place, style);
    to.set_stringn(place.x, place.y, plain::line(text), place.width.into(), style);
}
