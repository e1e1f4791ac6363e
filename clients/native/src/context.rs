//! What a module in another language can ask of its runtime.

use crate::error::NativeError;
use crate::following::{FollowRate, Following, item_of};
use crate::parameters::Parameters;
use crate::peers::{Peer, Peers};
use crate::record::{Front, OpenedRecord, RecordRoom};
use crate::streams::NativeStream;
use rohrpost_config::Installation;
use rohrpost_mailbox::{Interest, Name, SystemTime, Watch};
use rohrpost_modules::call::CallError;
use rohrpost_modules::parameter::Refusal;
use rohrpost_modules::runtime::{Context, Moment};
use rohrpost_schema::{DataKind, Description};
use std::io;
use std::os::fd::AsFd;
use std::rc::Rc;
use std::time::Duration;

/// What belongs to a module besides its runtime's context.
pub(crate) struct NativeState {
    /// The name under which it serves its interface.
    pub(crate) serves: Name,
    pub(crate) description: Description,
    pub(crate) parameters: Parameters,
    /// The configuration's settings, without parameters, as JSON.
    pub(crate) settings: String,
    pub(crate) following: Following,
    pub(crate) peers: Peers,
    pub(crate) open: Option<OpenedRecord>,
    pub(crate) front: Front,
}

/// A module's connection to its node, during a call of its functions.
pub struct NativeContext<'a> {
    pub(crate) context: &'a mut Context,
    pub(crate) state: &'a mut NativeState,
}

impl NativeContext<'_> {
    /// The module's own name.
    pub fn me(&self) -> Name {
        self.context.me()
    }

    /// The configuration that it runs under.
    pub fn installation(&self) -> &Installation {
        self.context.installation()
    }

    /// Whether its description has a function of this number.
    pub fn offers(&self, number: u16) -> bool {
        self.state.description.functions.iter().any(|function| function.number == number)
    }

    /// Its settings that are no parameters, as an object in JSON.
    pub fn settings(&self) -> &str {
        &self.state.settings
    }

    /// The present value of a parameter, in postcard.
    pub fn parameter(&self, name: &str) -> Option<&[u8]> {
        self.state.parameters.value(name)
    }

    /// The module sets a parameter of its own.
    ///
    /// # Errors
    /// There is none of this name, or it does not have such a value.
    pub fn set_parameter(&mut self, name: &str, value: &[u8]) -> Result<(), Refusal> {
        self.state.parameters.set(name, value)
    }

    /// System time now, with its error bound and age.
    pub fn now(&self) -> SystemTime {
        self.context.now()
    }

    /// Asks for [`crate::NativeModule::tick`] once in this time, from now on.
    pub fn set_period(&mut self, period: Duration) {
        self.context.set_period(period);
    }

    /// Publishes a value of its data or of a stream, in postcard, that was true at this time; now, if none is said.
    ///
    /// # Errors
    /// There is no such number, a record is being filled, or the stream does not take it.
    pub fn publish(&mut self, number: u16, at: Option<Moment>, value: &[u8]) -> Result<(), NativeError> {
        self.require(number, None)?;
        let at = at.unwrap_or_else(|| Moment::Ns(self.context.now().ns));
        Ok(self.context.publish_as(self.state.serves, number, at, value)?)
    }

    /// Begins a record of a stream, to be filled in place. `front` is postcard of a value that ends with empty bytes;
    /// `len` of them are to be filled. Then [`NativeContext::finish`] or [`NativeContext::abandon`].
    ///
    /// # Errors
    /// As for [`NativeContext::publish`], and when the type does not end with bytes.
    pub fn begin(
        &mut self,
        number: u16,
        at: Option<Moment>,
        front: &[u8],
        len: usize,
    ) -> Result<RecordRoom, NativeError> {
        self.require(number, Some(DataKind::Stream))?;
        let at = at.unwrap_or_else(|| Moment::Ns(self.context.now().ns));
        let NativeState { serves, front: kept, .. } = &mut *self.state;
        let (open, room) = OpenedRecord::begin(self.context, (*serves, number), at, (front, kept), len)?;
        self.state.open = Some(open);
        Ok(room)
    }

    /// Makes the record that is being filled the stream's newest; its sequence. `own`: the bytes, if they are in the
    /// author's memory ([`RecordRoom::Own`]).
    ///
    /// # Errors
    /// [`NativeError::NoRecordOpen`], or the stream does not take it.
    pub fn finish(&mut self, own: &[u8]) -> Result<u64, NativeError> {
        let open = self.state.open.take().ok_or(NativeError::NoRecordOpen)?;
        open.finish(self.context, &self.state.front, own)
    }

    /// Gives up the record that is being filled; nothing happened.
    pub fn abandon(&mut self) {
        if let Some(open) = self.state.open.take() {
            open.abandon(self.context);
        }
    }

    /// Follows data or a stream of another module, by the names of both; which of those that the module follows it is.
    /// The other one need not run yet.
    ///
    /// # Errors
    /// The text names no module, or there is no room for another.
    pub fn follow(&mut self, module: &str, item: &str, rate: FollowRate) -> Result<usize, NativeError> {
        self.state.following.follow(self.context, module, item, rate)
    }

    /// Opens a stream of another module of this node, or of which this node has a replica, to look at when the module
    /// likes. None as long as the other one has not described itself, since it does not run yet: ask again. Where only
    /// the other one itself can say what it offers, its answer is waited for at most so long. `is_late`: it was asked
    /// for before, in vain, so that the stream is read from its first record on.
    ///
    /// # Errors
    /// The stream cannot be on this node, the other one has no such stream, or all its seats are taken.
    pub fn stream(
        &mut self,
        module: &str,
        item: &str,
        timeout: Duration,
        is_late: bool,
    ) -> Result<Option<NativeStream>, NativeError> {
        let name = self.context.module_named(module)?;
        self.context.require_stream(name, item)?;
        let Some(peer) = self.state.peers.described(self.context, (module, name), timeout)? else { return Ok(None) };
        let item = item_of(&peer.description, module, item, true)?;
        let mut stream = self.context.stream_untyped(peer.name, &item, peer.hash)?;
        if is_late {
            stream.from(0);
        }
        Ok(Some(NativeStream::new(item, stream)))
    }

    /// A module that can be called; the first time it is asked what it offers, at most so long.
    ///
    /// # Errors
    /// The text names no module, or it does not answer.
    pub fn peer(&mut self, module: &str, timeout: Duration) -> Result<Rc<Peer>, NativeError> {
        self.state.peers.find(self.context, module, timeout)
    }

    /// A module that said that its interface is another by now is asked anew.
    pub fn forget(&mut self, module: &str) {
        self.state.peers.forget(module);
    }

    /// Runs a function of another module, and waits for its result: arguments are postcard, one after the other; so is
    /// the result.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn call(
        &mut self,
        peer: &Peer,
        function: u16,
        arguments: &[u8],
        timeout: Duration,
    ) -> Result<Vec<u8>, CallError> {
        peer.call(self.context.link(), function, arguments, timeout)
    }

    /// Asks another module for its newest data: postcard of its time (ns since 1970), then of the value.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn get(&mut self, peer: &Peer, number: u16, timeout: Duration) -> Result<Vec<u8>, CallError> {
        peer.get(self.context.link(), number, timeout)
    }

    /// Waits for a descriptor, too; [`crate::NativeModule::ready`] tells when there is something to do.
    ///
    /// # Errors
    /// Too many are watched, or the process has none left.
    pub fn watch(&mut self, descriptor: &impl AsFd, interest: Interest) -> io::Result<Watch> {
        self.context.watch(descriptor, interest)
    }

    /// Waits for it no longer; false when it was not waited for.
    pub fn unwatch(&mut self, watch: Watch) -> bool {
        self.context.unwatch(watch)
    }

    fn require(&self, number: u16, kind: Option<DataKind>) -> Result<(), NativeError> {
        let item = self.state.description.data.iter().find(|item| item.number == number);
        let item = item.filter(|item| kind.is_none_or(|kind| item.kind == kind));
        if item.is_none() {
            return Err(NativeError::NoNumber(number));
        }
        if self.state.open.is_some() { Err(NativeError::RecordOpen) } else { Ok(()) }
    }
}
