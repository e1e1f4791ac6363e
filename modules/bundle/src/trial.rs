//! The trial of a bundle: whether what it starts stays up.

use crate::digest::Sha256;
use crate::node::{NodeFolder, NodeFolderError, STATE_PATIENCE};
use crate::state::{Kept, State, TrialState};
use std::fs::File;
use std::time::Duration;

/// Launch waits so long for the lock of the state while its modules run, which it alone watches.
const PATIENCE: Duration = Duration::from_millis(200);

/// A launch of a bundle. While this value lives, no other launch of the folder begins, and the bundle stays there.
#[derive(Debug)]
pub struct Trial {
    node: NodeFolder,
    bundle: Sha256,
    is_due: bool,
    /// The bundle to go back to, which was trusted and whole when this launch began.
    behind: Option<Kept>,
    _lock: File,
}

/// How a launch begins.
#[derive(Debug)]
pub enum Begun {
    /// Modules may start.
    Launch(Trial),
    /// An earlier launch did not end its trial: it was killed, or the computer lost power. The node has gone back;
    /// versions from and to. What is current now is to be launched.
    Back(u64, u64),
}

impl Trial {
    /// Begins a launch of a bundle. If its trial is due, the bundle to go back to is verified.
    ///
    /// # Errors
    /// [`NodeFolderError::Launched`], and a state that cannot be read or written.
    pub fn begin(node: &NodeFolder, bundle: Sha256) -> Result<Begun, NodeFolderError> {
        let mut trial = Self::beside(node, bundle)?;
        // Another bundle than the current one is launched by a person that names it.
        let is_current = node.current()? == Some(bundle);
        let kept = node.state()?.of(bundle).filter(|kept| is_current && kept.trial != TrialState::Passed);
        let Some(kept) = kept else { return Ok(Begun::Launch(trial)) };
        (trial.is_due, trial.behind) = (true, node.whole_behind(bundle)?);
        if kept.trial != TrialState::Due
            && let Some((from, to)) = trial.go_back()?
        {
            return Ok(Begun::Back(from, to));
        }
        Ok(Begun::Launch(trial))
    }

    /// Begins a launch of another configuration of a bundle than that of its manifest: it has no trial.
    ///
    /// # Errors
    /// [`NodeFolderError::Launched`], and what the system says of the locks.
    pub fn beside(node: &NodeFolder, bundle: Sha256) -> Result<Self, NodeFolderError> {
        let _state = node.lock_state(STATE_PATIENCE)?;
        let lock = node.lock_launch(bundle)?;
        Ok(Self { node: node.clone(), bundle, is_due: false, behind: None, _lock: lock })
    }

    /// Modules are about to start: from now on a launch that ends without a word has failed. No effect without a trial.
    ///
    /// # Errors
    /// A state that cannot be read or written; then no module may start.
    pub fn start(&mut self) -> Result<(), NodeFolderError> {
        if self.is_due { self.note(TrialState::Running) } else { Ok(()) }
    }

    /// What this launch runs is not what the manifest says: its trial stays due.
    pub fn leave_due(&mut self) {
        self.is_due = false;
    }

    /// The node's folder.
    pub fn node(&self) -> &NodeFolder {
        &self.node
    }

    /// Whether the trial is under way.
    pub fn is_under_way(&self) -> bool {
        self.is_due
    }

    /// All modules have stayed up: the node keeps the bundle.
    ///
    /// # Errors
    /// A state that cannot be read or written; the trial is under way still.
    pub fn pass(&mut self) -> Result<(), NodeFolderError> {
        self.note(TrialState::Passed)?;
        self.is_due = false;
        Ok(())
    }

    /// The launch ends because it was told to: the next one begins the trial anew. No effect after the trial.
    ///
    /// # Errors
    /// A state that cannot be read or written.
    pub fn interrupt(&mut self) -> Result<(), NodeFolderError> {
        if self.is_due { self.note(TrialState::Due) } else { Ok(()) }
    }

    /// The modules have not stayed up: the node goes back. Versions from and to; `None` if the node has no whole bundle
    /// before, or has another current one by now.
    ///
    /// # Errors
    /// [`NodeFolderError::Busy`]: try again; the trial is under way still. A state that cannot be read or written.
    pub fn fail(&mut self) -> Result<Option<(u64, u64)>, NodeFolderError> {
        let failed = self.go_back();
        self.is_due = matches!(failed, Err(NodeFolderError::Busy(_)));
        failed
    }

    fn go_back(&self) -> Result<Option<(u64, u64)>, NodeFolderError> {
        let (_state, state) = self.change(TrialState::Failed)?;
        let (Some(from), Some(behind)) = (state.of(self.bundle), self.behind) else { return Ok(None) };
        if self.node.current()? != Some(self.bundle) {
            return Ok(None);
        }
        self.node.switch(behind.bundle)?;
        Ok(Some((from.version, behind.version)))
    }

    fn note(&self, trial: TrialState) -> Result<(), NodeFolderError> {
        self.change(trial).map(drop)
    }

    /// Writes how far the trial is; the lock of the state, and what it is now.
    fn change(&self, trial: TrialState) -> Result<(File, State), NodeFolderError> {
        let lock = self.node.lock_state(PATIENCE)?;
        let mut state = self.node.state()?;
        state.set_trial(self.bundle, trial);
        self.node.write_state(&state)?;
        Ok((lock, state))
    }
}
