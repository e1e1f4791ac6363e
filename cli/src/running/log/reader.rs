//! Reads the collector's lines page by page, across its restarts.
//!
//! Polling pages costs less than a subscription: a quiet collector answers one short command five times a second, at
//! the lowest priority, instead of sending a package for each line; nothing must be renewed; and a slow or stopped
//! reader misses nothing that the collector still keeps, and notices what it missed.

use crate::look::target::Running;
use crate::terminal::Failure;
use rohrpost::interface::Interface;
use rohrpost::interfaces::{CollectorInterface, Page};
use rohrpost::output::OutputLine;
use rohrpost::{CallError, Fault, Name, ToolLink};
use rohrpost_config::Installation;

/// Number of `lines_from` in the collector's interface.
pub(crate) const LINES_FROM: u16 = 16;

/// The collector of output of an installation, also where that has no such module; none without its class.
pub(crate) fn collector(installation: &Installation) -> Option<Name> {
    let class = installation.classes.id(CollectorInterface::CLASS)?;
    Some(Name::new(installation.system.id, class.0, 0, 0))
}

pub(super) struct Reader<'a> {
    running: &'a Running,
    collector: Name,
    /// Whether launch ran at the start; if so, the node ends with it.
    launched: bool,
    /// The collector's incarnation that `next` belongs to.
    incarnation: Option<u32>,
    next: u64,
    /// Whether the reader waits for a collector.
    waiting: bool,
}

/// The result of one poll.
pub(super) struct News {
    pub(super) lines: Vec<OutputLine>,
    /// A notice to print before the lines.
    pub(super) note: Option<String>,
    /// Whether there is more to read at once.
    pub(super) more: bool,
}

impl<'a> Reader<'a> {
    pub(super) fn new(running: &'a Running, collector: Name) -> Self {
        // For a collector on another node this is unknown: the reader waits for it.
        let launched = running.is_own(collector) && running.node.launcher().is_some();
        Self { running, collector, launched, incarnation: None, next: 0, waiting: false }
    }

    /// The next page. A follower waits for a collector that has answered once.
    pub(super) fn read(&mut self, tool: &mut ToolLink, follow: bool) -> Result<News, Failure> {
        match self.page(tool) {
            Ok(page) => Ok(self.take(page)),
            Err(error) if follow && self.incarnation.is_some() => self.missed(&error),
            Err(error) => Err(told(self.running, self.collector, &error).into()),
        }
    }

    fn page(&self, tool: &mut ToolLink) -> Result<Page, CallError> {
        let from = self.next;
        let write = |body: &mut Vec<u8>| rohrpost::wire::append(body, &(from,));
        let read = |bytes: &[u8]| rohrpost::wire::from_bytes::<Page>(bytes);
        tool.call(self.collector, LINES_FROM, CollectorInterface::hash(), write, read)
    }

    fn take(&mut self, page: Page) -> News {
        let name = self.running.text(self.collector);
        let waited = std::mem::take(&mut self.waiting);
        let known = self.incarnation.replace(page.life);
        if known.is_some_and(|incarnation| incarnation != page.life) {
            // This page's numbers belong to the new incarnation; it may begin in the middle.
            self.next = 0;
            let file = &self.running.installation.output.file;
            let file = file.as_ref().map(|file| format!("; {} has them", file.display())).unwrap_or_default();
            let note = format!("{name} was started again; the lines since the last one above are lost{file}");
            return News { lines: Vec::new(), note: Some(note), more: true };
        }
        let skipped = page.first.saturating_sub(self.next);
        let note = match (skipped, known) {
            (1.., Some(_)) => Some(format!("{skipped} lines are lost: {name} keeps fewer")),
            _ if waited => Some(format!("{name} answers again")),
            _ => None,
        };
        self.next = page.first + page.lines.len() as u64;
        News { more: !page.lines.is_empty() && self.next < page.next, lines: page.lines, note }
    }

    /// Reported once; after that the reader waits silently.
    fn missed(&mut self, error: &CallError) -> Result<News, Failure> {
        if self.launched && self.running.node.launcher().is_none() {
            let node = &self.running.node_name;
            return Err(format!("launch has ended, and node `{node}` with it; nobody collects output any more").into());
        }
        let said = std::mem::replace(&mut self.waiting, true);
        let why = || format!("{} Waiting for it.", told(self.running, self.collector, error));
        Ok(News { lines: Vec::new(), note: (!said).then(why), more: false })
    }
}

/// A missing answer, and what to do about it.
fn told(running: &Running, collector: Name, error: &CallError) -> String {
    let name = running.text(collector);
    let said = running.told(collector, error).to_string();
    match error {
        CallError::Fault(_, Fault::ModuleOff) => {
            format!("the collector {name} is switched off: `rohrpost call {name} on` switches it on")
        }
        CallError::Timeout(..) => {
            format!(
                "{said} It hangs or is stopped: `rohrpost list` shows its process; if you end that, launch starts \
                 another"
            )
        }
        CallError::NotSent(_) => format!("{said} It collects what modules say; `rohrpost list` shows what runs"),
        _ => said,
    }
}
