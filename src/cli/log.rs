//! `rohrpost log`: what modules say.

use super::target::{Running, Target};
use super::{Failure, say};
use rohrpost::common::OutputLevel;
use rohrpost::interface::Interface;
use rohrpost::interfaces::{CollectorInterface, Page};
use rohrpost::output::OutputLine;
use rohrpost::{Name, ToolLink};
use std::process::ExitCode;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(1);
/// New lines are asked for so often.
const POLL: Duration = Duration::from_millis(200);
/// Number of `lines_from` in the collector's interface.
pub(super) const LINES_FROM: u16 = 16;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost log                       what was said so far
  rohrpost log --follow              and what is said from now on
  rohrpost log --module pilot.0 --level warn")]
pub(super) struct Arguments {
    #[command(flatten)]
    target: Target,
    /// Go on with new lines until Ctrl-C.
    #[arg(long, short)]
    follow: bool,
    /// Only lines as important as this: error, warn, info, debug, trace.
    #[arg(long, default_value = "trace", value_name = "LEVEL")]
    level: String,
    /// Only lines of this module.
    #[arg(long, value_name = "NAME")]
    module: Option<String>,
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
}

struct Filter {
    level: OutputLevel,
    module: Option<Name>,
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let class = running.installation.classes.id(CollectorInterface::CLASS);
    let class = class.ok_or("the configuration has no class `output`, so nobody collects output")?;
    let collector = Name::new(running.installation.system.id, class.0, 0, 0);
    let filter = Filter {
        level: super::call::level_of(&arguments.level)?,
        module: arguments.module.as_deref().map(|name| running.module(name)).transpose()?,
        json: arguments.json,
    };
    let mut tool = running.join(PATIENCE)?;
    let stop = rohrpost::launch::events()?;
    let mut next = 0;
    let result = loop {
        match show(&running, collector, &filter, &mut next, &mut tool) {
            Ok(true) if arguments.follow => {}
            Ok(_) => break Ok(ExitCode::SUCCESS),
            Err(error) => break Err(error),
        }
        if let Ok(rohrpost::launch::Event::Stop) = stop.recv_timeout(POLL) {
            break Ok(ExitCode::SUCCESS);
        }
    };
    tool.close();
    result.map_err(|error: Failure| running.told(collector, &*error))
}

/// Prints all lines from `next` on; false when nobody reads any more.
fn show(
    running: &Running,
    collector: Name,
    filter: &Filter,
    next: &mut u64,
    tool: &mut ToolLink,
) -> Result<bool, Failure> {
    loop {
        let from = *next;
        let write = |body: &mut Vec<u8>| rohrpost::macro_support::append(body, &(from,));
        let read = |bytes: &[u8]| rohrpost::macro_support::from_bytes::<Page>(bytes);
        let page = tool.call(collector, LINES_FROM, CollectorInterface::hash(), write, read)?;
        if page.first > from && from > 0 {
            say(format_args!("... {} lines are gone: the collector keeps fewer", page.first - from));
        }
        for line in &page.lines {
            if !filter.passes(line) {
                continue;
            }
            if !filter.print(running, line)? {
                return Ok(false);
            }
        }
        *next = page.first + page.lines.len() as u64;
        if page.lines.is_empty() || *next >= page.next {
            return Ok(true);
        }
    }
}

impl Filter {
    fn passes(&self, line: &OutputLine) -> bool {
        line.level <= self.level && self.module.is_none_or(|module| module == line.module())
    }

    fn print(&self, running: &Running, line: &OutputLine) -> Result<bool, Failure> {
        let module = running.text(line.module());
        if self.json {
            let object = serde_json::json!({
                "time_ns": line.time_ns, "node": running.node_name, "module": module,
                "level": line.level.name(), "lost_before": line.lost, "text": line.text,
            });
            return Ok(say(object));
        }
        if line.lost > 0 && !say(format_args!("... {} lines of {module} were lost", line.lost)) {
            return Ok(false);
        }
        Ok(say(format_args!("{} {:5} {module}: {}", line.time_text(), line.level.name(), line.text)))
    }
}
