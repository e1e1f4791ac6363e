//! `stream interp`.

use super::between::between;
use super::choice::{ChosenStream, StreamChoice};
use super::output::{RecordContent, RecordForm, RecordObject};
use super::refusal::{AroundRefusal, around_or_refusal};
use super::stamp::{StreamMoment, parse_moment, stamp_text};
use crate::terminal::units::{LOOK, Stop};
use crate::terminal::{Failure, say, say_folded};
use rohrpost::Name;
use rohrpost::fusion::Share;
use rohrpost::schema::{Field, Value, decode};
use rohrpost_config::parse_duration;
use rohrpost_mailbox::{Participant, RecordInfo, Stamp, StreamReader};
use serde::Serialize;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Looks for the two records before it says that they left the ring meanwhile.
const TRIES: usize = 3;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost stream interp odometry.0 odometry --at -1.5s               1.5 s before the newest record
  rohrpost stream interp odometry.0 odometry --at 1700000000.25       a stamp as they are printed
  rohrpost stream interp odometry.0 odometry --at +0.1s --wait 1s     as soon as it is known
Numbers with a fraction go in a straight line, those of unit rad the short way round; all else comes from the record \
that is nearer in time. A value that is printed is final. Takes a reader's seat while it runs; the writer waits for no \
reader.")]
pub(super) struct InterpArguments {
    #[command(flatten)]
    stream: StreamChoice,
    /// The time: a stamp as they are printed, or ns since 1970, or from the newest record on, such as -1.5s.
    #[arg(long, value_name = "TIME", value_parser = parse_moment, allow_hyphen_values = true)]
    at: StreamMoment,
    /// Epoch of that time; default: that of the newest record.
    #[arg(long)]
    epoch: Option<u64>,
    /// Wait so long for records that decide, such as 500ms.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration, default_value = "0s",
        hide_default_value = true)]
    wait: Duration,
    /// Fail when the two records are further apart than this; default: however far they are.
    #[arg(long, value_name = "DURATION", value_parser = parse_duration)]
    gap: Option<Duration>,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

/// The value at a time, and the two records that it comes from.
struct Interpolated {
    at: Stamp,
    share: Share,
    value: Value,
    before: (RecordInfo, Value),
    after: (RecordInfo, Value),
}

#[derive(Serialize)]
struct InterpolatedObject {
    value: Value,
    stamp_ns: u64,
    epoch: u64,
    /// How much of the time between the two has gone by, 0 to 1.
    share: f64,
    before: RecordObject,
    after: RecordObject,
}

pub(super) fn run(arguments: &InterpArguments) -> Result<ExitCode, Failure> {
    let chosen = arguments.stream.find()?;
    chosen.inspect()?;
    let Some(item) = &chosen.item else {
        return Err(format!(
            "stream {}: no module has left a description of it here, so there is nothing to interpolate by; `rohrpost \
             stream read` with the same --at prints the two records",
            chosen.text()
        )
        .into());
    };
    let participant = Participant::join(&chosen.running.node, Name::NONE)?;
    let reader = participant.stream_reader(chosen.id).map_err(|error| chosen.failure(&error))?;
    let mut search = ValueSearch { arguments, chosen: &chosen, field: &item.field, reader, at: None };
    match search.value()? {
        Ok(found) => found.say(arguments.json),
        Err(refusal) => refusal.told(&chosen.text(), arguments.json),
    }
}

/// A time that is looked for, until the answer is final or the patience ends.
struct ValueSearch<'a> {
    arguments: &'a InterpArguments,
    chosen: &'a ChosenStream,
    field: &'a Field,
    reader: StreamReader,
    /// The time; none before there is a record, as the epoch is that of the newest.
    at: Option<Stamp>,
}

impl ValueSearch<'_> {
    fn value(&mut self) -> Result<Result<Interpolated, AroundRefusal>, Failure> {
        let (stop, began) = (Stop::new()?, Instant::now());
        loop {
            let found = self.value_now()?;
            let left = self.arguments.wait.saturating_sub(began.elapsed());
            let may_change = found.as_ref().err().is_some_and(|refusal| refusal.may_change);
            if !may_change || left.is_zero() || stop.within(Duration::ZERO) {
                return Ok(found);
            }
            // Until the next record is there, which decides.
            let failure = |error| self.chosen.failure(&error);
            self.reader.next_timeout(left.min(LOOK)).map_err(failure)?;
            self.reader.pass_over().map_err(failure)?;
        }
    }

    /// The value as far as records decide it now; as `Stream::at` finds it.
    fn value_now(&mut self) -> Result<Result<Interpolated, AroundRefusal>, Failure> {
        let Some(at) = self.at()? else { return Ok(Err(AroundRefusal::empty())) };
        let mut by_ns = 0;
        // Again if the writer has put others in their place meanwhile.
        for _ in 0..TRIES {
            let answer = self.reader.around(at).map_err(|error| self.chosen.failure(&error))?;
            let (before, after) = match around_or_refusal(at, &answer) {
                Ok(around) => around,
                Err(refusal) => return Ok(Err(refusal)),
            };
            let gap_ns = after.stamp.ns.saturating_sub(before.stamp.ns);
            if let Some(longest) = self.arguments.gap.filter(|longest| u128::from(gap_ns) > longest.as_nanos()) {
                return Ok(Err(AroundRefusal::gap(gap_ns, longest)));
            }
            by_ns = after.stamp.ns.saturating_sub(at.ns);
            let Some(share) = Share::between(before.stamp.ns, at.ns, after.stamp.ns) else { continue };
            let Some(from) = self.read(before.sequence)? else { continue };
            let Some(to) = self.read(after.sequence)? else { continue };
            let value = between(self.field, &from, &to, share);
            return Ok(Ok(Interpolated { at, share, value, before: (before, from), after: (after, to) }));
        }
        Ok(Err(AroundRefusal::before_oldest(at, by_ns)))
    }

    /// The time that is looked for, which stays the same when newer records come.
    fn at(&mut self) -> Result<Option<Stamp>, Failure> {
        if self.at.is_none() {
            let newest = self.reader.newest().map_err(|error| self.chosen.failure(&error))?;
            self.at = newest.map(|newest| self.arguments.at.stamp(newest.info().stamp, self.arguments.epoch));
        }
        Ok(self.at)
    }

    fn read(&mut self, sequence: u64) -> Result<Option<Value>, Failure> {
        let Some(record) = self.reader.record(sequence) else { return Ok(None) };
        let value = decode(&self.field.ty, record.body());
        let text = self.chosen.text();
        let failure = |error| format!("stream {text}: #{sequence} is not what the module's description says: {error}");
        Ok(Some(value.map_err(failure)?))
    }
}

impl Interpolated {
    fn say(self, json: bool) -> Result<ExitCode, Failure> {
        let Self { at, share, value, before, after } = self;
        let form = RecordForm::new(json, RecordForm::BYTES_MAX);
        if json {
            let [before, after] =
                [before, after].map(|(record, value)| form.object(None, &record, RecordContent::Value(value)));
            let Stamp { epoch, ns: stamp_ns } = at;
            let value = form.brief(value);
            let object = InterpolatedObject { value, stamp_ns, epoch, share: share.get(), before, after };
            say(serde_json::to_string(&object)?);
            return Ok(ExitCode::SUCCESS);
        }
        let from = match (before.0.sequence, after.0.sequence) {
            (before, after) if before == after => format!("the stamp of #{before}"),
            (before, after) => format!("{:.3} of the way from #{before} to #{after}", share.get()),
        };
        let before = form.line(Some("before"), &before.0, RecordContent::Value(before.1))?;
        let after = form.line(Some("after"), &after.0, RecordContent::Value(after.1))?;
        say_folded(format_args!("{value}\nat {}, {from}\n{before}\n{after}", stamp_text(at.ns)));
        Ok(ExitCode::SUCCESS)
    }
}
