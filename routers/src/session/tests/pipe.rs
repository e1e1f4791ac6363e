//! One direction of a connection: bytes in their order, late, in pieces of any size, or not at all.

use rohrpost_testbed::sim::chance::Chance;
use std::collections::VecDeque;

const MS: u64 = 1_000_000;

pub(super) struct Pipe {
    pieces: VecDeque<(u64, Vec<u8>)>,
    held: usize,
    /// What the buffers of both kernels hold.
    capacity: usize,
    bytes_ms: u64,
    delay_ms: u64,
    free_ns: u64,
    pub(super) stalled_until_ns: u64,
    /// What is written is gone, and nobody is told.
    pub(super) is_dead: bool,
    /// The writer has closed its end: after the last byte the reader is told.
    pub(super) is_closed: bool,
    chance: Chance,
}

impl Pipe {
    pub(super) fn new(mut chance: Chance, bytes_ms: u64, is_wide: bool) -> Self {
        let delay_ms = chance.scale(1, 60);
        let capacity = if is_wide { 1 << 22 } else { chance.scale(2000, 100_000) as usize };
        Self {
            pieces: VecDeque::new(),
            held: 0,
            capacity,
            bytes_ms,
            delay_ms,
            free_ns: 0,
            stalled_until_ns: 0,
            is_dead: false,
            is_closed: false,
            chance,
        }
    }

    /// It holds no more than so many bytes.
    pub(super) fn holding(self, bytes: usize) -> Self {
        Self { capacity: bytes, ..self }
    }

    pub(super) fn has_room(&self) -> bool {
        self.held < self.capacity
    }

    pub(super) fn write(&mut self, now_ns: u64, bytes: &[u8]) -> usize {
        let mut count = bytes.len().min(self.capacity - self.held);
        if self.chance.percent(20) {
            count = self.chance.below(count as u64 + 1) as usize;
        }
        let takes_ns = count as u64 * MS / self.bytes_ms.max(1);
        self.free_ns = self.free_ns.max(now_ns + self.chance.between(self.delay_ms / 2, self.delay_ms) * MS) + takes_ns;
        self.pieces.push_back((self.free_ns, bytes[..count].to_vec()));
        self.held += count;
        count
    }

    /// What has come by now, a piece at a time, cut anywhere.
    pub(super) fn read(&mut self, now_ns: u64) -> Option<Vec<u8>> {
        if self.is_dead || now_ns < self.stalled_until_ns {
            return None;
        }
        let (at_ns, piece) = self.pieces.front_mut()?;
        if *at_ns > now_ns {
            return None;
        }
        let cut =
            if self.chance.percent(30) { self.chance.below(piece.len() as u64 + 1) as usize } else { piece.len() };
        let rest = piece.split_off(cut);
        let read = std::mem::replace(piece, rest);
        if piece.is_empty() {
            self.pieces.pop_front();
        }
        self.held -= read.len();
        Some(read)
    }

    /// Whether the reader sees the end.
    pub(super) fn is_at_end(&self) -> bool {
        self.is_closed && !self.is_dead && self.pieces.is_empty()
    }
}
