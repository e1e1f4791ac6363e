//! `output`: collects what all modules of the node say; keeps the last lines, writes them to a file, passes them on.

use crate::interfaces::{Collector, CollectorInterface, Page};
use crate::module::{Module, ModuleError};
use crate::output::{LINES, OutputLine};
use crate::runtime::{Context, Received};
use rohrpost_mailbox::Shape;
use serde::Deserialize;
use std::collections::VecDeque;
use std::fs::File;
use std::io::Write;

/// Lines that may wait for the collector.
const SLOTS: u16 = 512;
/// Bytes of text in a page, so that it fits in any reply mailbox.
const PAGE_BYTES: usize = 2500;

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct Settings {}

impl super::check::Settings for Settings {}

pub(super) struct OutputModule {
    ring: VecDeque<OutputLine>,
    ring_max: usize,
    /// Lines that have left the ring.
    gone: u64,
    file: Option<File>,
}

impl Module for OutputModule {
    type Settings = Settings;
    type Interfaces = CollectorInterface;

    fn new(_: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let output = context.installation().output.clone();
        let file = match &output.file {
            Some(path) => {
                let file = File::options().create(true).append(true).open(path);
                Some(file.map_err(|error| ModuleError::new(format!("output file {}: {error}", path.display())))?)
            }
            None => None,
        };
        context.open_mailbox(LINES, Shape { slots: SLOTS, body_bytes_max: 1024, ..Shape::default() })?;
        let ring_max = output.ring as usize;
        Ok(Self { ring: VecDeque::with_capacity(ring_max.min(10_000)), ring_max, gone: 0, file })
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

impl OutputModule {
    fn write(&mut self, line: &OutputLine, context: &Context) {
        let Some(file) = &mut self.file else { return };
        let module = context.installation().classes.format(line.module());
        let text = format!("{} {:5} {module}: {}\n", line.time_text(), line.level.name(), line.text);
        if let Err(error) = file.write_all(text.as_bytes()) {
            // A full disk must not end the collector: the ring and the subscribers go on. Said once.
            tracing::error!("the output file cannot be written any more: {error}");
            self.file = None;
        }
    }
}

impl Collector for OutputModule {
    fn lines_from(&mut self, number: u64) -> Page {
        let first = number.max(self.gone);
        let mut bytes = 0;
        let fits = |line: &&OutputLine| {
            bytes += line.text.len() + 24;
            bytes <= PAGE_BYTES
        };
        let skip = usize::try_from(first - self.gone).unwrap_or(usize::MAX);
        let lines = self.ring.iter().skip(skip).take_while(fits).cloned().collect();
        Page { first, next: self.gone + self.ring.len() as u64, lines }
    }
}
