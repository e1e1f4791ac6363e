//! Parts of a record that a node has asked for once more.

use rohrpost_mailbox::RecordInfo;

/// Parts of a record leave again at most as often as it has parts, and so many times more.
const MORE: usize = 8;

/// A part that is to leave.
#[derive(Clone, Copy)]
pub(super) struct AskedPart {
    pub(super) record: RecordInfo,
    /// What was sampled out before the record.
    pub(super) sampled: u32,
    pub(super) index: usize,
}

/// Room for one record at a time.
#[derive(Default)]
pub(super) struct Again {
    record: Option<RecordInfo>,
    /// What was sampled out before it.
    sampled: u32,
    /// Parts that are to leave, one bit each.
    wanted: Box<[u64]>,
    /// How many.
    left: usize,
    /// How many more may be asked for.
    budget: usize,
}

impl Again {
    /// Room for a record of so many parts.
    pub(super) fn new(parts: usize) -> Self {
        Self { wanted: vec![0; parts.div_ceil(64)].into(), ..Self::default() }
    }

    /// Begins with a record. `sampled`: what was sampled out before it.
    pub(super) fn begin(&mut self, record: RecordInfo, sampled: u32, parts: usize) {
        self.clear();
        (self.record, self.sampled, self.budget) = (Some(record), sampled, parts + MORE);
    }

    /// Parts that there is room for: more than a record of the configured size has.
    pub(super) fn room(&self) -> usize {
        64 * self.wanted.len()
    }

    /// The record; none: there was none yet.
    pub(super) fn record(&self) -> Option<&RecordInfo> {
        self.record.as_ref()
    }

    /// Whether something is to leave.
    pub(super) fn is_wanted(&self) -> bool {
        self.left > 0
    }

    /// A part is asked for; false: too often.
    pub(super) fn want(&mut self, index: usize) -> bool {
        let (word, bit) = (&mut self.wanted[index / 64], 1 << (index % 64));
        if *word & bit == 0 && self.budget > 0 {
            *word |= bit;
            (self.left, self.budget) = (self.left + 1, self.budget - 1);
        }
        *word & bit != 0
    }

    /// The first part that is to leave.
    pub(super) fn next(&self) -> Option<AskedPart> {
        let record = self.record.filter(|_| self.left > 0)?;
        let at = self.wanted.iter().position(|word| *word != 0)?;
        let index = 64 * at + self.wanted[at].trailing_zeros() as usize;
        Some(AskedPart { record, sampled: self.sampled, index })
    }

    /// A part has left.
    pub(super) fn left(&mut self, index: usize) {
        self.wanted[index / 64] &= !(1 << (index % 64));
        self.left -= 1;
    }

    /// Nothing is to leave any more.
    pub(super) fn drop_wanted(&mut self) {
        if self.left > 0 {
            self.wanted.fill(0);
            self.left = 0;
        }
    }

    /// The same, and its record is forgotten.
    pub(super) fn clear(&mut self) {
        self.drop_wanted();
        self.record = None;
    }
}
