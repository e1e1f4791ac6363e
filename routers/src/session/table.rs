//! Maps names to the clients that host them. No two clients host one name: of what one hosts no other gets a part,
//! however narrow, until that one gives it up.
//!
//! ```text
//!  ranges   [1.0.0.0 ─── node brain ─── 1.9.255.255]    [1.200.0.0 ─ arm ─ 1.200.0.255]
//!  a name   is hosted by the last range that begins before it or with it, if that reaches so far
//! ```
//!
//! To register costs as much as there are ranges in the registration and in the one before it, times the depth of an
//! ordered map.

use super::ClientIndex;
use super::frame::{Objection, RANGES_MAX, Range};
use rohrpost_mailbox::Name;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// The ranges of all clients.
#[derive(Debug, Default)]
pub struct RoutingTable {
    /// By their first name. None has a name in common with another.
    ranges: BTreeMap<Name, Hosted>,
    /// The same, by host.
    of_client: BTreeMap<ClientIndex, Box<[Range]>>,
    /// How many ranges there are of each system of which some names are hosted.
    systems: BTreeMap<u8, u32>,
}

#[derive(Clone, Copy, Debug)]
struct Hosted {
    last: Name,
    client: ClientIndex,
}

/// Why ranges were not taken.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Conflict {
    /// What speaks against it.
    pub objection: Objection,
    /// The range.
    pub range: Range,
    /// The host of the range in conflict, if that is the cause.
    pub holder: Option<ClientIndex>,
}

/// Ranges of all clients together, at most.
pub const ENTRIES_MAX: usize = 64 * 1024;
const _: () = assert!(ENTRIES_MAX >= 8 * RANGES_MAX, "one client is far from filling it");

impl RoutingTable {
    /// A client hosts these names and no others; all of them or, if it may not, what it hosted before. Ranges that lie
    /// in others of its own are part of these. `may`: whether it may host a range, and `room`: ranges that it may host
    /// at most.
    ///
    /// # Errors
    /// [`Conflict`]
    pub fn register(
        &mut self,
        client: ClientIndex,
        room: usize,
        may: impl Fn(&Range) -> bool,
        ranges: impl Iterator<Item = Range>,
    ) -> Result<(), Conflict> {
        let objects = |objection, range, holder| Conflict { objection, range, holder };
        let wanted: Vec<Range> = ranges.collect();
        if let Some(range) = wanted.iter().find(|range| range.first > range.last || !may(range)) {
            return Err(objects(Objection::NotOwn, *range, None));
        }
        let wanted = outermost(wanted).map_err(|range| objects(Objection::Crosses, range, Some(client)))?;
        let others = self.ranges.len() - self.count_of(client);
        let free = room.min(ENTRIES_MAX.saturating_sub(others));
        if let Some(range) = wanted.get(free) {
            return Err(objects(Objection::TooMany, *range, None));
        }
        for range in &wanted {
            // What another hosts is never given away.
            if let Some((held, holder)) = self.in_the_way(client, range) {
                let objection = if held.holds(range) { Objection::Taken } else { Objection::Crosses };
                return Err(objects(objection, *range, Some(holder)));
            }
        }
        self.remove(client);
        for range in &wanted {
            self.ranges.insert(range.first, Hosted { last: range.last, client });
            self.count(range.first.system(), 1);
        }
        if !wanted.is_empty() {
            self.of_client.insert(client, wanted.into());
        }
        Ok(())
    }

    /// A client hosts nothing any more.
    pub fn remove(&mut self, client: ClientIndex) {
        for range in self.of_client.remove(&client).unwrap_or_default() {
            if self.ranges.get(&range.first).is_some_and(|hosted| hosted.client == client) {
                self.ranges.remove(&range.first);
            }
            self.count(range.first.system(), -1);
        }
    }

    /// The host of a name.
    pub fn client_of(&self, name: Name) -> Option<ClientIndex> {
        let (_, hosted) = self.ranges.range(..=name).next_back()?;
        (hosted.last >= name).then_some(hosted.client)
    }

    /// Ranges of a client, in the order of their names.
    pub fn ranges_of(&self, client: ClientIndex) -> &[Range] {
        self.of_client.get(&client).map_or(&[], |ranges| ranges)
    }

    /// How many ranges a client has.
    pub fn count_of(&self, client: ClientIndex) -> usize {
        self.ranges_of(client).len()
    }

    /// Ranges of all clients.
    pub fn len(&self) -> usize {
        self.ranges.len()
    }

    /// Whether nobody hosts anything.
    pub fn is_empty(&self) -> bool {
        self.ranges.is_empty()
    }

    /// Systems of which some names are hosted.
    pub fn systems(&self) -> impl Iterator<Item = u8> {
        self.systems.keys().copied()
    }

    /// A range of another client that has names in common with this one.
    fn in_the_way(&self, client: ClientIndex, range: &Range) -> Option<(Range, ClientIndex)> {
        let back = self.ranges.range(..=range.last).rev().take_while(|(_, hosted)| hosted.last >= range.first);
        let mut others = back.filter(|(_, hosted)| hosted.client != client);
        others.next().map(|(first, hosted)| (Range { first: *first, last: hosted.last }, hosted.client))
    }

    fn count(&mut self, system: u8, change: i32) {
        let count = self.systems.entry(system).or_default();
        *count = count.saturating_add_signed(change);
        if *count == 0 {
            self.systems.remove(&system);
        }
    }
}

/// Sorted, and without those that lie in others; or the one that crosses another.
fn outermost(mut ranges: Vec<Range>) -> Result<Vec<Range>, Range> {
    ranges.sort_unstable_by_key(|range| (range.first, Reverse(range.last)));
    let mut outer: Vec<Range> = Vec::with_capacity(ranges.len());
    for range in ranges {
        match outer.last() {
            Some(before) if before.holds(&range) => {}
            Some(before) if before.meets(&range) => return Err(range),
            _ => outer.push(range),
        }
    }
    Ok(outer)
}

#[cfg(test)]
mod tests;
