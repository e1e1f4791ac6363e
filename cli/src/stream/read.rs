//! `stream read`.

use super::choice::{ChosenStream, StreamChoice};
use super::output::{RecordForm, RecordOutput};
use super::stamp::{parse_stamp, stamp_text};
use crate::terminal::{Failure, say};
use crate::units::{Stop, seconds};
use rohrpost::Name;
use rohrpost_mailbox::{Around, Next, Participant, RecordInfo, Stamp, StreamInfo, StreamReader};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Longest sleep without a check for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost stream read camera.0 1                        the newest record
  rohrpost stream read camera.0 1 --next 10              the next ten that are written
  rohrpost stream read camera.0 1 --from 0               all from a sequence on that are there
  rohrpost stream read camera.0 1 --at 1700000000.25     the two around a time, or why not
  rohrpost stream read camera.0 1 --raw newest.jpg
Takes a reader's seat while it runs; the writer waits for no reader.")]
pub(super) struct ReadArguments {
    #[command(flatten)]
    stream: StreamChoice,
    /// Read this many records, one after the other, and wait for them: from --from, else from the next one written.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    next: Option<u64>,
    /// Read from this sequence on; without --next, to the newest.
    #[arg(long, value_name = "SEQUENCE")]
    from: Option<u64>,
    /// Read the two records around this time: seconds of system time, as stamps are printed.
    #[arg(long, value_name = "STAMP", value_parser = parse_stamp, conflicts_with_all = ["next", "from"])]
    at: Option<u64>,
    /// Epoch of that time; default: that of the newest record.
    #[arg(long, requires = "at")]
    epoch: Option<u64>,
    /// Fail when no record comes for this time, seconds; 0 waits for ever.
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    timeout: f64,
    /// Write the bytes of records, one after the other, into this file; `-`: print them, and nothing else.
    #[arg(long, value_name = "FILE")]
    raw: Option<PathBuf>,
    /// Print at most this many bytes of a record as hex; 0 prints all.
    #[arg(long, default_value_t = 64, value_name = "N")]
    bytes: usize,
    /// One JSON object a record, with all of its bytes.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &ReadArguments) -> Result<ExitCode, Failure> {
    let chosen = arguments.stream.find()?;
    let info = chosen.inspect()?;
    let form = if arguments.json { RecordForm::Json } else { RecordForm::Line { bytes_max: arguments.bytes } };
    let participant = Participant::join(&chosen.running.node, Name::NONE)?;
    let reader = participant.stream_reader(chosen.id).map_err(|error| chosen.failure(&error))?;
    // Last: a file is made anew only when there is a stream to read.
    let output = RecordOutput::open(form, arguments.raw.as_deref())?;
    let mut reading = StreamReading { arguments, chosen, info, reader, body: Vec::new(), output };
    match (arguments.at, arguments.next, arguments.from) {
        (Some(at_ns), ..) => reading.around(at_ns),
        (None, None, None) => reading.newest(),
        (None, wanted, from) => reading.follow(wanted, from),
    }
}

/// What is read, and what was known when that began.
struct StreamReading<'a> {
    arguments: &'a ReadArguments,
    chosen: ChosenStream,
    info: StreamInfo,
    reader: StreamReader,
    body: Vec<u8>,
    output: RecordOutput,
}

impl StreamReading<'_> {
    fn newest(&mut self) -> Result<ExitCode, Failure> {
        let newest = self.reader.newest_into(&mut self.body).map_err(|error| self.chosen.failure(&error))?;
        let Some(record) = newest else {
            let text = self.chosen.text();
            return Err(match self.info.written {
                0 => format!("stream {text}: nothing was written yet").into(),
                _ => format!("stream {text}: each record was replaced while it was read; raise its `keep`").into(),
            });
        };
        self.output.record(None, &record, &self.body)?;
        Ok(ExitCode::SUCCESS)
    }

    /// One record after the other: as many as wanted, or those that were there when this began.
    fn follow(&mut self, wanted: Option<u64>, from: Option<u64>) -> Result<ExitCode, Failure> {
        let end = self.info.written;
        if let Some(from) = from {
            if from > end || from == end && wanted.is_none() {
                return Err(self.unwritten(from));
            }
            self.reader.seek(from);
        }
        let (patience, stop) = (seconds(self.arguments.timeout)?, Stop::new()?);
        let (mut count, mut last_at) = (0, Instant::now());
        while !stop.within(Duration::ZERO) {
            let next = self.reader.next_timeout_into(&mut self.body, LOOK);
            match next.map_err(|error| self.chosen.failure(&error))? {
                Next::Record(record) => {
                    (count, last_at) = (count + 1, Instant::now());
                    if !self.output.record(None, &record, &self.body)? {
                        break;
                    }
                }
                Next::Lost(lost) => self.output.lost(lost),
                Next::Nothing if !patience.is_zero() && last_at.elapsed() >= patience => {
                    return Err(format!("stream {}: no record within {patience:?}", self.chosen.text()).into());
                }
                Next::Nothing => {}
            }
            if wanted.map_or(self.reader.position() >= end, |wanted| count >= wanted) {
                break;
            }
        }
        Ok(ExitCode::SUCCESS)
    }

    fn unwritten(&self, sequence: u64) -> Failure {
        let there = match (&self.info.oldest, &self.info.newest) {
            (Some(oldest), Some(newest)) => format!("#{} to #{} are there", oldest.sequence, newest.sequence),
            _ => "none is there".into(),
        };
        format!("stream {}: record #{sequence} is not written yet; {there}", self.chosen.text()).into()
    }

    /// The two records around a time, or why not.
    fn around(&mut self, ns: u64) -> Result<ExitCode, Failure> {
        let newest_epoch = self.info.newest.map_or(0, |newest| newest.stamp.epoch);
        let at = Stamp { epoch: self.arguments.epoch.unwrap_or(newest_epoch), ns };
        let answer = self.reader.around(at).map_err(|error| self.chosen.failure(&error))?;
        match refusal(at, &answer) {
            Ok((before, after)) => {
                self.side("before", before.sequence)?;
                self.side("after", after.sequence)?;
                Ok(ExitCode::SUCCESS)
            }
            Err(refusal) if self.arguments.json => {
                say(serde_json::to_string(&refusal)?);
                Ok(ExitCode::FAILURE)
            }
            Err(refusal) => Err(format!("stream {}: {}", self.chosen.text(), refusal.text).into()),
        }
    }

    fn side(&mut self, side: &'static str, sequence: u64) -> Result<(), Failure> {
        let Some(record) = self.reader.record_into(sequence, &mut self.body) else {
            let text = self.chosen.text();
            return Err(format!("stream {text}: #{sequence} was replaced before it was read; raise its `keep`").into());
        };
        self.output.record(Some(side), &record, &self.body)?;
        Ok(())
    }
}

/// Why there are no two records around a time.
#[derive(Debug, serde::Serialize)]
struct AroundRefusal {
    answer: &'static str,
    by_ns: Option<u64>,
    newest_epoch: Option<u64>,
    text: String,
}

/// The two records around a time; or why not, and how far it is.
fn refusal(at: Stamp, answer: &Around) -> Result<(RecordInfo, RecordInfo), AroundRefusal> {
    let refused = |answer, by_ns, newest_epoch, text| Err(AroundRefusal { answer, by_ns, newest_epoch, text });
    match *answer {
        Around::Records { before, after } => Ok((before, after)),
        Around::Empty => refused("empty", None, None, "nothing was written yet".into()),
        Around::BeforeOldest { by_ns } => {
            let first = stamp_text(at.ns.saturating_add(by_ns));
            let text =
                format!("the record before that time is not there; the first time with two around it is {first}");
            refused("before oldest", Some(by_ns), None, text)
        }
        Around::NotYet { by_ns } => {
            let by = stamp_text(by_ns);
            let text = format!("not yet: nearer records may come until stamps are at most {by} s further");
            refused("not yet", Some(by_ns), None, text)
        }
        Around::OtherEpoch { newest } => {
            let text = format!(
                "no two records of epoch {} are around that time, and none will be; the newest record is of epoch \
                 {newest}, see --epoch",
                at.epoch
            );
            refused("other epoch", None, Some(newest), text)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_answer_that_is_no_record_says_exactly_why() {
        let at = Stamp { epoch: 3, ns: 2_000_000_000 };
        for (answer, words) in [
            (Around::Empty, "nothing was written yet"),
            (
                Around::BeforeOldest { by_ns: 5 },
                "the record before that time is not there; the first time with two around it is 2.000000005",
            ),
            (
                Around::NotYet { by_ns: 1_500_000_000 },
                "not yet: nearer records may come until stamps are at most 1.500000000 s further",
            ),
            (
                Around::OtherEpoch { newest: 4 },
                "no two records of epoch 3 are around that time, and none will be; the newest record is of epoch 4, \
                 see --epoch",
            ),
        ] {
            assert_eq!(refusal(at, &answer).unwrap_err().text, words, "{answer:?}");
        }
    }

    #[test]
    fn the_two_records_are_handed_on() {
        let record = |sequence| RecordInfo {
            sequence,
            stamp: Stamp { epoch: 3, ns: 1 },
            written_ns: 1,
            len_bytes: 0,
            incarnation: 1,
        };
        let answer = Around::Records { before: record(4), after: record(5) };
        let (before, after) = refusal(Stamp { epoch: 3, ns: 1 }, &answer).unwrap();
        assert_eq!((before.sequence, after.sequence), (4, 5));
    }
}
