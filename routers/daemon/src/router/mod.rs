//! The router of a node: carries packages between it and the others of its system. Launch starts one on each node.

mod clock;
mod clock_watch;
pub(crate) mod faults;
mod flows;
pub mod keys;
mod links;
pub(crate) mod replicas;
mod slots;

use crate::moving::Moving;
use clock_watch::{ClockReading, ClockWatch};
use rohrpost_config::ClockSetPolicy;
use rohrpost_mailbox::{Latency, Ready};
use rohrpost_modules::interfaces::{ClockRole, NewEpochError, Router, RouterInterface};
use rohrpost_modules::runtime::{Context, clock_was_set, kept};
use rohrpost_modules::{Module, ModuleError, NoSettings};
use rohrpost_routers::impair;
use rohrpost_routers::replication::ReplicaSettings;
use rohrpost_routers::settings::Settings;
use rohrpost_routers::shell::clock::ClockParts;
use rohrpost_routers::shell::{Parts, ReplicaParts, Shell};
use rohrpost_routers::time::Role;
use std::sync::Arc;
use std::time::Duration;

/// How often it publishes its state.
const PERIOD: Duration = Duration::from_millis(500);

/// A router of a node.
pub(crate) struct RouterModule {
    shell: Shell,
    /// All of the installation.
    replicas: Vec<ReplicaSettings>,
    /// Delays of those that come, as they were reported last.
    delays: Vec<Latency>,
    clock_watch: ClockWatch,
    moving: Moving,
}

impl RouterModule {
    /// Has the clock's thread begin an epoch. False: that is asked already.
    fn ask_new_epoch(&mut self) -> bool {
        let is_asked = self.shell.clock().is_some_and(|clock| clock.ask_new_epoch());
        if is_asked {
            self.clock_watch.asked(ClockReading::now());
        }
        is_asked
    }
}

impl Router for RouterModule {
    fn new_epoch(&mut self) -> Result<u64, NewEpochError> {
        let clock = self.shell.clock().ok_or(NewEpochError::NotMaster)?;
        let seen = clock.snapshot();
        if seen.role != Role::Master {
            return Err(NewEpochError::NotMaster);
        }
        if self.clock_watch.is_too_soon(ClockReading::now()) {
            return Err(NewEpochError::TooSoon);
        }
        self.ask_new_epoch();
        tracing::warn!("a new epoch of time begins at this computer's clock, as asked");
        Ok(seen.record.epoch)
    }
}

impl Module for RouterModule {
    type Settings = NoSettings;
    type Interfaces = RouterInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        let installation = context.installation();
        let impair = impairment()?;
        let node = installation.node_of(context.me()).unwrap_or_default();
        let keys = keys::of(installation)?;
        let settings = Settings::new(installation, node, keys::incarnation(keys.is_some())?)?;
        if let Some(security) = installation.security_text() {
            match &keys {
                Some(_) => tracing::info!("{security}"),
                None => tracing::warn!("{security}"),
            }
        }
        if let Some(impair) = impair {
            tracing::warn!("adds network faults, as {} requests: {impair}", impair::ENVIRONMENT);
        }
        let moving = settings.moving.clone();
        let faults = Arc::new(faults::Encoded::of(installation));
        let node = context.link().borrow().participant().node().clone();
        let clock = ClockParts::new(&settings, installation, &node).map(|parts| ClockParts { impair, ..parts });
        let (name, mut sockets) = (context.me(), kept());
        // In the order of `listen`.
        let others = 1 + usize::from(installation.rest_port().is_some());
        let socket = if sockets.len() > others { sockets.pop() } else { None };
        let replicas = ReplicaSettings::all(installation);
        let parts = Parts { node: &node, name, settings, faults, sockets, impair, clock };
        let mut shell = match keys {
            Some(keys) => Shell::start_sealed(parts, keys)?,
            None => Shell::start(parts)?,
        };
        if !replicas.is_empty() {
            let describe = Arc::new(replicas::stream_number);
            shell.replicate(&node, ReplicaParts { replicas: &replicas, describe, socket, impair })?;
        }
        context.use_computer_clock();
        context.set_period(PERIOD);
        let moving = Moving::watch(moving, context)?;
        let clock_watch = ClockWatch::new(ClockReading::now());
        Ok(Self { shell, replicas, delays: Vec::new(), clock_watch, moving })
    }

    fn on(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.moving.look(context);
        Ok(())
    }

    fn ready(&mut self, context: &mut Context, _: Ready) -> Result<(), ModuleError> {
        self.moving.ready(context);
        Ok(())
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        // It cannot work without one of its threads; launch restarts it.
        assert!(self.shell.is_well(), "a thread of the router has ended");
        self.moving.look(context);
        context.publish_now(RouterInterface::LINKS, &links::of(&self.shell))?;
        if let Some(clock) = self.shell.clock() {
            let state = clock::of(&self.shell, clock);
            context.publish_now(RouterInterface::CLOCK, &state)?;
            let follows = context.installation().when_set == ClockSetPolicy::NewEpoch;
            if let Some(by_ns) = state.clock_set_by_ns
                && follows
                && state.role == ClockRole::Master
                && self.clock_watch.was_set(ClockReading::now())
                && self.ask_new_epoch()
            {
                tracing::warn!("{}: a new epoch of time begins at it", clock_was_set(by_ns));
            }
        }
        if let Some(slots) = self.shell.slots() {
            context.publish_now(RouterInterface::SLOTS, &slots::of(&self.shell, slots))?;
        }
        let flows = flows::of(&self.shell, &context.installation().classes);
        context.publish_now(RouterInterface::FLOWS, &flows)?;
        let installation = context.installation();
        let node = installation.node_of(context.me()).unwrap_or_default();
        let Self { shell, replicas, delays, .. } = self;
        if let Some(states) = replicas::of(node, shell.replicas(), installation, replicas, delays) {
            context.publish_now(RouterInterface::REPLICAS, &states)?;
        }
        Ok(())
    }
}

/// The network faults that a test requests.
pub(crate) fn impairment() -> Result<Option<impair::ImpairmentSettings>, ModuleError> {
    let text = std::env::var(impair::ENVIRONMENT).unwrap_or_default();
    if text.is_empty() {
        return Ok(None);
    }
    let parsed = text.parse().map_err(|error| ModuleError::new(format!("{}: {error}", impair::ENVIRONMENT)));
    parsed.map(Some)
}
