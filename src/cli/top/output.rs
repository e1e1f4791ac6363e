//! The newest output lines, followed in the collector's ring.

use super::app::LineFilter;
use super::draw::OutputText;
use rohrpost::Name;
use rohrpost::config::Installation;
use rohrpost::interface::Interface;
use rohrpost::interfaces::{CollectorInterface, Page};
use rohrpost::output::OutputLine;
use std::collections::VecDeque;

/// Lines that were said before, and that are kept.
const BACKLOG: u64 = 200;
const KEPT: usize = 2000;
/// No screen shows more.
const SHOWN: usize = 500;

/// What was said, as far as it is kept here.
pub(super) struct Output {
    collector: Option<Name>,
    lines: VecDeque<OutputLine>,
    /// Number of the next line, in this life of the collector; none until it has said how far it is.
    next: Option<(u32, u64)>,
    /// Why there is none.
    pub(super) silence: Option<String>,
}

impl Output {
    /// Of the installation's collector.
    pub(super) fn new(installation: &Installation) -> Self {
        let class = installation.classes.id(CollectorInterface::CLASS);
        let name = class.map(|class| Name::new(installation.system.id, class.0, 0, 0));
        let collector = name.filter(|name| installation.module(*name).is_some());
        let silence = collector.is_none().then(|| "the configuration has no module `output.0`".into());
        Self { collector, lines: VecDeque::new(), next: None, silence }
    }

    /// Whom to ask for lines, and from which number on.
    pub(super) fn wants(&self) -> Option<(Name, u64)> {
        // No line has the highest number: the answer tells how far the collector is.
        Some((self.collector?, self.next.map_or(u64::MAX, |(_, next)| next)))
    }

    /// Takes the collector's answer; true when there is more to ask for at once.
    pub(super) fn take(&mut self, page: Result<Page, String>) -> bool {
        let page = match page {
            Ok(page) => page,
            Err(error) => {
                self.silence = Some(error);
                return false;
            }
        };
        self.silence = None;
        if self.next.is_none_or(|(life, _)| life != page.life) {
            // The first time, or the collector began anew.
            self.next = Some((page.life, page.next.saturating_sub(BACKLOG)));
            return page.next > 0;
        }
        let more = !page.lines.is_empty();
        let next = page.first + page.lines.len() as u64;
        self.next = Some((page.life, next));
        self.lines.extend(page.lines);
        let excess = self.lines.len().saturating_sub(KEPT);
        self.lines.drain(..excess);
        more && next < page.next
    }

    /// The newest lines that pass, as they are shown.
    pub(super) fn shown(&self, installation: &Installation, filter: LineFilter) -> Vec<OutputText> {
        let passing = self.lines.iter().rev().filter(|line| filter.passes(line)).take(SHOWN);
        let mut shown: Vec<OutputText> = passing.map(|line| shown(installation, line)).collect();
        shown.reverse();
        shown
    }
}

fn shown(installation: &Installation, line: &OutputLine) -> OutputText {
    let lost = if line.lost > 0 { format!("({} lines lost) ", line.lost) } else { String::new() };
    let (time, level, module) = (line.time_text(), line.level.name(), installation.classes.format(line.module()));
    OutputText { level: line.level, text: format!("{time} {level:5} {module}: {lost}{}", line.text) }
}
