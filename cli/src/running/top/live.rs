//! The loop at the terminal: observes, draws, handles keys, and polls calls.

use super::app::{App, Screen, ScreenAction};
use super::calls::{Answer, Calls};
use super::details;
use super::draw::{Palette, ScreenModel, columns};
use super::map::{MapPage, MapReader};
use super::model::{self, ErrorCauses, Model, NodeSurveys, Sample};
use super::output::Output;
use crate::look::control::supervisor;
use crate::look::observer::Silence;
use crate::look::target::Running;
use crate::terminal::Failure;
use crate::terminal::raw::{RawTerminal, keyboard};
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{Event, KeyEventKind};
use rohrpost::Name;
use rohrpost::interfaces::ControlState;
use rohrpost::schema::Description;
use rohrpost_launch::survey::Standing;
use rohrpost_launch::{Event as LaunchEvent, events};
use std::collections::HashMap;
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Polling period for signals and for outstanding answers.
const LOOK: Duration = Duration::from_millis(100);
const LOOK_WAITING: Duration = Duration::from_millis(10);

/// Draws until the user or a signal ends it.
pub(super) fn run(running: Running, interval: Duration, palette: Palette, first: Screen) -> Result<ExitCode, Failure> {
    let told = events()?;
    let mut live = Live::new(running, interval, palette)?;
    live.app.screen = first;
    let outcome = {
        let mut screen = RawTerminal::new()?;
        let typed = keyboard()?;
        live.watch(&mut screen.0, &typed, || matches!(told.try_recv(), Ok(LaunchEvent::Stop)))
    };
    outcome.map(|()| ExitCode::SUCCESS)
}

/// The selected nodes, except the own one.
fn others(running: &Running) -> impl Iterator<Item = &str> {
    running.shown().into_iter().filter(|node| *node != running.node_name)
}

fn not_seen_yet(running: &Running) -> NodeSurveys {
    others(running).map(|node| Err(Silence::new(node, "no report yet"))).collect()
}

/// The reports of all selected nodes, in the order of the configuration.
fn in_order(running: &Running, own: NodeSurveys, others: &NodeSurveys) -> NodeSurveys {
    let (mut own, mut others) = (own.into_iter(), others.iter().cloned());
    let next = |node: &str| if node == running.node_name { own.next() } else { others.next() };
    running.shown().into_iter().filter_map(next).collect()
}

struct Live {
    running: Running,
    interval: Duration,
    palette: Palette,
    app: App,
    /// The observation that rates are relative to, and the newest.
    earlier: Option<Sample>,
    now: Sample,
    model: Model,
    /// The last reports of other nodes, in the order of the configuration.
    others: NodeSurveys,
    silent_since: HashMap<String, Instant>,
    /// Interfaces of other nodes' modules; each module is asked once.
    described: HashMap<Name, Option<Description>>,
    /// Our place among the callers; none if all places are taken.
    calls: Option<Calls>,
    output: Output,
    /// Why modules are in error, as they reported.
    said: ErrorCauses,
    /// What a supervisor told last, for its page.
    control: Option<(Name, ControlState)>,
    /// What the page *map* reads, or why it cannot, once it was shown.
    map_reader: Option<Result<MapReader, String>>,
    map: MapPage,
}

impl Live {
    fn new(running: Running, interval: Duration, palette: Palette) -> Result<Self, Failure> {
        let others = not_seen_yet(&running);
        let seen = in_order(&running, model::own(&running)?, &others);
        let now = model::put_together(&running, seen, None, &ErrorCauses::default());
        let model = Model::new(&running.installation, &running.node_name, &running.shown(), &now, None);
        let output = Output::new(&running.installation);
        let mut live = Self {
            running,
            interval,
            palette,
            app: App::new(),
            earlier: None,
            now,
            model,
            others,
            silent_since: HashMap::new(),
            described: HashMap::new(),
            calls: None,
            output,
            said: ErrorCauses::default(),
            control: None,
            map_reader: None,
            map: MapPage::default(),
        };
        live.join();
        Ok(live)
    }

    /// Takes part as a tool, if a place is free. Counters are shown without it, too.
    fn join(&mut self) {
        match Calls::join(&self.running) {
            Ok(calls) => self.calls = Some(calls),
            Err(error) => self.output.silence = Some(error.to_string()),
        }
    }

    fn watch(
        &mut self,
        terminal: &mut DefaultTerminal,
        typed: &Receiver<Event>,
        stop: impl Fn() -> bool,
    ) -> Result<(), Failure> {
        let mut next = Instant::now() + self.interval;
        self.ask();
        let mut changed = true;
        while !stop() {
            if std::mem::take(&mut changed) {
                self.draw(terminal)?;
            }
            let look = if self.calls.as_ref().is_some_and(Calls::waits) { LOOK_WAITING } else { LOOK };
            let wait = if self.app.paused { look } else { look.min(next.saturating_duration_since(Instant::now())) };
            match typed.recv_timeout(wait) {
                Ok(event) if self.event(&event) => return Ok(()),
                Ok(_) => changed = true,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err("the terminal was closed".into()),
            }
            if Instant::now() >= next && !self.app.paused {
                next = Instant::now() + self.interval;
                self.look();
                changed = true;
            }
            changed |= self.read_map();
            changed |= self.answers();
        }
        Ok(())
    }

    /// Takes what scanner and odometry say, while the map is shown; returns whether there is something to draw.
    fn read_map(&mut self) -> bool {
        if self.app.screen != Screen::Map || self.app.paused {
            return false;
        }
        let Self { running, map_reader, map, .. } = self;
        if let Ok(reader) = map_reader.get_or_insert_with(|| MapReader::open(running)) {
            reader.read(map);
        }
        true
    }

    /// Observes the node again; rates are relative to the previous observation.
    fn look(&mut self) {
        let was_launched = self.now.launched;
        match self.sample(Some(&self.now)) {
            Ok(now) => self.earlier = Some(std::mem::replace(&mut self.now, now)),
            Err(_) => self.now.launched = false,
        }
        if was_launched && !self.now.launched {
            let node = &self.running.node_name;
            self.app.message = Some(format!("the launch of node {node} has ended; what is shown is its last state"));
        }
        if !self.now.launched {
            self.find_again();
        }
        // Where nothing wrote scans yet, something may do so by now.
        self.map_reader.take_if(|reader| reader.is_err());
        self.make_model();
        self.ask();
    }

    /// Updates what has just changed; the base of rates stays.
    fn peek(&mut self) {
        if let Ok(now) = self.sample(self.earlier.as_ref()) {
            self.now = now;
        }
        self.make_model();
    }

    /// The present state: a new observation of the own node, and the last reports of the others.
    fn sample(&self, earlier: Option<&Sample>) -> Result<Sample, Failure> {
        let mut others = self.others.clone();
        for silence in others.iter_mut().filter_map(|seen| seen.as_mut().err()) {
            if let Some(since) = self.silent_since.get(&silence.node) {
                silence.silent_s = Some(since.elapsed().as_secs_f64());
            }
        }
        let seen = in_order(&self.running, model::own(&self.running)?, &others);
        Ok(model::put_together(&self.running, seen, earlier, &self.said))
    }

    fn make_model(&mut self) {
        let Self { running, now, earlier, .. } = self;
        self.model = Model::new(&running.installation, &running.node_name, &running.shown(), now, earlier.as_ref());
    }

    /// The node may have been launched again, perhaps with another configuration.
    fn find_again(&mut self) {
        let Ok(running) = self.running.again() else { return };
        let Ok(own) = model::own(&running) else { return };
        let others = not_seen_yet(&running);
        let now = model::put_together(&running, in_order(&running, own, &others), None, &ErrorCauses::default());
        if !now.launched {
            return;
        }
        self.others = others;
        self.silent_since.clear();
        self.described.clear();
        self.calls = None;
        (self.map_reader, self.map) = (None, MapPage::default());
        self.app.message = Some("launched again".into());
        (self.running, self.now, self.earlier) = (running, now, None);
        self.said = ErrorCauses::default();
        self.output = Output::new(&self.running.installation);
        self.join();
    }

    /// Requests, once per observation, new output lines and the causes of modules' errors.
    fn ask(&mut self) {
        let Some(calls) = &mut self.calls else { return };
        let mut answers = Vec::new();
        let others: Vec<&str> = others(&self.running).collect();
        calls.look(&self.running, &others);
        if let Some((collector, from)) = self.output.purpose() {
            answers.extend(calls.lines(&self.running, collector, from));
        }
        // A past error is dropped: the next one may be different.
        let is_in_error =
            |name: &Name| self.model.row(*name).is_some_and(|row| row.line.account.state == Standing::Error);
        self.said.retain(|name, _| is_in_error(name));
        for name in self.now.unexplained() {
            answers.extend(calls.why(&self.running, name));
        }
        if let Screen::Details(name) = self.app.screen
            && let Some(supervisor) = supervisor(&self.running, name)
        {
            answers.extend(calls.control(&self.running, supervisor));
        }
        answers.into_iter().for_each(|answer| self.answer(answer));
    }

    /// Takes the answers that arrived; returns whether there were any.
    fn answers(&mut self) -> bool {
        let Some(calls) = &mut self.calls else { return false };
        let answers = calls.poll(&self.running);
        let some = !answers.is_empty();
        answers.into_iter().for_each(|answer| self.answer(answer));
        some
    }

    fn answer(&mut self, answer: Answer) {
        match answer {
            Answer::Done(message) => {
                self.app.message = Some(message);
                self.peek();
            }
            Answer::Snapshot(node, seen) => {
                if seen.is_ok() {
                    self.silent_since.remove(&node);
                } else {
                    self.silent_since.entry(node.clone()).or_insert_with(Instant::now);
                }
                let at = others(&self.running).position(|other| other == node);
                if let Some(known) = at.and_then(|at| self.others.get_mut(at)) {
                    // Its first report is shown at once.
                    let first = known.is_err() && seen.is_ok();
                    *known = seen;
                    if first {
                        self.peek();
                    }
                }
            }
            Answer::Lines(page) => {
                if self.output.take(page) {
                    self.ask();
                }
            }
            Answer::Control(name, state) => self.control = Some((name, state)),
            Answer::Why(name, error) => {
                self.said.insert(name, error);
                self.peek();
            }
        }
    }

    /// Handles terminal events; true when it is time to end.
    fn event(&mut self, event: &Event) -> bool {
        let Event::Key(key) = *event else { return false };
        if key.kind == KeyEventKind::Release {
            return false;
        }
        match self.app.key(key, &self.model) {
            Some(ScreenAction::Quit) => return true,
            Some(action) => self.act(action),
            None => {}
        }
        false
    }

    fn act(&mut self, action: ScreenAction) {
        if self.calls.is_none() {
            self.join();
        }
        let Some(calls) = &mut self.calls else {
            self.app.message = self.output.silence.clone();
            return;
        };
        let (message, answer) = match action {
            ScreenAction::Quit => return,
            ScreenAction::Switch(name, on) => {
                let on_or_off = if on { "on" } else { "off" };
                let message = format!("switching {} {on_or_off} ...", self.running.text(name));
                (message, calls.switch(&self.running, name, on))
            }
            ScreenAction::Restart(name) => {
                (format!("restarting {} ...", self.running.text(name)), calls.restart(&self.running, name))
            }
        };
        self.app.message = Some(message);
        answer.into_iter().for_each(|answer| self.answer(answer));
    }

    fn draw(&mut self, terminal: &mut DefaultTerminal) -> Result<(), Failure> {
        let details = match self.app.screen {
            Screen::Details(name) => {
                let Self { running, described, now, model, control, .. } = self;
                let describe = |alias| match running.is_own(alias) {
                    true => running.describe(alias).ok(),
                    // Asked once, and not if the call would only time out.
                    false if now.is_silent(name) => None,
                    false => described.entry(alias).or_insert_with(|| running.describe(alias).ok()).clone(),
                };
                let shown = supervisor(running, name);
                let control = control.as_ref().filter(|(of, _)| shown == Some(*of)).map(|(_, state)| state);
                details::page(&running.installation, now, model, name, (control, describe))
            }
            Screen::Table | Screen::Map | Screen::Help => Vec::new(),
        };
        self.app.columns = columns(&self.model, terminal.size()?.width).into_iter().map(|(column, _)| column).collect();
        let output = self.output.shown(&self.running.installation, self.app.lines);
        let view = ScreenModel {
            model: &self.model,
            app: &self.app,
            output: &output,
            silence: self.output.silence.as_deref(),
            details: &details,
            map: match &self.map_reader {
                Some(Err(why)) => Err(why),
                _ => Ok(&self.map),
            },
            palette: self.palette,
        };
        terminal.draw(|frame| view.draw(frame.area(), frame.buffer_mut()))?;
        Ok(())
    }
}
