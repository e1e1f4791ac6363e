//! What the future of a view depends on. A private part of the core's `view`.

use super::super::team_model::key::Key;
use super::{Ledger, Records, View};
use super::super::RobotId;
use std::collections::BTreeMap;

impl View {
    pub(crate) fn key(&self, key: &mut Key) {
        key.hash(&(self.numbers.version, &self.numbers.unsent, self.tracks.len()));
        ledgers_key(&self.ledgers, key);
    }
}

impl Records {
    pub(crate) fn key(&self, key: &mut Key) {
        key.hash(&(self.from, self.is_synchro));
        ledgers_key(&self.ledgers, key);
    }
}

/// All but the ages.
fn ledgers_key(ledgers: &BTreeMap<RobotId, Ledger>, key: &mut Key) {
    for (observer, ledger) in ledgers {
        key.hash(&(observer, ledger.floor, ledger.records.len()));
        ledger.records.iter().for_each(|(number, kept)| key.hash(&(number, &kept.record)));
    }
}
