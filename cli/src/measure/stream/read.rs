//! `stream read`.

use super::choice::{ChosenStream, StreamChoice};
use super::output::{RecordForm, RecordOutput};
use super::refusal::around_or_refusal;
use super::stamp::{StreamMoment, parse_moment};
use crate::terminal::Failure;
use crate::terminal::units::{LOOK, Stop, seconds, size_argument};
use rohrpost::Name;
use rohrpost_mailbox::{Next, Participant, Stamp, StreamInfo, StreamReader};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// While nothing comes it is asked so often whether the writer is in error.
const WRITER_LOOK: Duration = Duration::from_secs(1);

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost stream read odometry.0 odometry                  the newest record
  rohrpost stream read odometry.0 odometry --next 10        the next ten that are written
  rohrpost stream read odometry.0 odometry --from 0         all from a sequence on that are there
  rohrpost stream read odometry.0 odometry --at -1.5s       the two around a time, or why not
  rohrpost stream read camera.0 image --raw newest.postcard
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
    /// Read the two records around this time: a stamp as they are printed, or ns since 1970, or from the newest record
    /// on, such as -1.5s.
    #[arg(long, value_name = "TIME", value_parser = parse_moment, allow_hyphen_values = true,
        conflicts_with_all = ["next", "from"])]
    at: Option<StreamMoment>,
    /// Epoch of that time; default: that of the newest record.
    #[arg(long, requires = "at")]
    epoch: Option<u64>,
    /// Fail when no record comes for this time, seconds; 0 waits for ever.
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    timeout: f64,
    /// Write the bytes of records, one after the other, into this file; `-`: print them, and nothing else.
    #[arg(long, value_name = "FILE")]
    raw: Option<PathBuf>,
    /// Print bytes as they are, as hex, also where the description of the module tells what they mean.
    #[arg(long)]
    hex: bool,
    /// Print at most this many bytes as hex: of a record, in JSON of a field of bytes; 0 prints all.
    #[arg(long, default_value_t = RecordForm::BYTES_MAX as u32, value_name = "SIZE", value_parser = size_argument)]
    bytes: u32,
    /// One JSON object a record, with its value; without a description, with all of its bytes.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &ReadArguments) -> Result<ExitCode, Failure> {
    let chosen = arguments.stream.find()?;
    let info = chosen.inspect()?;
    let form = RecordForm::new(arguments.json, arguments.bytes as usize);
    let participant = Participant::join(&chosen.running.node, Name::NONE)?;
    let reader = participant.stream_reader(chosen.id).map_err(|error| chosen.failure(&error))?;
    // Last: a file is made anew only when there is a stream to read.
    let ty = chosen.item.as_ref().filter(|_| !arguments.hex).map(|item| item.field.ty.clone());
    let output = RecordOutput::open(form, ty, arguments.raw.as_deref())?;
    let mut reading = StreamReading { arguments, chosen, info, reader, body: Vec::new(), output };
    match (arguments.at, arguments.next, arguments.from) {
        (Some(at), ..) => reading.around(at),
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
        let (mut count, mut last_at, mut told) = (0, Instant::now(), self.reader.missed());
        let mut look_at = last_at + WRITER_LOOK;
        while !stop.within(Duration::ZERO) {
            let next = self.reader.next_timeout_into(&mut self.body, LOOK);
            let next = next.map_err(|error| self.chosen.failure(&error))?;
            // All that was missed up to a record is one line before it.
            let missed = self.reader.missed().since(&told);
            if missed.all() > 0 && !matches!(next, Next::Lost(_)) {
                self.output.missed(missed)?;
                told = self.reader.missed();
            }
            match next {
                Next::Record(record) => {
                    (count, last_at) = (count + 1, Instant::now());
                    if !self.output.record(None, &record, &self.body)? {
                        break;
                    }
                }
                Next::Nothing if !patience.is_zero() && last_at.elapsed() >= patience => {
                    return Err(format!("stream {}: no record within {patience:?}", self.chosen.text()).into());
                }
                Next::Nothing if Instant::now() >= look_at => {
                    look_at = Instant::now() + WRITER_LOOK;
                    self.chosen.running.in_error(self.chosen.id.name).map_or(Ok(()), Err)?;
                }
                Next::Lost(_) | Next::Nothing => {}
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
    fn around(&mut self, at: StreamMoment) -> Result<ExitCode, Failure> {
        let newest = self.info.newest.map_or(Stamp { epoch: 0, ns: 0 }, |newest| newest.stamp);
        let at = at.stamp(newest, self.arguments.epoch);
        let answer = self.reader.around(at).map_err(|error| self.chosen.failure(&error))?;
        match around_or_refusal(at, &answer) {
            Ok((before, after)) => {
                self.side("before", before.sequence)?;
                self.side("after", after.sequence)?;
                Ok(ExitCode::SUCCESS)
            }
            Err(refusal) => refusal.told(&self.chosen.text(), self.arguments.json),
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
