//! Memory in blocks of one size: a body is a chain of them, written once and read once, front to back.

/// Bytes of a block. The first one holds what is reported of a lost package.
pub(super) const BLOCK_BYTES: usize = rohrpost_network::KEPT_IN_BYTES as usize;
const NONE: u32 = u32::MAX;

/// All blocks.
#[derive(Debug)]
pub(super) struct Blocks {
    bytes: Box<[u8]>,
    after: Box<[u32]>,
    free: u32,
}

/// The blocks of one body, and how far it was read.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Chain {
    first: u32,
    last: u32,
    blocks: u32,
    /// The next block to read, and the offset in it.
    reading: u32,
    offset: u32,
}

impl Chain {
    pub(super) fn blocks(&self) -> u32 {
        self.blocks
    }
}

impl Blocks {
    pub(super) fn new(count: usize) -> Self {
        let after = (1..=count as u32).map(|next| if next == count as u32 { NONE } else { next }).collect();
        Self { bytes: vec![0; count * BLOCK_BYTES].into(), after, free: if count == 0 { NONE } else { 0 } }
    }

    /// How many blocks a body takes: one at least.
    pub(super) fn needed(bytes: usize) -> u32 {
        bytes.div_ceil(BLOCK_BYTES).max(1) as u32
    }

    /// Copies a body in. The caller has checked that enough blocks are free.
    pub(super) fn store(&mut self, body: &[u8]) -> Chain {
        let blocks = Self::needed(body.len());
        let first = self.free;
        let mut last = first;
        for (index, piece) in body.chunks(BLOCK_BYTES).enumerate() {
            if index > 0 {
                last = self.after[last as usize];
            }
            let start = last as usize * BLOCK_BYTES;
            self.bytes[start..start + piece.len()].copy_from_slice(piece);
        }
        self.free = self.after[last as usize];
        Chain { first, last, blocks, reading: first, offset: 0 }
    }

    /// Copies the next bytes out; there are as many.
    pub(super) fn read(&self, chain: &mut Chain, mut into: &mut [u8]) {
        while !into.is_empty() {
            if chain.offset as usize == BLOCK_BYTES {
                chain.reading = self.after[chain.reading as usize];
                chain.offset = 0;
            }
            let count = into.len().min(BLOCK_BYTES - chain.offset as usize);
            let start = chain.reading as usize * BLOCK_BYTES + chain.offset as usize;
            let (now, rest) = into.split_at_mut(count);
            now.copy_from_slice(&self.bytes[start..start + count]);
            chain.offset += count as u32;
            into = rest;
        }
    }

    /// The first of a body's bytes, even after they were read or freed, until others are stored.
    pub(super) fn beginning(&self, chain: &Chain, len: u16) -> &[u8] {
        let start = chain.first as usize * BLOCK_BYTES;
        &self.bytes[start..start + BLOCK_BYTES.min(len.into())]
    }

    pub(super) fn free(&mut self, chain: Chain) {
        self.after[chain.last as usize] = self.free;
        self.free = chain.first;
    }
}
