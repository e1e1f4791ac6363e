//! The party that a connection counts to. Limits hold for each principal, so that more connections give no larger
//! share.

use super::connections::ConnectionsByOwner;
use crate::session::{ClientIndex, WAIT_MAX_NS};
use std::collections::{BTreeMap, VecDeque};
use std::net::IpAddr;

/// Bits of an IPv6 address that the network gives; the rest each computer chooses as it likes.
const IPV6_NETWORK_BITS: u32 = 64;

/// The owner of a connection.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Principal {
    /// It has shown no certificate: the address that it comes from, or its network.
    Address(IpAddr),
    /// The name in its certificate.
    Certificate(String),
}

impl Principal {
    pub(super) fn of(address: IpAddr) -> Self {
        Self::Address(match address.to_canonical() {
            IpAddr::V6(address) => {
                let network = address.to_bits() >> IPV6_NETWORK_BITS << IPV6_NETWORK_BITS;
                IpAddr::V6(network.into())
            }
            address => address,
        })
    }
}

/// A principal by a number that no other gets as long as anything of it waits.
pub(in crate::session) type PrincipalId = u32;

/// Resources that a principal uses.
#[derive(Debug)]
pub(in crate::session) struct Uses {
    owner: Principal,
    /// Ranges of names that its clients host.
    pub(super) ranges: usize,
    /// Work on its registrations before the next look, at most.
    pub(super) work_left: usize,
    /// Packages that it sent and that were lost since it had more in a queue than its share.
    pub(in crate::session) lost: u64,
    /// When it had no connection any more, ns.
    gone_ns: u64,
}

/// All that take part, or did a moment ago.
#[derive(Debug, Default)]
pub(in crate::session) struct Principals {
    ids: BTreeMap<Principal, PrincipalId>,
    uses: BTreeMap<PrincipalId, Uses>,
    /// Their connections.
    pub(super) members: ConnectionsByOwner<PrincipalId>,
    /// Principals without a connection, and since when, ns.
    gone: VecDeque<(u64, PrincipalId)>,
    next: PrincipalId,
}

impl Principals {
    /// A connection of a principal becomes a member.
    pub(super) fn joins(&mut self, owner: &Principal, began_ns: u64, client: ClientIndex, work: usize) -> PrincipalId {
        let id = self.id_of(owner).unwrap_or_else(|| {
            self.next = self.next.wrapping_add(1);
            self.ids.insert(owner.clone(), self.next);
            let uses = Uses { owner: owner.clone(), ranges: 0, work_left: work, lost: 0, gone_ns: 0 };
            self.uses.insert(self.next, uses);
            self.next
        });
        self.members.add(&id, began_ns, client);
        id
    }

    /// A connection of a principal is no member any more.
    pub(super) fn leaves(&mut self, now_ns: u64, id: PrincipalId, began_ns: u64, client: ClientIndex) {
        self.members.remove(&id, began_ns, client);
        if let Some(uses) = self.uses.get_mut(&id).filter(|_| self.members.count_of(&id) == 0) {
            uses.gone_ns = now_ns;
            self.gone.push_back((now_ns, id));
        }
    }

    pub(super) fn id_of(&self, owner: &Principal) -> Option<PrincipalId> {
        self.ids.get(owner).copied()
    }

    pub(super) fn uses(&self, id: PrincipalId) -> Option<&Uses> {
        self.uses.get(&id)
    }

    pub(in crate::session) fn uses_mut(&mut self, id: PrincipalId) -> Option<&mut Uses> {
        self.uses.get_mut(&id)
    }

    /// A new round: each may cause so much work. A principal without connections is forgotten when nothing of it waits
    /// any more; before that it comes back as the same.
    pub(super) fn look(&mut self, now_ns: u64, work: usize) {
        self.uses.values_mut().for_each(|uses| uses.work_left = work);
        let is_past = |(gone_ns, _): &mut (u64, PrincipalId)| now_ns.saturating_sub(*gone_ns) > 2 * WAIT_MAX_NS;
        while let Some((gone_ns, id)) = self.gone.pop_front_if(is_past) {
            let is_gone = |uses: &Uses| uses.gone_ns == gone_ns && self.members.count_of(&id) == 0;
            if self.uses.get(&id).is_some_and(is_gone)
                && let Some(uses) = self.uses.remove(&id)
            {
                self.ids.remove(&uses.owner);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_computer_is_one_principal_whichever_of_its_addresses_it_takes() {
        let of = |text: &str| Principal::of(text.parse().unwrap());
        for (one, other, same, what) in [
            ("10.0.0.1", "10.0.0.2", false, "two computers"),
            ("10.0.0.1", "::ffff:10.0.0.1", true, "the same in both ways"),
            ("2001:db8::1", "2001:db8::ffff:1", true, "one network of IPv6"),
            ("2001:db8::1", "2001:db8:0:1::1", false, "two of them"),
        ] {
            assert_eq!(of(one) == of(other), same, "{what}");
        }
    }

    #[test]
    fn a_principal_that_comes_back_at_once_is_the_same() {
        let (mut principals, owner) = (Principals::default(), Principal::Certificate("node a".into()));
        let first = principals.joins(&owner, 0, ClientIndex(0), 5);
        principals.uses_mut(first).unwrap().lost = 7;
        principals.leaves(10, first, 0, ClientIndex(0));
        principals.look(10 + WAIT_MAX_NS, 5);
        assert_eq!(principals.joins(&owner, 20, ClientIndex(1), 5), first);
        principals.look(10 + 3 * WAIT_MAX_NS, 5);
        assert_eq!(principals.uses(first).map(|uses| uses.lost), Some(7), "it is there again");
        let now_ns = 10 + 3 * WAIT_MAX_NS;
        principals.leaves(now_ns, first, 20, ClientIndex(1));
        principals.look(now_ns + 2 * WAIT_MAX_NS + 1, 5);
        assert!(principals.uses(first).is_none() && principals.gone.is_empty());
        assert_ne!(principals.joins(&owner, 30, ClientIndex(0), 5), first);
    }
}
