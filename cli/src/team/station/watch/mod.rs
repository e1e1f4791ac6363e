//! `rohrpost station watch`: the team live, on its map; and a person's keys.
//!
//! ```text
//! station ── states ──▶ Watched ──▶ draw ──▶ screen
//! keys ──▶ Person ──▶ calls ──▶ station
//! ```

mod draw;
mod ground;

use super::link::StationLink;
use super::{ask, fake};
use crate::look::newest;
use crate::look::target::Inquiry;
use crate::terminal::Failure;
use crate::terminal::raw::{RawTerminal, keyboard};
use draw::Watched;
use ground::StationGround;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{Event, KeyCode, KeyEventKind, KeyModifiers};
use rohrpost::interface::Interface;
use rohrpost::interfaces::{StationRequestKind, StationState, TeamInterface, TeamObjectId, TeamState};
use rohrpost_launch::{Event as LaunchEvent, events};
use rohrpost_mailbox::Name;
use rohrpost_team::grid::{Cell, Direction};
use std::io::IsTerminal;
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// From one look at the station to the next: its beat.
const INTERVAL: Duration = Duration::from_millis(500);
/// Between two looks whether a signal ends it.
const LOOK: Duration = Duration::from_millis(100);

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost station watch\nKeys: arrows move the mark; f makes up an intruder there, m \
    moves the last one there, x removes the one there; i asks all robots, Q tells all to end, after y; q ends it.")]
pub(super) struct Arguments {
    #[command(flatten)]
    inquiry: Inquiry,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    if arguments.inquiry.json || !std::io::stdout().is_terminal() || !std::io::stdin().is_terminal() {
        return Err("`station watch` draws on a terminal; for programs, `rohrpost team --json`".into());
    }
    let told = events()?;
    let mut person = Person::new(StationLink::find(&arguments.inquiry)?)?;
    let mut screen = RawTerminal::new()?;
    let typed = keyboard()?;
    person.watch(&mut screen.0, &typed, || matches!(told.try_recv(), Ok(LaunchEvent::Stop)))?;
    Ok(ExitCode::SUCCESS)
}

/// What is seen, where the mark is, and what came of the last key.
struct Person {
    link: StationLink,
    /// The station, under the name that tells of the team.
    member: Name,
    ground: StationGround,
    team: TeamState,
    station: StationState,
    mark: Cell,
    /// The intruder that was made up or moved last.
    last: Option<TeamObjectId>,
    /// All are to end, if the next key is y.
    asks_quit: bool,
    said: String,
}

impl Person {
    fn new(mut link: StationLink) -> Result<Self, Failure> {
        let ground = StationGround::read(&link)?;
        let member = link.running.module(TeamInterface::CLASS)?;
        let station = link.state()?;
        let (mark, said) = (ground.first_path(), String::new());
        let team = TeamState::default();
        let mut person = Self { link, member, ground, team, station, mark, last: None, asks_quit: false, said };
        person.look();
        Ok(person)
    }

    fn watch(
        &mut self,
        terminal: &mut DefaultTerminal,
        typed: &Receiver<Event>,
        stop: impl Fn() -> bool,
    ) -> Result<(), Failure> {
        let mut next = Instant::now() + INTERVAL;
        while !stop() {
            let seen = Watched {
                ground: &self.ground,
                team: &self.team,
                station: &self.station,
                mark: self.mark,
                said: &self.said,
            };
            terminal.draw(|frame| seen.draw(frame.area(), frame.buffer_mut()))?;
            match typed.recv_timeout(LOOK.min(next.saturating_duration_since(Instant::now()))) {
                Ok(Event::Key(key)) if key.kind == KeyEventKind::Press => {
                    let is_interrupt = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
                    if is_interrupt || !self.key(key.code) {
                        return Ok(());
                    }
                }
                Ok(_) | Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err("the terminal was closed".into()),
            }
            if Instant::now() >= next {
                next = Instant::now() + INTERVAL;
                self.look();
            }
        }
        Ok(())
    }

    /// Reads the states anew; of a station that does not answer the last ones stay.
    fn look(&mut self) {
        let StationLink { running, tool, .. } = &mut self.link;
        let team = newest(tool, self.member, TeamInterface::STATE).map_err(|error| running.told(self.member, &error));
        match team.and_then(|(_, team)| Ok((team, self.link.state()?))) {
            Ok((team, station)) => (self.team, self.station) = (team, station),
            Err(error) => self.said = error.to_string(),
        }
    }

    /// Does what a key says; false: it ends.
    fn key(&mut self, key: KeyCode) -> bool {
        let asked = std::mem::take(&mut self.asks_quit);
        match key {
            KeyCode::Char('q') => return false,
            KeyCode::Up => self.step(Direction::North),
            KeyCode::Down => self.step(Direction::South),
            KeyCode::Left => self.step(Direction::West),
            KeyCode::Right => self.step(Direction::East),
            KeyCode::Char('Q') => {
                self.asks_quit = true;
                self.said = "all robots are to end? y".into();
            }
            KeyCode::Char('y') if asked => self.ask(StationRequestKind::Quit),
            KeyCode::Char('i') => self.ask(StationRequestKind::Info),
            KeyCode::Char('f') => self.set(),
            KeyCode::Char('m') => self.move_last(),
            KeyCode::Char('x') => self.remove(),
            _ => self.said.clear(),
        }
        true
    }

    fn step(&mut self, direction: Direction) {
        self.mark = self.ground.beside(self.mark, direction);
        self.said.clear();
    }

    /// Tells what became of a call, and looks.
    fn tell(&mut self, done: Result<String, Failure>) {
        self.said = done.unwrap_or_else(|error| error.to_string());
        self.look();
    }

    fn ask(&mut self, kind: StationRequestKind) {
        let asked = self.link.call::<u32>(ask::ASK, &(kind, None::<u8>));
        self.tell(asked.map(|number| format!("request {number}")));
    }

    fn set(&mut self) {
        let set = self.link.call::<TeamObjectId>(fake::SET, &self.ground.middle_m(self.mark));
        self.last = set.as_ref().ok().copied().or(self.last);
        self.tell(set.map(|id| format!("{} set", fake::name(id))));
    }

    fn move_last(&mut self) {
        let Some(id) = self.last else { return self.said = "f makes up an intruder first".into() };
        let (x_m, y_m) = self.ground.middle_m(self.mark);
        let moved = self.link.call::<()>(fake::MOVE, &(id, x_m, y_m));
        self.tell(moved.map(|()| format!("{} moved", fake::name(id))));
    }

    fn remove(&mut self) {
        let here = self.team.objects.iter().find(|it| it.fake && self.ground.cell(it.x_m, it.y_m) == Some(self.mark));
        let Some(id) = here.map(|object| object.id) else { return self.said = "no made-up intruder is there".into() };
        let removed = self.link.call::<()>(fake::REMOVE, &(id,));
        self.tell(removed.map(|()| format!("{} removed", fake::name(id))));
    }
}
