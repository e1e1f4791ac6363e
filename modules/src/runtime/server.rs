//! Commands: decided on, run, answered.

use super::context::Context;
use super::face::{Face, Offer};
use super::parameters;
use super::runner::Life;
use crate::call::{CallEnvelope, Fault, ReplyEnvelope, Request, Verdict};
use crate::common::{self, DescriptionPart, OutputLevel, SetParameters, Subscribe};
use crate::interface::append;
use crate::module::Module;
use crate::output;
use rohrpost_mailbox::{Head, Kind, Label, Options, SendError, Type, local, monotonic_ns};

/// What commands of one module share besides the module itself.
pub(crate) struct Server {
    /// The result being written; kept, so that answering allocates nothing.
    reply: Vec<u8>,
}

impl Server {
    pub(crate) fn new() -> Self {
        Self { reply: Vec::with_capacity(1024) }
    }

    /// Handles the next command of a face; false when there is none.
    pub(crate) fn handle<M: Module>(
        &mut self,
        face: &mut Face<M>,
        index: usize,
        life: &mut Life<M>,
        context: &mut Context,
    ) -> bool {
        let Some(package) = face.commands.try_receive() else { return false };
        let head = *package.head();
        let (Kind::Command(number), Ok((envelope, arguments))) =
            (head.kind.kind(), CallEnvelope::split(package.body()))
        else {
            tracing::warn!("{} sent {} a package that is no command ({:?})", head.from, head.to, head.kind.kind());
            return true;
        };
        let now_ns = monotonic_ns();
        let waited_ns = now_ns.saturating_sub(package.published_ns());
        let request = Request {
            from: head.from,
            incarnation: envelope.incarnation,
            sequence: envelope.sequence,
            valid_for_ns: u64::from(envelope.valid_for_us) * 1000,
            age_ns: u64::from(envelope.age_us) * 1000 + waited_ns,
            repeat: envelope.age_us > 0,
            redelivered: head.options.has(Options::REDELIVERED),
            idempotent: number < common::FIRST_OWN || face.offer.idempotent.contains(&number),
        };
        let (error, body): (bool, &[u8]) = match face.once.judge(&request, now_ns) {
            Verdict::Ignore => return true,
            Verdict::Again(error, body) => (error, body),
            Verdict::Refuse(fault) => {
                fill(&mut self.reply, &fault);
                (true, &self.reply)
            }
            Verdict::Run => {
                self.reply.clear();
                let call = Call { index, number, head, hash: envelope.interface, arguments };
                let error = match call.run(&face.offer, life, context, &mut self.reply) {
                    Ok(()) => false,
                    Err(fault) => {
                        fill(&mut self.reply, &fault);
                        true
                    }
                };
                face.once.done(&request, now_ns, error, &self.reply);
                (error, &self.reply)
            }
        };
        answer(context, &head, number, &envelope, error, body);
        true
    }
}

fn fill(reply: &mut Vec<u8>, fault: &Fault) {
    reply.clear();
    // Writing a fault to a growing vector does not fail; an empty answer would be told as unreadable.
    let _ = append(reply, fault);
}

fn answer(context: &Context, head: &Head, number: u16, envelope: &CallEnvelope, error: bool, body: &[u8]) {
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
    let mut link = context.link.borrow_mut();
    let sent = match link.send(head.from, &label(error), &[&envelope, body]) {
        Err(SendError::TooLarge { len, .. }) => {
            let mut fault = Vec::new();
            fill(&mut fault, &Fault::TooLarge(len as u32));
            link.send(head.from, &label(true), &[&envelope, &fault])
        }
        sent => sent,
    };
    if let Err(error) = sent {
        // The caller has ended, or reads nothing. It repeats, or its time runs out: nothing more to do here.
        tracing::debug!("reply to {}: {error}", head.from);
    }
}

/// A command that is to be run.
struct Call<'a> {
    index: usize,
    number: u16,
    head: Head,
    hash: u32,
    arguments: &'a [u8],
}

impl Call<'_> {
    fn run<M: Module>(
        &self,
        offer: &Offer<M>,
        life: &mut Life<M>,
        context: &mut Context,
        reply: &mut Vec<u8>,
    ) -> Result<(), Fault> {
        let of_interface =
            self.number >= common::FIRST_OWN || matches!(self.number, common::GET_DATA | common::SUBSCRIBE);
        let server = if of_interface { offer.hash } else { common::HASH };
        if self.hash != server {
            return Err(Fault::InterfaceDiffers { server });
        }
        if self.number < common::FIRST_OWN {
            return self.common(offer, life, context, reply);
        }
        life.require_on()?;
        let serve = offer.serve.ok_or(Fault::Unknown(self.number))?;
        serve(&mut life.module, self.number, self.arguments, reply)
    }

    fn common<M: Module>(
        &self,
        offer: &Offer<M>,
        life: &mut Life<M>,
        context: &mut Context,
        reply: &mut Vec<u8>,
    ) -> Result<(), Fault> {
        match self.number {
            common::ON => life.turn_on(context),
            common::OFF => {
                life.turn_off(context);
                Ok(())
            }
            common::STATUS => write_result(reply, &life.status(context)),
            common::GET_DATA => self.get_data(offer, context, reply),
            common::SUBSCRIBE => {
                let (wish,): (Subscribe,) = read_arguments(self.arguments)?;
                offer.require_data(wish.number)?;
                let to = self.head.from.with_local(local::DATA);
                let now_ns = monotonic_ns();
                let room = context.subscriptions.subscribe(self.index, to, self.head.priority, wish, now_ns);
                if room { Ok(()) } else { Err(Fault::Busy) }
            }
            common::UNSUBSCRIBE => {
                let (id,): (u16,) = read_arguments(self.arguments)?;
                context.subscriptions.unsubscribe(self.head.from.with_local(local::DATA), id);
                Ok(())
            }
            common::OUTPUT_LEVEL => {
                let (level,): (OutputLevel,) = read_arguments(self.arguments)?;
                write_result(reply, &output::set_level(level))
            }
            common::DESCRIBE => {
                let (from,): (u32,) = read_arguments(self.arguments)?;
                let rest = offer.description.get(from as usize..).unwrap_or_default();
                let bytes = rest[..rest.len().min(common::DESCRIPTION_PART)].to_vec();
                write_result(reply, &DescriptionPart { total: offer.description.len() as u32, bytes })
            }
            common::PARAMETERS => {
                let (from,): (u16,) = read_arguments(self.arguments)?;
                write_result(reply, &parameters::page(&mut life.module, life.changes, from))
            }
            common::SET_PARAMETERS => {
                let wish: SetParameters = read_arguments(self.arguments)?;
                let by = context.installation.classes.format(self.head.from.module());
                let set = parameters::set(&mut life.module, context, &wish, &by);
                life.changes = life.changes.wrapping_add(u32::from(set.is_ok() && !wish.only_check));
                write_result(reply, &set)
            }
            other => Err(Fault::Unknown(other)),
        }
    }

    fn get_data<M>(&self, offer: &Offer<M>, context: &Context, reply: &mut Vec<u8>) -> Result<(), Fault> {
        let (number,): (u16,) = read_arguments(self.arguments)?;
        offer.require_data(number)?;
        let is_it = |newest: &&crate::publish::Newest| (newest.face, newest.number) == (self.index, number);
        let newest = context.newest.iter().find(is_it).ok_or(Fault::NothingYet)?;
        // A tuple of the time and the value: in postcard just the one after the other.
        write_result(reply, &newest.stamp_ns)?;
        reply.extend_from_slice(&newest.value);
        Ok(())
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
