//! How records are printed: a line with their bytes as hex, an object, or the bytes as they are.

use super::stamp::stamp_text;
use super::view::RecordView;
use crate::terminal::{Failure, complain, say};
use rohrpost_mailbox::{RecordInfo, monotonic_ns};
use serde::Serialize;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

/// Where records are printed.
pub(super) struct RecordOutput {
    form: RecordForm,
    raw: Option<RawOutput>,
}

/// What is printed of each record.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum RecordForm {
    /// A line, with so many bytes at most; 0: all.
    Line { bytes_max: usize },
    /// One JSON object, with all bytes.
    Json,
}

enum RawOutput {
    File(PathBuf, File),
    Stdout,
}

#[derive(Serialize)]
struct RecordObject {
    /// On which side of the time that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    side: Option<&'static str>,
    #[serde(flatten)]
    record: RecordView,
    /// Its bytes; none where they go elsewhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    hex: Option<String>,
}

impl RecordOutput {
    /// Records go to the terminal, their bytes into `raw` if that is named; `-` is the standard output.
    pub(super) fn open(form: RecordForm, raw: Option<&Path>) -> Result<Self, Failure> {
        let raw = match raw {
            None => None,
            Some(path) if path == Path::new("-") => {
                if io::stdout().is_terminal() {
                    return Err("a terminal would obey raw bytes; send them into a file or a pipe".into());
                }
                Some(RawOutput::Stdout)
            }
            Some(path) => {
                let file = File::create(path).map_err(|error| format!("{}: {error}", path.display()))?;
                Some(RawOutput::File(path.into(), file))
            }
        };
        Ok(Self { form, raw })
    }

    /// Prints a record; false when nobody reads any more.
    pub(super) fn record(
        &mut self,
        side: Option<&'static str>,
        record: &RecordInfo,
        body: &[u8],
    ) -> Result<bool, Failure> {
        match &mut self.raw {
            None => Ok(say(line(self.form, side, record, Some(body))?)),
            Some(RawOutput::File(path, file)) => {
                file.write_all(body).map_err(|error| format!("{}: {error}", path.display()))?;
                Ok(say(line(self.form, side, record, None)?))
            }
            Some(RawOutput::Stdout) => {
                let mut stdout = io::stdout();
                match stdout.write_all(body).and_then(|()| stdout.flush()) {
                    Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(false),
                    written => Ok(written.map(|()| true)?),
                }
            }
        }
    }

    /// Says how many records were lost here.
    pub(super) fn lost(&self, lost: u64) {
        let text = match self.form {
            RecordForm::Json => serde_json::json!({ "lost": lost }).to_string(),
            RecordForm::Line { .. } => format!("(lost {lost}: newer records took their places before they were read)"),
        };
        if matches!(self.raw, Some(RawOutput::Stdout)) {
            complain(text);
        } else {
            say(text);
        }
    }
}

/// A record in one line; without its bytes where they go elsewhere.
fn line(
    form: RecordForm,
    side: Option<&'static str>,
    record: &RecordInfo,
    body: Option<&[u8]>,
) -> Result<String, Failure> {
    let bytes_max = match form {
        RecordForm::Json => {
            let (record, hex) = (RecordView::new(record, monotonic_ns()), body.map(hex));
            return Ok(serde_json::to_string(&RecordObject { side, record, hex })?);
        }
        RecordForm::Line { bytes_max: 0 } => usize::MAX,
        RecordForm::Line { bytes_max } => bytes_max,
    };
    let side = side.map_or(String::new(), |side| format!("{side:6}  "));
    let mut text = format!("{side}#{}  {}  {} B", record.sequence, stamp_text(record.stamp.ns), record.len_bytes);
    if let Some(body) = body.filter(|body| !body.is_empty()) {
        text += &format!("  {}", hex(&body[..body.len().min(bytes_max)]));
        if body.len() > bytes_max {
            text += &format!(" … {} B more", body.len() - bytes_max);
        }
    }
    Ok(text)
}

fn hex(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len() * 2);
    for byte in bytes {
        // Writing to a string does not fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_mailbox::Stamp;

    fn record(len_bytes: usize) -> RecordInfo {
        let stamp = Stamp { epoch: 1, ns: 1_700_000_000_250_000_000 };
        RecordInfo { sequence: 7, stamp, written_ns: 0, len_bytes, incarnation: 1 }
    }

    #[test]
    fn a_line_has_as_many_bytes_as_are_asked_for() {
        let line = |bytes_max, body: &[u8]| {
            line(RecordForm::Line { bytes_max }, None, &record(body.len()), Some(body)).unwrap()
        };
        assert_eq!(line(64, b"hello"), "#7  1700000000.250000000  5 B  68656c6c6f");
        assert_eq!(line(2, b"hello"), "#7  1700000000.250000000  5 B  6865 … 3 B more");
        assert_eq!(line(0, &[0; 65]).len(), "#7  1700000000.250000000  65 B  ".len() + 130);
        assert_eq!(line(64, b""), "#7  1700000000.250000000  0 B");
    }

    #[test]
    fn the_two_around_a_time_say_their_sides() {
        let form = RecordForm::Line { bytes_max: 64 };
        let told = ["before", "after"].map(|side| line(form, Some(side), &record(1), None).unwrap());
        assert_eq!(told, ["before  #7  1700000000.250000000  1 B", "after   #7  1700000000.250000000  1 B"]);
    }

    #[test]
    fn an_object_has_all_bytes() {
        let object = line(RecordForm::Json, None, &record(2), Some(b"\x00\xff")).unwrap();
        let object: serde_json::Value = serde_json::from_str(&object).unwrap();
        assert_eq!((&object["sequence"], &object["hex"]), (&7.into(), &"00ff".into()));
        assert_eq!((&object["stamp_ns"], &object["len_bytes"]), (&1_700_000_000_250_000_000_u64.into(), &2.into()));
        assert_eq!((object.get("side"), object["epoch"].as_u64()), (None, Some(1)));
    }
}
