//! The newest output lines, followed in the collector's ring.

use super::app::LineFilter;
use super::draw::OutputText;
use crate::running::log::collector;
use rohrpost::Name;
use rohrpost::interfaces::Page;
use rohrpost::output::OutputLine;
use rohrpost_builtin::format::Format;
use rohrpost_config::Installation;
use std::collections::VecDeque;

/// Number of kept lines.
const BACKLOG: u64 = 200;
const KEPT: usize = 2000;
/// No screen shows more.
const SHOWN: usize = 500;

/// The lines that are kept here.
pub(super) struct Output {
    collector: Option<Name>,
    lines: VecDeque<OutputLine>,
    /// The collector's incarnation that `next` belongs to; none before its first answer.
    incarnation: Option<u32>,
    next: u64,
    /// Why there are no lines.
    pub(super) silence: Option<String>,
}

impl Output {
    pub(super) fn new(installation: &Installation) -> Self {
        let collector = collector(installation).filter(|name| installation.module(*name).is_some());
        let silence = collector.is_none().then(|| "the configuration has no module `output.0`".into());
        Self { collector, lines: VecDeque::new(), incarnation: None, next: u64::MAX, silence }
    }

    /// The collector to ask, and the first line to ask for.
    pub(super) fn purpose(&self) -> Option<(Name, u64)> {
        // No line has the highest number: the first answer only tells the collector's position.
        Some((self.collector?, self.next))
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
        if self.incarnation != Some(page.life) {
            (self.incarnation, self.next) = (Some(page.life), page.next.saturating_sub(BACKLOG));
            return page.next > 0;
        }
        let more = !page.lines.is_empty();
        self.next = page.first + page.lines.len() as u64;
        self.lines.extend(page.lines);
        let excess = self.lines.len().saturating_sub(KEPT);
        self.lines.drain(..excess);
        more && self.next < page.next
    }

    /// The newest lines that pass the filter, in the displayed form.
    pub(super) fn shown(&self, installation: &Installation, filter: LineFilter) -> Vec<OutputText> {
        let format = Format::new(installation);
        let passing = self.lines.iter().rev().filter(|line| filter.passes(line)).take(SHOWN);
        let shown = passing.map(|line| OutputText { level: line.level, text: format.short(line) });
        let mut shown: Vec<OutputText> = shown.collect();
        shown.reverse();
        shown
    }
}
