//! How records are printed: a line or an object, with the value where its type is known, else with the bytes as hex;
//! or the bytes as they are.

use super::stamp::stamp_text;
use super::view::{MissedView, RecordView};
use crate::terminal::{Failure, complain, say};
use rohrpost::schema::{Type, Value, decode};
use rohrpost_mailbox::{Missed, RecordInfo, monotonic_ns};
use serde::Serialize;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

/// Where records are printed.
pub(super) struct RecordOutput {
    form: RecordForm,
    /// What values are; none: it is not known.
    ty: Option<Type>,
    raw: Option<RawOutput>,
}

/// What is printed of each record.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct RecordForm {
    /// One JSON object, not a line.
    json: bool,
    /// So many bytes as hex at most.
    bytes_max: usize,
}

/// What is printed of a record's bytes.
pub(super) enum RecordContent<'a> {
    /// Nothing: they go elsewhere.
    Elsewhere,
    /// As they are; and why they are no value, if they should be one.
    Bytes(&'a [u8], Option<String>),
    Value(Value),
}

enum RawOutput {
    File(PathBuf, File),
    Stdout,
}

#[derive(Serialize)]
pub(super) struct RecordObject {
    /// On which side of the time that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    side: Option<&'static str>,
    #[serde(flatten)]
    record: RecordView,
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<Value>,
    /// Why its bytes are no value.
    #[serde(skip_serializing_if = "Option::is_none")]
    unreadable: Option<String>,
    /// Its bytes, where they are not told as a value and do not go elsewhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    hex: Option<String>,
}

impl RecordForm {
    /// So many bytes as hex, unless another number is asked for.
    pub(super) const BYTES_MAX: usize = 64;

    /// With so many bytes as hex; 0: all.
    pub(super) fn new(json: bool, bytes_max: usize) -> Self {
        Self { json, bytes_max: if bytes_max == 0 { usize::MAX } else { bytes_max } }
    }

    /// A value in JSON: each field of bytes has their number and the first of them as hex, since a picture is a million
    /// of them.
    pub(super) fn brief(self, value: Value) -> Value {
        match value {
            Value::Bytes(bytes) => {
                let head = hex(&bytes[..bytes.len().min(self.bytes_max)]);
                Value::Map(vec![("len_bytes".into(), Value::U(bytes.len() as u128)), ("hex".into(), Value::Text(head))])
            }
            Value::List(values) => Value::List(values.into_iter().map(|value| self.brief(value)).collect()),
            Value::Map(entries) => {
                Value::Map(entries.into_iter().map(|(name, value)| (name, self.brief(value))).collect())
            }
            Value::Variant(name, payload) => Value::Variant(name, Box::new(self.brief(*payload))),
            plain => plain,
        }
    }

    pub(super) fn object(
        self,
        side: Option<&'static str>,
        record: &RecordInfo,
        content: RecordContent<'_>,
    ) -> RecordObject {
        let (value, unreadable, hex) = match content {
            RecordContent::Elsewhere => (None, None, None),
            RecordContent::Bytes(body, why) => (None, why, Some(hex(body))),
            RecordContent::Value(value) => (Some(self.brief(value)), None, None),
        };
        RecordObject { side, record: RecordView::new(record, monotonic_ns()), value, unreadable, hex }
    }

    pub(super) fn line(
        self,
        side: Option<&'static str>,
        record: &RecordInfo,
        content: RecordContent<'_>,
    ) -> Result<String, Failure> {
        if self.json {
            return Ok(serde_json::to_string(&self.object(side, record, content))?);
        }
        let side = side.map_or(String::new(), |side| format!("{side:6}  "));
        let mut text = format!("{side}#{}  {}  {} B", record.sequence, stamp_text(record.stamp.ns), record.len_bytes);
        match content {
            RecordContent::Elsewhere => {}
            RecordContent::Value(value) => text += &format!("  {value}"),
            RecordContent::Bytes(body, why) => {
                if !body.is_empty() {
                    text += &format!("  {}", hex(&body[..body.len().min(self.bytes_max)]));
                }
                if body.len() > self.bytes_max {
                    text += &format!(" … {} B more", body.len() - self.bytes_max);
                }
                text += &why.map_or(String::new(), |why| format!("  ({why})"));
            }
        }
        Ok(text)
    }
}

impl<'a> RecordContent<'a> {
    /// The value that these bytes are.
    pub(super) fn of(ty: Option<&Type>, body: &'a [u8]) -> Self {
        match ty.map(|ty| decode(ty, body)) {
            None => Self::Bytes(body, None),
            Some(Ok(value)) => Self::Value(value),
            Some(Err(error)) => Self::Bytes(body, Some(format!("not what the module's description says: {error}"))),
        }
    }
}

impl RecordOutput {
    /// Records go to the terminal, their bytes into `raw` if that is named; `-` is the standard output.
    pub(super) fn open(form: RecordForm, ty: Option<Type>, raw: Option<&Path>) -> Result<Self, Failure> {
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
        Ok(Self { form, ty, raw })
    }

    /// Prints a record; false when nobody reads any more.
    pub(super) fn record(
        &mut self,
        side: Option<&'static str>,
        record: &RecordInfo,
        body: &[u8],
    ) -> Result<bool, Failure> {
        match &mut self.raw {
            None => Ok(say(self.form.line(side, record, RecordContent::of(self.ty.as_ref(), body))?)),
            Some(RawOutput::File(path, file)) => {
                file.write_all(body).map_err(|error| format!("{}: {error}", path.display()))?;
                Ok(say(self.form.line(side, record, RecordContent::Elsewhere)?))
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

    /// Says which records were missed here, and why.
    pub(super) fn missed(&self, missed: Missed) -> Result<(), Failure> {
        let text = match self.form.json {
            true => serde_json::to_string(&MissedView::from(missed))?,
            false => missed_text(missed),
        };
        if matches!(self.raw, Some(RawOutput::Stdout)) {
            complain(text);
        } else {
            say(text);
        }
        Ok(())
    }
}

/// Records that were missed one after the other, in one line.
fn missed_text(missed: Missed) -> String {
    let Missed { lost, sampled, passed_over } = missed;
    let causes = [
        (lost, "lost on the way"),
        (sampled, "left out by sampling"),
        (passed_over, "passed over: newer records took their places before they were read"),
    ];
    let told: Vec<_> =
        causes.iter().filter(|(count, _)| *count > 0).map(|(count, why)| format!("{count} {why}")).collect();
    format!("({} missed: {})", missed.all(), told.join(", "))
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
    use rohrpost::schema::Schema;
    use rohrpost_mailbox::Stamp;

    fn record(len_bytes: usize) -> RecordInfo {
        let stamp = Stamp { epoch: 1, ns: 1_700_000_000_250_000_000 };
        RecordInfo { sequence: 7, stamp, written_ns: 0, len_bytes, incarnation: 1 }
    }

    #[test]
    fn a_line_has_as_many_bytes_as_are_asked_for() {
        let line = |bytes_max, body: &[u8]| {
            RecordForm::new(false, bytes_max).line(None, &record(body.len()), RecordContent::of(None, body)).unwrap()
        };
        assert_eq!(line(64, b"hello"), "#7  1700000000.250000000  5 B  68656c6c6f");
        assert_eq!(line(2, b"hello"), "#7  1700000000.250000000  5 B  6865 … 3 B more");
        assert_eq!(line(0, &[0; 65]).len(), "#7  1700000000.250000000  65 B  ".len() + 130);
        assert_eq!(line(64, b""), "#7  1700000000.250000000  0 B");
    }

    #[test]
    fn the_two_around_a_time_say_their_sides() {
        let form = RecordForm::new(false, 64);
        let told = ["before", "after"].map(|side| form.line(Some(side), &record(1), RecordContent::Elsewhere).unwrap());
        assert_eq!(told, ["before  #7  1700000000.250000000  1 B", "after   #7  1700000000.250000000  1 B"]);
    }

    #[test]
    fn what_was_missed_is_told_by_cause() {
        for (lost, sampled, passed_over, text) in [
            (0, 9, 0, "(9 missed: 9 left out by sampling)"),
            (1, 9, 0, "(10 missed: 1 lost on the way, 9 left out by sampling)"),
            (0, 0, 2, "(2 missed: 2 passed over: newer records took their places before they were read)"),
        ] {
            assert_eq!(missed_text(Missed { lost, sampled, passed_over }), text);
        }
    }

    fn object(bytes_max: usize, ty: Option<&Type>, body: &[u8]) -> serde_json::Value {
        let content = RecordContent::of(ty, body);
        let object = RecordForm::new(true, bytes_max).line(None, &record(body.len()), content).unwrap();
        serde_json::from_str(&object).unwrap()
    }

    #[test]
    fn an_object_without_a_description_has_all_bytes() {
        let object = object(1, None, b"\x00\xff");
        assert_eq!((&object["sequence"], &object["hex"]), (&7.into(), &"00ff".into()));
        assert_eq!((&object["stamp_ns"], &object["len_bytes"]), (&1_700_000_000_250_000_000_u64.into(), &2.into()));
        assert_eq!((object.get("side"), object["epoch"].as_u64()), (None, Some(1)));
    }

    #[test]
    fn a_record_of_a_known_type_is_a_value_and_bytes_in_it_are_told_by_size_and_head() {
        let ty = <(u16, Vec<u8>)>::schema();
        let body = [7, 3, 10, 11, 12];
        let line = RecordForm::new(false, 2).line(None, &record(5), RecordContent::of(Some(&ty), &body)).unwrap();
        assert_eq!(line, "#7  1700000000.250000000  5 B  [7, [10, 11, 12]]");
        let object = object(2, Some(&ty), &body);
        assert_eq!(object["value"], serde_json::json!([7, { "len_bytes": 3, "hex": "0a0b" }]));
        assert_eq!((object.get("hex"), object.get("unreadable")), (None, None));
    }

    #[test]
    fn bytes_that_are_not_what_the_description_says_are_told_with_the_reason() {
        let (ty, body) = (f64::schema(), [1, 2]);
        let line = RecordForm::new(false, 64).line(None, &record(2), RecordContent::of(Some(&ty), &body)).unwrap();
        let words = "#7  1700000000.250000000  2 B  0102  (not what the module's description says: ";
        assert!(line.starts_with(words) && line.ends_with(')'), "{line}");
        let object = object(64, Some(&ty), &body);
        assert_eq!((object.get("value"), &object["hex"]), (None, &"0102".into()));
        assert!(object["unreadable"].as_str().is_some_and(|why| line.contains(why)), "{object}");
    }
}
