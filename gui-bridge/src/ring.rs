//! A stream that is looked at so often, and its newest record read where it lies: a large one of the bridge's own node,
//! or a replica that this node has of another one's.
//!
//! A record is held only while it is drawn, which copies what is kept of it: a viewer or a disk that stands still holds
//! none. What writes the stream does not notice that it is looked at.

use rohrpost::schema::DataItem;
use rohrpost::{Context, Name, RecordInfo, Stream};
use std::time::{Duration, Instant};

/// A stream that cannot be opened, since all its seats are taken, say, is tried again after so long.
const RETRY: Duration = Duration::from_secs(5);

/// See the module's text.
pub(crate) struct Ring {
    /// Hash of the interface that was described.
    interface: u32,
    period: Duration,
    /// When it is looked at next.
    due: Instant,
    /// When it was looked at last.
    looked: Instant,
    stream: Option<Stream<()>>,
    /// The record that was drawn last.
    drawn: Option<RecordInfo>,
    /// Why it could not be read, so that it is told once.
    told: Option<String>,
}

impl Ring {
    /// A stream of the interface with this hash, looked at once in `period`.
    pub(crate) fn new(interface: u32, period: Duration) -> Self {
        let now = Instant::now();
        Self { interface, period, due: now, looked: now, stream: None, drawn: None, told: None }
    }

    /// What was drawn is to be drawn once more.
    pub(crate) fn forget(&mut self) {
        self.drawn = None;
    }

    /// Whether it is time to look at it, and it can be looked at; it is opened if it is not open yet.
    pub(crate) fn is_due(&mut self, context: &mut Context, from: Name, item: &DataItem, now: Instant) -> bool {
        if now < self.due {
            return false;
        }
        if self.stream.is_none() {
            match context.stream_untyped(from, item, self.interface) {
                Ok(stream) => self.stream = Some(stream),
                Err(error) => {
                    self.due = now + RETRY;
                    self.tell(error.to_string());
                }
            }
        }
        self.looked = now;
        if self.stream.is_some() {
            // In step with the period; but what was not looked at in time is not made up for.
            self.due = (self.due + self.period).max(now);
        }
        self.stream.is_some()
    }

    /// Shows the time and the bytes of the newest record, unless that was drawn already.
    pub(crate) fn look(&mut self, draw: impl FnOnce(u64, &[u8])) {
        let Some(stream) = &mut self.stream else { return };
        let failure = match stream.newest() {
            Ok(Some(record)) if self.drawn != Some(record.info()) => {
                self.drawn = Some(record.info());
                self.told = None;
                draw(record.stamp_ns(), record.bytes());
                None
            }
            Ok(_) => {
                // It is looked at again soon: one that is written as often as it is drawn is drawn each time.
                self.due = self.looked;
                None
            }
            Err(error) => Some(error.to_string()),
        };
        if let Some(text) = failure {
            self.tell(text);
        }
    }

    fn tell(&mut self, text: String) {
        if self.told.as_ref() != Some(&text) {
            tracing::warn!("{text}");
            self.told = Some(text);
        }
    }
}
