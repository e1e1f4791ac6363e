//! `output`: collects what all modules of the node say; keeps the last lines, writes them to a file and to the system's journal,
//! passes them on.

mod file;
mod journal;
mod sink;

use crate::interfaces::{Collector, CollectorInterface, Page};
use crate::module::{Module, ModuleError};
use crate::output::{Format, LINES, OutputLine};
use crate::runtime::{Context, Received};
use file::LogFile;
use journal::Journal;
use rohrpost_config::{LineFormat, Output};
use rohrpost_mailbox::Shape;
use serde::Deserialize;
use sink::Change;
use std::collections::VecDeque;
use std::path::Path;
use std::time::Instant;

/// Lines that may wait for the collector.
const SLOTS: u16 = 512;
/// Bytes of lines in a page, so that it fits in any reply mailbox.
const PAGE_BYTES: usize = 2500;
/// Most bytes that a line has besides its text: time, module, level, two counts, the length of the text.
const NUMBERS_BYTES: usize = 10 + 5 + 1 + 5 + 5 + 2;

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct Settings {}

impl super::check::Settings for Settings {}

pub(super) struct OutputModule {
    ring: VecDeque<OutputLine>,
    ring_max: usize,
    /// Lines that have left the ring.
    gone: u64,
    /// Tells this life's numbers from earlier ones.
    life: u32,
    format: LineFormat,
    file: Option<LogFile>,
    journal: Option<Journal>,
}

impl Module for OutputModule {
    type Settings = Settings;
    type Interfaces = CollectorInterface;

    fn new(_: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let output = context.installation().output.clone();
        let file = output.file.as_deref().map(|path| open(path, &output)).transpose()?;
        let journal = output.journal.then(|| Journal::new(Path::new(journal::SOCKET)));
        let journal = journal.transpose().map_err(|error| ModuleError::new(format!("journal: {error}")))?;
        context.open_mailbox(LINES, Shape { slots: SLOTS, body_bytes_max: 1024, ..Shape::default() })?;
        let ring_max = output.ring as usize;
        let ring = VecDeque::with_capacity(ring_max.min(10_000));
        let life = context.link().borrow().participant().incarnation();
        Ok(Self { ring, ring_max, gone: 0, life, format: output.format, file, journal })
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let Some(line) = data.read_from::<OutputLine>(LINES) else { return Ok(()) };
        self.write(&line, context);
        context.publish(CollectorInterface::LINE, line.time_ns, &line)?;
        if self.ring.len() >= self.ring_max {
            self.ring.pop_front();
            self.gone += 1;
        }
        self.ring.push_back(line);
        Ok(())
    }
}

fn open(path: &Path, output: &Output) -> Result<LogFile, ModuleError> {
    let file = LogFile::open(path, output.file_size, output.files);
    file.map_err(|error| ModuleError::new(format!("output file {}: {error}", path.display())))
}

impl OutputModule {
    /// Passes a line to what keeps it for longer. A full disk or a journal that hangs must not end the collector: the ring
    /// and the subscribers go on.
    fn write(&mut self, line: &OutputLine, context: &Context) {
        let (installation, now) = (context.installation(), Instant::now());
        if let Some(file) = &mut self.file {
            let format = Format::new(installation);
            let text = match self.format {
                LineFormat::Text => format.long(line),
                LineFormat::Json => format.json(line),
            };
            let change = file.write(&text, now);
            tell(change, &format_args!("the output file {}", file.path().display()));
        }
        if let Some(journal) = &mut self.journal {
            let change = journal.write(line, installation, now);
            tell(change, &format_args!("the journal at {}", journal::SOCKET));
        }
    }
}

/// What the collector says itself comes to its own mailbox as a line like any other.
fn tell(change: Option<Change>, what: &dyn std::fmt::Display) {
    match change {
        Some(Change::Fails(error)) => {
            tracing::error!("{what} takes no lines: {error}; goes on without, and tries again every second");
        }
        Some(Change::Works(missing)) => tracing::warn!("{what} takes lines again; {missing} are missing there"),
        None => {}
    }
}

impl Collector for OutputModule {
    fn lines_from(&mut self, number: u64) -> Page {
        let first = number.max(self.gone);
        let mut bytes = 0;
        let fits = |line: &&OutputLine| {
            bytes += line.text.len() + NUMBERS_BYTES;
            bytes <= PAGE_BYTES
        };
        let skip = usize::try_from(first - self.gone).unwrap_or(usize::MAX);
        let lines = self.ring.iter().skip(skip).take_while(fits).cloned().collect();
        Page { life: self.life, first, next: self.gone + self.ring.len() as u64, lines }
    }
}
