//! What lookups and matchers should find, from the definitions alone and with all records known: each possibility is
//! looked at, whatever it takes.

use crate::arrival::Coming;
use rohrpost_fusion::{NoValue, Stamp};

/// The records around a time, by their numbers; one twice if it has that very stamp. Of several with one stamp the
/// newest counts.
pub(crate) fn around(known: &[Coming], lateness_ns: u64, asked_ns: u64, gap_max_ns: u64) -> Result<[u64; 2], NoValue> {
    let key = |record: &&Coming| (record.stamp.ns, record.sequence);
    let newest_ns = known.iter().map(|record| record.stamp.ns).max().ok_or(NoValue::Empty)?;
    // Until the newest stamp is this, a record at `ns` may come.
    let open =
        |ns: u64| (newest_ns < ns + lateness_ns).then(|| NoValue::NotYet { by_ns: ns + lateness_ns - newest_ns });
    if let Some(exact) = known.iter().filter(|record| record.stamp.ns == asked_ns).max_by_key(key) {
        return open(asked_ns).map_or(Ok([exact.sequence; 2]), Err);
    }
    let before = known.iter().filter(|record| record.stamp.ns < asked_ns).max_by_key(key);
    let Some(after) = known
        .iter()
        .filter(|record| record.stamp.ns > asked_ns)
        .min_by_key(|record| (record.stamp.ns, u64::MAX - record.sequence))
    else {
        return Err(NoValue::NotYet { by_ns: asked_ns + lateness_ns - newest_ns });
    };
    if let Some(open) = open(after.stamp.ns) {
        return Err(open);
    }
    let Some(before) = before else { return Err(NoValue::BeforeOldest { by_ns: after.stamp.ns - asked_ns }) };
    let gap_ns = after.stamp.ns - before.stamp.ns;
    if gap_ns > gap_max_ns { Err(NoValue::Gap { gap_ns, gap_max_ns }) } else { Ok([before.sequence, after.sequence]) }
}

/// A set: for each stream, the index of its record in the order of stamps and numbers.
pub(crate) type Chosen = Vec<usize>;

pub(crate) struct Streams<'r> {
    pub(crate) records: &'r [Vec<Coming>],
    pub(crate) tolerance_ns: u64,
}

impl Streams<'_> {
    /// All sets, one after the other.
    pub(crate) fn sets(&self) -> Vec<Chosen> {
        let (mut sets, mut begin) = (Vec::new(), vec![0; self.records.len()]);
        while let Some(set) = self.least(&begin) {
            begin = set.iter().map(|index| index + 1).collect();
            sets.push(set);
        }
        sets
    }

    /// Of all sets behind these indices that are contiguous, the one of least size; of several the one that ends
    /// first; of several the one with the earliest records.
    pub(crate) fn least(&self, begin: &[usize]) -> Option<Chosen> {
        let end: Vec<usize> = self.records.iter().map(Vec::len).collect();
        let mut all = self.within(begin, &end);
        all.sort_by_key(|set| (self.size_ns(set), self.ends(set), set.clone()));
        all.into_iter().find(|set| self.is_contiguous(begin, set))
    }

    /// Whether what lies between has no set within the tolerance.
    pub(crate) fn is_contiguous(&self, begin: &[usize], set: &[usize]) -> bool {
        self.within(begin, set).is_empty()
    }

    /// All sets within the tolerance with indices in these ranges.
    fn within(&self, begin: &[usize], end: &[usize]) -> Vec<Chosen> {
        let mut all = vec![Vec::new()];
        for (begin, end) in begin.iter().zip(end) {
            let longer = |set: Chosen| (*begin..*end).map(move |index| [&set[..], &[index]].concat());
            all = all.into_iter().flat_map(longer).collect();
            all.retain(|set| self.size_ns(set).is_some_and(|size_ns| size_ns <= self.tolerance_ns));
        }
        all
    }

    fn stamps(&self, set: &[usize]) -> impl Iterator<Item = Stamp> {
        set.iter().zip(self.records).map(|(index, records)| records[*index].stamp)
    }

    fn ends(&self, set: &[usize]) -> Option<Stamp> {
        self.stamps(set).max()
    }

    /// None: of two epochs.
    pub(crate) fn size_ns(&self, set: &[usize]) -> Option<u64> {
        self.ends(set)?.since(self.stamps(set).min()?)
    }
}
