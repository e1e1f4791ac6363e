//! The loop of a module's one thread.

use super::context::{Context, Received};
use super::face::Face;
use super::server::Server;
use super::start::{Start, StartError};
use crate::call::Fault;
use crate::common::{DataHead, Status};
use crate::interface::Interfaces;
use crate::module::{Module, ModuleError};
use crate::output;
use rohrpost_mailbox::{Kind, ModuleState, Participant, Receiver, monotonic_ns, wait_any};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Packages handled between two looks at the clock: a flood of them must not keep ticks and renewals waiting.
const BURST: usize = 32;

/// Runs a module until it is told to end; the whole of a module's `main`.
///
/// Launch tells it by its environment what it is; by hand say `--config FILE --name CLASS.INSTANCE` (and `--off`, to leave it
/// switched off).
pub fn run<M: Module>() -> ExitCode {
    match Start::from_environment().and_then(run_started::<M>) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            tracing::error!("{error}");
            output::drain();
            output::print(&error);
            ExitCode::FAILURE
        }
    }
}

/// Runs a module as something that was started already says: for programs that hold several kinds of module.
///
/// # Errors
/// See [`StartError`].
pub fn run_started<M: Module>(start: Start) -> Result<(), StartError> {
    let mut running = start.join::<M>()?;
    running.turn_on_if_wanted();
    running.go();
    running.end();
    Ok(())
}

/// The module and the state it is in.
pub(crate) struct Life<M> {
    pub(crate) module: M,
    participant: Arc<Participant>,
    state: ModuleState,
    error: String,
    started: Instant,
}

impl<M: Module> Life<M> {
    pub(crate) fn new(module: M, participant: Arc<Participant>) -> Self {
        let mut life =
            Self { module, participant, state: ModuleState::Starting, error: String::new(), started: Instant::now() };
        life.enter(ModuleState::Off);
        life
    }

    fn enter(&mut self, state: ModuleState) {
        self.state = state;
        self.participant.set_state(state);
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
        if let Err(error) = self.module.on(context) {
            self.fail(&error, context);
            return Err(Fault::ModuleError(self.error.clone()));
        }
        self.enter(ModuleState::On);
        tracing::info!("is on");
        context.next_tick = context.period.map(|_| Instant::now());
        // Asked for before the answer goes out: who switches modules on one after the other knows who listens to whom.
        context.followings.renew(&mut context.link.borrow_mut(), Instant::now());
        Ok(())
    }

    pub(crate) fn turn_off(&mut self, context: &mut Context) {
        if self.state == ModuleState::On {
            self.module.off(context);
            tracing::info!("is off");
        }
        self.error.clear();
        self.enter(ModuleState::Off);
    }

    fn fail(&mut self, error: &ModuleError, context: &mut Context) {
        self.module.off(context);
        self.error = error.to_string();
        tracing::error!("{error}");
        self.enter(ModuleState::Error);
    }

    fn check(&mut self, result: Result<(), ModuleError>, context: &mut Context) {
        if let Err(error) = result {
            self.fail(&error, context);
        }
    }

    pub(crate) fn status(&self, context: &Context) -> Status {
        Status {
            state: self.state.into(),
            error: self.error.clone(),
            incarnation: self.participant.incarnation(),
            uptime_ms: self.started.elapsed().as_millis() as u64,
            subscribers: context.subscriptions.len() as u32,
            missed: context.subscriptions.missed(),
            lost: context.followings.lost,
            output_lost: output::lost(),
        }
    }
}

/// A module that runs.
pub(crate) struct Running<M> {
    pub(crate) life: Life<M>,
    pub(crate) faces: Vec<Face<M>>,
    pub(crate) data: Receiver,
    pub(crate) context: Context,
    pub(crate) stop: Arc<AtomicBool>,
    pub(crate) turn_on: bool,
    /// Nobody else removes its mailboxes.
    pub(crate) by_hand: bool,
}

impl<M: Module> Running<M> {
    fn turn_on_if_wanted(&mut self) {
        if self.turn_on {
            // A failure is in the module's state and output.
            let _ = self.life.turn_on(&mut self.context);
        }
    }

    fn go(&mut self) {
        let mut server = Server::new();
        while !self.stop.load(Ordering::Acquire) {
            let mut busy = self.commands(&mut server);
            busy |= self.take_data();
            self.periodic();
            output::drain();
            if !busy {
                self.sleep();
            }
        }
    }

    fn commands(&mut self, server: &mut Server) -> bool {
        let mut handled = 0;
        for (index, face) in self.faces.iter_mut().enumerate() {
            while handled < BURST && server.handle(face, index, &mut self.life, &mut self.context) {
                handled += 1;
            }
        }
        handled > 0
    }

    /// Hands out what came to the data mailbox and to the module's own; while the module is off it is dropped.
    fn take_data(&mut self) -> bool {
        let mut any = take(&mut self.data, &mut self.life, &mut self.context);
        // Taken out meanwhile, since the module is given the context whose they are.
        let mut own = std::mem::take(&mut self.context.own);
        for mailbox in &mut own {
            any |= take(mailbox, &mut self.life, &mut self.context);
        }
        own.append(&mut self.context.own);
        self.context.own = own;
        any
    }

    fn periodic(&mut self) {
        let now = Instant::now();
        // Also while it is off: late answers must not wait for ever in front of its sleep.
        self.context.link.borrow_mut().collect();
        if self.life.state == ModuleState::On {
            self.context.followings.renew(&mut self.context.link.borrow_mut(), now);
        }
        self.context.deliver_due(monotonic_ns());
        let (Some(period), Some(due)) = (self.context.period, self.context.next_tick) else { return };
        if self.life.state == ModuleState::On && due <= now {
            // Ticks that were slept through are not made up for; the grid stays where it was.
            let passed = (now - due).as_nanos() / period.as_nanos();
            self.context.next_tick = Some(due + period * (u32::try_from(passed).unwrap_or(u32::MAX - 1) + 1));
            let result = self.life.module.tick(&mut self.context);
            self.life.check(result, &mut self.context);
        }
    }

    /// Until a package comes, something is due, or it is told to stop.
    fn sleep(&mut self) {
        let on = self.life.state == ModuleState::On;
        let tick = self.context.next_tick.filter(|_| on);
        let renewal = self.context.followings.next().filter(|_| on);
        let now_ns = monotonic_ns();
        let delivery = self.context.subscriptions.next_ns();
        let delivery = delivery.map(|ns| Instant::now() + Duration::from_nanos(ns.saturating_sub(now_ns)));
        let output = output::retry_at();
        let deadline = [tick, renewal, delivery, output].into_iter().flatten().min();
        let mut link = self.context.link.borrow_mut();
        let mut receivers: Vec<&mut Receiver> = Vec::with_capacity(self.faces.len() + self.context.own.len() + 2);
        receivers.extend(self.faces.iter_mut().map(|face| &mut face.commands));
        receivers.push(&mut self.data);
        receivers.extend(&mut self.context.own);
        receivers.push(link.replies());
        wait_any(&mut receivers, deadline, || self.stop.load(Ordering::Acquire));
    }

    fn end(mut self) {
        if self.life.state == ModuleState::On {
            self.life.module.off(&mut self.context);
        }
        self.context.followings.end(&mut self.context.link.borrow_mut());
        self.life.enter(ModuleState::Stopping);
        tracing::debug!("ends");
        output::drain();
        if !self.by_hand {
            return;
        }
        let commands = self.faces.into_iter().map(|face| face.commands);
        for mailbox in commands.chain([self.data]).chain(self.context.own) {
            mailbox.close();
        }
        if let Ok(link) = std::rc::Rc::try_unwrap(self.context.link) {
            link.into_inner().close();
        }
    }
}

/// Hands out a burst of packages of one mailbox; false when there was none.
fn take<M: Module>(mailbox: &mut Receiver, life: &mut Life<M>, context: &mut Context) -> bool {
    let local = mailbox.name().local();
    for handled in 0..BURST {
        let Some(package) = mailbox.try_receive() else { return handled > 0 };
        let head = package.head();
        let (Kind::Data(number), Some((data, value))) = (head.kind.kind(), DataHead::split(package.body())) else {
            tracing::warn!("{} sent {} a package that is no data ({:?})", head.from, head.to, head.kind.kind());
            continue;
        };
        if local == rohrpost_mailbox::local::DATA {
            context.followings.note(head.from, head.id, &data);
        }
        if life.state == ModuleState::On {
            let received = Received { from: head.from, number, mailbox: local, id: head.id, head: data, value };
            let result = life.module.received(context, &received);
            life.check(result, context);
        }
    }
    true
}

/// What a module serves, in the order of its faces.
pub(crate) fn served<M: Module>() -> Vec<crate::interface::Served<M>> {
    M::Interfaces::table()
}
