//! A program beside the robot: it calls and reads as a tool, and needs no class, no `[[module]]`, no certificates.

use rohrpost_config::{Errors, Installation, NameTextError};
use rohrpost_mailbox::{CreateError, Kind, Name, Next, RecordInfo, StreamError, StreamId, StreamReader};
use rohrpost_modules::call::CallError;
use rohrpost_modules::common::DataHead;
use rohrpost_modules::description::noted;
use rohrpost_modules::runtime::{ClientError, NotHere, ToolLink, configuration_here, describe, open_here};
use rohrpost_schema::Description;
use std::time::Duration;

/// Why a program cannot take part as a tool.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    /// Nothing that was meant runs on this computer.
    #[error(transparent)]
    NotHere(#[from] NotHere),
    /// The configuration of what runs.
    #[error(transparent)]
    Configuration(#[from] Errors),
    /// The node has no room for another tool.
    #[error(transparent)]
    Join(#[from] ClientError),
    /// The mailbox for data.
    #[error(transparent)]
    Mailbox(#[from] CreateError),
    /// A text that names no module.
    #[error(transparent)]
    Name(#[from] NameTextError),
    /// A stream.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// A call.
    #[error(transparent)]
    Call(#[from] CallError),
}

/// A tool's place on a node of this computer.
pub struct NativeTool {
    installation: Installation,
    tool: ToolLink,
}

/// A value that came of a subscription.
pub struct ToolData {
    /// The module that published it.
    pub from: Name,
    /// The number of the item.
    pub number: u16,
    /// The subscription, as its subscriber numbered it.
    pub id: u16,
    /// When it was true, and what is missing before it.
    pub head: DataHead,
    /// Postcard of the value.
    pub value: Vec<u8>,
}

impl NativeTool {
    /// Joins the installation of this name, or the only one that runs here, on the node of this name, or the first that
    /// runs here.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn join(installation: Option<&str>, node: Option<&str>) -> Result<Self, ToolError> {
        let installation = Installation::load(&configuration_here(installation, node)?)?;
        let (name, node) = open_here(&installation, node)?;
        let tool = ToolLink::join(&installation, &node, name, Duration::from_secs(1))?;
        Ok(Self { tool, installation })
    }

    /// The module that a text names.
    ///
    /// # Errors
    /// [`ToolError::Name`].
    pub fn name(&self, text: &str) -> Result<Name, ToolError> {
        Ok(self.installation.classes.parse_name(text)?.module())
    }

    /// Names of all modules of the configuration, and their aliases.
    pub fn modules(&self) -> Vec<String> {
        let names = self.installation.modules.iter().flat_map(|module| module.names());
        names.map(|name| self.installation.classes.format(name)).collect()
    }

    /// Describes a module, as it left its description on this node, or else as it answers.
    ///
    /// # Errors
    /// [`CallError`].
    pub fn describe(&mut self, module: Name, timeout: Duration) -> Result<Description, CallError> {
        match noted(self.tool.link.participant().node(), module) {
            Some(description) => Ok(description),
            None => describe(&mut self.tool.link, module, timeout),
        }
    }

    /// Calls a function: arguments and result are postcard.
    ///
    /// # Errors
    /// [`CallError`].
    pub fn call(
        &mut self,
        module: Name,
        (interface, function): (u32, u16),
        arguments: &[u8],
        timeout: Duration,
    ) -> Result<Vec<u8>, CallError> {
        let write = |body: &mut Vec<u8>| {
            body.extend_from_slice(arguments);
            Ok(())
        };
        let call = self.tool.link.begin(module, function, interface, timeout, write)?;
        self.tool.link.wait(call, |reply| Ok(reply.to_vec()))
    }

    /// Waits for a value of any subscription of this tool; none within this time. Makes its mailbox at the first time.
    ///
    /// # Errors
    /// [`ToolError::Mailbox`].
    pub fn data(&mut self, timeout: Duration) -> Result<Option<ToolData>, ToolError> {
        // Data that an earlier program subscribed to under this name may still arrive for a while.
        let incarnation = self.tool.link.incarnation();
        let Some(package) = self.tool.data()?.receive_timeout(timeout) else { return Ok(None) };
        let head = *package.head();
        let (Kind::Data(number), Some((about, value))) = (head.kind.kind(), DataHead::split(package.body())) else {
            return Ok(None);
        };
        let data = || ToolData { from: head.from.module(), number, id: head.id, head: about, value: value.to_vec() };
        Ok((about.incarnation == incarnation).then(data))
    }

    /// Opens a stream that is in this node's memory.
    ///
    /// # Errors
    /// [`ToolError::Stream`].
    pub fn stream(&self, module: Name, number: u16) -> Result<ToolStream, ToolError> {
        let id = StreamId { name: module, number };
        Ok(ToolStream { reader: self.tool.link.participant().stream_reader(id)? })
    }

    /// Gives the place back.
    pub fn close(self) {
        self.tool.close();
    }
}

/// A stream, read by copies: what a program holds keeps no writer waiting.
pub struct ToolStream {
    reader: StreamReader,
}

/// A record, and its value as postcard.
pub type CopiedRecord = (RecordInfo, Vec<u8>);

impl ToolStream {
    /// The newest record; none before the first.
    ///
    /// # Errors
    /// [`ToolError::Stream`].
    pub fn newest(&mut self) -> Result<Option<CopiedRecord>, ToolError> {
        let mut body = Vec::new();
        let newest = self.reader.newest_into(&mut body)?;
        Ok(newest.map(|info| (info, body)))
    }

    /// The next record, or how many were lost; the first time the first one written after the stream was opened.
    ///
    /// # Errors
    /// [`ToolError::Stream`].
    pub fn next_within(&mut self, timeout: Duration) -> Result<Next<CopiedRecord>, ToolError> {
        let mut body = Vec::new();
        let next = self.reader.next_timeout_into(&mut body, timeout)?;
        Ok(next.map(|info| (info, body)))
    }
}
