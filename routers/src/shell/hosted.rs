//! The names that configuration gives a node, and which of them have no mailbox now: no other name is ever looked up.
//!
//! A lookup of a mailbox is a system call, and remote senders decide how often one is made. So each name is looked up
//! once until a mailbox of the node comes or goes, however many names there are, and a name that the node does not host
//! never.

use rohrpost_mailbox::Name;

/// Names with a bit each.
pub(crate) struct HostedNames {
    /// First and last name of each range, and where its bits begin; sorted.
    ranges: Box<[(u32, u32, usize)]>,
    absent: Box<[u64]>,
    /// Epoch of the registry when the bits were set.
    epoch: u32,
}

impl HostedNames {
    /// None of these ranges overlaps another. Takes all its memory now.
    pub(crate) fn new(ranges: &[(Name, Name)]) -> Self {
        let mut sorted = ranges.to_vec();
        sorted.sort_unstable();
        let mut bits = 0;
        let place = |(first, last): (Name, Name)| {
            let begin = bits;
            bits += (last.raw() - first.raw()) as usize + 1;
            (first.raw(), last.raw(), begin)
        };
        let ranges: Box<[_]> = sorted.into_iter().map(place).collect();
        Self { ranges, absent: vec![0; bits.div_ceil(64)].into(), epoch: 0 }
    }

    /// Whether a lookup is worthwhile. `epoch`: of the registry, now.
    pub(crate) fn may_be_there(&mut self, name: Name, epoch: u32) -> bool {
        if self.epoch != epoch {
            self.absent.fill(0);
            self.epoch = epoch;
        }
        self.place(name).is_some_and(|bit| self.absent[bit / 64] & 1 << (bit % 64) == 0)
    }

    /// A lookup did not find it.
    pub(crate) fn is_absent(&mut self, name: Name) {
        if let Some(bit) = self.place(name) {
            self.absent[bit / 64] |= 1 << (bit % 64);
        }
    }

    fn place(&self, name: Name) -> Option<usize> {
        let after = self.ranges.partition_point(|(first, ..)| *first <= name.raw());
        let (first, last, begin) = *self.ranges.get(after.checked_sub(1)?)?;
        (name.raw() <= last).then(|| begin + (name.raw() - first) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_name_of_the_node_is_looked_for_once_and_no_other_ever() {
        let whole = |class, first, last| (Name::new(1, class, first, 0), Name::new(1, class, last, u8::MAX));
        let ranges = [whole(200, 0, 0), whole(32, 40, 47), whole(200, 3, 3)];
        let mut hosted = HostedNames::new(&ranges);
        let all: Vec<Name> = ranges.iter().flat_map(|(a, b)| (a.raw()..=b.raw()).map(Name::from_raw)).collect();
        for epoch in [0, 1, 7] {
            for name in &all {
                assert!(hosted.may_be_there(*name, epoch), "{name}, not looked for yet");
                hosted.is_absent(*name);
                assert!(!hosted.may_be_there(*name, epoch), "{name}, looked for");
            }
        }
        for (class, instance) in [(200, 1), (200, 4), (32, 39), (32, 48), (1, 0), (255, 255)] {
            for local in [0, 1, u8::MAX] {
                let name = Name::new(1, class, instance, local);
                assert!(!hosted.may_be_there(name, 8), "{name} is not hosted");
                hosted.is_absent(name);
            }
        }
        assert!(all.iter().all(|name| hosted.may_be_there(*name, 8)), "and those of others mark none of these");
        assert!(!HostedNames::new(&[]).may_be_there(all[0], 0));
    }
}
