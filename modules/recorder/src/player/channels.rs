//! What is played: values as their modules published them, and what became of them.

use rohrpost::interface::StandIn;
use rohrpost::wire::append;
use rohrpost::{Context, ContextError, Installation, Name};
use rohrpost_mailbox::Stamp;
use rohrpost_recording::{Message, RecordedChannel};
use std::collections::{BTreeMap, BTreeSet};

/// A channel that is played.
struct PlayedChannel {
    from: Name,
    number: u16,
    /// Its messages are of another program, and bytes here.
    is_opaque: bool,
    has_played: bool,
    has_refused: bool,
}

/// All of them.
#[derive(Default)]
pub(super) struct PlayedChannels {
    by_topic: BTreeMap<String, PlayedChannel>,
    /// A message of another program, with its length.
    opaque: Vec<u8>,
    /// Recorded epochs, and those of the node in their place.
    epochs: Vec<(u64, u64)>,
    /// Values that were published: in their turn, and from before the place where it began.
    pub(super) played: u64,
    pub(super) older: u64,
    /// Values that their streams did not take.
    pub(super) refused: u64,
}

impl PlayedChannels {
    /// Items of these modules that are among the topics. `into` are topics of another program, and those here in which
    /// their messages are played.
    pub(super) fn new(
        stand_ins: &[StandIn],
        topics: &BTreeSet<String>,
        into: &[(String, String)],
        installation: &Installation,
    ) -> Self {
        let mut channels = Self::default();
        for StandIn { name, description } in stand_ins {
            let module = installation.classes.format(*name);
            for item in &description.data {
                let topic = format!("{module}/{}", item.field.name);
                if topics.contains(&topic) {
                    let (from, number) = (*name, item.number);
                    let other = into.iter().find(|(_, stream)| *stream == topic).map(|(other, _)| other.clone());
                    let is_opaque = other.is_some();
                    let channel = PlayedChannel { from, number, is_opaque, has_played: false, has_refused: false };
                    channels.by_topic.insert(other.unwrap_or(topic), channel);
                }
            }
        }
        channels
    }

    /// Topics in the files.
    pub(super) fn topics(&self) -> BTreeSet<String> {
        self.by_topic.keys().cloned().collect()
    }

    /// A recorded epoch begins, which is this one of the node.
    pub(super) fn begin(&mut self, recorded: u64, epoch: u64) {
        // Behind a seek, or in another recording, they begin anew.
        self.epochs.retain(|(earlier, _)| *earlier < recorded);
        self.epochs.push((recorded, epoch));
    }

    /// Publishes a value as its module did, and counts it.
    pub(super) fn play(
        &mut self,
        context: &mut Context,
        recorded: &RecordedChannel,
        message: &Message<'_>,
    ) -> Result<(), ContextError> {
        let epoch = self.epoch_of(message.epoch);
        let Some(channel) = self.by_topic.get_mut(recorded.topic.as_str()) else { return Ok(()) };
        let stamp = Stamp { epoch, ns: stamp_of(message, channel.is_opaque) };
        let mut value = message.data;
        if channel.is_opaque {
            opaque_of(&mut self.opaque, value);
            value = &self.opaque;
        }
        match context.publish_as(channel.from, channel.number, stamp, value) {
            Ok(()) => {
                channel.has_played = true;
                let count = if recorded.is_repeated() { &mut self.older } else { &mut self.played };
                *count += 1;
            }
            Err(ContextError::Record(error)) => {
                self.refused += 1;
                if !std::mem::replace(&mut channel.has_refused, true) {
                    tracing::warn!("{}: {error}; values like this one are counted as `refused`", recorded.topic);
                }
            }
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// How many of them had a value.
    pub(super) fn count(&self) -> u32 {
        self.by_topic.values().filter(|channel| channel.has_played).count() as u32
    }

    /// The node's epoch in the place of a recorded one. Streams learn of a step of time one after the other: a value
    /// may be of the epoch before.
    fn epoch_of(&self, recorded: u64) -> u64 {
        let known = self.epochs.iter().find(|(earlier, _)| *earlier == recorded);
        known.or(self.epochs.last()).map_or(0, |(_, epoch)| *epoch)
    }
}

/// When a message was made. Other programs may not say, and write 0: then it is when it arrived. Their time may begin
/// with 0, which a stream takes for no time.
fn stamp_of(message: &Message<'_>, is_opaque: bool) -> u64 {
    match message.stamp_ns {
        0 if is_opaque => message.arrival_ns.max(1),
        stamp_ns => stamp_ns,
    }
}

/// Postcard of bytes: their count, and they themselves.
fn opaque_of(to: &mut Vec<u8>, bytes: &[u8]) {
    to.clear();
    // A number is always written.
    let _ = append(to, &bytes.len());
    to.extend_from_slice(bytes);
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::schema::Bytes;
    use rohrpost::wire::from_bytes;

    #[test]
    fn time_that_begins_with_0_is_a_time() {
        for (stamp_ns, arrival_ns, is_opaque, wanted) in
            [(0, 0, true, 1), (0, 7, true, 7), (5, 7, true, 5), (0, 7, false, 0)]
        {
            let message = Message { arrival_ns, stamp_ns, epoch: 0, sequence: 0, data: &[] };
            assert_eq!(stamp_of(&message, is_opaque), wanted, "{stamp_ns} {arrival_ns}");
        }
    }

    #[test]
    fn messages_of_others_are_bytes() {
        let mut opaque = vec![7; 3];
        for len in [0, 1, 127, 128, 16_383, 16_384, 3_000_000] {
            let bytes: Vec<u8> = (0..len).map(|at: usize| at as u8).collect();
            opaque_of(&mut opaque, &bytes);
            assert_eq!(from_bytes::<Bytes>(&opaque).unwrap().0, bytes);
        }
    }

    #[test]
    fn messages_of_others_without_a_publish_time_are_of_the_time_of_their_arrival() {
        let message = |stamp_ns| Message { arrival_ns: 7, stamp_ns, epoch: 1, sequence: 0, data: &[] };
        assert_eq!([0, 5].map(|stamp_ns| stamp_of(&message(stamp_ns), true)), [7, 5]);
        assert_eq!(stamp_of(&message(0), false), 0, "ours are as they are");
    }

    #[test]
    fn a_value_of_the_epoch_before_a_step_stays_of_that() {
        let mut channels = PlayedChannels::default();
        channels.begin(3, 3);
        channels.begin(4, 7);
        assert_eq!([3, 4, 9].map(|recorded| channels.epoch_of(recorded)), [3, 7, 7]);
        channels.begin(3, 8);
        assert_eq!([3, 4].map(|recorded| channels.epoch_of(recorded)), [8, 8], "behind a seek");
    }
}
