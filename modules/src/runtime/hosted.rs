//! A module as the senders of commands see it, under one of its names.

use super::context::Context;
use super::endpoint::Offer;
use super::exchange;
use super::incarnation::Incarnation;
use super::parameters;
use super::refusals::Cause;
use super::server::{Command, CommandHandler, admit, read_arguments, write_result};
use crate::call::Fault;
use crate::common::{self, OutputLevel, SetParameters, Subscribe, TimeReport, Unsubscribe};
use crate::interface::StandInCommand;
use crate::module::Module;
use crate::output;
use crate::publish::RequestOrigin;
use rohrpost_config::Principal;
use rohrpost_mailbox::{BODY_BYTES_MAX, Head, Label, Name, Options, SendError, Work, local};

/// What is needed to run one command.
pub(super) struct Hosted<'a, M> {
    /// Which endpoint.
    pub(super) index: usize,
    pub(super) offer: &'a Offer<M>,
    pub(super) life: &'a mut Incarnation<M>,
    pub(super) context: &'a mut Context,
}

impl<M: Module> CommandHandler for Hosted<'_, M> {
    fn is_idempotent(&self, number: u16) -> bool {
        number < common::FIRST_OWN || self.offer.idempotent.contains(&number)
    }

    fn run(&mut self, call: &Command<'_>, reply: &mut Vec<u8>) -> Result<(), Fault> {
        call.require_interface(self.offer.hash)?;
        if call.number < common::FIRST_OWN {
            return self.common(call, reply);
        }
        self.life.require_on()?;
        if self.offer.stands_in.is_some() {
            return self.stand_in(call, reply);
        }
        let serve = self.offer.serve.ok_or(Fault::Unknown(call.number))?;
        let part = |module: &mut M, _: &mut Context| serve(module, call.number, call.arguments, reply);
        self.life.work(Work::Function(call.number), self.context, part)
    }

    fn admit(&self, head: &Head) -> Result<Principal, Fault> {
        admit(&self.context.installation, head)
    }

    fn refuse(&mut self, cause: Cause, from: Name) {
        self.context.refusals.note(cause, from);
    }

    fn send(&mut self, to: Name, label: &Label, parts: &[&[u8]]) -> Result<(), SendError> {
        self.context.link.borrow_mut().send(to, label, parts)
    }
}

impl<M: Module> Hosted<'_, M> {
    fn stand_in(&mut self, call: &Command<'_>, reply: &mut Vec<u8>) -> Result<(), Fault> {
        if !self.offer.functions.iter().any(|(number, _)| *number == call.number) {
            return Err(Fault::Unknown(call.number));
        }
        let (to, number) = (self.context.endpoints[self.index], call.number);
        let command = StandInCommand { to, number, arguments: call.arguments };
        let part = |module: &mut M, context: &mut Context| module.stand_in_command(context, &command, reply);
        self.life.work(Work::Function(number), self.context, part)
    }

    fn common(&mut self, call: &Command<'_>, reply: &mut Vec<u8>) -> Result<(), Fault> {
        match call.number {
            common::ON => {
                let () = read_arguments(call.arguments)?;
                self.life.turn_on(self.context)
            }
            common::OFF => {
                let () = read_arguments(call.arguments)?;
                self.life.turn_off(self.context);
                Ok(())
            }
            common::STATUS => {
                let () = read_arguments(call.arguments)?;
                write_result(reply, &self.life.status(self.context))
            }
            common::GET_DATA => self.get_data(call, reply),
            common::SUBSCRIBE => {
                let (wish,): (Subscribe,) = read_arguments(call.arguments)?;
                self.offer.require_data(wish.number)?;
                let to = data_mailbox(call, wish.mailbox)?;
                let now = self.context.schedule.moment();
                let subscriptions = &mut self.context.subscriptions;
                let asked = RequestOrigin {
                    by: call.head.from,
                    principal: self.context.installation.principal(call.head.from),
                    incarnation: call.incarnation,
                    to,
                    priority: call.head.priority,
                    newest: call.head.options.has(Options::NEWEST),
                };
                let room = subscriptions.subscribe(self.index, asked, wish, now);
                if room {
                    return Ok(());
                }
                self.context.refusals.note(Cause::NoPlace, call.head.from);
                Err(Fault::Busy)
            }
            common::UNSUBSCRIBE => {
                let (wish,): (Unsubscribe,) = read_arguments(call.arguments)?;
                self.context.subscriptions.unsubscribe(data_mailbox(call, wish.mailbox)?, wish.id);
                Ok(())
            }
            common::OUTPUT_LEVEL => {
                let (level,): (OutputLevel,) = read_arguments(call.arguments)?;
                write_result(reply, &output::set_level(level))
            }
            common::DESCRIBE => call.describe(&self.offer.description, reply),
            common::PARAMETERS => {
                let (from,): (u16,) = read_arguments(call.arguments)?;
                write_result(reply, &parameters::page(&mut self.life.module, self.life.changes, from))
            }
            common::SET_PARAMETERS => {
                let wish: SetParameters = read_arguments(call.arguments)?;
                let by = self.context.installation.classes.format(call.head.from.module());
                let part = |module: &mut M, context: &mut Context| parameters::set(module, context, &wish, &by);
                let set = self.life.work(Work::Parameters, self.context, part);
                self.life.changes = self.life.changes.wrapping_add(u32::from(set.is_ok() && !wish.only_check));
                write_result(reply, &set)
            }
            common::TIME => {
                let () = read_arguments(call.arguments)?;
                write_result(reply, &TimeReport::of(&self.context.clock))
            }
            common::EXCHANGE => {
                let (from,): (u16,) = read_arguments(call.arguments)?;
                write_result(reply, &exchange::page(self.context, from))
            }
            other => Err(Fault::Unknown(other)),
        }
    }

    fn get_data(&self, call: &Command<'_>, reply: &mut Vec<u8>) -> Result<(), Fault> {
        let (number,): (u16,) = read_arguments(call.arguments)?;
        self.offer.require_data(number)?;
        let newest = self.context.newest_of(self.index, number).ok_or(Fault::NothingYet)?;
        // A stream's records may be larger than any package.
        if newest.value.len() > BODY_BYTES_MAX {
            return Err(Fault::TooLarge(u32::try_from(newest.value.len()).unwrap_or(u32::MAX)));
        }
        // A tuple of the time and the value: in postcard just the one after the other.
        write_result(reply, &newest.stamp_ns)?;
        reply.extend_from_slice(newest.value);
        Ok(())
    }
}

/// A mailbox of the caller's that takes data: those for commands and replies do not.
fn data_mailbox(call: &Command<'_>, local: u8) -> Result<Name, Fault> {
    if local >= local::DATA {
        return Ok(call.head.from.with_local(local));
    }
    Err(Fault::Arguments(format!("mailbox {local} takes no data; name {} or one above", local::DATA)))
}
