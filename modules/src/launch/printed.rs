//! What a module's process prints, as launch remembers it.

use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, PipeReader, PipeWriter};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Lines that are kept to be told when it ends: a panic and its back trace.
const LINES_MAX: usize = 64;
/// Longest line, bytes; the rest of a longer one is the next line.
const LINE_BYTES_MAX: u64 = 4096;

/// The last lines of a process, the one that runs or the one that ended last.
#[derive(Default)]
pub(super) struct Printed {
    lines: Arc<Mutex<VecDeque<String>>>,
    reader: Option<JoinHandle<()>>,
}

impl Printed {
    /// Where the next process prints to. What the one before said is forgotten.
    pub(super) fn begin(&mut self) -> io::Result<PipeWriter> {
        let (reader, writer) = io::pipe()?;
        // Of its own: who left processes behind that still print must not mix with what follows.
        self.lines = Arc::default();
        let lines = self.lines.clone();
        self.reader = Some(std::thread::Builder::new().name("printed".into()).spawn(move || keep(reader, &lines))?);
        Ok(writer)
    }

    /// Whether all that it printed has come. A process may leave others behind that hold its pipe: then never.
    pub(super) fn is_complete(&self) -> bool {
        self.reader.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// All that is kept, each line on one of its own below what was said before.
    pub(super) fn below(&self) -> String {
        self.lines().iter().map(|line| format!("\n    {line}")).collect()
    }

    /// The last line, empty if there is none.
    pub(super) fn last(&self) -> String {
        self.lines().back().cloned().unwrap_or_default()
    }

    fn lines(&self) -> MutexGuard<'_, VecDeque<String>> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Keeps the last lines that come through a pipe, until it closes.
fn keep(pipe: PipeReader, lines: &Mutex<VecDeque<String>>) {
    let mut pipe = BufReader::new(pipe);
    let mut line = Vec::new();
    while let Ok(1..) = io::Read::take(&mut pipe, LINE_BYTES_MAX).read_until(b'\n', &mut line) {
        let mut lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
        if lines.len() == LINES_MAX {
            lines.pop_front();
        }
        lines.push_back(String::from_utf8_lossy(&line).trim_end().to_owned());
        line.clear();
    }
}
