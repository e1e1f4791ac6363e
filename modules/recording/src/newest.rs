//! The newest message of each channel: the next file begins with those that would be missing at its beginning.

use crate::batch::{Batch, Message};
use crate::shape::Shape;
use crate::status::{ChannelId, ChannelState};
use rohrpost_schema::Type;
use std::sync::Arc;

/// A channel of which nothing came for so long is slow.
const SLOW_NS: u64 = 1_000_000_000;
/// Memory for all of them, and what a file begins with at most.
pub(crate) const KEPT_BYTES_MAX: usize = 32 << 20;
/// A longer message is copied only if its channel is slow.
const LONG_BYTES: usize = 1 << 20;

/// The newest message of each channel that is in a file.
pub(crate) struct Newest {
    channels: Vec<NewestOf>,
    bytes: usize,
    bytes_max: usize,
    /// Those of before the recording, of channels that it does not know yet.
    earlier: Option<Box<Earlier>>,
}

/// The newest message of a channel.
struct NewestOf {
    /// Its messages are words: the newest one says no more than others.
    is_words: bool,
    kept: Option<KeptMessage>,
}

struct KeptMessage {
    arrival_ns: u64,
    stamp_ns: u64,
    epoch: u64,
    sequence: u32,
    /// None if it is too long.
    data: Option<Vec<u8>>,
}

impl KeptMessage {
    /// Whether so much time is between it and a later one, or a step of time.
    fn is_old_at(&self, later: &Message<'_>) -> bool {
        self.epoch != later.epoch || later.arrival_ns.saturating_sub(self.arrival_ns) >= SLOW_NS
    }
}

impl Newest {
    /// Of none; files have this length, and begin with no more than a quarter of it.
    pub(crate) fn new(file_bytes: u64) -> Self {
        let quarter = usize::try_from(file_bytes / 4).unwrap_or(usize::MAX);
        Self { channels: Vec::new(), bytes: 0, bytes_max: quarter.min(KEPT_BYTES_MAX), earlier: None }
    }

    /// The same, behind those of another recording.
    pub(crate) fn behind(earlier: Option<Earlier>, file_bytes: u64) -> Self {
        Self { earlier: earlier.map(Box::new), ..Self::new(file_bytes) }
    }

    /// Takes notice of channels that are new.
    pub(crate) fn learn(&mut self, channels: &[Arc<ChannelState>]) {
        for channel in &channels[self.channels.len()..] {
            let ty = Type::from_bytes(&channel.schema).ok();
            let is_words = ty.as_ref().and_then(Shape::of) == Some(Shape::Line);
            self.channels.push(NewestOf { is_words, kept: None });
            if let Some(kept) = self.earlier.as_mut().and_then(|earlier| earlier.take(channel)) {
                self.put(self.channels.len() - 1, kept);
            }
        }
    }

    /// Puts in what another one has kept, if there is room.
    fn put(&mut self, at: usize, kept: KeptMessage) {
        let bytes = kept.data.as_ref().map_or(0, Vec::capacity);
        if self.bytes + bytes <= self.bytes_max {
            self.bytes += bytes;
            self.channels[at].kept = Some(kept);
        }
    }

    /// Notes what is in a file now.
    pub(crate) fn note(&mut self, batch: &Batch, channels: &[Arc<ChannelState>]) {
        self.learn(channels);
        let mut last = vec![None; channels.len()];
        batch.messages().enumerate().for_each(|(place, (at, _))| last[at] = Some(place));
        for (place, (at, message)) in batch.messages().enumerate() {
            if last[at] == Some(place) && !self.channels[at].is_words {
                self.keep(at, &message);
            }
        }
    }

    fn keep(&mut self, at: usize, message: &Message<'_>) {
        let Message { arrival_ns, stamp_ns, epoch, sequence, data } = *message;
        let before = self.channels[at].kept.take();
        let is_slow = before.as_ref().is_none_or(|kept| kept.is_old_at(message));
        let mut memory = before.and_then(|kept| kept.data).unwrap_or_default();
        self.bytes -= memory.capacity();
        if memory.capacity() < data.len() || memory.capacity() > LONG_BYTES {
            memory = Vec::new();
        }
        memory.clear();
        let fits = self.bytes + memory.capacity().max(data.len()) <= self.bytes_max;
        let copied = ((data.len() <= LONG_BYTES || is_slow) && fits).then(|| {
            memory.reserve_exact(data.len());
            memory.extend_from_slice(data);
            memory
        });
        self.bytes += copied.as_ref().map_or(0, Vec::capacity);
        self.channels[at].kept = Some(KeptMessage { arrival_ns, stamp_ns, epoch, sequence, data: copied });
    }

    /// What a file begins with before these first messages, with the numbers of the channels, in the order of arrival:
    /// nobody knows how far the next message of a channel is that is not among them.
    pub(crate) fn before(&self, batch: &Batch) -> Vec<(usize, Message<'_>)> {
        let Some((_, first)) = batch.messages().next() else { return Vec::new() };
        let mut comes = vec![false; self.channels.len()];
        for (at, _) in batch.messages() {
            if let Some(comes) = comes.get_mut(at) {
                *comes = true;
            }
        }
        let kept = self.channels.iter().zip(comes).enumerate();
        let kept = kept.filter_map(|(at, (channel, comes))| Some((at, channel.kept.as_ref()?, comes)));
        let missing = kept.filter(|(_, kept, comes)| !comes || kept.is_old_at(&first)).filter_map(|(at, kept, _)| {
            let KeptMessage { arrival_ns, stamp_ns, epoch, sequence, .. } = *kept;
            let data = kept.data.as_deref()?;
            Some((at, Message { arrival_ns, stamp_ns, epoch, sequence, data }))
        });
        let mut missing: Vec<_> = missing.collect();
        missing.sort_by_key(|(_, message)| (message.epoch, message.arrival_ns));
        missing
    }
}

/// The newest message of each channel of a recording that has ended, and of what came since then: another recording
/// begins with them ([`crate::Writer::start_behind`]).
pub struct Earlier {
    channels: Vec<Arc<ChannelState>>,
    newest: Newest,
}

impl Earlier {
    pub(crate) fn new(channels: Vec<Arc<ChannelState>>, mut newest: Newest) -> Self {
        newest.learn(&channels);
        newest.earlier = None;
        Self { channels, newest }
    }

    /// Notes a message that is not recorded, of a channel of the recording that has ended. Takes as long as copying it.
    pub fn note(&mut self, channel: ChannelId, message: &Message<'_>) {
        if self.newest.channels.get(channel.0).is_some_and(|its| !its.is_words) {
            self.newest.keep(channel.0, message);
        }
    }

    /// Fills in what is older, of channels of which nothing came since then.
    pub fn fill(&mut self, mut older: Self) {
        for (at, channel) in self.channels.iter().enumerate() {
            if self.newest.channels[at].kept.is_none()
                && let Some(kept) = older.take(channel)
            {
                self.newest.put(at, kept);
            }
        }
    }

    /// That of a channel, which may have another number here.
    fn take(&mut self, channel: &ChannelState) -> Option<KeptMessage> {
        let is_it = |its: &Arc<ChannelState>| its.topic == channel.topic && its.type_hash == channel.type_hash;
        let at = self.channels.iter().position(is_it)?;
        self.newest.channels[at].kept.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn channels(count: usize) -> Vec<Arc<ChannelState>> {
        let channel = |at: usize| {
            let schema = ("bytes".to_owned(), Type::Bytes.to_bytes(), Type::Bytes.hash());
            Arc::new(ChannelState::new(format!("a.{at}/b"), schema, BTreeMap::new()))
        };
        (0..count).map(channel).collect()
    }

    fn message(arrival_ns: u64, epoch: u64, data: &[u8]) -> Message<'_> {
        Message { arrival_ns, stamp_ns: arrival_ns, epoch, sequence: 0, data }
    }

    /// Each as a batch of its own, as long ones are.
    fn noted(bytes_max: u64, all: &[(usize, Message<'_>)]) -> Newest {
        let mut newest = Newest::new(bytes_max);
        for (at, message) in all {
            let mut batch = Batch::default();
            batch.push(*at, message);
            newest.note(&batch, &channels(4));
        }
        newest
    }

    /// Before these first messages.
    fn found_before(newest: &Newest, all: &[(usize, Message<'_>)]) -> Vec<(usize, u64, usize)> {
        let mut batch = Batch::default();
        all.iter().for_each(|(at, message)| batch.push(*at, message));
        newest.before(&batch).iter().map(|(at, its)| (*at, its.arrival_ns, its.data.len())).collect()
    }

    /// Before a message of the last channel.
    fn found(newest: &Newest, first: &Message<'_>) -> Vec<(usize, u64, usize)> {
        found_before(newest, &[(3, *first)])
    }

    #[test]
    fn a_file_begins_with_what_is_old_or_does_not_come_soon() {
        let newest =
            noted(1 << 30, &[(2, message(5, 1, b"old")), (0, message(1, 1, b"x")), (1, message(SLOW_NS + 1, 1, b"y"))]);
        let [x, old, y] = [(0, 1, 1), (2, 5, 3), (1, SLOW_NS + 1, 1)];
        let first = |at_ns, epoch| message(at_ns, epoch, b"");
        assert_eq!(found(&newest, &first(SLOW_NS + 2, 1)), [x, old, y], "in the order of arrival, however new");
        let all = |first: Message<'static>| [0, 1, 2, 7].map(|at| (at, first));
        assert_eq!(found_before(&newest, &all(first(SLOW_NS, 1))), [], "not a second old, and each comes");
        assert_eq!(found_before(&newest, &all(first(SLOW_NS + 5, 1))), [x, old], "two are that old");
        assert_eq!(found_before(&newest, &all(first(SLOW_NS, 1))[1..]), [x], "one does not come");
        assert_eq!(found_before(&newest, &all(first(9, 2))).len(), 3, "times of two epochs say nothing of each other");
        assert_eq!(found_before(&newest, &[]), []);
    }

    #[test]
    fn long_messages_are_kept_of_slow_channels_only() {
        let long = vec![0; LONG_BYTES + 1];
        let far = message(u64::MAX, 1, b"");
        let newest = noted(1 << 30, &[(0, message(0, 1, &long))]);
        assert_eq!(found(&newest, &far), [(0, 0, long.len())]);
        let newest = noted(1 << 30, &[(0, message(0, 1, &long)), (0, message(1, 1, &long))]);
        assert_eq!((found(&newest, &far), newest.bytes), (vec![], 0), "two within a second");
        let newest = noted(1 << 30, &[(0, message(0, 1, &long)), (0, message(SLOW_NS, 1, &long[1..]))]);
        assert_eq!(found(&newest, &far), [(0, SLOW_NS, LONG_BYTES)]);
    }

    #[test]
    fn memory_is_bounded_by_the_length_of_a_file() {
        let some = vec![0; 300];
        let all: Vec<_> = (0..4).map(|at| (at, message(at as u64, 1, &some[..]))).collect();
        let newest = noted(4_000, &all);
        assert_eq!((found(&newest, &message(u64::MAX, 1, b"")).len(), newest.bytes), (3, 900));
    }

    #[test]
    fn of_a_batch_the_last_message_of_each_channel_is_kept() {
        let mut batch = Batch::default();
        for (at, arrival_ns) in [(0, 1), (1, 2), (0, 3), (1, 4), (0, 5)] {
            batch.push(at, &message(arrival_ns, 1, b"abc"));
        }
        let mut newest = Newest::new(1 << 30);
        newest.note(&batch, &channels(2));
        assert_eq!(found(&newest, &message(u64::MAX, 1, b"")), [(1, 4, 3), (0, 5, 3)]);
        assert!(newest.bytes <= 6);
    }
}
