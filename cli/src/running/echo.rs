//! `rohrpost echo`: prints the data that a module publishes, using the module's own description.

use crate::look::observer::PATIENCE;
use crate::look::target::{Running, Target};
use crate::measure::stream::too_large_for_data;
use crate::terminal::{Failure, complain, say, say_folded};
use rohrpost::common::{DataHead, SUBSCRIBE, Subscribe, UNSUBSCRIBE, Unsubscribe};
use rohrpost::output::plain;
use rohrpost::schema::{DataItem, Description, decode};
use rohrpost::{Name, ToolLink};
use rohrpost_mailbox::{Kind, local};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Lease of a subscription; it is renewed three times in this time.
const LEASE: Duration = Duration::from_secs(3);

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost echo odometry.0                 each value; Ctrl-C ends it
  rohrpost echo laser.0 scan --rate 1      the newest scan once a second
  rohrpost echo odometry.0 --count 3 --json")]
pub(crate) struct Arguments {
    /// Module, such as laser.0.
    name: String,
    /// Data; optional if the module publishes only one kind.
    data: Option<String>,
    #[command(flatten)]
    target: Target,
    /// Highest rate, values a second; 0 for all.
    #[arg(long, default_value_t = 0.0, value_name = "HZ", value_parser = crate::terminal::units::rate_or_all)]
    rate: f64,
    /// End after this many values.
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// Fail when no data comes for this time, seconds; 0 waits for ever.
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    timeout: f64,
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let module = running.module(&arguments.name)?;
    let mut tool = running.join(PATIENCE)?;
    let result = echo(arguments, &running, module, &mut tool);
    result.map(|()| ExitCode::SUCCESS).map_err(|error| running.told(module, &*error))
}

fn echo(arguments: &Arguments, running: &Running, module: Name, tool: &mut ToolLink) -> Result<(), Failure> {
    let description = tool.describe(module)?;
    let item = choose(&description, arguments.data.as_deref())
        .map_err(|error| format!("{}: {error}", running.text(module)))?;
    if let Some(why) = too_large_for_data(running, module, item) {
        return Err(why);
    }
    let rate_us = if arguments.rate > 0.0 { (1e6 / arguments.rate) as u32 } else { 0 };
    let mailbox = local::DATA;
    let wish =
        Subscribe { number: item.number, id: 1, period_us: rate_us, lease_ms: LEASE.as_millis() as u32, mailbox };
    let result = follow(arguments, running, &description, item, (module, wish), tool);
    // The module may have ended; the lease would expire anyway.
    let _ = tool.common::<()>(module, UNSUBSCRIBE, &Unsubscribe { id: wish.id, mailbox });
    result
}

/// Values that could not be decoded.
#[derive(Default)]
struct UnreadableValues {
    /// Why, as it was told last.
    told: String,
}

impl UnreadableValues {
    /// Whether this is another reason than that of the one before.
    fn is_news(&mut self, why: &str) -> bool {
        let is_news = self.told != why;
        if is_news {
            self.told = why.into();
        }
        is_news
    }
}

fn choose<'a>(description: &'a Description, name: Option<&str>) -> Result<&'a DataItem, Failure> {
    let names = || description.data.iter().map(|item| item.field.name.as_str()).collect::<Vec<_>>().join(", ");
    match (name, &description.data[..]) {
        (_, []) => Err("publishes no data; `rohrpost call NAME` lists what it offers".into()),
        (None, [only]) => Ok(only),
        (None, _) => Err(format!("which data? it has: {}", names()).into()),
        (Some(name), _) => {
            description.data_item(name).ok_or_else(|| format!("no data `{name}`; it has: {}", names()).into())
        }
    }
}

fn follow(
    arguments: &Arguments,
    running: &Running,
    description: &Description,
    item: &DataItem,
    (module, wish): (Name, Subscribe),
    tool: &mut ToolLink,
) -> Result<(), Failure> {
    tool.data()?;
    // Data that an earlier program subscribed to under this name may still arrive for a while.
    let incarnation = tool.link.incarnation();
    let patience = crate::terminal::units::seconds(arguments.timeout)?;
    let (mut renew_at, mut count) = (Instant::now(), 0);
    let mut last_at = Instant::now();
    let mut unreadable = UnreadableValues::default();
    let stop = rohrpost_launch::events()?;
    loop {
        if Instant::now() >= renew_at {
            let write = |body: &mut Vec<u8>| rohrpost::wire::append(body, &wish);
            tool.call(module, SUBSCRIBE, description.hash(), write, |_| Ok(()))?;
            renew_at = Instant::now() + LEASE / 3;
            if last_at.elapsed() >= LEASE / 3
                && let Some(failure) = running.in_error(module)
            {
                return Err(failure);
            }
        }
        if let Ok(rohrpost_launch::Event::Stop) = stop.try_recv() {
            return Ok(());
        }
        if !patience.is_zero() && last_at.elapsed() > patience {
            return Err(format!("no data within {patience:?}").into());
        }
        let Some(package) = tool.data()?.receive_timeout(Duration::from_millis(50)) else { continue };
        let Kind::Data(number) = package.head().kind.kind() else { continue };
        let Some((head, value)) = DataHead::split(package.body()) else { continue };
        let (from, id) = (package.head().from.module(), package.head().id);
        if (number, from, id, head.incarnation) != (item.number, module, wish.id, incarnation) {
            continue;
        }
        last_at = Instant::now();
        let value = match decode(&item.field.ty, value) {
            Ok(value) => value,
            Err(error) => {
                let why = error.to_string();
                if unreadable.is_news(&why) {
                    let (name, data) = (&arguments.name, plain::line(&item.field.name));
                    complain(format_args!("{name} {data}: left out, as others like it will be: {}", plain::line(&why)));
                }
                continue;
            }
        };
        let line = if arguments.json {
            let stamped = serde_json::json!({
                "time_ns": head.stamp_ns, "sequence": head.sequence, "missed": head.missed, "value": value,
            });
            stamped.to_string()
        } else {
            format!("{}.{:09} #{} {value}", head.stamp_ns / 1_000_000_000, head.stamp_ns % 1_000_000_000, head.sequence)
        };
        count += 1;
        let is_read = if arguments.json { say(line) } else { say_folded(line) };
        if !is_read || arguments.count.is_some_and(|wanted| count >= wanted) {
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn why_values_are_left_out_is_told_when_it_changes() {
        let mut values = UnreadableValues::default();
        assert_eq!(
            ["too many", "too many", "cut", "too many"].map(|why| values.is_news(why)),
            [true, false, true, true]
        );
    }
}
