//! Why messages are in no file, and how many of them for each cause.

use crate::format;
use std::collections::BTreeMap;
use std::ops::{AddAssign, Index};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Between topic and cause, in files. No topic of a recorder has one.
const BETWEEN: char = ' ';

/// Why a message that should be recorded is in no file. What is left out by sampling is not lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LossCause {
    /// Lost between two nodes.
    Way,
    /// No recorder ran.
    Away,
    /// The recorder had its processor, and was slower than messages came.
    Recorder,
    /// Other programs had the recorder's processor.
    Processor,
    /// The disk was slower than messages came, or failed.
    Disk,
    /// Longer than a message, or the recorder's mailbox, can be.
    Long,
}

impl LossCause {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Way, Self::Away, Self::Recorder, Self::Processor, Self::Disk, Self::Long];

    /// The cause's name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Way => "way",
            Self::Away => "away",
            Self::Recorder => "recorder",
            Self::Processor => "processor",
            Self::Disk => "disk",
            Self::Long => "long",
        }
    }

    /// What happened, behind a number of messages.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Way => "on the way between nodes",
            Self::Away => "while no recorder ran",
            Self::Recorder => "as they came faster than the recorder takes them",
            Self::Processor => "as other programs had the processor",
            Self::Disk => "as the disk was slower than they came, or failed",
            Self::Long => "as they are longer than the recording or its mailbox takes",
        }
    }
}

/// Messages lost, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses([u64; LossCause::ALL.len()]);

impl Losses {
    /// Those for all causes.
    pub fn all(&self) -> u64 {
        self.0.iter().fold(0, |all, count| all.saturating_add(*count))
    }

    /// The causes of which there are any.
    pub fn iter(&self) -> impl Iterator<Item = (LossCause, u64)> {
        LossCause::ALL.into_iter().zip(self.0).filter(|(_, count)| *count > 0)
    }

    /// What came since they were `before`.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        Self(std::array::from_fn(|at| self.0[at].saturating_sub(before.0[at])))
    }

    /// The causes in words, with their numbers.
    pub fn text(&self) -> String {
        let each = self.iter().map(|(cause, count)| format!("{count} {}", cause.text()));
        each.collect::<Vec<_>>().join(", ")
    }

    /// As the metadata of a file have them, beside those of other topics.
    pub(crate) fn texts(&self, topic: &str) -> impl Iterator<Item = (String, String)> {
        self.iter().map(move |(cause, count)| (format!("{topic}{BETWEEN}{}", cause.name()), count.to_string()))
    }

    /// Of the metadata of a file: by topic. Causes that are not known here are passed over.
    pub(crate) fn of_texts(texts: &BTreeMap<String, String>) -> BTreeMap<String, Self> {
        let mut all: BTreeMap<String, Self> = BTreeMap::new();
        for (key, count) in format::counts(texts) {
            let Some((topic, name)) = key.rsplit_once(BETWEEN) else { continue };
            let cause = LossCause::ALL.into_iter().find(|cause| cause.name() == name);
            if let Some(cause) = cause {
                all.entry(topic.into()).or_default().0[cause as usize] = count;
            }
        }
        all
    }
}

impl Index<LossCause> for Losses {
    type Output = u64;

    fn index(&self, cause: LossCause) -> &u64 {
        &self.0[cause as usize]
    }
}

impl AddAssign for Losses {
    fn add_assign(&mut self, more: Self) {
        self.0.iter_mut().zip(more.0).for_each(|(count, more)| *count = count.saturating_add(more));
    }
}

/// Losses that several threads count. They are read for display and order nothing.
#[derive(Default)]
pub(crate) struct LossCounters([AtomicU64; LossCause::ALL.len()]);

impl LossCounters {
    pub(crate) fn count(&self, cause: LossCause, count: u64) {
        self.0[cause as usize].fetch_add(count, Relaxed);
    }

    pub(crate) fn read(&self) -> Losses {
        Losses(std::array::from_fn(|at| self.0[at].load(Relaxed)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_the_losses_of_each_topic_by_cause() {
        let counters = LossCounters::default();
        for (cause, count) in LossCause::ALL.into_iter().zip(1..) {
            counters.count(cause, count);
        }
        let losses = counters.read();
        assert_eq!((losses.all(), losses[LossCause::Long]), (21, 6));
        let mut texts: BTreeMap<String, String> = losses.texts("camera.0/image").collect();
        texts.insert("camera.0/image flood".into(), "7".into());
        texts.insert("camera.0/image way".into(), "1".into());
        texts.insert("way".into(), "7".into());
        assert_eq!(Losses::of_texts(&texts), BTreeMap::from([("camera.0/image".into(), losses)]));
        assert_eq!(losses.since(&losses), Losses::default());
    }
}
