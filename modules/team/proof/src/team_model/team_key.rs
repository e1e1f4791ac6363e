//! What the future of a robot depends on. A private part of the core's `team`.

use super::super::team_model::key::Key;
use super::Team;

impl Team {
    pub(crate) fn key(&self, now_ns: u64, key: &mut Key) {
        self.group.key(now_ns, key);
        self.view.key(key);
        key.hash(&key.robots().map(|robot| self.missing.get(&robot)).collect::<Vec<_>>());
        key.version(self.group.me(), self.last_synchro);
    }
}
