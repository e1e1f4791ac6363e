//! `output`: collects what all modules of the node say; keeps the last lines, writes them to a file and to the system's
//! journal, passes them on.

mod admission;
mod file;
mod journal;
mod ring;
mod sink;

use crate::format::Format;
use admission::{Admission, Came, NotTaken};
use file::LogFile;
use journal::Journal;
use ring::Ring;
use rohrpost_config::{LineFormat, Output, Principal};
use rohrpost_mailbox::{Shape, monotonic_ns};
use rohrpost_modules::interfaces::{Collector, CollectorInterface, Page, RefusedLines};
use rohrpost_modules::output::{LINES, OutputLine};
use rohrpost_modules::runtime::{Context, Received};
use rohrpost_modules::{Module, ModuleError};
use serde::Deserialize;
use sink::SinkChange;
use std::path::Path;
use std::time::Instant;

/// Lines that may wait for the collector.
const SLOTS: u16 = 512;
/// Bytes of lines in a page, so that it fits in any reply mailbox.
const PAGE_BYTES: usize = 2500;
/// Most bytes that a line has besides its text: time, module, level, two counts, a number of an error, the length of
/// the text.
const NUMBERS_BYTES: usize = 10 + 5 + 1 + 5 + 5 + 4 + 2;

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct Settings {}

impl super::settings::Settings for Settings {}

pub(super) struct OutputModule {
    admission: Admission,
    ring: Ring,
    /// Tells this incarnation's numbers from earlier ones.
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
        let journal = journal.transpose().map_err(|error| ModuleError::at("journal", error))?;
        context.open_mailbox_to_all(LINES, Shape { slots: SLOTS, body_bytes_max: 1024, ..Shape::default() })?;
        let (admission, ring) = (Admission::new(output.rate, output.burst), Ring::new(output.ring as usize));
        let life = context.link().borrow().participant().incarnation();
        Ok(Self { admission, ring, life, format: output.format, file, journal })
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        match self.admit(context, data) {
            Ok((principal, line)) => {
                self.write(&line, context);
                context.publish(CollectorInterface::LINE, line.time_ns, &line)?;
                self.ring.push(principal, line);
            }
            Err(NotTaken(Some(why))) => tracing::warn!("{why} (`rohrpost call output.0 refused` counts them)"),
            Err(NotTaken(None)) => {}
        }
        Ok(())
    }
}

fn open(path: &Path, output: &Output) -> Result<LogFile, ModuleError> {
    let file = LogFile::open(path, output.file_size, output.files);
    file.map_err(|error| ModuleError::at(format_args!("output file {}", path.display()), error))
}

impl OutputModule {
    /// The line in a package, and the principal that is charged for it.
    fn admit(&mut self, context: &Context, data: &Received<'_>) -> Result<(Principal, OutputLine), NotTaken> {
        let came = Came { mono_ns: monotonic_ns(), time_ns: context.now().ns };
        let read = postcard::from_bytes(data.value);
        let mut line: OutputLine = read.map_err(|_| self.admission.unreadable(data.from, came.mono_ns))?;
        let principal = self.admission.validate(context.installation(), data.from, &mut line, came)?;
        Ok((principal, line))
    }

    /// Passes a line to what keeps it for longer. A full disk or a journal that hangs must not end the collector: the
    /// ring and the subscribers go on.
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
fn tell(change: Option<SinkChange>, what: &dyn std::fmt::Display) {
    match change {
        Some(SinkChange::Fails(error)) => {
            tracing::error!(
                errno = error.raw_os_error(),
                "{what} takes no lines: {error}; goes on without, and tries again every second"
            );
        }
        Some(SinkChange::Works(missing)) => tracing::warn!("{what} takes lines again; {missing} are missing there"),
        None => {}
    }
}

impl Collector for OutputModule {
    fn lines_from(&mut self, number: u64) -> Page {
        let (first, run) = self.ring.run(number);
        let mut bytes = 0;
        let fits = |line: &&OutputLine| {
            bytes += line.text.len() + NUMBERS_BYTES;
            bytes <= PAGE_BYTES
        };
        let lines = run.take_while(fits).cloned().collect();
        Page { life: self.life, first, next: self.ring.next(), lines }
    }

    fn refused(&mut self) -> RefusedLines {
        self.admission.counts
    }
}
