//! Launch as the senders of commands see it.

use super::child::{Child, Then};
use super::leases::Leases;
use super::look::{Looks, see};
use super::time::NodeTime;
use crate::launcher::{Children, ControlError, Launcher, LauncherInterface, Phase};
use crate::launcher::{LeaseMessage, LookError, LookPage, SnapshotRequest};
use rohrpost_config::{Installation, Principal};
use rohrpost_mailbox::{CreateError, Head, Label, Name, Node, Receiver, SendError, Shape};
use rohrpost_modules::call::{Fault, Link};
use rohrpost_modules::common;
use rohrpost_modules::interface::{Interface, Serve};
use rohrpost_modules::launch_support::{Cause, Command, CommandHandler, CommandServer, Refusals, admit};
use rohrpost_schema::Description;
use std::time::Instant;

/// Commands taken in one go: a flood of them must not keep launch from its modules.
const BURST: usize = 32;
/// Bytes of states in one reply, so that it fits every reply mailbox.
const PAGE_BYTES: usize = 3000;

/// Launch's command mailbox, and what it tells of itself.
pub(super) struct Counter {
    command_server: CommandServer,
    description: Description,
    /// Postcard of it.
    bytes: Vec<u8>,
    refusals: Refusals,
}

impl Counter {
    pub(super) fn open(link: &Link, installation: &Installation) -> Result<Self, CreateError> {
        let commands = link.participant().clone().receiver(link.me(), Shape::default())?;
        let description = LauncherInterface::description();
        // Writing to a growing vector does not fail.
        let bytes = description.to_bytes();
        Ok(Self {
            command_server: CommandServer::new(commands, &installation.callers(link.me())),
            description,
            bytes,
            refusals: Refusals::default(),
        })
    }

    /// To wait on.
    pub(super) fn commands(&mut self) -> &mut Receiver {
        &mut self.command_server.commands
    }

    /// Answers pending requests.
    pub(super) fn serve(&mut self, orders: Orders<'_>, link: &mut Link) {
        let Self { description, bytes, refusals, .. } = self;
        let mut clerk = Clerk { orders, link, description, bytes, refusals };
        for _ in 0..BURST {
            if !self.command_server.handle(&mut clerk) {
                return;
            }
        }
    }

    pub(super) fn close(self) {
        self.command_server.commands.close();
    }
}

/// What commands are about.
pub(super) struct Orders<'a> {
    pub(super) children: &'a mut [Child],
    pub(super) installation: &'a Installation,
    pub(super) node: &'a Node,
    pub(super) node_name: &'a str,
    pub(super) looks: &'a mut Looks,
    /// Events to show.
    pub(super) notes: &'a mut Vec<String>,
    /// System time of the node.
    pub(super) time: &'a mut NodeTime,
    pub(super) leases: &'a mut Leases,
    /// Launch stops all.
    pub(super) ending: bool,
}

struct Clerk<'a> {
    orders: Orders<'a>,
    link: &'a mut Link,
    description: &'a Description,
    bytes: &'a [u8],
    refusals: &'a mut Refusals,
}

impl CommandHandler for Clerk<'_> {
    fn is_idempotent(&self, number: u16) -> bool {
        number < common::FIRST_OWN || self.description.functions.iter().any(|f| f.number == number && f.idempotent)
    }

    fn run(&mut self, call: &Command<'_>, reply: &mut Vec<u8>) -> Result<(), Fault> {
        call.require_interface(LauncherInterface::hash())?;
        match call.number {
            common::DESCRIBE => call.describe(self.bytes, reply),
            number if number < common::FIRST_OWN => Err(Fault::Unknown(number)),
            number => LauncherInterface::serve(&mut self.orders, number, call.arguments, reply),
        }
    }

    fn admit(&self, head: &Head) -> Result<Principal, Fault> {
        admit(self.orders.installation, head)
    }

    fn refuse(&mut self, cause: Cause, from: Name) {
        self.refusals.note(cause, from);
    }

    fn send(&mut self, to: Name, label: &Label, parts: &[&[u8]]) -> Result<(), SendError> {
        self.link.send(to, label, parts)
    }
}

impl Orders<'_> {
    /// The module of this name, or with this alias.
    fn find(&mut self, module: &str) -> Result<&mut Child, ControlError> {
        if self.ending {
            return Err(ControlError::Ending(module.into()));
        }
        let name = self.installation.classes.parse_name(module).ok();
        let name = name.and_then(|name| self.installation.module(name.module())).map(|module| module.name);
        let child = self.children.iter_mut().find(|child| Some(child.name()) == name);
        child.ok_or_else(|| ControlError::NoModule(module.into()))
    }

    /// Starts a module, if its program is there; one that runs is ended first. The number of the process that is to
    /// come.
    fn begin_anew(&mut self, module: &str) -> Result<u32, ControlError> {
        let (node, installation) = (self.node, self.installation);
        let child = self.find(module)?;
        let was_left_out = child.phase() == Phase::LeftOut;
        if let Some(configured) = installation.module(child.name()) {
            child.program().look_again(configured, installation).map_err(|missing| ControlError::NoProgram {
                module: child.text().into(),
                program: missing.program,
                place: missing.place,
            })?;
        }
        child.tell_to_end(Then::Start, node, Instant::now());
        let (text, incarnation) = (child.text().to_owned(), child.lives() + 1);
        if was_left_out {
            self.notes.push(format!("{text} was left out and is started, as asked: its program is there now"));
        }
        Ok(incarnation)
    }
}

impl Launcher for Orders<'_> {
    fn children(&mut self, first: u16) -> Children {
        let (now, mut bytes) = (Instant::now(), 0);
        let mut states = Vec::new();
        for child in self.children.iter().skip(first.into()) {
            let state = child.state(now);
            bytes += 50 + state.module.len() + state.last_end.len() + state.error.len() + state.printed.len();
            if bytes > PAGE_BYTES {
                break;
            }
            states.push(state);
        }
        Children { total: self.children.len() as u16, states }
    }

    fn restart(&mut self, module: String) -> Result<u32, ControlError> {
        self.begin_anew(&module)
    }

    fn stop(&mut self, module: String) -> Result<(), ControlError> {
        let node = self.node;
        let child = self.find(&module)?;
        match child.phase() {
            Phase::Stopped => Err(ControlError::Stopped(child.text().into())),
            Phase::LeftOut => Err(ControlError::LeftOut(child.text().into())),
            phase if phase.is_over() => Err(ControlError::Ended(child.text().into())),
            _ => {
                child.tell_to_end(Then::Stay, node, Instant::now());
                Ok(())
            }
        }
    }

    fn start(&mut self, module: String) -> Result<u32, ControlError> {
        let child = self.find(&module)?;
        if child.is_at_work() {
            return Err(ControlError::Running(child.text().into()));
        }
        self.begin_anew(&module)
    }

    fn look(&mut self, what: SnapshotRequest, form: u32, bytes_max: u16) -> Result<LookPage, LookError> {
        self.looks.take(form, bytes_max, || see(what, self.node, self.installation, self.node_name))
    }

    fn new_epoch(&mut self) -> Result<u64, ControlError> {
        let epoch = self.time.begin_epoch().ok_or(ControlError::OtherTime)?;
        self.notes.push(format!("epoch {epoch} of time begins at this computer's clock, as asked"));
        Ok(epoch)
    }

    fn end_failing(&mut self, module: String, cause: String, incarnation: u32) -> Result<bool, ControlError> {
        let node = self.node;
        Ok(self.find(&module)?.end_failing(&cause, incarnation, node, Instant::now()))
    }

    fn lease(&mut self, asks: LeaseMessage) -> LeaseMessage {
        self.leases.answer(&asks, self.node)
    }

    fn look_on(&mut self, look: u32, from: u32, bytes_max: u16) -> Result<LookPage, LookError> {
        self.looks.page(look, from, bytes_max)
    }
}
