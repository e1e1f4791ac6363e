//! Launch's output on standard output and standard error. A reader may block (a full pipe, a
//! journal that hangs, a terminal after Ctrl-S), and launch must go on: so each stream has a queue, and a thread that
//! writes. Lines that find no room are dropped and counted, and the count is printed in their place.
//!
//! ```text
//! launch ── line ──▶ queue, 256 lines ──▶ thread ──▶ stdout          the same with stderr
//! ```

use rohrpost::output::plain::Lines;
use std::collections::VecDeque;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::MetadataExt;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Capacity of the queue for a stream that is not read.
const WAITING_MAX: usize = 256;
/// At the end, wait this long for the reader.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// Severities of lines, as the journal numbers them.
const ERROR: u8 = 3;
const NOTICE: u8 = 5;

/// Prints without blocking, except for a moment at the end.
pub(crate) struct Speech {
    out: Stream,
    err: Stream,
}

impl Speech {
    /// For this process's standard output and standard error.
    pub(crate) fn begin() -> io::Result<Self> {
        Ok(Self {
            out: Stream::begin("says", io::stdout(), NOTICE)?,
            err: Stream::begin("complains", io::stderr(), ERROR)?,
        })
    }

    /// Prints an event.
    pub(crate) fn say(&self, line: &str) {
        self.out.line(line);
    }

    /// Prints a failure.
    pub(crate) fn complain(&self, line: &str) {
        self.err.line(line);
    }

    /// Redraws over the previous drawing; skipped while that is still being written.
    pub(crate) fn draw(&self, picture: String) {
        let mut queue = self.out.shared.lock();
        if !queue.is_busy() {
            queue.push(picture);
            self.out.shared.changed.notify_all();
        }
    }

    /// Waits until all is written, but only for a moment: at the end, when nothing runs any more.
    pub(crate) fn settle(&self) {
        let deadline = Instant::now() + LAST_WORDS;
        self.out.shared.wait(deadline);
        self.err.shared.wait(deadline);
    }
}

struct Stream {
    shared: Arc<Shared>,
    /// The prefix of each line in the journal; empty elsewhere.
    mark: String,
}

#[derive(Default)]
struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
}

impl Stream {
    fn begin(name: &str, stream: impl Write + AsFd + Send + 'static, severity: u8) -> io::Result<Self> {
        let mark = if is_journal(&stream) { format!("<{severity}>") } else { String::new() };
        let shared = Arc::new(Shared::default());
        let (source, lost_mark) = (shared.clone(), mark.clone());
        // Never joined: it may block in a write for ever, and ends with the process.
        std::thread::Builder::new().name(name.into()).spawn(move || source.write_all(stream, &lost_mark))?;
        Ok(Self { shared, mark })
    }

    fn line(&self, line: &str) {
        self.shared.lock().push(marked(&self.mark, line));
        self.shared.changed.notify_all();
    }
}

/// Lines in the journal's format: each begins with its severity.
fn marked(mark: &str, line: &str) -> String {
    format!("{mark}{}\n", Lines(line).to_string().replace('\n', &format!("\n{mark}")))
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn write_all(&self, mut stream: impl Write, mark: &str) {
        let mut queue = self.lock();
        loop {
            let Some(next) = queue.take() else {
                queue = self.changed.wait(queue).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            drop(queue);
            let text = match next {
                Next::Text(text) => text,
                Next::Lost(count) => marked(mark, &format!("… {count} lines lost here, since nobody read this stream")),
            };
            // The reader may be gone; that does not stop a robot.
            let _ = stream.write_all(text.as_bytes()).and_then(|()| stream.flush());
            queue = self.lock();
            queue.writing = false;
            self.changed.notify_all();
        }
    }

    fn wait(&self, deadline: Instant) {
        let left = deadline.saturating_duration_since(Instant::now());
        let waited = self.changed.wait_timeout_while(self.lock(), left, |queue| queue.is_busy());
        drop(waited.unwrap_or_else(PoisonError::into_inner));
    }
}

/// The queue of a stream. A new text without room is lost, not an older one: the order stays, and the gap has a place.
#[derive(Default)]
struct Queue {
    waiting: VecDeque<Next>,
    /// The text that was taken last is being written.
    writing: bool,
}

#[derive(Debug, PartialEq)]
enum Next {
    Text(String),
    /// This many texts found no room here.
    Lost(u64),
}

impl Queue {
    fn push(&mut self, text: String) {
        if self.waiting.len() < WAITING_MAX {
            self.waiting.push_back(Next::Text(text));
        } else if let Some(Next::Lost(count)) = self.waiting.back_mut() {
            *count += 1;
        } else {
            self.waiting.push_back(Next::Lost(1));
        }
    }

    fn take(&mut self) -> Option<Next> {
        let next = self.waiting.pop_front();
        self.writing = next.is_some();
        next
    }

    fn is_busy(&self) -> bool {
        self.writing || !self.waiting.is_empty()
    }
}

/// Whether systemd has connected this stream to its journal: `JOURNAL_STREAM` has its device and inode.
fn is_journal(stream: impl AsFd) -> bool {
    let Ok(wanted) = std::env::var("JOURNAL_STREAM") else { return false };
    let own = stream.as_fd().try_clone_to_owned().and_then(|stream| std::fs::File::from(stream).metadata());
    own.is_ok_and(|own| wanted == format!("{}:{}", own.dev(), own.ino()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dropped_lines_are_counted_at_their_place() {
        let mut queue = Queue::default();
        let text = |n: usize| Next::Text(n.to_string());
        for n in 0..WAITING_MAX + 3 {
            queue.push(n.to_string());
        }
        for n in 0..WAITING_MAX {
            assert_eq!(queue.take(), Some(text(n)));
            // There is room again from the second text on: the first makes room for the count.
            if n < 2 {
                queue.push(format!("{}", 1000 + n));
            }
        }
        assert_eq!(queue.take(), Some(Next::Lost(4)), "the first of the later ones still found no room");
        assert_eq!(queue.take(), Some(text(1001)));
        assert!(queue.is_busy(), "it is being written");
        assert_eq!((queue.take(), queue.is_busy()), (None, false));
    }

    #[test]
    fn each_line_in_the_journal_begins_with_its_severity() {
        assert_eq!(marked("<5>", "probe.0 ended\n    why"), "<5>probe.0 ended\n<5>    why\n");
        assert_eq!(marked("", "a\nb"), "a\nb\n");
    }
}
