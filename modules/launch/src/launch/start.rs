//! The start of a launch: modules one after the other, then switched on; and what is asked of a module later on: to
//! switch itself on, and why it is in error. Nothing here waits for a module that may be done without.

use super::child::Child;
use super::{Launch, LaunchError};
use crate::launcher::Phase;
use rohrpost_config::{Module, Scheduling as Wanted};
use rohrpost_mailbox::sys::{Scheduling, scheduling_of};
use rohrpost_modules::call::{CallError, Fault};
use rohrpost_modules::common::{self, State, Status};
use rohrpost_modules::output::plain;
use std::ops::Range;
use std::time::{Duration, Instant};

/// A router that was started again so often, and is not ready, is not going to be.
const ROUTER_RESTARTS_MAX: u32 = 8;

/// Calls of launch to a module that are under way.
#[derive(Clone, Default)]
pub(super) struct UnderWay {
    /// Switches it on: the call, and how often it had been in error before.
    pub(super) switch: Option<(u32, u32)>,
    /// Asks it why it is in error: the number of that error, and the call.
    why: Option<(u32, u32)>,
}

impl Launch {
    pub(super) fn start_all(&mut self) -> Result<(), LaunchError> {
        let mut absent = Vec::new();
        for index in 0..self.children.len() {
            // Unless somebody wants it stopped already.
            if self.children[index].phase() == Phase::Waiting {
                let note = self.children[index].spawn(&self.node, Instant::now());
                self.note(note);
            }
            if !self.await_ready(index)? {
                absent.push(index);
            }
            // At once: switched off, the collector would drop what the others say while they start.
            if self.is_collector(&self.children[index]) {
                self.switch_on(index);
            }
        }
        self.await_any()?;
        // Not before it is known that there are others.
        absent.into_iter().for_each(|index| self.note_absent(index));
        // One after the other, so that each finds those on that it needs.
        for index in 0..self.children.len() {
            self.switch_on(index);
            while self.calls[index].switch.is_some() {
                let turned = self.turn(0..self.children.len(), index);
                self.switch_on(index);
                // A launch that is told to stop after the last answer has started, and stops as such.
                if self.calls[index].switch.is_some() {
                    turned?;
                }
            }
        }
        let note = self.without_real_time();
        self.note(note);
        Ok(())
    }

    /// Until this module is ready, or the others begin without it: then false.
    fn await_ready(&mut self, index: usize) -> Result<bool, LaunchError> {
        // Looked at before each sleep: nothing may be left that would end it.
        loop {
            let child = &self.children[index];
            match child.phase() {
                Phase::Ready | Phase::Running | Phase::Stopped | Phase::Ended | Phase::LeftOut | Phase::StandsBy => {
                    return Ok(true);
                }
                Phase::Failed if child.is_required() => return Err(not_ready(child, child.last_end())),
                Phase::Failed => return Ok(false),
                _ if self.never_ready(child) => return Err(not_ready(child, child.last_end())),
                _ if !child.is_required() && child.restarts() > 0 => return Ok(false),
                Phase::Starting | Phase::Waiting | Phase::Stopping => {}
            }
            self.turn(0..index + 1, index)?;
        }
    }

    /// Says of a module that it was not waited for, if it still has not started.
    fn note_absent(&mut self, index: usize) {
        let child = &self.children[index];
        let note = match child.phase() {
            Phase::Failed => format!("{} does not start; the others go on without it", child.text()),
            Phase::Waiting | Phase::Starting => {
                format!("{} does not start yet; the others go on without it, and it is tried again", child.text())
            }
            _ => return,
        };
        self.note(Some(note));
    }

    /// A node has not started if none of its modules starts.
    fn await_any(&mut self) -> Result<(), LaunchError> {
        let is_in_file = |child: &Child| self.installation.module(child.name()).is_some_and(Module::is_in_file);
        let may_start = |child: &Child| is_in_file(child) && child.phase() != Phase::LeftOut;
        let own: Vec<usize> = (0..self.children.len()).filter(|index| may_start(&self.children[*index])).collect();
        let work: Vec<usize> = own.iter().copied().filter(|index| !self.is_collector(&self.children[*index])).collect();
        let work = if work.is_empty() { own } else { work };
        let Some(first) = work.first().copied() else { return Ok(()) };
        loop {
            let phase = |index: &usize| self.children[*index].phase();
            if work.iter().any(|index| !matches!(phase(index), Phase::Failed | Phase::Waiting | Phase::Starting)) {
                return Ok(());
            }
            if work.iter().all(|index| phase(index) == Phase::Failed) {
                return Err(not_ready(&self.children[first], self.children[first].last_end()));
            }
            self.turn(0..self.children.len(), first)?;
        }
    }

    fn is_collector(&self, child: &Child) -> bool {
        Some(child.name().class()) == self.installation.classes.id(rohrpost_modules::output::CLASS)
    }

    /// A router is never given up, but a node on which it never was ready has not started: perhaps another one has its
    /// port.
    fn never_ready(&self, child: &Child) -> bool {
        let is_router = self.installation.module(child.name()).is_some_and(|module| !module.is_in_file());
        is_router && child.is_required() && child.restarts() > ROUTER_RESTARTS_MAX
    }

    /// What to say of modules that are meant to be real time and are not: where nobody reads the log, nobody would
    /// know.
    fn without_real_time(&self) -> Option<String> {
        let is_ordinary = |child: &&Child| {
            let wanted = self.installation.scheduling(child.name().class());
            let real = child.pid().and_then(|pid| scheduling_of(pid).ok());
            matches!((wanted, real), (Wanted::Fifo { .. }, Some(Scheduling::Normal(_))))
        };
        let ordinary: Vec<&str> = self.children.iter().filter(is_ordinary).map(Child::text).collect();
        (!ordinary.is_empty()).then(|| {
            format!(
                "no real time: {} run{} like ordinary programs, and late when the computer is busy; allow it with a \
                 limit `rtprio` for this user (limits.conf) or CAP_SYS_NICE (`rohrpost doctor` says what is missing)",
                ordinary.join(", "),
                if ordinary.len() == 1 { "s" } else { "" }
            )
        })
    }

    /// Sleeps until something happens, then looks after those children that were started, and answers tools.
    fn turn(&mut self, started: Range<usize>, index: usize) -> Result<(), LaunchError> {
        self.sleep(started.clone(), Duration::MAX);
        if self.bell.words() > 0 {
            let module = self.children[index].text().into();
            return Err(LaunchError::Stopped { module, notes: Vec::new() });
        }
        // Those that were started before may end meanwhile.
        self.step_leases();
        started.for_each(|index| self.step(index));
        self.serve(false);
        Ok(())
    }

    /// Switches a module on that is ready, or looks how far that is. Never waits: one that hangs must not keep the
    /// others from being watched.
    pub(super) fn switch_on(&mut self, index: usize) {
        let child = &mut self.children[index];
        let call = self.calls[index].switch.take();
        if child.phase() != Phase::Ready {
            // It ended meanwhile.
            call.into_iter().for_each(|(call, _)| self.tool.link.forget(call));
            return;
        }
        let before = call.map_or(0, |(_, errors)| errors);
        let answer = match call {
            None if !child.wants_on() => Some(Ok(())),
            None => match self.tool.begin_switch(child.name(), true) {
                Ok(call) => return self.calls[index].switch = Some((call, child.errors(&self.node))),
                Err(error) => Some(Err(error)),
            },
            Some((number, _)) => {
                self.tool.link.collect();
                let answer = self.tool.link.poll(number);
                self.calls[index].switch = call.filter(|_| answer.is_none());
                answer
            }
        };
        let Some(answer) = answer else { return };
        child.runs(answer.is_ok());
        if let Err(CallError::Fault(_, Fault::ModuleError(why))) = &answer {
            // It may be in a later one by now.
            let number = child.in_error(&self.node).filter(|number| *number == before.wrapping_add(1));
            child.health().went_into_error(number, why.clone());
        }
        // The lower layers know numbers only.
        let told = |error: CallError| error.to_string().replace(&child.name().to_string(), child.text());
        let note = answer.err().map(|error| format!("{} could not be switched on: {}", child.text(), told(error)));
        self.note(note);
    }

    /// Asks a module that says it is in error why, or what it complains of, or looks whether it has answered. Never
    /// waits.
    pub(super) fn ask_why(&mut self, index: usize) {
        let child = &mut self.children[index];
        let (asked, error) = (self.calls[index].why.take(), child.asks_why(&self.node));
        let (error, call) = match (asked, error) {
            (Some((of, call)), Some(error)) if of == error => (error, call),
            (asked, error) => {
                // That is over, or it is in another one.
                asked.into_iter().for_each(|(_, call)| self.tool.link.forget(call));
                let mut begin = || self.tool.begin(child.name(), common::STATUS, common::HASH, |_| Ok(())).ok();
                // One that cannot be asked now is asked at the next look.
                self.calls[index].why = error.and_then(|error| Some((error, begin()?)));
                return;
            }
        };
        self.tool.link.collect();
        match self.tool.link.poll_for(call, |bytes| postcard::from_bytes::<Status>(bytes)) {
            None => self.calls[index].why = Some((error, call)),
            // Of this error, if it is in no later one even now.
            Some(Ok(status)) if child.in_trouble(&self.node) == Some(error) => {
                let why = if status.error.is_empty() { "it does not say why".into() } else { status.error };
                let is_error = status.state == State::Error;
                let how = if is_error { " is in error" } else { "" };
                let note = format!("{}{how}: {}", child.text(), plain::line(&why));
                match is_error {
                    true => child.health().went_into_error(Some(error), why),
                    false => child.health().complained(error, why),
                }
                self.note(Some(note));
            }
            Some(_) => {}
        }
    }
}

fn not_ready(child: &Child, why: &str) -> LaunchError {
    LaunchError::NotReady { module: child.text().into(), why: why.into(), notes: Vec::new() }
}
