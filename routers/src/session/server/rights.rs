//! Which names of its system a client may host: what the file of the TCP router gives a node goes to that node alone.

use super::principal::Principal;
use crate::session::frame::Range;
use rohrpost_mailbox::Name;
use std::collections::{BTreeMap, BTreeSet};
use std::net::IpAddr;
use std::sync::Arc;

/// Ranges that have no name in common, in their order.
#[derive(Clone, Default, Debug)]
pub struct Names(Arc<[Range]>);

impl FromIterator<Range> for Names {
    fn from_iter<I: IntoIterator<Item = Range>>(ranges: I) -> Self {
        let mut ranges: Vec<Range> = ranges.into_iter().collect();
        ranges.sort_unstable_by_key(|range| range.first);
        Self(ranges.into())
    }
}

impl Names {
    /// All of them, in their order.
    pub fn iter(&self) -> impl Iterator<Item = &Range> {
        self.0.iter()
    }

    /// Whether a range lies in one of them.
    fn hold(&self, range: &Range) -> bool {
        let after = self.0.partition_point(|own| own.first <= range.first);
        self.0[..after].last().is_some_and(|own| own.holds(range))
    }

    /// Whether a range has a name in common with one of them.
    fn meet(&self, range: &Range) -> bool {
        let after = self.0.partition_point(|own| own.first <= range.last);
        self.0[..after].last().is_some_and(|own| own.meets(range))
    }
}

/// A node of the TCP router's own system, as its file has it.
#[derive(Clone, Debug)]
pub struct OwnNode {
    /// What its client calls itself in its hello.
    pub name: String,
    /// What it hosts here.
    pub names: Names,
    /// All of its names, also those that it hosts on its LAN alone.
    pub all: Names,
    /// Where it is, if the file says it.
    pub address: Option<IpAddr>,
}

/// What the file of the TCP router's own system gives its nodes.
#[derive(Clone, Default, Debug)]
pub struct OwnNodes {
    by_name: BTreeMap<String, Names>,
    addresses: BTreeSet<(String, Principal)>,
    all: Names,
}

impl OwnNodes {
    /// All of them.
    pub fn new(nodes: impl IntoIterator<Item = OwnNode>) -> Self {
        let (mut by_name, mut addresses) = (BTreeMap::<String, Vec<Range>>::new(), BTreeSet::new());
        let mut given = Vec::<Range>::new();
        for OwnNode { name, names, all, address } in nodes {
            given.extend(all.iter());
            addresses.extend(address.map(|address| (name.clone(), Principal::of(address))));
            // Names that were cut may be the same.
            by_name.entry(name).or_default().extend(names.iter());
        }
        let all = given.into_iter().collect();
        let by_name = by_name.into_iter().map(|(name, ranges)| (name, ranges.into_iter().collect())).collect();
        Self { by_name, addresses, all }
    }

    /// Whether a client that calls itself so comes from where the file says this node is.
    pub(super) fn is_at_home(&self, name: &str, address: &Principal) -> bool {
        self.addresses.contains(&(name.to_owned(), address.clone()))
    }

    /// Whether a node's client calls itself so.
    pub(super) fn has(&self, name: &str) -> bool {
        self.by_name.contains_key(name)
    }

    /// What a client of the own system without a certificate may host. What the file gives
    /// the node that it names, and what the file gives to no node.
    pub(super) fn rights_of(&self, name: &str) -> Rights {
        let own = self.by_name.get(name).cloned().unwrap_or_default();
        Rights { own, not: Some(self.all.clone()) }
    }
}

/// Which names of its system a client may host.
#[derive(Clone, Debug)]
pub struct Rights {
    /// Those in these.
    own: Names,
    /// And all that are not in these; none: no others.
    not: Option<Names>,
}

impl Rights {
    /// Any.
    pub fn any() -> Self {
        Self { own: Names::default(), not: Some(Names::default()) }
    }

    /// Those in these ranges alone.
    pub fn only(names: Names) -> Self {
        Self { own: names, not: None }
    }

    /// Whether it may host all of a range.
    pub(super) fn may(&self, range: &Range) -> bool {
        let is_free = |not: &Names| !not.meet(range);
        self.own.hold(range) || self.not.as_ref().is_some_and(is_free)
    }

    /// Whether it may host a name.
    pub(super) fn may_host(&self, name: Name) -> bool {
        self.may(&Range { first: name, last: name })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn modules(from: u8, to: u8) -> Range {
        Range { first: Name::new(1, from, 0, 0), last: Name::new(1, to, 255, 255) }
    }

    #[test]
    fn what_the_file_gives_a_node_goes_to_that_node_and_the_rest_to_any() {
        let names = |ranges: &[Range]| ranges.iter().copied().collect::<Names>();
        let (base, brain) = (names(&[modules(30, 30), modules(10, 12)]), names(&[modules(20, 20)]));
        let node = |name: &str, names: &Names| OwnNode {
            name: name.into(),
            names: names.clone(),
            all: names.clone(),
            address: None,
        };
        let own = OwnNodes::new([node("node base of one", &base), node("node brain of one", &brain)]);
        let (as_base, as_guest) = (own.rights_of("node base of one"), own.rights_of("a guest"));
        let certified = Rights::only(base);
        for (range, base, guest, by_certificate, what) in [
            (modules(10, 12), true, false, true, "a range of its own"),
            (modules(11, 11), true, false, true, "a part of one"),
            (modules(30, 30), true, false, true, "its second range"),
            (modules(12, 13), false, false, false, "more than its range"),
            (modules(20, 20), false, false, false, "that of another node"),
            (modules(13, 40), false, false, false, "what lies around that"),
            (modules(40, 49), true, true, false, "what nobody has"),
            (modules(1, 9), true, true, false, "and before all"),
        ] {
            assert_eq!((as_base.may(&range), as_guest.may(&range)), (base, guest), "{what}");
            assert_eq!((certified.may(&range), Rights::any().may(&range)), (by_certificate, true), "{what}");
        }
    }
}
