//! The first call of a module that stands by for another node: it waits until this node runs the module.

use super::Link;
use crate::call::stand_by::StandBy;
use rohrpost_mailbox::{CreateError, ModuleState};

impl Link {
    /// From now on it calls nobody before the module takes over.
    pub(crate) fn stand_by(&mut self, stand_by: StandBy) {
        self.stand_by = Some(stand_by);
    }

    /// Stands by until this node runs the module: then its mailboxes are found, and its calls are later ones than those
    /// that other nodes made under its name. Returns at once if nobody has said [`Self::stand_by`]; without a lease if
    /// the process is to end.
    ///
    /// # Errors
    /// When its mailboxes cannot have their names.
    pub(crate) fn take_over(&mut self) -> Result<(), CreateError> {
        let Some(stand_by) = &self.stand_by else { return Ok(()) };
        self.participant.set_state(ModuleState::StandsBy);
        if !stand_by.wait(&mut self.replies) {
            return Ok(());
        }
        self.participant.set_state(ModuleState::Starting);
        self.participant.reveal_mailboxes()?;
        self.incarnation = self.participant.node().next_incarnation();
        self.stand_by = None;
        Ok(())
    }
}
