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
use crate::journal::{Blob, JournalEvent, NotedReply, NotedValue, Tag};
use crate::made::MadeModule;
use crate::output;
use crate::publish::RequestOrigin;
use rohrpost_config::Principal;
use rohrpost_mailbox::{BODY_BYTES_MAX, Head, Label, Name, Options, SendError, local};

/// What is needed to run one command.
pub(super) struct Hosted<'a, M> {
    /// Which endpoint.
    pub(super) index: usize,
    pub(super) offer: &'a Offer<M>,
    pub(super) life: &'a mut Incarnation<M>,
    pub(super) context: &'a mut Context,
}

impl<M: MadeModule> CommandHandler for Hosted<'_, M> {
    fn is_idempotent(&self, number: u16) -> bool {
        number < common::FIRST_OWN || self.offer.idempotent.contains(&number)
    }

    fn run(&mut self, call: &Command<'_>, reply: &mut Vec<u8>) -> Result<(), Fault> {
        call.require_interface(self.offer.hash)?;
        if call.number < common::FIRST_OWN {
            return self.common(call, reply);
        }
        self.life.require_on()?;
        self.context.running_command.begin(call);
        self.function(call.number, call.arguments, reply)
    }

    fn admit(&self, head: &Head) -> Result<Principal, Fault> {
        admit(&self.context.installation, head)
    }

    fn refuse(&mut self, cause: Cause, from: Name) {
        self.context.refusals.note(cause, from);
    }

    fn send(&mut self, to: Name, label: &Label, parts: &[&[u8]]) -> Result<(), SendError> {
        self.context.link.unseen().borrow_mut().send(to, label, parts)
    }
}

impl<M: MadeModule> Hosted<'_, M> {
    /// Runs a function of the module's own.
    pub(super) fn function(&mut self, number: u16, arguments: &[u8], reply: &mut Vec<u8>) -> Result<(), Fault> {
        let event = JournalEvent::Function { endpoint: self.index as u16, number, arguments: Blob(arguments) };
        let result = if self.offer.stands_in.is_some() {
            if !self.offer.functions.iter().any(|(known, _)| *known == number) {
                return Err(Fault::Unknown(number));
            }
            let command = StandInCommand { to: self.context.endpoints[self.index], number, arguments };
            let part = |module: &mut M, context: &mut Context| module.command(context, &command, reply);
            let done = self.life.work(event, self.context, part);
            done.map_err(|failure| self.life.failure(failure, self.context))
        } else {
            let serve = self.offer.serve.ok_or(Fault::Unknown(number))?;
            let part = |module: &mut M, _: &mut Context| serve(module, number, arguments, reply);
            self.life.work(event, self.context, part)
        };
        self.note_reply(&result, reply);
        result
    }

    /// Sets parameters, all or none.
    pub(super) fn set_parameters(&mut self, arguments: &[u8], by: &str, reply: &mut Vec<u8>) -> Result<(), Fault> {
        let wish: SetParameters = read_arguments(arguments)?;
        let part = |module: &mut M, context: &mut Context| parameters::set(module, context, &wish, by);
        let set = self.life.work(JournalEvent::Parameters { wish: Blob(arguments), by }, self.context, part);
        self.life.changes = self.life.changes.wrapping_add(u32::from(set.is_ok() && !wish.only_check));
        let result = write_result(reply, &set);
        self.note_reply(&result, reply);
        result
    }

    fn note_reply(&self, result: &Result<(), Fault>, reply: &[u8]) {
        let journal = &self.context.journal;
        if journal.is_none() {
            return;
        }
        let fault = result.as_ref().err().map(|fault| fault.to_string());
        let value = fault.as_ref().map_or(reply, |text| text.as_bytes());
        journal.output(Tag::Replied, &NotedReply { is_fault: fault.is_some(), result: NotedValue::of(value) });
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
                let by = self.context.installation.classes.format(call.head.from.module());
                self.set_parameters(call.arguments, &by, reply)
            }
            common::TIME => {
                let () = read_arguments(call.arguments)?;
                write_result(reply, &TimeReport::of(self.context.clock.unseen()))
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
