//! The models of the single-writer cells. This file is compiled beside the real `cell.rs` and beside each broken one.

use crate::cell::{SeqCount, SeqLatch};
use crate::step::{dies_at, reached};
use crate::sync::{AtomicU64, Ordering};
use loom::thread::{self, JoinHandle};
use std::sync::Arc;

/// Does something with a cell on a thread of its own.
fn beside<C: 'static, R: 'static>(cell: &Arc<C>, act: impl FnOnce(&C) -> R + 'static) -> JoinHandle<R> {
    let cell = cell.clone();
    thread::spawn(move || act(&cell))
}

/// Both words of a value are the same number.
#[derive(Default)]
struct Words([AtomicU64; 2]);

impl Words {
    fn store(&self, value: u64) {
        for word in &self.0 {
            word.store(value, Ordering::Relaxed);
            reached("words: stored");
        }
    }

    fn load(&self) -> [u64; 2] {
        self.0.each_ref().map(|word| {
            reached("words: before load");
            word.load(Ordering::Relaxed)
        })
    }
}

/// # Panics
/// On words of two values.
fn whole([first, second]: [u64; 2]) -> u64 {
    assert_eq!(first, second, "torn");
    first
}

#[derive(Default)]
struct InPlace {
    count: SeqCount,
    words: Words,
}

impl InPlace {
    fn write(&self, value: u64) {
        self.count.write(|| self.words.store(value));
    }

    fn read(&self) -> Option<(u32, u64)> {
        reached("read: before");
        let (version, words) = self.count.read(|| self.words.load())?;
        Some((version, whole(words)))
    }
}

/// The writer writes 1 and 2 while a reader reads: it gets a whole value, of the version that it is told, or nothing.
pub(crate) fn a_value_is_read_whole() {
    let cell = Arc::new(InPlace::default());
    let writer = beside(&cell, |cell| [1, 2].into_iter().for_each(|value| cell.write(value)));
    if let Some((version, value)) = cell.read() {
        assert_eq!(u64::from(version), 2 * value, "a value of another version");
    }
    writer.join().unwrap();
    assert_eq!(cell.read(), Some((4, 2)));
}

/// A writer dies between two words: readers get nothing. Its successor makes the value whole, in front of a reader.
pub(crate) fn a_successor_completes_what_the_dead_left() {
    let cell = Arc::new(InPlace::default());
    cell.write(1);
    assert!(dies_at("words: stored", || cell.write(2)));
    assert_eq!(cell.read(), None);
    let successor = beside(&cell, |cell| cell.write(3));
    assert!(cell.read().is_none_or(|read| read == (4, 3)));
    successor.join().unwrap();
    assert_eq!(cell.read(), Some((4, 3)));
}

#[derive(Default)]
struct Latched {
    latch: SeqLatch,
    places: [Words; 2],
}

impl Latched {
    fn fill(&self, value: u64) {
        self.latch.fill(|place| self.places[place].store(value));
    }

    fn write(&self, value: u64) {
        self.fill(value);
        self.latch.publish();
    }

    fn read(&self, tries: usize) -> Option<u64> {
        reached("read: before");
        self.latch.read(tries, |place| self.places[place].load()).map(whole)
    }
}

/// The writer writes 2 and 3 over 1 while a reader reads: it gets a whole value, or nothing after its only try.
pub(crate) fn a_latched_value_is_read_whole() {
    let cell = Arc::new(Latched::default());
    cell.write(1);
    let writer = beside(&cell, |cell| [2, 3].into_iter().for_each(|value| cell.write(value)));
    if let Some(value) = cell.read(1) {
        assert!((1..=3).contains(&value), "{value} was never published");
    }
    writer.join().unwrap();
    assert_eq!(cell.read(1), Some(3));
}

/// A writer fills the other place while a reader reads: the value that is there stays readable, at the first try.
pub(crate) fn a_latched_value_stays_readable() {
    let cell = Arc::new(Latched::default());
    cell.write(1);
    let writer = beside(&cell, |cell| cell.fill(2));
    assert_eq!(cell.read(1), Some(1));
    writer.join().unwrap();
    assert_eq!(cell.read(1), Some(1));
}

/// A writer dies between two words of the other place: the value before stays, until a successor writes the next.
pub(crate) fn a_latched_value_outlives_its_writer() {
    let cell = Arc::new(Latched::default());
    cell.write(1);
    assert!(dies_at("words: stored", || cell.write(2)));
    assert_eq!(cell.read(1), Some(1));
    let successor = beside(&cell, |cell| cell.write(3));
    assert!(matches!(cell.read(2), Some(1 | 3)));
    successor.join().unwrap();
    assert_eq!(cell.read(1), Some(3));
}
