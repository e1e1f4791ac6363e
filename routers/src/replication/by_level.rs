//! Streams of this node that others have, by importance and in turn.

use super::outgoing::OutgoingReplica;
use crate::frame::NodeIndex;
use rohrpost_network::LEVELS;

/// Streams, the most important first; those of one level in turn, record by record.
pub(super) struct StreamsByLevel {
    pub(super) streams: Vec<OutgoingReplica>,
    /// Of each level, the first of its streams to be asked.
    turns: [usize; LEVELS],
}

impl StreamsByLevel {
    pub(super) fn new(mut streams: Vec<OutgoingReplica>) -> Self {
        streams.sort_by_key(|stream| stream.settings.level);
        Self { streams, turns: [0; LEVELS] }
    }

    /// Looks for newer records, and which nodes are there. `peers`: see [`OutgoingReplica::meet`].
    pub(super) fn refresh(&mut self, now_ns: u64, peers: impl Fn(NodeIndex) -> (u64, bool)) {
        for stream in &mut self.streams {
            stream.refresh();
            stream.meet(now_ns, &peers);
        }
    }

    /// A stream and one of its destinations that have something for a ready peer: of the most important level `before`
    /// this one, and there in turn.
    pub(super) fn choose(&mut self, now_ns: u64, ready: u64, before: u8) -> Option<(usize, usize)> {
        let mut begin = 0;
        for level in self.streams.chunk_by_mut(|a, b| a.settings.level == b.settings.level) {
            if level[0].settings.level >= before {
                break;
            }
            let count = level.len();
            let turn = self.turns[usize::from(level[0].settings.level)];
            let first = turn.checked_sub(begin).filter(|first| *first < count).unwrap_or(0);
            for at in (0..count).map(|step| (first + step) % count) {
                if let Some(to) = level[at].choose(now_ns, ready) {
                    return Some((begin + at, to));
                }
            }
            begin += count;
        }
        None
    }

    /// A part of a stream was made for one of its destinations: behind the last one of a record others have their turn.
    pub(super) fn made(&mut self, (at, to): (usize, usize)) {
        let stream = &mut self.streams[at];
        if stream.destinations[to].under_way.is_none() && !stream.destinations[to].is_asked() {
            self.turns[usize::from(stream.settings.level)] = at + 1;
        }
        stream.turn = to + 1;
    }
}
