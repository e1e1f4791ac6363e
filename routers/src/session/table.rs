//! Who hosts which names. Ranges lie in each other or have no name in common, so that every name has one narrowest range.
//!
//! ```text
//!  ranges   [1.0.0.0 ─────────── node brain ──────────── 1.255.255.255]
//!                     [1.200.0.0 ─ arm ─ 1.200.0.255]
//!  steps    brain     arm                             brain            nobody        what a name is looked up in
//! ```

use super::ClientIndex;
use super::frame::{Objection, Range};
use crate::broken::broken;
use rohrpost_mailbox::Name;

/// The ranges of all clients.
#[derive(Debug, Default)]
pub struct Table {
    /// By their first name; of two with the same the wider one first.
    entries: Vec<Entry>,
    /// From a name on, until the next: who hosts it.
    steps: Vec<(u32, Option<ClientIndex>)>,
    /// Systems of which some names are hosted.
    systems: Vec<u8>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    range: Range,
    client: ClientIndex,
}

/// Why ranges were not taken.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Conflict {
    /// What speaks against it.
    pub objection: Objection,
    /// The range.
    pub range: Range,
    /// Who hosts what is in its way, if that is it.
    pub holder: Option<ClientIndex>,
}

/// Ranges of all clients together, at most.
pub const ENTRIES_MAX: usize = 64 * 1024;

impl Table {
    /// A client hosts these names and no others; all of them or, if it may not, what it hosted before. `may_host`: ranges in which they have to lie,
    /// besides that they are of its system.
    ///
    /// # Errors
    /// [`Conflict`]
    pub fn register(
        &mut self,
        client: ClientIndex,
        (system, may_host): (u8, Option<&[Range]>),
        ranges: impl Iterator<Item = Range>,
    ) -> Result<(), Conflict> {
        let own = |entry: &Entry| entry.client == client;
        let mut entries: Vec<Entry> = self.entries.iter().filter(|entry| !own(entry)).copied().collect();
        entries.extend(ranges.map(|range| Entry { range, client }));
        entries.sort_by_key(|entry| (entry.range.first, std::cmp::Reverse(entry.range.last)));
        let objects = |objection, range, holder| Err(Conflict { objection, range, holder });
        for Entry { range, .. } in entries.iter().filter(|entry| own(entry)) {
            let is_one = range.first.system() == system && range.last.system() == system && range.first <= range.last;
            let may = may_host.is_none_or(|may_host| may_host.iter().any(|may| may.holds(range)));
            if !(is_one && may) {
                return objects(Objection::NotOwn, *range, None);
            }
            if entries.len() > ENTRIES_MAX {
                return objects(Objection::TooMany, *range, None);
            }
        }
        if let Some((one, other)) = first_conflict(&entries).filter(|_| !broken!(TakesTwice)) {
            let objection = if one.range == other.range { Objection::Taken } else { Objection::Crosses };
            let (newer, older) = if own(&one) { (one, other) } else { (other, one) };
            return objects(objection, newer.range, Some(older.client));
        }
        self.entries = entries;
        self.flatten();
        Ok(())
    }

    /// A client hosts nothing any more.
    pub fn remove(&mut self, client: ClientIndex) {
        let before = self.entries.len();
        self.entries.retain(|entry| entry.client != client);
        if self.entries.len() != before {
            self.flatten();
        }
    }

    /// Who hosts a name: of all ranges that it lies in, the narrowest counts.
    pub fn client_of(&self, name: Name) -> Option<ClientIndex> {
        if broken!(TakesAnyRange) {
            return self.entries.iter().find(|entry| entry.range.has(name)).map(|entry| entry.client);
        }
        let after = self.steps.partition_point(|(first, _)| *first <= name.raw());
        self.steps[..after].last().and_then(|(_, client)| *client)
    }

    /// Ranges of all clients.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether nobody hosts anything.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Systems of which some names are hosted.
    pub fn systems(&self) -> &[u8] {
        &self.systems
    }

    /// All ranges, each with who hosts it.
    pub fn hosted(&self) -> impl Iterator<Item = (ClientIndex, Range)> {
        self.entries.iter().map(|entry| (entry.client, entry.range))
    }

    fn flatten(&mut self) {
        self.steps.clear();
        let mut open: Vec<Entry> = Vec::new();
        for entry in &self.entries {
            close(&mut self.steps, &mut open, Some(entry.range.first));
            step(&mut self.steps, entry.range.first.raw(), Some(entry.client));
            open.push(*entry);
        }
        close(&mut self.steps, &mut open, None);
        self.systems = self.entries.iter().map(|entry| entry.range.first.system()).collect();
        self.systems.dedup();
    }
}

/// Ends the ranges that end before a name, innermost first: behind each, what is around it goes on.
fn close(steps: &mut Vec<(u32, Option<ClientIndex>)>, open: &mut Vec<Entry>, before: Option<Name>) {
    while let Some(inner) = open.pop_if(|inner| before.is_none_or(|first| inner.range.last < first)) {
        // Behind the very last name there is none.
        if let Some(next) = inner.range.last.raw().checked_add(1) {
            step(steps, next, open.last().map(|outer| outer.client));
        }
    }
}

/// What begins where another begins takes its place.
fn step(steps: &mut Vec<(u32, Option<ClientIndex>)>, first: u32, client: Option<ClientIndex>) {
    match steps.last_mut() {
        Some(last) if last.0 == first => last.1 = client,
        _ => steps.push((first, client)),
    }
}

/// Two ranges that are equal or cross, in sorted entries.
fn first_conflict(entries: &[Entry]) -> Option<(Entry, Entry)> {
    let mut open: Vec<Entry> = Vec::new();
    for entry in entries {
        while open.pop_if(|outer| outer.range.last < entry.range.first).is_some() {}
        if let Some(outer) = open.last().filter(|outer| outer.range == entry.range || !outer.range.holds(&entry.range))
        {
            return Some((*outer, *entry));
        }
        open.push(*entry);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn range(first: [u8; 4], last: [u8; 4]) -> Range {
        Range { first: Name::from_raw(u32::from_be_bytes(first)), last: Name::from_raw(u32::from_be_bytes(last)) }
    }

    #[test]
    fn the_narrowest_range_counts() {
        let mut table = Table::default();
        let [brain, arm, far] = [0, 1, 2].map(ClientIndex);
        table.register(brain, (1, None), [range([1, 0, 0, 0], [1, 255, 255, 255])].into_iter()).unwrap();
        table.register(arm, (1, None), [range([1, 200, 0, 0], [1, 200, 0, 255])].into_iter()).unwrap();
        table.register(far, (2, None), [range([2, 200, 0, 0], [2, 200, 0, 255])].into_iter()).unwrap();
        for (name, client, why) in [
            (Name::new(1, 200, 0, 0), Some(arm), "the first of the narrower one"),
            (Name::new(1, 200, 0, 255), Some(arm), "its last"),
            (Name::new(1, 200, 1, 0), Some(brain), "behind it the wider one goes on"),
            (Name::new(1, 199, 255, 255), Some(brain), "and before"),
            (Name::new(2, 200, 0, 1), Some(far), "another system"),
            (Name::new(2, 200, 1, 0), None, "nobody"),
            (Name::new(0, 200, 1, 0), None, "nobody"),
        ] {
            assert_eq!(table.client_of(name), client, "{name}: {why}");
        }
        assert_eq!(table.systems(), [1, 2]);
        table.remove(arm);
        assert_eq!(table.client_of(Name::new(1, 200, 0, 0)), Some(brain));
        table.remove(brain);
        assert_eq!((table.client_of(Name::new(1, 200, 0, 0)), table.systems()), (None, &[2][..]));
    }

    #[test]
    fn what_is_taken_or_crosses_is_refused_and_nothing_changes() {
        let mut table = Table::default();
        let (one, other) = (ClientIndex(0), ClientIndex(1));
        let held = range([1, 10, 0, 0], [1, 20, 0, 0]);
        table.register(one, (1, None), [held].into_iter()).unwrap();
        table.register(other, (1, None), [range([1, 30, 0, 0], [1, 30, 0, 9])].into_iter()).unwrap();
        for (range, objection, holder) in [
            (held, Objection::Taken, Some(one)),
            (range([1, 9, 0, 0], [1, 10, 0, 0]), Objection::Crosses, Some(one)),
            (range([1, 20, 0, 0], [1, 21, 0, 0]), Objection::Crosses, Some(one)),
            (range([2, 20, 0, 0], [2, 21, 0, 0]), Objection::NotOwn, None),
            (range([1, 20, 0, 0], [2, 21, 0, 0]), Objection::NotOwn, None),
            (range([1, 41, 0, 0], [1, 40, 0, 0]), Objection::NotOwn, None),
        ] {
            let conflict = Conflict { objection, range, holder };
            assert_eq!(table.register(other, (1, None), [range].into_iter()), Err(conflict), "{range}");
            assert_eq!(table.client_of(Name::new(1, 30, 0, 5)), Some(other), "as it was");
        }
        table.register(other, (1, None), [range([1, 11, 0, 0], [1, 11, 0, 9])].into_iter()).unwrap();
        assert_eq!(table.client_of(Name::new(1, 30, 0, 5)), None, "a registration says all");
        table.register(one, (1, None), [held].into_iter()).unwrap();
    }

    proptest! {
        #[test]
        fn a_look_up_finds_what_a_search_finds(ranges in prop::collection::vec((0u8..6, 0u8..6, 0u16..3), 0..8), asked in 0u8..7) {
            let mut table = Table::default();
            for (first, length, client) in ranges {
                let wanted = range([1, first, 0, 0], [1, first + length, 255, 255]);
                let client = ClientIndex(client);
                let own = table.entries.iter().filter(|entry| entry.client == client);
                let mut all: Vec<Range> = own.map(|entry| entry.range).collect();
                all.push(wanted);
                let before = table.entries.len();
                if table.register(client, (1, None), all.into_iter()).is_err() {
                    prop_assert_eq!(table.entries.len(), before);
                }
            }
            let name = Name::new(1, asked, 3, 3);
            let around = table.entries.iter().filter(|entry| entry.range.has(name));
            let narrowest = around.min_by_key(|entry| entry.range.last.raw() - entry.range.first.raw());
            prop_assert_eq!(table.client_of(name), narrowest.map(|entry| entry.client));
        }
    }
}
