//! A participant: one user of mailboxes on a node, mostly a process.

use crate::figures::traffic::Table;
use crate::name::Name;
use crate::node::directory::{Node, open_once_more};
use crate::node::entry::{COMPLAINS, Entry, ModuleState, PARTICIPANTS_MAX};
use crate::node::error::NodeError;
use crate::node::lock;
use crate::node::work::Work;
use crate::slots::word::Claimant;
use crate::step::step;
use crate::wake::doorbell;
use std::fs::File;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// This process's place in a node's table. A thread that sleeps on mailboxes of its own joins on its own.
pub struct Participant {
    node: Arc<Node>,
    /// Holds the lock; never inherited by a program that this one starts.
    file: File,
    me: Claimant,
    /// Counts what it sends.
    traffic: Table,
    /// Mailboxes it sends to now, so that nobody holds more claims than the mailbox allows. Not on any hot path.
    sending: Mutex<Vec<Name>>,
    /// Whether it watches descriptors.
    watching: Mutex<bool>,
    /// The mailboxes that it receives from and nobody finds, while it [hides](Self::hide_mailboxes) them.
    hidden: Mutex<Option<Vec<Name>>>,
}

impl Participant {
    /// Takes a free place in the table, under this module name (local id 0; [`Name::NONE`] for a bystander).
    ///
    /// # Errors
    /// [`NodeError::Crowded`] when there is none.
    pub fn join(node: &Arc<Node>, module: Name) -> Result<Arc<Self>, NodeError> {
        let failed = |error| NodeError::of(node.path(), error);
        let file = open_once_more(node.directory())?;
        for participant in 0..PARTICIPANTS_MAX as u16 {
            if !lock::try_lock(&file, u64::from(participant)).map_err(failed)? {
                continue;
            }
            step!("join: locked");
            node.check_present(&file)?;
            let incarnation = node.next_incarnation();
            let me = Claimant { participant, incarnation };
            // Before the entry says so: a table is read if the entry has the same incarnation.
            let traffic = Table::make(node, me)?;
            let entry = node.entry(participant);
            // First of all: the lock is ours, but the name and the number still are those of the participant before.
            entry.module.store(0, Ordering::Release);
            // A participant that leaves in order takes its process id out of the table.
            let died = entry.pid.load(Ordering::Relaxed) != 0;
            entry.state.store(0, Ordering::Relaxed);
            entry.restarts.store(0, Ordering::Relaxed);
            entry.errors.store(0, Ordering::Relaxed);
            // The participant before may have died in its sleep.
            entry.polling.store(0, Ordering::Relaxed);
            entry.mark.clear();
            doorbell::remove_pipe(node, participant);
            entry.joined_ns.store(crate::clock::monotonic_ns(), Ordering::Relaxed);
            step!("join: before incarnation");
            entry.incarnation.store(incarnation, Ordering::Release);
            step!("join: incarnation");
            if died {
                // From our lock until the new incarnation the dead one looked alive; a receiver that searched then
                // missed what it left.
                node.announce_death();
            }
            entry.pid.store(std::process::id(), Ordering::Relaxed);
            entry.module.store(module.module().raw(), Ordering::Release);
            step!("join: joined");
            let (sending, watching, hidden) = Default::default();
            return Ok(Arc::new(Self { node: node.clone(), file, me, traffic, sending, watching, hidden }));
        }
        Err(NodeError::Crowded(node.path().into()))
    }

    /// The node it is on.
    pub fn node(&self) -> &Arc<Node> {
        &self.node
    }

    /// Tells this use of the name from all earlier ones on this node; also from those before its directory was last
    /// made, if the computer's clock runs on while it is off.
    pub fn incarnation(&self) -> u32 {
        self.me.incarnation
    }

    /// The module it joined as.
    pub fn module(&self) -> Name {
        Name::from_raw(self.entry().module.load(Ordering::Relaxed))
    }

    /// Says what the module is doing, for everyone to read.
    pub fn set_state(&self, state: ModuleState) {
        if state == ModuleState::Error {
            // Relaxed: the Release of the state hands it over, too.
            self.entry().errors.fetch_add(1, Ordering::Relaxed);
        }
        // The module alone writes it.
        let complains = self.entry().state.load(Ordering::Relaxed) & COMPLAINS;
        self.entry().state.store(state as u32 | complains, Ordering::Release);
    }

    /// Says that something does not work although the module is on, such as a subscription that is refused, or that all
    /// does. Each call that says so is another complaint, to be asked for.
    pub fn set_complaint(&self, complains: bool) {
        let (entry, complaint) = (self.entry(), if complains { COMPLAINS } else { 0 });
        if complains {
            // Relaxed: the Release of the state hands it over, too.
            entry.errors.fetch_add(1, Ordering::Relaxed);
        }
        let state = entry.state.load(Ordering::Relaxed) & !COMPLAINS;
        entry.state.store(state | complaint, Ordering::Release);
    }

    /// Says how often launch has started this module again.
    pub fn set_restarts(&self, restarts: u32) {
        self.entry().restarts.store(restarts, Ordering::Relaxed);
    }

    /// Says that this part of the module's own code runs from now on, for everyone to read. One store; by one thread
    /// alone.
    pub fn begin_work(&self, work: Work) {
        self.entry().mark.begin(work);
    }

    /// Says that it has come back, and returns how long it took.
    pub fn end_work(&self) -> Duration {
        self.entry().mark.end()
    }

    /// Ends this participant's sleep, now or when it next wants to: for signal handlers' threads and the like.
    pub fn ring(&self) {
        doorbell::ring(&self.node, self.me.participant);
    }

    pub(crate) fn entry(&self) -> &Entry {
        self.node.entry(self.me.participant)
    }

    /// The mailboxes it sends to now.
    pub(crate) fn sending(&self) -> MutexGuard<'_, Vec<Name>> {
        self.sending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts what it sends.
    pub(crate) fn traffic(&self) -> &Table {
        &self.traffic
    }

    /// Whether it watches descriptors; locked while that changes.
    pub(crate) fn watching(&self) -> MutexGuard<'_, bool> {
        self.watching.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The mailboxes that it hides; none: it hides none.
    pub(crate) fn hidden(&self) -> MutexGuard<'_, Option<Vec<Name>>> {
        self.hidden.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn claimant(&self) -> Claimant {
        self.me
    }
}

impl Participant {
    /// Takes its name and its process id out of the table: it ends in order, and is not to be mourned. Dropping it does
    /// the same; this is for processes with threads that keep it until they end.
    pub fn leave(&self) {
        let entry = self.entry();
        doorbell::remove_pipe(&self.node, self.me.participant);
        entry.module.store(0, Ordering::Relaxed);
        entry.state.store(0, Ordering::Relaxed);
        entry.mark.clear();
        entry.pid.store(0, Ordering::Release);
        // In a directory that was removed and made anew, the file of this name is somebody else's.
        if self.node.check_present(&self.file).is_ok() {
            self.traffic.remove(&self.node);
        }
    }
}

impl Drop for Participant {
    fn drop(&mut self) {
        self.leave();
        // Closing the file would unlock it too; doing it by name says when.
        let _ = lock::unlock(&self.file, u64::from(self.me.participant));
    }
}
