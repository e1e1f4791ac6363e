//! Other modules, as they describe themselves, to be called.

use crate::error::NativeError;
use rohrpost_mailbox::Name;
use rohrpost_modules::call::{CallError, Caller};
use rohrpost_modules::common::{DESCRIBE, GET_DATA, HASH};
use rohrpost_modules::description::assemble;
use rohrpost_modules::runtime::Context;
use rohrpost_modules::wire::{append, from_bytes};
use rohrpost_schema::Description;
use std::rc::Rc;
use std::time::Duration;

/// A module that can be called.
#[derive(Debug)]
pub struct Peer {
    /// Its name.
    pub name: Name,
    /// What it offers.
    pub description: Description,
    /// Its hash.
    pub hash: u32,
}

/// Those that were asked for, with the texts by which they were.
#[derive(Default)]
pub(crate) struct Peers(Vec<(String, Rc<Peer>)>);

impl Peers {
    /// A module; it is asked what it offers, if it was not before.
    pub(crate) fn find(&mut self, context: &Context, module: &str, timeout: Duration) -> Result<Rc<Peer>, NativeError> {
        if let Some((_, peer)) = self.0.iter().find(|(known, _)| known == module) {
            return Ok(peer.clone());
        }
        let name = context.callee(module)?;
        let description = describe(context, name, timeout)?;
        let peer = Rc::new(Peer { name, hash: description.hash(), description });
        self.0.push((module.to_owned(), peer.clone()));
        Ok(peer)
    }

    /// It is asked anew, since it is another by now.
    pub(crate) fn forget(&mut self, module: &str) {
        self.0.retain(|(known, _)| known != module);
    }
}

impl Peer {
    /// Runs a function of it: arguments and result are postcard.
    pub(crate) fn call(
        &self,
        link: &Caller,
        function: u16,
        arguments: &[u8],
        timeout: Duration,
    ) -> Result<Vec<u8>, CallError> {
        let interface = (self.hash, &self.description);
        let sequence = link.begin_bytes(self.name, function, interface, timeout, arguments)?;
        link.wait_bytes(sequence, self.name)
    }

    /// Asks for its newest data: postcard of the time (ns since 1970), then of the value.
    pub(crate) fn get(&self, link: &Caller, number: u16, timeout: Duration) -> Result<Vec<u8>, CallError> {
        let mut arguments = Vec::new();
        append(&mut arguments, &number).map_err(|error| CallError::BadArguments(error.to_string()))?;
        self.call(link, GET_DATA, &arguments, timeout)
    }
}

/// Asks a module what it offers; all parts of the answer must come in time.
fn describe(context: &Context, module: Name, timeout: Duration) -> Result<Description, CallError> {
    // Of the functions that all modules have no module tells.
    let common = Description {
        name: String::new(),
        class: String::new(),
        text: String::new(),
        functions: Vec::new(),
        data: Vec::new(),
    };
    let link = context.link();
    // By the clock that a journal keeps: replayed, each part is asked for within the same time.
    let began = context.now();
    let elapsed = || {
        let now = context.now();
        // Once time was set, nobody can say how long it took.
        let is_one_time = now.epoch == began.epoch;
        if is_one_time { Duration::from_nanos(now.ns.saturating_sub(began.ns)) } else { Duration::MAX }
    };
    let ask = |from: u32, left| {
        let mut arguments = Vec::new();
        append(&mut arguments, &from).map_err(|error| CallError::BadArguments(error.to_string()))?;
        let sequence = link.begin_bytes(module, DESCRIBE, (HASH, &common), left, &arguments)?;
        let reply = link.wait_bytes(sequence, module)?;
        from_bytes(&reply).map_err(|error| CallError::BadReply(module, error.to_string()))
    };
    assemble(module, timeout, elapsed, ask)
}
