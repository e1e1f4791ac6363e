//! `launch --log`: what the modules of a node say, asked of the collector page by page. Nothing here waits for it.

use crate::running::log::{LINES_FROM, POLL, collector};
use crate::terminal::Failure;
use rohrpost::Name;
use rohrpost::common::OutputLevel;
use rohrpost::interfaces::{CollectorInterface, Page};
use rohrpost_builtin::format::Format;
use rohrpost_config::Installation;
use rohrpost_launch::Launch;
use std::time::{Duration, Instant};

/// The lines that come, of this severity and above.
pub(super) struct LogLines {
    least: OutputLevel,
    node: String,
    collector: Name,
    /// The collector's incarnation that `next` belongs to.
    incarnation: Option<u32>,
    next: u64,
    /// The question that is under way.
    call: Option<u32>,
    ask_at: Instant,
}

impl LogLines {
    /// Of the modules of this node.
    ///
    /// # Errors
    /// When nobody collects what modules say.
    pub(super) fn new(installation: &Installation, node: &str, least: OutputLevel) -> Result<Self, Failure> {
        let collector = collector(installation).filter(|name| installation.module(*name).is_some());
        let collector = collector.ok_or_else(|| {
            format!(
                "--log shows what the collector of output has, and {} has none; add a module with `builtin \
                 = \"output\"`",
                installation.shown.display()
            )
        })?;
        let node = node.to_owned();
        Ok(Self { least, node, collector, incarnation: None, next: 0, call: None, ask_at: Instant::now() })
    }

    /// Time until the next question.
    pub(super) fn wait(&self) -> Duration {
        match self.call {
            // Its answer wakes launch.
            Some(_) => POLL,
            None => self.ask_at.saturating_duration_since(Instant::now()),
        }
    }

    /// What has come.
    pub(super) fn take(&mut self, launch: &mut Launch) -> Vec<String> {
        let Some(call) = self.call else {
            self.ask(launch);
            return Vec::new();
        };
        let read = |bytes: &[u8]| rohrpost::wire::from_bytes::<Page>(bytes);
        let Some(answer) = launch.tool().link.poll_for(call, read) else { return Vec::new() };
        self.call = None;
        // A collector that does not answer is asked again; that it does not run, is in the table.
        let Ok(page) = answer else { return Vec::new() };
        if self.incarnation.replace(page.life).is_some_and(|known| known != page.life) {
            // It counts anew.
            self.next = 0;
            return Vec::new();
        }
        self.next = page.first + page.lines.len() as u64;
        if self.next < page.next && !page.lines.is_empty() {
            self.ask_at = Instant::now();
        }
        let installation = launch.installation();
        let is_own = |module| installation.node_of(module) == Some(&*self.node);
        let lines = page.lines.iter().filter(|line| line.level <= self.least && is_own(line.module()));
        lines.map(|line| Format::new(installation).short(line)).collect()
    }

    fn ask(&mut self, launch: &mut Launch) {
        if Instant::now() < self.ask_at {
            return;
        }
        self.ask_at = Instant::now() + POLL;
        let from = self.next;
        let write = |body: &mut Vec<u8>| rohrpost::wire::append(body, &(from,));
        self.call = launch.tool().begin(self.collector, LINES_FROM, CollectorInterface::hash(), write).ok();
    }
}
