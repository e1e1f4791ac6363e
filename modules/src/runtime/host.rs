//! How a program that is no module takes part: tools, tests, launch itself.

use crate::call::append;
use crate::call::{CallError, Link, REPLIES_KEPT};
use crate::common::{
    self, Change, DescriptionPart, Exchange, ExchangePage, OutputLevel, ParameterPage, SetParameters, Status,
    TimeReport,
};
use crate::parameter::{Parameter, Refusal};
use rohrpost_config::Installation;
use rohrpost_mailbox::{
    BODY_BYTES_MAX, CreateError, Name, Node, NodeError, Participant, Receiver, Shape, SystemClock, local,
};
use rohrpost_schema::Description;
use std::sync::Arc;
use std::time::Duration;

/// Packages of subscribed data that may wait for a tool.
const DATA_SLOTS: u16 = 128;

/// Longest description that is asked for, bytes.
const DESCRIPTION_MAX: usize = 1 << 20;

/// Most parameters of a module that are asked for.
const PARAMETERS_MAX: u16 = 1024;
/// Times that parameters are read anew because they were set meanwhile.
const READS_MAX: usize = 5;

/// Why a tool cannot take part.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The node.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// A mailbox.
    #[error(transparent)]
    Mailbox(#[from] CreateError),
    /// All instances of class `tool` that programs run by hand may take are in use.
    #[error(
        "no room for another tool on node `{1}`: programs run by hand have {0} instances there, all in use; end some, \
        or \
         widen `tools` in the configuration"
    )]
    Crowded(usize, String),
    /// The configuration has no such node.
    #[error("the configuration has no node `{0}`")]
    NoNode(String),
}

/// A tool's place on a node: a link and a data mailbox, under the first free instance of class `tool` but one: that is
/// launch's.
pub struct ToolLink {
    /// Sends and calls.
    pub link: Link,
    /// Room for any answer and any data; tools are few, and give it back when they end.
    large: Shape,
    data: Option<Receiver>,
    /// Reads system time.
    pub clock: SystemClock,
    timeout: Duration,
    /// Launch of this node.
    launcher: Name,
}

impl ToolLink {
    /// Joins a running node. Calls made by this link end after `timeout`.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub fn join(
        installation: &Installation,
        node: &Arc<Node>,
        name: &str,
        timeout: Duration,
    ) -> Result<Self, ClientError> {
        let config = installation.node(name).ok_or_else(|| ClientError::NoNode(name.into()))?;
        let participant = Participant::join(node, Name::NONE)?;
        let tool = |instance| Name::new(installation.system.id, installation.classes.tool().0, instance, 0);
        for instance in config.tools_by_hand() {
            match Self::take(&participant, tool(instance), tool(config.launch_instance()), timeout) {
                Err(CreateError::Owned(..)) => {}
                taken => return Ok(taken?),
            }
        }
        Err(ClientError::Crowded(config.tools_by_hand().count(), name.into()))
    }

    /// Joins as the launch of a node: under the first instance, where tools look for it.
    pub(crate) fn join_as_launch(
        installation: &Installation,
        node: &Arc<Node>,
        name: &str,
        timeout: Duration,
    ) -> Result<Self, ClientError> {
        let config = installation.node(name).ok_or_else(|| ClientError::NoNode(name.into()))?;
        let participant = Participant::join(node, Name::NONE)?;
        let me = Name::new(installation.system.id, installation.classes.tool().0, config.launch_instance(), 0);
        Ok(Self::take(&participant, me, me, timeout)?)
    }

    fn take(participant: &Arc<Participant>, me: Name, launcher: Name, timeout: Duration) -> Result<Self, CreateError> {
        let large = Shape { slots: REPLIES_KEPT as u16, body_bytes_max: BODY_BYTES_MAX as u16, ..Shape::default() };
        let replies = participant.receiver(me.with_local(local::REPLIES), large)?;
        let link = Link::new(participant, me, replies);
        Ok(Self { link, large, data: None, clock: SystemClock::open(participant.node()), timeout, launcher })
    }

    /// Where the launch of this node takes commands, if one runs.
    pub fn launcher(&self) -> Name {
        self.launcher
    }

    /// The mailbox that takes subscribed data; made when it is first asked for.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn data(&mut self) -> Result<&mut Receiver, CreateError> {
        if self.data.is_none() {
            let name = self.link.me().with_local(local::DATA);
            let shape = Shape { slots: DATA_SLOTS, ..self.large };
            self.data = Some(self.link.participant().clone().receiver(name, shape)?);
        }
        self.data.as_mut().ok_or(CreateError::Reserved(Name::NONE))
    }

    /// Calls a common function with a tuple of arguments.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn common<T: serde::de::DeserializeOwned>(
        &mut self,
        module: Name,
        function: u16,
        arguments: &impl serde::Serialize,
    ) -> Result<T, CallError> {
        self.call(module, function, common::HASH, |body| append(body, arguments), |bytes| postcard::from_bytes(bytes))
    }

    /// Calls any function: `write` appends its arguments, `read` takes its result.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn call<T>(
        &mut self,
        module: Name,
        function: u16,
        interface: u32,
        write: impl FnOnce(&mut Vec<u8>) -> Result<(), postcard::Error>,
        read: impl FnOnce(&[u8]) -> Result<T, postcard::Error>,
    ) -> Result<T, CallError> {
        let call = self.begin(module, function, interface, write)?;
        self.link.wait(call, read)
    }

    /// Begins to call any function, and returns at once; [`Link::poll_as`] tells how it went.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn begin(
        &mut self,
        module: Name,
        function: u16,
        interface: u32,
        write: impl FnOnce(&mut Vec<u8>) -> Result<(), postcard::Error>,
    ) -> Result<u32, CallError> {
        self.link.begin(module, function, interface, self.timeout, write)
    }

    /// Switches a module on or off.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn switch(&mut self, module: Name, on: bool) -> Result<(), CallError> {
        self.common(module, if on { common::ON } else { common::OFF }, &())
    }

    /// Begins to switch a module on or off, and returns at once; [`Link::poll`] tells how it went.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn begin_switch(&mut self, module: Name, on: bool) -> Result<u32, CallError> {
        self.begin(module, if on { common::ON } else { common::OFF }, common::HASH, |_| Ok(()))
    }

    /// Asks a module how it is.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn status(&mut self, module: Name) -> Result<Status, CallError> {
        self.common(module, common::STATUS, &())
    }

    /// Asks a module for system time as its node has it.
    ///
    /// # Errors
    /// See [`CallError`]. A module built before there was this function says [`crate::call::Fault::Unknown`].
    pub fn time(&mut self, module: Name) -> Result<TimeReport, CallError> {
        self.common(module, common::TIME, &())
    }

    /// Asks a module what came of its exchange with others: the data that it follows, then those that it has called.
    ///
    /// # Errors
    /// See [`CallError`]. A module built before there was this function says [`crate::call::Fault::Unknown`].
    pub fn exchange(&mut self, module: Name) -> Result<Vec<Exchange>, CallError> {
        let mut all = Vec::new();
        loop {
            let page: ExchangePage = self.common(module, common::EXCHANGE, &(all.len() as u16,))?;
            let last = page.exchanges.is_empty();
            all.extend(page.exchanges);
            if all.len() >= usize::from(page.total) || last {
                return Ok(all);
            }
        }
    }

    /// Sets which output lines a module sends, and tells which it sent before; none when nothing collects them.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn output_level(&mut self, module: Name, level: OutputLevel) -> Result<Option<OutputLevel>, CallError> {
        self.common(module, common::OUTPUT_LEVEL, &(level,))
    }

    /// Asks a module what it offers.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn describe(&mut self, module: Name) -> Result<Description, CallError> {
        describe(&mut self.link, module, self.timeout)
    }

    /// Asks a module for its parameters and their values; empty, if it has none.
    ///
    /// # Errors
    /// See [`CallError`]. A module built before there were parameters says [`crate::call::Fault::Unknown`].
    pub fn parameters(&mut self, module: Name) -> Result<Vec<Parameter>, CallError> {
        let mut found = Vec::new();
        let mut changes = None;
        let mut reads = 0;
        loop {
            let from = found.len() as u16;
            let write = |body: &mut Vec<u8>| append(body, &(from,));
            let page: ParameterPage =
                self.call(module, common::PARAMETERS, common::HASH, write, |bytes| postcard::from_bytes(bytes))?;
            // What it says of itself is a claim.
            if page.total > PARAMETERS_MAX {
                let text = format!("its {} parameters are more than {PARAMETERS_MAX}", page.total);
                return Err(CallError::BadReply(module, text));
            }
            // Somebody set some in between: values of one moment belong together.
            if changes.replace(page.changes).is_some_and(|before| before != page.changes) && reads < READS_MAX {
                reads += 1;
                found.clear();
                changes = None;
                continue;
            }
            let last = page.parameters.is_empty();
            found.extend(page.parameters);
            if found.len() >= usize::from(page.total) || last {
                return Ok(found);
            }
        }
    }

    /// Sets parameters of a module, all of them or none; returns what they were and are.
    ///
    /// # Errors
    /// See [`CallError`] and [`Refusal`].
    pub fn set_parameters(&mut self, module: Name, wish: &SetParameters) -> Result<Vec<Change>, CallError<Refusal>> {
        let set: Result<_, Refusal> = self.common(module, common::SET_PARAMETERS, wish).map_err(CallError::widen)?;
        set.map_err(|refusal| CallError::Module(module, refusal))
    }

    /// Removes the tool's mailboxes.
    pub fn close(self) {
        if let Some(data) = self.data {
            data.close();
        }
        self.link.close();
    }
}

/// Asks a module what it offers; each part of the answer must come within `timeout`.
///
/// # Errors
/// See [`CallError`].
pub fn describe(link: &mut Link, module: Name, timeout: Duration) -> Result<Description, CallError> {
    let mut bytes = Vec::new();
    loop {
        let from = bytes.len() as u32;
        let call = link.begin(module, common::DESCRIBE, common::HASH, timeout, |body| append(body, &(from,)))?;
        let part: DescriptionPart = link.wait(call, |reply| postcard::from_bytes(reply))?;
        // What it says of itself is a claim.
        if part.total as usize > DESCRIPTION_MAX {
            let text = format!("its description of {} bytes is longer than {DESCRIPTION_MAX}", part.total);
            return Err(CallError::BadReply(module, text));
        }
        let last = part.bytes.is_empty();
        bytes.extend_from_slice(&part.bytes);
        if bytes.len() >= part.total as usize || last {
            break;
        }
    }
    Description::from_bytes(&bytes).map_err(|error| CallError::BadReply(module, error.to_string()))
}
