//! Commands: taken from a mailbox, decided on, run by the server, answered.

use super::refusals::Cause;
use crate::call::append;
use crate::call::{CallEnvelope, Deduplicator, Fault, ReplyEnvelope, Request, Verdict};
use crate::common::{self, DescriptionPart};
use rohrpost_config::{Installation, Principal};
use rohrpost_mailbox::{Head, Kind, Label, Name, Options, Package, Receiver, SendError, Type, local, monotonic_ns};

/// Runs the commands of a mailbox: a module under one of its names, or launch.
pub trait CommandHandler {
    /// Whether a function may be run twice without harm.
    fn is_idempotent(&self, number: u16) -> bool;
    /// Runs a command; what it has to say is appended to the reply.
    ///
    /// # Errors
    /// What the caller is told instead.
    fn run(&mut self, call: &Command<'_>, reply: &mut Vec<u8>) -> Result<(), Fault>;
    /// The principal that is charged for a command, unless its sender may not command at all.
    ///
    /// # Errors
    /// What such a sender is told.
    fn admit(&self, head: &Head) -> Result<Principal, Fault>;
    /// Counts what is not taken.
    fn refuse(&mut self, cause: Cause, from: Name);
    /// Sends an answer.
    ///
    /// # Errors
    /// When it cannot be sent.
    fn send(&mut self, to: Name, label: &Label, parts: &[&[u8]]) -> Result<(), SendError>;
}

/// A command mailbox, and what was run of what came there.
pub struct CommandServer {
    /// Mailbox in which commands arrive.
    pub commands: Receiver,
    deduplicator: Deduplicator,
    /// The result being written; kept, so that answering allocates nothing.
    reply: Vec<u8>,
}

impl CommandServer {
    /// The previous owner of this mailbox has ended by now, and ran nothing after this. These principals always find a
    /// place.
    pub fn new(commands: Receiver, named: &[Principal]) -> Self {
        Self { commands, deduplicator: Deduplicator::new(monotonic_ns(), named), reply: Vec::with_capacity(1024) }
    }

    /// Another node's process has served these commands up to now, and does so no more.
    pub(super) fn takes_over(&mut self) {
        self.deduplicator.takes_over(monotonic_ns());
    }

    /// Handles the next command; false when there is none.
    pub fn handle(&mut self, handler: &mut impl CommandHandler) -> bool {
        let Some(package) = self.commands.try_receive() else { return false };
        let head = *package.head();
        let (Kind::Command(number), Ok((envelope, arguments))) =
            (head.kind.kind(), CallEnvelope::split(package.body()))
        else {
            handler.refuse(Cause::Malformed, head.from);
            return true;
        };
        let principal = match handler.admit(&head) {
            Ok(principal) => principal,
            Err(fault) => {
                handler.refuse(Cause::NotAllowed, head.from);
                fill(&mut self.reply, &fault);
                answer(handler, &head, number, &envelope, true, &self.reply);
                return true;
            }
        };
        let now_ns = monotonic_ns();
        let request = request(&package, &envelope, principal, handler.is_idempotent(number), now_ns);
        let (error, body): (bool, &[u8]) = match self.deduplicator.validate(&request, now_ns) {
            Verdict::Ignore => return true,
            Verdict::Again(error, body) => (error, body),
            Verdict::Refuse(fault) => {
                match fault {
                    Fault::Busy => handler.refuse(Cause::NoPlace, head.from),
                    Fault::EarlierIncarnation => handler.refuse(Cause::EarlierIncarnation, head.from),
                    _ => {}
                }
                fill(&mut self.reply, &fault);
                (true, &self.reply)
            }
            Verdict::Run => {
                self.reply.clear();
                let CallEnvelope { interface: hash, incarnation, sequence, .. } = envelope;
                let call = Command { number, head, hash, incarnation, sequence, age_ns: request.age_ns, arguments };
                let error = match handler.run(&call, &mut self.reply) {
                    Ok(()) => false,
                    Err(fault) => {
                        fill(&mut self.reply, &fault);
                        true
                    }
                };
                self.deduplicator.done(&request, now_ns, error, &self.reply);
                (error, &self.reply)
            }
        };
        answer(handler, &head, number, &envelope, error, body);
        true
    }
}

/// Validates the sender of a command by `[access]`, and says which principal's share of places it uses. The routers
/// have validated by the same rules what comes from other nodes; here it holds for what comes from the same one, too.
///
/// # Errors
/// [`Fault::NotAllowed`]
pub fn admit(installation: &Installation, head: &Head) -> Result<Principal, Fault> {
    let Some(rule) = installation.access_against(head.from, head.to) else {
        return Ok(installation.principal(head.from));
    };
    let node = installation.node_of(head.to).unwrap_or("?").to_owned();
    Err(Fault::NotAllowed { node, rule: format!("{}:{}", installation.shown.display(), rule.line) })
}

fn request(
    package: &Package<'_>,
    envelope: &CallEnvelope,
    principal: Principal,
    idempotent: bool,
    now_ns: u64,
) -> Request {
    let head = package.head();
    let waited_ns = now_ns.saturating_sub(package.published_ns());
    Request {
        from: head.from,
        principal,
        incarnation: envelope.incarnation,
        sequence: envelope.sequence,
        valid_for_ns: u64::from(envelope.valid_for_us) * 1000,
        age_ns: u64::from(envelope.age_us) * 1000 + waited_ns,
        repeat: envelope.age_us > 0,
        redelivered: head.options.has(Options::REDELIVERED),
        idempotent,
    }
}

fn fill(reply: &mut Vec<u8>, fault: &Fault) {
    reply.clear();
    // Writing a fault to a growing vector does not fail; an empty answer would be told as unreadable.
    let _ = append(reply, fault);
}

fn answer(
    handler: &mut impl CommandHandler,
    head: &Head,
    number: u16,
    envelope: &CallEnvelope,
    error: bool,
    body: &[u8],
) {
    if !head.from.is_mailbox() {
        return;
    }
    let envelope = ReplyEnvelope { incarnation: envelope.incarnation, sequence: envelope.sequence }.to_bytes();
    let label = |error: bool| Label {
        from: head.to.with_local(local::COMMANDS),
        kind: Type::reply(number),
        id: head.id,
        priority: head.priority,
        options: if error { Options::ERROR } else { Options::default() },
    };
    let sent = match handler.send(head.from, &label(error), &[&envelope, body]) {
        Err(SendError::TooLarge { len, .. }) => {
            let mut fault = Vec::new();
            fill(&mut fault, &Fault::TooLarge(len as u32));
            handler.send(head.from, &label(true), &[&envelope, &fault])
        }
        sent => sent,
    };
    if let Err(error) = sent {
        // The caller has ended, or reads nothing. It repeats, or its time runs out: nothing more to do here.
        tracing::debug!("reply to {}: {error}", head.from);
    }
}

/// A command that is to be run.
pub struct Command<'a> {
    /// Number of the function that is called.
    pub number: u16,
    pub(crate) head: Head,
    /// Hash of the interface that the caller knows.
    hash: u32,
    /// The caller's.
    pub(crate) incarnation: u32,
    /// The caller's number of it.
    pub(crate) sequence: u32,
    /// How long ago it was sent first, ns.
    pub(crate) age_ns: u64,
    /// Arguments: postcard of a tuple.
    pub arguments: &'a [u8],
}

impl Command<'_> {
    /// The caller knows the interface that is served here; common functions are of none.
    ///
    /// # Errors
    /// [`Fault::InterfaceDiffers`]
    pub fn require_interface(&self, own: u32) -> Result<(), Fault> {
        let of_interface =
            self.number >= common::FIRST_OWN || matches!(self.number, common::GET_DATA | common::SUBSCRIBE);
        let server = if of_interface { own } else { common::HASH };
        if self.hash == server { Ok(()) } else { Err(Fault::InterfaceDiffers { server }) }
    }

    /// The part that was asked for of the bytes of a description.
    ///
    /// # Errors
    /// See [`read_arguments`] and [`write_result`].
    pub fn describe(&self, description: &[u8], reply: &mut Vec<u8>) -> Result<(), Fault> {
        let (from,): (u32,) = read_arguments(self.arguments)?;
        let rest = description.get(from as usize..).unwrap_or_default();
        let bytes = rest[..rest.len().min(common::DESCRIPTION_PART)].to_vec();
        write_result(reply, &DescriptionPart { total: description.len() as u32, bytes })
    }
}

/// Reads a tuple of arguments.
///
/// # Errors
/// [`Fault::Arguments`] when they are of another shape, or more than there should be.
pub fn read_arguments<'a, T: serde::Deserialize<'a>>(arguments: &'a [u8]) -> Result<T, Fault> {
    match postcard::take_from_bytes(arguments) {
        Ok((values, [])) => Ok(values),
        Ok((_, rest)) => Err(Fault::Arguments(format!("{} bytes too many", rest.len()))),
        Err(error) => Err(Fault::Arguments(error.to_string())),
    }
}

/// Appends a function's result to a reply.
///
/// # Errors
/// [`Fault::ModuleError`] when it cannot be written.
pub fn write_result<T: serde::Serialize>(reply: &mut Vec<u8>, result: &T) -> Result<(), Fault> {
    append(reply, result).map_err(|error| Fault::ModuleError(format!("its result cannot be written: {error}")))
}
