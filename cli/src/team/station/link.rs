//! What commands of a station ask it.

use crate::look::newest;
use crate::look::observer::Tool;
use crate::look::target::{Inquiry, Running};
use crate::terminal::Failure;
use rohrpost::interface::Interface;
use rohrpost::interfaces::{StationInterface, StationState, TeamRefusal};
use rohrpost::wire::{append, from_bytes};
use rohrpost_mailbox::Name;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// The station that runs here.
pub(super) struct StationLink {
    pub(super) running: Running,
    pub(super) tool: Tool,
    pub(super) module: Name,
}

impl StationLink {
    pub(super) fn find(inquiry: &Inquiry) -> Result<Self, Failure> {
        let running = inquiry.target.find()?;
        let module = running.module(StationInterface::CLASS)?;
        let tool = running.join(inquiry.timeout()?)?;
        Ok(Self { running, tool, module })
    }

    /// Calls a function that may refuse.
    pub(super) fn call<T: DeserializeOwned>(
        &mut self,
        function: u16,
        arguments: &impl Serialize,
    ) -> Result<T, Failure> {
        let write = |body: &mut Vec<u8>| append(body, arguments);
        let read = |bytes: &[u8]| from_bytes::<Result<T, TeamRefusal>>(bytes);
        let answer = self.tool.call(self.module, function, StationInterface::hash(), write, read);
        Ok(answer.map_err(|error| self.running.told(self.module, &error))??)
    }

    pub(super) fn state(&mut self) -> Result<StationState, Failure> {
        let newest = newest(&mut self.tool, self.module, StationInterface::STATE);
        newest.map(|(_, state)| state).map_err(|error| self.running.told(self.module, &error))
    }
}
