//! `rohrpost log`: shows the output of modules, also of recordings, and sets its level.

mod arguments;
mod levels;
mod reader;
mod recorded;
mod show;

use crate::terminal::Failure;
pub(crate) use arguments::Arguments;
use arguments::Filter;
use levels::Setting;
use reader::Reader;
pub(crate) use reader::{LINES_FROM, collector};
use rohrpost::output::OutputLine;
use rohrpost_builtin::format::Format;
use show::{Show, keep_last};
use std::collections::VecDeque;
use std::process::ExitCode;
use std::time::Duration;

pub(crate) const POLL: Duration = Duration::from_millis(200);

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    if !arguments.file.is_empty() {
        return recorded::run(arguments);
    }
    let running = arguments.target.find()?;
    let collector = collector(&running.installation);
    let collector = collector.ok_or("the configuration has no class `output`, so nobody collects output")?;
    let (settings, mut filter) = Filter::read(arguments, &running.installation, &|text| running.module(text))?;
    let settings: Vec<Setting> =
        settings.iter().map(|(name, level)| Setting::read(name, level, &running)).collect::<Result<_, _>>()?;
    let since = arguments.since.as_deref().map(rohrpost_config::parse_duration).transpose()?;
    if !settings.is_empty() && !arguments.follow && arguments.chooses_lines() {
        return Err(
            "--level NAME=LEVEL sets a level and shows no lines, so there are none to choose; add --follow to \
                    see lines too, or leave out what chooses them"
                .into(),
        );
    }
    let mut tool = running.join(crate::terminal::units::seconds(arguments.timeout)?)?;
    if arguments.levels {
        return levels::list(&running, arguments.json, &mut tool);
    }
    let code = levels::set(&settings, &running, arguments, &mut tool);
    if !settings.is_empty() && !arguments.follow {
        return Ok(code);
    }
    filter.since_ns = since.map(|since| tool.clock.now().ns.saturating_sub(since.as_nanos() as u64));
    let show = Show { filter, format: Format::new(&running.installation), arguments };
    let mut reader = Reader::new(&running, collector);
    show.all(&mut reader, &mut tool).map(|()| code)
}

impl Show<'_> {
    fn all(&self, reader: &mut Reader<'_>, tool: &mut rohrpost::ToolLink) -> Result<(), Failure> {
        let stop = rohrpost_launch::events()?;
        // With --last, earlier lines are shown after all of them have been read.
        let mut last = VecDeque::new();
        let keep = |line: OutputLine| {
            keep_last(&mut last, line, self.arguments.last.unwrap_or(0));
            true
        };
        if self.arguments.last.is_some() {
            self.pages(reader, tool, keep)?;
        }
        if !last.iter().all(|line| self.line(line)) {
            return Ok(());
        }
        while self.pages(reader, tool, |line| self.line(&line))? && self.arguments.follow {
            if let Ok(rohrpost_launch::Event::Stop) = stop.recv_timeout(POLL) {
                break;
            }
        }
        Ok(())
    }

    /// Reads all available pages; false when nobody reads any more.
    fn pages(
        &self,
        reader: &mut Reader<'_>,
        tool: &mut rohrpost::ToolLink,
        mut show: impl FnMut(OutputLine) -> bool,
    ) -> Result<bool, Failure> {
        loop {
            let news = reader.read(tool, self.arguments.follow)?;
            if !news.note.is_none_or(|note| self.note(&note)) {
                return Ok(false);
            }
            let mut lines = news.lines.into_iter().filter(|line| self.filter.passes(line));
            if !lines.all(&mut show) {
                return Ok(false);
            }
            if !news.more {
                return Ok(true);
            }
        }
    }
}
