//! Messages as JSON, one object a line.

use crate::terminal::{Failure, say};
use rohrpost::schema::{Value, decode};
use rohrpost_recording::{Message, PartFile, RecordedChannel};
use serde::Serialize;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// A message. Numbers that JSON does not have are texts in its value: `"NaN"`, `"inf"`, `"-inf"`.
#[derive(Serialize)]
pub(super) struct JsonMessage<'a> {
    topic: &'a str,
    stamp_ns: u64,
    epoch: u64,
    arrival_ns: u64,
    sequence: u32,
    /// It is of an earlier file; left out if it is not.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    repeated: bool,
    #[serde(flatten)]
    content: JsonContent<'a>,
}

#[derive(Serialize)]
#[serde(untagged)]
enum JsonContent<'a> {
    Value {
        value: Value,
    },
    /// Of others, if it is JSON already.
    Json {
        value: serde_json::Value,
    },
    /// What is not known, or not what its description says.
    Bytes {
        unreadable: String,
        encoding: &'a str,
        hex: String,
    },
}

/// Where they are written.
pub(super) enum JsonLines {
    /// Each as it comes.
    Stdout,
    File(JsonFile),
}

/// A file in the making. It gets its name once it is whole; dropped before, it leaves nothing.
pub(super) struct JsonFile {
    out: BufWriter<File>,
    part: PartFile,
    messages: u64,
    bytes: u64,
}

impl JsonLines {
    /// A new file, or the standard output for `-`.
    pub(super) fn create(to: &Path) -> Result<Self, Failure> {
        if to == Path::new("-") {
            return Ok(Self::Stdout);
        }
        let (part, file) = PartFile::create(to, |path| File::create_new(path))?;
        Ok(Self::File(JsonFile { out: BufWriter::new(file), part, messages: 0, bytes: 0 }))
    }

    /// Writes a message; false when nobody reads any more.
    pub(super) fn add(&mut self, message: &JsonMessage<'_>) -> Result<bool, Failure> {
        let line = serde_json::to_string(message)?;
        match self {
            Self::Stdout => Ok(say(line)),
            Self::File(file) => {
                file.add(&line).map_err(|error| format!("{}: {error}", file.part.path().display()))?;
                Ok(true)
            }
        }
    }

    /// Ends it; messages and bytes of a file.
    pub(super) fn finish(self) -> Result<Option<(u64, u64)>, Failure> {
        let Self::File(mut file) = self else { return Ok(None) };
        file.flush().map_err(|error| format!("{}: {error}", file.part.path().display()))?;
        file.part.finish()?;
        Ok(Some((file.messages, file.bytes)))
    }
}

impl JsonFile {
    fn add(&mut self, line: &str) -> io::Result<()> {
        writeln!(self.out, "{line}")?;
        self.messages += 1;
        self.bytes += line.len() as u64 + 1;
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()?;
        self.out.get_ref().sync_all()
    }
}

impl<'a> JsonMessage<'a> {
    /// A message of a recording.
    pub(super) fn of(channel: &'a RecordedChannel, message: &Message<'_>) -> Self {
        let Message { arrival_ns, stamp_ns, epoch, sequence, data } = *message;
        let (repeated, content) = (channel.is_repeated(), content(channel, data));
        Self { topic: &channel.topic, stamp_ns, epoch, arrival_ns, sequence, repeated, content }
    }

    /// Why its bytes are given as they are; none if they are not.
    pub(super) fn unreadable(&self) -> Option<&str> {
        if let JsonContent::Bytes { unreadable, .. } = &self.content { Some(unreadable) } else { None }
    }
}

fn content<'a>(channel: &'a RecordedChannel, data: &[u8]) -> JsonContent<'a> {
    let encoding = channel.message_encoding.as_str();
    let unreadable = match (&channel.ty, encoding) {
        (Some(ty), "postcard") => match decode(ty, data) {
            Ok(value) => return JsonContent::Value { value },
            Err(error) => error.to_string(),
        },
        (_, "json") => match serde_json::from_slice(data) {
            Ok(value) => return JsonContent::Json { value },
            Err(error) => error.to_string(),
        },
        _ => "its type is not described in a way that is read here".to_owned(),
    };
    let hex = data.iter().map(|byte| format!("{byte:02x}")).collect();
    JsonContent::Bytes { unreadable, encoding, hex }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::schema::{Field, Members, Named, Type};
    use std::sync::Arc;

    fn channel(ty: Option<Type>, encoding: &str) -> RecordedChannel {
        RecordedChannel {
            topic: "laser.0/scan".into(),
            name: "laser.0".into(),
            item: "scan".into(),
            ty: ty.map(Arc::new),
            message_encoding: encoding.into(),
            ..RecordedChannel::default()
        }
    }

    fn line(channel: &RecordedChannel, data: &[u8]) -> String {
        let message = Message { arrival_ns: 12, stamp_ns: 10, epoch: 1, sequence: 3, data };
        serde_json::to_string(&JsonMessage::of(channel, &message)).unwrap()
    }

    #[test]
    fn numbers_that_json_does_not_have_are_texts() {
        let field = Field::new("ranges", Type::Array(4, Box::new(Type::F32)));
        let ty = Type::Struct(Named::new("Scan", Members::Fields(vec![field])));
        let data: Vec<u8> =
            [1.5, f32::NAN, f32::INFINITY, f32::NEG_INFINITY].iter().flat_map(|range| range.to_le_bytes()).collect();
        let head = r#"{"topic":"laser.0/scan","stamp_ns":10,"epoch":1,"arrival_ns":12,"sequence":3,"#;
        let told = line(&channel(Some(ty.clone()), "postcard"), &data);
        assert_eq!(told, format!(r#"{head}"value":{{"ranges":[1.5,"NaN","inf","-inf"]}}}}"#));
        let told = line(&channel(Some(ty), "postcard"), &data[1..]);
        assert!(told.starts_with(&format!(r#"{head}"unreadable":""#)) && told.contains(r#""hex":"00c03f"#), "{told}");
    }

    #[test]
    fn no_file_of_a_user_is_taken_for_a_temporary_one() {
        let folder = tempfile::tempdir().unwrap();
        let [to, part] = ["out.jsonl", "out.jsonl.part"].map(|name| folder.path().join(name));
        std::fs::write(&part, "a user's").unwrap();
        drop(JsonLines::create(&to).unwrap());
        assert_eq!(JsonLines::create(&to).unwrap().finish().unwrap(), Some((0, 0)));
        assert_eq!(std::fs::read_to_string(&part).unwrap(), "a user's");
        assert!(JsonLines::create(&to).err().unwrap().to_string().contains("is there already"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn what_others_wrote_is_told_as_json_or_as_bytes() {
        assert!(line(&channel(None, "json"), br#"{"x": [1]}"#).ends_with(r#""value":{"x":[1]}}"#));
        let told = line(&channel(None, "cdr"), &[0, 1, 0xfe]);
        assert!(told.ends_with(r#""encoding":"cdr","hex":"0001fe"}"#), "{told}");
        let message = Message { arrival_ns: 12, stamp_ns: 10, epoch: 1, sequence: 3, data: &[0; 4] };
        // More units than a message of four bytes may have: its sender may be right all the same.
        let units = channel(Some(Type::Array(1 << 20, Box::new(Type::Unit))), "postcard");
        let why = JsonMessage::of(&units, &message).unreadable().unwrap().to_owned();
        assert!(why.contains("more than ") && why.contains("values"), "{why}");
        let bytes = channel(Some(Type::Array(4, Box::new(Type::U8))), "postcard");
        assert_eq!(JsonMessage::of(&bytes, &message).unreadable(), None);
    }
}
