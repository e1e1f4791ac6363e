//! What is recorded: the same bytes for all, which compress as what sensors say does: to about a third.

use rohrpost_bench_local::harness::{Failure, OrFail};
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

/// Messages are cut out of so many bytes, more than what a compressor looks back for.
const NOISE_BYTES: usize = 16 << 20;
/// The name of the channel.
pub(super) const NAME: (&str, &str) = ("laser.0", "scan");
/// Before compression.
pub(super) const CHUNK_BYTES: u64 = 1 << 20;

/// The messages of a turn.
pub(super) struct Workload {
    /// Of each message.
    pub(super) bytes: usize,
    pub(super) messages: usize,
}

impl Workload {
    /// Makes the bytes, so that it is not measured.
    pub(super) fn prepare(&self) {
        noise();
    }

    /// All messages, by their numbers.
    pub(super) fn all(&self) -> impl Iterator<Item = (u32, &'static [u8])> {
        let places = NOISE_BYTES - self.bytes + 1;
        (0..self.messages).map(move |number| {
            let begin = number.wrapping_mul(self.bytes) % places;
            (number as u32, &noise()[begin..begin + self.bytes])
        })
    }

    /// Whether there is one file, which has as many messages as were written, by its own statistics and by reading it
    /// through; the bytes of each are those of [`Self::all`].
    pub(super) fn check(&self, folder: &Path) -> Result<(), Failure> {
        let files = fs::read_dir(folder).or_fail("reading what was recorded")?;
        let files: Vec<_> =
            files.map(|file| Ok(file?.path())).collect::<std::io::Result<_>>().or_fail("reading what was recorded")?;
        let [file] = files.as_slice() else {
            return Err(Failure::Failed(format!("{} files, not one", files.len())));
        };
        let bytes = fs::read(file).or_fail("reading what was recorded")?;
        let stream = mcap::MessageStream::new(&bytes).or_fail("reading what was recorded")?;
        let mut found = 0;
        for (message, (number, data)) in stream.zip(self.all()) {
            let message = message.or_fail("reading what was recorded")?;
            if message.sequence != number || message.data != data {
                return Err(Failure::Failed(format!("message {number} is recorded with other bytes, or elsewhere")));
            }
            found += 1;
        }
        let told = mcap::Summary::read(&bytes).or_fail("reading what was recorded")?.and_then(|summary| summary.stats);
        let told = told.map(|statistics| statistics.message_count);
        if found != self.messages || told != Some(self.messages as u64) {
            return Err(Failure::Failed(format!("{} written, {found} found, {told:?} told", self.messages)));
        }
        Ok(())
    }
}

/// Readings that change little from one to the next, each with some noise in its lowest bits.
fn noise() -> &'static [u8] {
    static NOISE: OnceLock<Vec<u8>> = OnceLock::new();
    NOISE.get_or_init(|| {
        let mut state = 1u32;
        let reading = |at: usize| {
            // Numerical Recipes, section 7.1: a quick linear congruential generator.
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((at / 64) as u32 * 7 + (state >> 27)).to_le_bytes()
        };
        (0..NOISE_BYTES / 4).flat_map(reading).collect()
    })
}
