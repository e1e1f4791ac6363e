//! Places in the simulation: which principals hold them, and what must hold of them.

use super::simulation::{NAMED, World};
use super::{CALLERS_MAX, Deduplicator, Name, Principal, TRANSIT_MAX_NS, VALIDITY_MAX_NS};
use std::collections::BTreeMap;

impl World {
    pub(super) fn once(started_ns: u64) -> Deduplicator {
        Deduplicator::new(started_ns, &[Self::named(0), Self::named(1)])
    }

    pub(super) fn named(caller: usize) -> Principal {
        Principal::Module(Self::name(caller))
    }

    pub(super) fn name(caller: usize) -> Name {
        Name::new(1, 9, caller as u8, 1)
    }

    pub(super) fn principal(&self, caller: usize) -> Principal {
        if caller < NAMED { Self::named(caller) } else { Principal::System((2 + caller % self.principals) as u8) }
    }

    /// Callers remembered from which a repeat can come.
    pub(super) fn held(&self) -> impl Iterator<Item = usize> {
        let live = self.deduplicator.callers.iter().filter(|caller| caller.until_ns >= self.now_ns);
        live.map(|caller| usize::from(caller.from.instance()))
    }

    pub(super) fn knows(&self, caller: usize) -> bool {
        self.held().any(|known| known == caller)
    }

    /// However many call, and however long they say that it is valid: no principal has more than half of the open
    /// places, and none for longer than it may.
    pub(super) fn check_places(&mut self) {
        if self.deduplicator.callers.len() > CALLERS_MAX + NAMED {
            self.problems.push("remembers more callers than it may".into());
        }
        let mut shares = BTreeMap::<u8, usize>::new();
        for caller in self.held().filter(|caller| *caller >= NAMED) {
            *shares.entry((caller % self.principals) as u8).or_default() += 1;
        }
        if shares.values().any(|held| *held > CALLERS_MAX / 2) {
            self.problems.push(format!("one principal holds more than half: {shares:?}"));
        }
        let latest_ns = self.deduplicator.callers.iter().map(|caller| caller.until_ns).max().unwrap_or_default();
        if latest_ns > self.now_ns + VALIDITY_MAX_NS + TRANSIT_MAX_NS {
            self.problems.push(format!("remembers a caller for {} s", (latest_ns - self.now_ns) / 1_000_000_000));
        }
    }

    /// A caller of its own place is never refused for want of one, and a principal that has none only where none is
    /// left.
    pub(super) fn check_refusal(&mut self, caller: usize, knows: bool) {
        let principal = self.principal(caller);
        let has_one = self.held().any(|other| self.principal(other) == principal);
        let open = self.held().filter(|other| *other >= NAMED).count();
        if knows || caller < NAMED || (!has_one && open < CALLERS_MAX) {
            self.problems.push(format!("caller {caller} of {principal:?} found no place, of which {open} are taken"));
        }
    }
}
