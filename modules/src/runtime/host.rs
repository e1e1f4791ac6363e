//! How a program that is no module takes part: tools, tests, launch itself.

mod functions;

use super::clock::ModuleClock;
use super::stream::{CheckedReader, Stream, StreamReadError};
use crate::call::append;
use crate::call::{CallError, Link, REPLIES_KEPT};
use crate::common;
use crate::description::assemble;
use crate::interface::StreamPort;
use crate::journal::ModuleJournal;
use rohrpost_config::Installation;
use rohrpost_mailbox::{
    BODY_BYTES_MAX, CreateError, Name, Node, NodeError, Participant, Receiver, Shape, SystemClock, local,
};
use rohrpost_schema::{Data, Description};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Packages of subscribed data that may wait for a tool.
const DATA_SLOTS: u16 = 128;

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
         or widen `tools` in the configuration"
    )]
    Crowded(usize, String),
    /// The configuration has no such node.
    #[error("the configuration has no node `{0}`")]
    NoNode(String),
}

/// A tool's place on a node: a link and a data mailbox, under the first free instance of class `tool` but one: that is
/// launch's.
///
/// ```no_run
/// use rohrpost_modules::runtime::{ToolLink, find_running};
/// use std::time::Duration;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let installation = rohrpost_config::Installation::load("robot.toml".as_ref())?;
/// let directory = find_running().pop().ok_or("no node runs")?;
/// let node = rohrpost_mailbox::Node::open(&directory)?;
/// let mut tool = ToolLink::join(&installation, &node, "base", Duration::from_secs(1))?;
/// let pilot = installation.classes.parse_module("pilot.0")?;
/// println!("it runs for {} ms", tool.status(pilot)?.uptime_ms);
/// tool.close();
/// # Ok(())
/// # }
/// ```
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
            match Self::take(&participant, tool(instance), installation.launch_of(config), timeout) {
                Err(CreateError::Owned(..)) => {}
                taken => return Ok(taken?),
            }
        }
        Err(ClientError::Crowded(config.tools_by_hand().count(), name.into()))
    }

    /// Joins as the launch of a node: under the first instance, where tools look for it.
    ///
    /// # Errors
    /// See [`ClientError`]; [`CreateError::Owned`] while a launch of it runs.
    #[doc(hidden)]
    pub fn join_as_launch(
        installation: &Installation,
        node: &Arc<Node>,
        name: &str,
        timeout: Duration,
    ) -> Result<Self, ClientError> {
        let config = installation.node(name).ok_or_else(|| ClientError::NoNode(name.into()))?;
        let participant = Participant::join(node, Name::NONE)?;
        let me = installation.launch_of(config);
        Ok(Self::take(&participant, me, me, timeout)?)
    }

    fn take(participant: &Arc<Participant>, me: Name, launcher: Name, timeout: Duration) -> Result<Self, CreateError> {
        let large = Shape { slots: REPLIES_KEPT as u16, body_bytes_max: BODY_BYTES_MAX as u16, ..Shape::default() };
        let replies = participant.receiver(me.with_local(local::REPLIES), large)?;
        let link = Link::new(participant, me, replies);
        Ok(Self { link, large, data: None, clock: SystemClock::open(participant.node()), timeout, launcher })
    }

    /// Where the launch of this node takes commands, if one runs.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink, schema::Description};
    /// # use std::time::Duration;
    /// fn what_launch_offers(tool: &mut ToolLink) -> Result<Description, CallError> {
    ///     let launcher = tool.launcher();
    ///     rohrpost_modules::runtime::describe(&mut tool.link, launcher, Duration::from_secs(1))
    /// }
    /// ```
    pub fn launcher(&self) -> Name {
        self.launcher
    }

    /// The mailbox that takes subscribed data; made when it is first asked for.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::ToolLink;
    /// # use rohrpost_mailbox::CreateError;
    /// fn wait_for_data(tool: &mut ToolLink) -> Result<bool, CreateError> {
    ///     let package = tool.data()?.receive_timeout(std::time::Duration::from_secs(1));
    ///     Ok(package.is_some())
    /// }
    /// ```
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

    /// A stream of a module of this node, read as [`super::Context::stream`] reads it.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Stream, StreamReadError, ToolLink};
    /// # use rohrpost_modules::{interface::StreamPort, types::Pose};
    /// # use rohrpost_config::Installation;
    /// # use rohrpost_mailbox::Name;
    /// fn hook(
    ///     tool: &ToolLink,
    ///     installation: &Installation,
    ///     port: StreamPort<Pose>,
    ///     crane: Name,
    /// ) -> Result<Stream<Pose>, StreamReadError> {
    ///     tool.stream(installation, port, crane)
    /// }
    /// ```
    ///
    /// # Errors
    /// [`StreamReadError::Ring`] when all its seats are taken, or its file cannot be read.
    pub fn stream<T: Data>(
        &self,
        installation: &Installation,
        port: StreamPort<T>,
        module: Name,
    ) -> Result<Stream<T>, StreamReadError> {
        let installation = Arc::new(installation.clone());
        let reader = CheckedReader::open(self.link.participant(), &installation, port.into(), module)?;
        Ok(Stream::new(reader, ModuleClock::new(self.clock.clone(), ModuleJournal::default())))
    }

    /// Calls a common function with a tuple of arguments.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// use rohrpost_modules::common::{STATUS, Status};
    ///
    /// fn status(tool: &mut ToolLink, module: Name) -> Result<Status, CallError> {
    ///     tool.common(module, STATUS, &())
    /// }
    /// ```
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
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// /// Its function 16 of interface 7, which takes an angle in radians and returns another.
    /// fn turn(tool: &mut ToolLink, module: Name, angle_rad: f64) -> Result<f64, CallError> {
    ///     let write = |body: &mut Vec<u8>| Ok(body.extend_from_slice(&angle_rad.to_le_bytes()));
    ///     tool.call(module, 16, 7, write, |bytes| postcard::from_bytes(bytes))
    /// }
    /// ```
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

    /// Begins to call any function, and returns at once; [`Link::poll_for`] tells how it went.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// fn stop_both(tool: &mut ToolLink, left: Name, right: Name) -> Result<(), CallError> {
    ///     let begun = [tool.begin(left, 16, 7, |_| Ok(()))?, tool.begin(right, 16, 7, |_| Ok(()))?];
    ///     begun.into_iter().try_for_each(|call| tool.link.wait(call, |_| Ok(())))
    /// }
    /// ```
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

    /// Removes the tool's mailboxes.
    pub fn close(self) {
        if let Some(data) = self.data {
            data.close();
        }
        self.link.close();
    }
}

/// Asks a module what it offers; all parts of the answer must come within `timeout`.
///
/// # Errors
/// See [`CallError`].
pub fn describe(link: &mut Link, module: Name, timeout: Duration) -> Result<Description, CallError> {
    let began = Instant::now();
    let ask = |from: u32, left| {
        let call = link.begin(module, common::DESCRIBE, common::HASH, left, |body| append(body, &(from,)))?;
        link.wait(call, |reply| postcard::from_bytes(reply))
    };
    assemble(module, timeout, || began.elapsed(), ask)
}
