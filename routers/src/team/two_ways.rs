//! What comes both by the TCP router and by the team's datagrams is delivered once.
//!
//! A package is known again by its head, but for what routers change in it, and its body. Each that came by one way
//! waits a while for its copy by the other one; so packages that are alike, and came by one way, are all delivered.

use rohrpost_mailbox::Head;
use std::hash::{BuildHasher, Hasher, RandomState};

/// Longest time between the two: a package by the TCP router is at most [`AGE_MAX_NS`](crate::session::AGE_MAX_NS) old.
pub const COPY_MAX_NS: u64 = 3_000_000_000;
const BUCKETS: usize = 512;
const IN_BUCKET: usize = 4;

/// The way by which a package of another system came.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Way {
    /// By a datagram of the team.
    Team,
    /// By the TCP router.
    Tcp,
}

/// A package that came by one way alone.
#[derive(Clone, Copy)]
struct Came {
    hash: u64,
    way: Way,
    at_ns: u64,
}

/// Packages that came of late. In a flood the oldest are forgotten first: their copies are delivered twice.
pub(super) struct TwoWays {
    hasher: RandomState,
    buckets: Box<[[Option<Came>; IN_BUCKET]]>,
}

impl Default for TwoWays {
    fn default() -> Self {
        Self { hasher: RandomState::new(), buckets: vec![[None; IN_BUCKET]; BUCKETS].into() }
    }
}

impl TwoWays {
    /// Whether a package that came is not the copy of one that came by the other way.
    pub(super) fn is_first(&mut self, now_ns: u64, way: Way, head: &Head, body: &[u8]) -> bool {
        let hash = self.hash(head, body);
        let bucket = &mut self.buckets[hash as usize % BUCKETS];
        let is_old = |came: &Came| now_ns.saturating_sub(came.at_ns) > COPY_MAX_NS;
        bucket.iter_mut().filter(|place| place.as_ref().is_some_and(is_old)).for_each(|place| *place = None);
        let copy = |place: &&mut Option<Came>| place.is_some_and(|came| came.hash == hash && came.way != way);
        if let Some(place) = bucket.iter_mut().find(copy) {
            *place = None;
            return false;
        }
        let oldest = bucket.iter_mut().min_by_key(|place| place.map_or(0, |came| came.at_ns));
        if let Some(place) = oldest {
            *place = Some(Came { hash, way, at_ns: now_ns });
        }
        true
    }

    fn hash(&self, head: &Head, body: &[u8]) -> u64 {
        let mut hasher = self.hasher.build_hasher();
        hasher.write_u32(head.from.raw());
        // For all systems, or for this one.
        hasher.write_u32(head.to.raw() & 0x00ff_ffff);
        hasher.write_u32(u32::from(head.kind.0 as u16) << 16 | u32::from(head.id));
        hasher.write(body);
        hasher.finish()
    }
}
