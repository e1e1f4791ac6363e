//! The link of a module as its proxies share it; what they do is noted in the module's journal, if it has one.

use super::{CallError, Link, append};
use crate::journal::{Blob, ModuleJournal, NotedCommand, NotedValue, Question, Tag, nanoseconds};
use rohrpost_config::CallLimits;
use rohrpost_mailbox::Name;
use rohrpost_schema::Description;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::cell::RefCell;
use std::ops::Deref;
use std::rc::Rc;
use std::time::Duration;

/// What the proxies of one thread share: its link.
///
/// Proxies are made of it. A module that speaks to the link itself does what an exact replay cannot repeat: the journal
/// ends there.
///
/// ```
/// use rohrpost_modules::call::Caller;
///
/// fn calls(link: &Caller) -> u64 {
///     link.borrow().tallies().iter().map(|tally| tally.calls).sum()
/// }
/// ```
#[derive(Clone)]
pub struct Caller(Rc<SharedLink>);

struct SharedLink {
    link: RefCell<Link>,
    journal: ModuleJournal,
    /// No proxy waits longer, whatever its program says.
    limits: CallLimits,
    /// Arguments, on their way into a journal and a command.
    arguments: RefCell<Vec<u8>>,
}

/// For those that are no proxy.
impl Deref for Caller {
    type Target = RefCell<Link>;

    fn deref(&self) -> &RefCell<Link> {
        self.0.journal.hole("the module speaks to its link itself (`Context::link`), and not by a proxy");
        &self.0.link
    }
}

impl Caller {
    pub(crate) fn new(link: Link, journal: ModuleJournal, limits: CallLimits) -> Self {
        Self(Rc::new(SharedLink { link: RefCell::new(link), journal, limits, arguments: RefCell::default() }))
    }

    /// For the runtime's own work, which no module sees.
    pub(crate) fn unseen(&self) -> &RefCell<Link> {
        &self.0.link
    }

    /// The link, if nothing else has it any more.
    pub(crate) fn into_link(self) -> Option<Link> {
        Rc::try_unwrap(self.0).ok().map(|shared| shared.link.into_inner())
    }

    /// Sends a command with a tuple of arguments, of the interface with this hash and description.
    pub(crate) fn begin<A: Serialize>(
        &self,
        to: Name,
        function: u16,
        interface: (u32, fn() -> Description),
        timeout: Duration,
        arguments: &A,
    ) -> Result<u32, CallError> {
        self.begin_with(to, function, interface, timeout, |body| append(body, arguments))
    }

    /// The same with arguments that are postcard already, one after the other, of an interface that is known by its
    /// hash and description; [`Caller::wait_bytes`] fetches the answer.
    ///
    /// ```
    /// # use rohrpost_mailbox::Name;
    /// use rohrpost_modules::{call::{CallError, Caller}, schema::Description};
    ///
    /// type Bytes = Vec<u8>;
    ///
    /// fn call(link: &Caller, to: Name, its: &Description, number: u16, arguments: &[u8]) -> Result<Bytes, CallError> {
    ///     let within = std::time::Duration::from_secs(1);
    ///     let sequence = link.begin_bytes(to, number, (its.hash(), its), within, arguments)?;
    ///     link.wait_bytes(sequence, to)
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn begin_bytes(
        &self,
        to: Name,
        function: u16,
        (interface, description): (u32, &Description),
        timeout: Duration,
        arguments: &[u8],
    ) -> Result<u32, CallError> {
        self.begin_with(to, function, (interface, || description.clone()), timeout, |body| {
            body.extend_from_slice(arguments);
            Ok(())
        })
    }

    fn begin_with(
        &self,
        to: Name,
        function: u16,
        (interface, description): (u32, impl FnOnce() -> Description),
        timeout: Duration,
        arguments: impl FnOnce(&mut Vec<u8>) -> Result<(), postcard::Error>,
    ) -> Result<u32, CallError> {
        let SharedLink { link, journal, limits, arguments: bytes } = &*self.0;
        let timeout = limits.of(to).map_or(timeout, |limit| timeout.min(limit));
        if journal.is_none() {
            return link.borrow_mut().begin(to, function, interface, timeout, arguments);
        }
        let mut bytes = bytes.borrow_mut();
        bytes.clear();
        arguments(&mut bytes).map_err(|error| CallError::BadArguments(error.to_string()))?;
        journal.replay(|replay| replay.know_called(interface, description));
        let timeout_ns = nanoseconds(timeout);
        let arguments = NotedValue::of(&bytes);
        journal.output(Tag::Called, &NotedCommand { to: to.raw(), function, interface, timeout_ns, arguments });
        let write = |body: &mut Vec<u8>| {
            body.extend_from_slice(&bytes);
            Ok(())
        };
        let begin = || link.borrow_mut().begin(to, function, interface, timeout, write);
        journal.answer(Tag::Begun, Question::Plain, begin)
    }

    /// Waits for the result of a call to this module.
    pub(crate) fn wait<T: DeserializeOwned>(&self, sequence: u32, to: Name) -> Result<T, CallError> {
        self.wait_for(sequence, to, |bytes| postcard::from_bytes(bytes))
    }

    /// The same, in postcard; nobody looks whether it is what the interface says.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn wait_bytes(&self, sequence: u32, to: Name) -> Result<Vec<u8>, CallError> {
        self.wait_for(sequence, to, |bytes| Ok(bytes.to_vec()))
    }

    fn wait_for<T>(
        &self,
        sequence: u32,
        to: Name,
        decode: impl FnOnce(&[u8]) -> Result<T, postcard::Error>,
    ) -> Result<T, CallError> {
        let SharedLink { link, journal, .. } = &*self.0;
        let question = Question::Call { to: to.raw(), sequence };
        if let Some(given) = journal.given(Tag::Answered, question) {
            let answer: Result<Blob<'_>, CallError> = given.read();
            return decode(answer?.0).map_err(|error| CallError::BadReply(to, error.to_string()));
        }
        let mut is_noted = journal.is_none();
        let read = |bytes: &[u8]| {
            journal.note(Tag::Answered, question, &Ok::<_, CallError>(Blob(bytes)));
            is_noted = true;
            decode(bytes)
        };
        let result = link.borrow_mut().wait(sequence, read);
        if let Some(error) = result.as_ref().err().filter(|_| !is_noted) {
            journal.note(Tag::Answered, question, &Err::<Blob<'_>, _>(error));
        }
        result
    }

    /// Gives a call up.
    pub(crate) fn forget(&self, sequence: u32) {
        if self.0.journal.is_replayed() {
            return;
        }
        // Not while the link waits: then this call is the one it waits for, and it forgets by itself.
        if let Ok(mut link) = self.0.link.try_borrow_mut() {
            link.forget(sequence);
        }
    }
}

/// Without a journal.
impl From<Link> for Caller {
    fn from(link: Link) -> Self {
        Self::new(link, ModuleJournal::default(), CallLimits::default())
    }
}
