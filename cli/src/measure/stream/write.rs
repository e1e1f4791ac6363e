//! `stream write`: files into a stream, each as a record.

use super::choice::StreamChoice;
use super::stamp::{parse_stamp, stamp_text};
use crate::terminal::units::{Stop, seconds, size_argument};
use crate::terminal::{Failure, complain, say};
use rohrpost::Name;
use rohrpost_mailbox::{Participant, Stamp, StreamShape, SystemClock};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost stream write camera.0 1 left.jpg
  rohrpost stream write camera.0 1 frames/*.jpg --delay 0.1
  rohrpost stream write camera.0 1 big.raw --record 8MiB --keep 4
A stream that is there goes on in its shape; another shape makes it anew, without its records. It stays when this \
program ends.")]
pub(super) struct WriteArguments {
    #[command(flatten)]
    stream: StreamChoice,
    /// Files; each is a record.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Time between two records, seconds.
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    delay: f64,
    /// Stamp of the first record, seconds of system time; each next one is later by --delay. Default: now, of each.
    #[arg(long, value_name = "STAMP", value_parser = parse_stamp)]
    stamp: Option<u64>,
    /// Largest record: bytes, or with a unit, as 8MiB; default: as the stream has it, else 1 KiB, or as the largest
    /// file.
    #[arg(long, value_name = "SIZE", value_parser = size_argument)]
    record: Option<u32>,
    /// Records that are kept; default: as the stream has it, else 64.
    #[arg(long, value_name = "N")]
    keep: Option<u32>,
    /// Most readers; default: as the stream has it, else 8.
    #[arg(long, value_name = "N")]
    readers: Option<u16>,
    /// How far behind the newest a stamp may be, seconds; default: as the stream has it, else 0.
    #[arg(long, value_name = "SECONDS")]
    late: Option<f64>,
    /// One JSON object a record.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &WriteArguments) -> Result<ExitCode, Failure> {
    let chosen = arguments.stream.find()?;
    let delay = seconds(arguments.delay)?;
    let there = chosen.look()?.map(|info| info.shape);
    let shape = shape(arguments, there, largest(&arguments.files)?)?;
    let node = &chosen.running.node;
    let participant = Participant::join(node, Name::NONE)?;
    let mut writer = participant.stream_writer(chosen.id, shape).map_err(|error| chosen.failure(&error))?;
    if there.is_some_and(|there| there != *writer.shape()) {
        complain(format_args!("stream {} was made anew: its shape is another now", chosen.text()));
    }
    let (clock, stop) = (SystemClock::open(node), Stop::new()?);
    for (at, file) in (0..).zip(&arguments.files) {
        if at > 0 && stop.within(delay) {
            break;
        }
        let bytes = std::fs::read(file).map_err(|error| format!("{}: {error}", file.display()))?;
        let now = clock.now();
        let ns = arguments.stamp.map_or(now.ns, |first| first.saturating_add(nth_ns(delay, at)));
        let stamp = Stamp { epoch: now.epoch, ns };
        let written = writer.write(stamp, &bytes);
        let sequence = written.map_err(|error| error.to_string().replace(&chosen.id.to_string(), &chosen.text()))?;
        if !say(line(arguments.json, sequence, stamp, bytes.len(), file)) {
            break;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn nth_ns(delay: Duration, at: u32) -> u64 {
    u64::try_from(delay.as_nanos() * u128::from(at)).unwrap_or(u64::MAX)
}

/// Bytes of the largest of these files, all of which can be records.
fn largest(files: &[PathBuf]) -> Result<u32, Failure> {
    let mut largest = 0;
    for file in files {
        let about = std::fs::metadata(file).map_err(|error| format!("{}: {error}", file.display()))?;
        if !about.is_file() {
            return Err(format!("{} is no file; each record is written from one", file.display()).into());
        }
        let len = u32::try_from(about.len());
        let too_large = |_| format!("{} has {} bytes; a record has {} at most", file.display(), about.len(), u32::MAX);
        largest = largest.max(len.map_err(too_large)?);
    }
    Ok(largest)
}

/// The shape to write with: as asked for, else as the stream has it, else with room for these files.
fn shape(arguments: &WriteArguments, there: Option<StreamShape>, largest: u32) -> Result<StreamShape, Failure> {
    let made = StreamShape::default();
    let usual = there.unwrap_or(StreamShape { record_bytes: made.record_bytes.max(largest), ..made });
    let shape = StreamShape {
        record_bytes: arguments.record.unwrap_or(usual.record_bytes),
        keep: arguments.keep.unwrap_or(usual.keep),
        readers: arguments.readers.unwrap_or(usual.readers),
        late: arguments.late.map_or(Ok(usual.late), seconds)?,
    };
    if largest > shape.record_bytes {
        let max = shape.record_bytes;
        return Err(format!("the largest file has {largest} bytes, and a record {max} at most; raise --record").into());
    }
    Ok(shape)
}

fn line(json: bool, sequence: u64, stamp: Stamp, len_bytes: usize, file: &Path) -> String {
    let Stamp { epoch, ns: stamp_ns } = stamp;
    let file = file.display().to_string();
    if json {
        return serde_json::json!({
            "sequence": sequence, "stamp_ns": stamp_ns, "epoch": epoch, "len_bytes": len_bytes, "file": file,
        })
        .to_string();
    }
    format!("wrote #{sequence}  {}  {len_bytes} B  {file}", stamp_text(stamp_ns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct WriteCommand {
        #[command(flatten)]
        write: WriteArguments,
    }

    fn shaped(options: &[&str], there: Option<StreamShape>, largest: u32) -> Result<StreamShape, String> {
        let words = ["write", "camera.0", "1", "file"].iter().chain(options);
        shape(&WriteCommand::parse_from(words).write, there, largest).map_err(|error| error.to_string())
    }

    #[test]
    fn a_stream_goes_on_in_its_shape_unless_another_is_asked_for() {
        let made = StreamShape::default();
        let there = StreamShape { record_bytes: 2048, keep: 9, readers: 3, late: Duration::from_millis(5) };
        assert_eq!(shaped(&[], None, 10), Ok(made));
        assert_eq!(shaped(&[], None, 5000), Ok(StreamShape { record_bytes: 5000, ..made }));
        assert_eq!(shaped(&[], Some(there), 10), Ok(there));
        assert_eq!(shaped(&["--keep", "4"], Some(there), 10), Ok(StreamShape { keep: 4, ..there }));
        let all = ["--record", "16", "--keep", "2", "--readers", "1", "--late", "0.5"];
        let asked = StreamShape { record_bytes: 16, keep: 2, readers: 1, late: Duration::from_millis(500) };
        assert_eq!(shaped(&all, Some(there), 10), Ok(asked));
        for (options, there) in [(&[][..], Some(there)), (&["--record", "2KiB"], None)] {
            let told = shaped(options, there, 5000).unwrap_err();
            assert_eq!(told, "the largest file has 5000 bytes, and a record 2048 at most; raise --record");
        }
    }

    #[test]
    fn stamps_follow_the_first_by_the_delay() {
        assert_eq!(nth_ns(Duration::from_millis(100), 3), 300_000_000);
        assert_eq!(nth_ns(Duration::MAX, u32::MAX), u64::MAX);
    }

    #[test]
    fn what_was_written_is_told() {
        let told = |json| line(json, 3, Stamp { epoch: 1, ns: 2_000_000_001 }, 5, Path::new("a.bin"));
        assert_eq!(told(false), "wrote #3  2.000000001  5 B  a.bin");
        assert!(told(true).contains("\"stamp_ns\":2000000001"));
    }
}
