//! A module and the state it is in.

use super::context::Context;
use super::work::{in_words, work_of};
use crate::call::Fault;
use crate::common::Status;
use crate::journal::{JournalEvent, Tag};
use crate::made::{CommandFailure, MadeModule};
use crate::module::ModuleError;
use crate::output;
use rohrpost_mailbox::{ModuleState, Participant};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The module and the state it is in.
pub(crate) struct Incarnation<M> {
    pub(crate) module: M,
    /// Times that parameters were set.
    pub(crate) changes: u32,
    pub(super) participant: Arc<Participant>,
    pub(super) state: ModuleState,
    error: String,
    /// What does not work although it is on; empty: all does.
    complaint: String,
    started: Instant,
    /// A part of the module's code that took so long is told.
    busy_after: Duration,
}

impl<M: MadeModule> Incarnation<M> {
    pub(crate) fn new(module: M, participant: Arc<Participant>, busy_after: Duration) -> Self {
        let (state, started) = (ModuleState::Starting, Instant::now());
        let mut life = Self {
            module,
            changes: 0,
            participant,
            state,
            error: String::new(),
            complaint: String::new(),
            started,
            busy_after,
        };
        life.enter(ModuleState::Off);
        life
    }

    /// Runs a part of the module's own code. Tools see which, and since when; what took long is told.
    pub(crate) fn work<T>(
        &mut self,
        event: JournalEvent<'_>,
        context: &mut Context,
        part: impl FnOnce(&mut M, &mut Context) -> T,
    ) -> T {
        let work = work_of(&event);
        context.journal.event(&event, || context.clock.unseen().now().ns);
        self.participant.begin_work(work);
        let result = part(&mut self.module, context);
        let lasted = self.participant.end_work();
        if lasted >= self.busy_after {
            tracing::warn!("was in {} for {:.1} s", in_words(work, &context.functions), lasted.as_secs_f64());
        }
        result
    }

    /// What a handler left half done is not to be trusted; but what it drives must be made safe.
    pub(super) fn panicked(&mut self, text: &str, context: &mut Context) {
        self.error = format!("panicked: {text}");
        context.journal.output(Tag::Panicked, text);
        self.enter(ModuleState::Error);
        // Whatever its state: it may have panicked half way on.
        if catch_unwind(AssertUnwindSafe(|| self.work(JournalEvent::Off, context, M::off))).is_err() {
            tracing::error!("panicked again on the way to its safe state");
        }
    }

    pub(super) fn enter(&mut self, state: ModuleState) {
        self.state = state;
        if state != ModuleState::On {
            // Its subscriptions rest.
            self.complains(None);
        }
        self.participant.set_state(state);
    }

    /// Takes what does not work although it is on, for tools and launch to see.
    pub(super) fn complains(&mut self, complaint: Option<&str>) {
        let complaint = complaint.unwrap_or_default();
        if self.complaint != complaint {
            self.complaint = complaint.into();
            self.participant.set_complaint(!complaint.is_empty());
        }
    }

    pub(crate) fn require_on(&self) -> Result<(), Fault> {
        match self.state {
            ModuleState::On => Ok(()),
            ModuleState::Error => Err(Fault::ModuleError(self.error.clone())),
            _ => Err(Fault::ModuleOff),
        }
    }

    pub(crate) fn turn_on(&mut self, context: &mut Context) -> Result<(), Fault> {
        if self.state == ModuleState::On {
            return Ok(());
        }
        self.error.clear();
        context.followed_streams.pass_over();
        if let Err(error) = self.work(JournalEvent::On, context, M::on) {
            self.fail(&error, context);
            return Err(Fault::ModuleError(self.error.clone()));
        }
        self.enter(ModuleState::On);
        tracing::info!("is on");
        context.schedule.restart();
        // Asked for before the answer goes out: a tool that switches modules on one after the other knows which one
        // subscribes to which.
        context.followings.renew(&mut context.link.unseen().borrow_mut(), Instant::now());
        Ok(())
    }

    pub(crate) fn turn_off(&mut self, context: &mut Context) {
        if self.state == ModuleState::On {
            self.work(JournalEvent::Off, context, M::off);
            tracing::info!("is off");
        }
        self.error.clear();
        self.enter(ModuleState::Off);
    }

    pub(super) fn fail(&mut self, error: &ModuleError, context: &mut Context) {
        context.journal.output(Tag::Failed, &error.to_string());
        self.work(JournalEvent::Off, context, M::off);
        self.error = error.to_string();
        tracing::error!(errno = error.errno(), "{error}");
        self.enter(ModuleState::Error);
    }

    /// What the caller of a command is told that failed.
    pub(super) fn failure(&mut self, failure: CommandFailure, context: &mut Context) -> Fault {
        match failure {
            CommandFailure::Fault(fault) => fault,
            CommandFailure::Module(error) => {
                self.fail(&error, context);
                Fault::ModuleError(self.error.clone())
            }
        }
    }

    /// As [`Self::work`], of a part that may fail: then the module is in error.
    pub(super) fn attempt(
        &mut self,
        event: JournalEvent<'_>,
        context: &mut Context,
        part: impl FnOnce(&mut M, &mut Context) -> Result<(), ModuleError>,
    ) {
        if let Err(error) = self.work(event, context, part) {
            self.fail(&error, context);
        }
    }

    pub(crate) fn status(&self, context: &Context) -> Status {
        Status {
            state: self.state.into(),
            error: if self.error.is_empty() { &self.complaint } else { &self.error }.clone(),
            incarnation: self.participant.incarnation(),
            uptime_ms: self.started.elapsed().as_millis() as u64,
            subscribers: context.subscriptions.len() as u32,
            missed: context.subscriptions.missed(),
            lost: context.followings.lost() + context.followed_streams.lost(),
            output_lost: output::lost(),
            output_suppressed: output::suppressed(),
            output_level: output::level(),
            refused: context.refusals.counts,
        }
    }
}
