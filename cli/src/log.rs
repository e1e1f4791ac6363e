//! `rohrpost log`: what modules say, and how much of it.

mod filter;
mod levels;
mod reader;

use super::target::{Running, Target};
use crate::terminal::{Failure, complain, say};
use filter::Filter;
use levels::Setting;
use reader::Reader;
use rohrpost::Name;
use rohrpost::interface::Interface;
use rohrpost::interfaces::CollectorInterface;
use rohrpost::output::{Format, OutputLine};
use std::collections::VecDeque;
use std::process::ExitCode;
use std::time::Duration;

/// New lines are asked for so often.
const POLL: Duration = Duration::from_millis(200);
/// Number of `lines_from` in the collector's interface.
pub(super) const LINES_FROM: u16 = 16;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost log                           what was said so far
  rohrpost log --follow                  and what is said from now on
  rohrpost log --level warn              only warnings and errors
  rohrpost log --module pilot.0 --text wall --since '5 min'
  rohrpost log --level pilot.0=debug     makes pilot.0 say more; with --follow, and shows it
  rohrpost log --level laser=error       makes all lasers say errors only
  rohrpost log --levels                  from which level on each module speaks")]
pub(super) struct Arguments {
    #[command(flatten)]
    target: Target,
    /// Go on with new lines until Ctrl-C.
    #[arg(long, short)]
    follow: bool,
    /// LEVEL: only lines as important as this: error, warn, info, debug, trace. NAME=LEVEL: set from which level on this
    /// module, or each of this class, speaks, until it starts anew.
    #[arg(long, value_name = "LEVEL|NAME=LEVEL")]
    level: Vec<String>,
    /// List from which level on each module speaks.
    #[arg(long, conflicts_with_all = ["follow", "level"])]
    levels: bool,
    /// Only lines of this module; may be given several times.
    #[arg(long, value_name = "NAME")]
    module: Vec<String>,
    /// Only lines of modules of this class; may be given several times.
    #[arg(long, value_name = "CLASS")]
    class: Vec<String>,
    /// Only lines that contain this, in small or capital letters.
    #[arg(long)]
    text: Option<String>,
    /// Only lines of the last while, such as '5 min'.
    #[arg(long, value_name = "DURATION")]
    since: Option<String>,
    /// Only the last lines, so many.
    #[arg(long, short = 'n', value_name = "COUNT")]
    last: Option<usize>,
    /// Wait so long for each answer, seconds.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    timeout: f64,
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
}

impl Arguments {
    /// Whether something here says which lines to show.
    fn chooses_lines(&self) -> bool {
        let level = self.level.iter().any(|level| !level.contains('='));
        level
            || !(self.module.is_empty() && self.class.is_empty())
            || self.text.is_some()
            || self.since.is_some()
            || self.last.is_some()
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let class = running.installation.classes.id(CollectorInterface::CLASS);
    let class = class.ok_or("the configuration has no class `output`, so nobody collects output")?;
    let collector = Name::new(running.installation.system.id, class.0, 0, 0);
    let (settings, mut filter) = Filter::read(arguments, &running)?;
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
    let mut tool = running.join(super::units::seconds(arguments.timeout)?)?;
    if arguments.levels {
        let code = levels::list(&running, arguments.json, &mut tool);
        tool.close();
        return code;
    }
    let code = levels::set(&settings, &running, arguments, &mut tool);
    if !settings.is_empty() && !arguments.follow {
        tool.close();
        return Ok(code);
    }
    filter.since_ns = since.map(|since| tool.clock.now().ns.saturating_sub(since.as_nanos() as u64));
    let show = Show { filter, format: Format::new(&running.installation), arguments };
    let mut reader = Reader::new(&running, collector);
    let result = show.all(&mut reader, &mut tool);
    tool.close();
    result.map(|()| code)
}

/// What is shown, and how.
struct Show<'a> {
    filter: Filter,
    format: Format<'a>,
    arguments: &'a Arguments,
}

impl Show<'_> {
    fn all(&self, reader: &mut Reader<'_>, tool: &mut rohrpost::ToolLink) -> Result<(), Failure> {
        let stop = rohrpost::launch::events()?;
        // With --last, what was said before is shown when all of it has been seen.
        let mut last = VecDeque::new();
        let keep = |line: OutputLine| {
            last.push_back(line);
            if last.len() > self.arguments.last.unwrap_or(0) {
                last.pop_front();
            }
            true
        };
        if self.arguments.last.is_some() {
            self.pages(reader, tool, keep)?;
        }
        if !last.iter().all(|line| self.line(line)) {
            return Ok(());
        }
        while self.pages(reader, tool, |line| self.line(&line))? && self.arguments.follow {
            if let Ok(rohrpost::launch::Event::Stop) = stop.recv_timeout(POLL) {
                break;
            }
        }
        Ok(())
    }

    /// All pages that are there; false when nobody reads any more.
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

    fn line(&self, line: &OutputLine) -> bool {
        say(if self.arguments.json { self.format.json(line) } else { self.format.short(line) })
    }

    /// A word of ours between the lines; programs read lines alone.
    fn note(&self, note: &str) -> bool {
        if self.arguments.json {
            complain(format_args!("… {note}"));
            return true;
        }
        say(format_args!("… {note}"))
    }
}

/// An answer that did not come, with what to do about it.
fn told(running: &Running, collector: Name, error: &rohrpost::CallError) -> String {
    use rohrpost::{CallError, Fault};
    let name = running.text(collector);
    let said = running.told(collector, error).to_string();
    match error {
        CallError::Fault(_, Fault::ModuleOff) => {
            format!("the collector {name} is switched off: `rohrpost call {name} on` switches it on")
        }
        CallError::Timeout(..) => {
            format!(
                "{said} It hangs or is stopped: `rohrpost list` shows its process; if you end that, launch starts another"
            )
        }
        CallError::NotSent(_) => format!("{said} It collects what modules say; `rohrpost list` shows what runs"),
        _ => said,
    }
}
