//! Counts connections by owner. At the limit, the owner with most connections gives way.

use crate::session::ClientIndex;
use std::collections::{BTreeMap, BTreeSet};

/// Connections by owner.
#[derive(Debug)]
pub(super) struct ConnectionsByOwner<K> {
    /// Connections of each owner, the oldest first.
    of: BTreeMap<K, BTreeSet<(u64, ClientIndex)>>,
    /// Each with how many it has.
    sizes: BTreeSet<(usize, K)>,
    len: usize,
}

impl<K> Default for ConnectionsByOwner<K> {
    fn default() -> Self {
        Self { of: BTreeMap::new(), sizes: BTreeSet::new(), len: 0 }
    }
}

impl<K: Ord + Clone> ConnectionsByOwner<K> {
    /// Adds a connection that began at this time, ns.
    pub(super) fn add(&mut self, owner: &K, began_ns: u64, client: ClientIndex) {
        let of = self.of.entry(owner.clone()).or_default();
        let before = of.len();
        if of.insert((began_ns, client)) {
            self.len += 1;
            self.sizes.remove(&(before, owner.clone()));
            self.sizes.insert((before + 1, owner.clone()));
        }
    }

    /// Removes a connection.
    pub(super) fn remove(&mut self, owner: &K, began_ns: u64, client: ClientIndex) {
        let Some(of) = self.of.get_mut(owner) else { return };
        let before = of.len();
        if of.remove(&(began_ns, client)) {
            self.len -= 1;
            self.sizes.remove(&(before, owner.clone()));
            if before > 1 {
                self.sizes.insert((before - 1, owner.clone()));
            } else {
                self.of.remove(owner);
            }
        }
    }

    /// Connections of all.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Connections of one.
    pub(super) fn count_of(&self, owner: &K) -> usize {
        self.of.get(owner).map_or(0, BTreeSet::len)
    }

    /// The owner with most connections, and how many.
    pub(super) fn largest(&self) -> Option<(&K, usize)> {
        self.sizes.last().map(|(count, owner)| (owner, *count))
    }

    /// The oldest of one's connections, and the newest.
    pub(super) fn ends_of(&self, owner: &K) -> Option<(ClientIndex, ClientIndex)> {
        let of = self.of.get(owner)?;
        Some((of.first()?.1, of.last()?.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_knows_the_owner_with_most_and_since_when() {
        let mut crowd = ConnectionsByOwner::default();
        for (owner, began_ns, client) in [("a", 5, 0), ("b", 9, 1), ("b", 7, 2), ("a", 6, 3), ("b", 8, 4)] {
            crowd.add(&owner, began_ns, ClientIndex(client));
        }
        assert_eq!((crowd.len(), crowd.largest()), (5, Some((&"b", 3))));
        assert_eq!(crowd.ends_of(&"b"), Some((ClientIndex(2), ClientIndex(1))));
        crowd.remove(&"b", 7, ClientIndex(2));
        crowd.remove(&"b", 7, ClientIndex(2));
        crowd.remove(&"b", 9, ClientIndex(1));
        assert_eq!((crowd.len(), crowd.largest(), crowd.count_of(&"b")), (3, Some((&"a", 2)), 1));
        crowd.remove(&"b", 8, ClientIndex(4));
        crowd.remove(&"a", 5, ClientIndex(0));
        crowd.remove(&"a", 6, ClientIndex(3));
        assert_eq!((crowd.len(), crowd.largest(), crowd.ends_of(&"a")), (0, None, None));
    }
}
