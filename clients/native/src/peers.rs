//! Other modules, as they describe themselves, to be called.

use crate::error::NativeError;
use rohrpost_mailbox::Name;
use rohrpost_modules::call::{CallError, Caller};
use rohrpost_modules::common::{DESCRIBE, GET_DATA, HASH};
use rohrpost_modules::description::{DescriptionRequest, assemble, noted};
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
pub(crate) struct Peers {
    known: Vec<(String, Rc<Peer>)>,
    /// Asked what they offer, without an answer so far.
    asked: Vec<(Name, DescriptionRequest)>,
}

impl Peers {
    /// A module; it is asked what it offers, if it was not before.
    pub(crate) fn find(&mut self, context: &Context, module: &str, timeout: Duration) -> Result<Rc<Peer>, NativeError> {
        if let Some(peer) = self.known(module) {
            return Ok(peer);
        }
        let name = context.callee(module)?;
        let description = describe(context, name, timeout)?;
        Ok(self.learn(module, name, description))
    }

    /// A module that may not run yet, as it describes itself on this node; or else as it answers, within this time or
    /// at a later look.
    pub(crate) fn described(
        &mut self,
        context: &Context,
        (module, name): (&str, Name),
        timeout: Duration,
    ) -> Result<Option<Rc<Peer>>, NativeError> {
        // By the journal, if there is one: the node of a replay has other modules.
        let node = context.link().borrow().participant().node().clone();
        let noted = || Ok(noted(&node, name).map(|its| its.to_bytes()).unwrap_or_default());
        let description = context.take_in(noted).ok().filter(|bytes| !bytes.is_empty());
        if let Some(description) = description.and_then(|bytes| Description::from_bytes(&bytes).ok()) {
            return Ok(Some(Rc::new(Peer { name, hash: description.hash(), description })));
        }
        let node = |name| context.installation().node_of(name);
        if node(name).is_some() && node(name) == node(context.me()) {
            return Ok(None);
        }
        if let Some(peer) = self.known(module) {
            return Ok(Some(peer));
        }
        if timeout.is_zero() {
            let at = self.asked.iter().position(|(asked, _)| *asked == name).unwrap_or_else(|| {
                self.asked.push((name, DescriptionRequest::default()));
                self.asked.len() - 1
            });
            let Some(description) = self.asked[at].1.poll(context, name) else { return Ok(None) };
            self.asked.swap_remove(at);
            return Ok(Some(self.learn(module, name, description)));
        }
        match describe(context, name, timeout) {
            Ok(description) => Ok(Some(self.learn(module, name, description))),
            // It does not run yet, or its node does not.
            Err(CallError::Timeout(..) | CallError::NotSent(_) | CallError::Fault(..)) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    fn known(&self, module: &str) -> Option<Rc<Peer>> {
        self.known.iter().find(|(known, _)| known == module).map(|(_, peer)| peer.clone())
    }

    fn learn(&mut self, module: &str, name: Name, description: Description) -> Rc<Peer> {
        let peer = Rc::new(Peer { name, hash: description.hash(), description });
        self.known.push((module.to_owned(), peer.clone()));
        peer
    }

    /// It is asked anew, since it is another by now.
    pub(crate) fn forget(&mut self, module: &str) {
        self.known.retain(|(known, _)| known != module);
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
