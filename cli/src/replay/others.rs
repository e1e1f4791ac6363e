//! Recordings of other programs, such as rosbag2: their messages are played as bytes that nobody reads, into streams
//! that the command names.
//!
//! ```text
//! /scan  sensor_msgs/msg/LaserScan cdr ros2msg ── --into /scan=laser.0/scan ──▶ laser.0/scan: bytes
//! ```

use super::configuration::PlayedModules;
use super::recorded::RecordedFiles;
use super::sizes::of_records;
use crate::record::ProgressLine;
use crate::terminal::Failure;
use rohrpost::output::plain::{ForeignText, line};
use rohrpost::schema::{DataItem, DataKind, Description, Field, Type};
use rohrpost_config::{Installation, is_class_name};
use rohrpost_recording::{ChannelInfo, ReadError, Reader};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::str::FromStr;

/// The configuration of files that have none.
const CONFIG: &str = "others.toml";
/// Classes get numbers from here on; a module that runs is not among them.
const CLASS_ID_MIN: usize = 20;
/// What a stream takes besides a message: the length of it.
const LENGTH_BYTES_MAX: usize = 5;
/// Names of types are as long as others like; so much of them is told.
const TYPE_CHARS_MAX: usize = 200;

/// A topic, and the stream into which it is played: `/scan=laser.0/scan`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct IntoStream {
    topic: String,
    module: String,
    item: String,
}

impl FromStr for IntoStream {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "write TOPIC=MODULE/STREAM, such as /scan=laser.0/scan".to_owned();
        // Topics of others may have any letters.
        let (topic, stream) = text.rsplit_once('=').ok_or_else(wrong)?;
        let (module, item) = stream.split_once('/').ok_or_else(wrong)?;
        let is_item = item.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
            && item.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_');
        let is_module = module
            .split_once('.')
            .is_some_and(|(class, instance)| is_class_name(class) && instance.parse::<u8>().is_ok());
        if topic.is_empty() || !is_module || !is_item {
            return Err(wrong());
        }
        if module.starts_with("tool.") {
            return Err("modules of class `tool` are programs run by hand; name another one".into());
        }
        Ok(Self { topic: topic.into(), module: module.into(), item: item.into() })
    }
}

impl IntoStream {
    /// As ours are called.
    fn name(&self) -> String {
        format!("{}/{}", self.module, self.item)
    }

    fn class(&self) -> &str {
        self.module.split('.').next().unwrap_or_default()
    }

    /// What the module says of itself, without streams: its trait is called as its class, `WheelLeft` for `wheel-left`.
    fn description(&self) -> Description {
        let part = |part: &str| part.chars().take(1).flat_map(char::to_uppercase).chain(part.chars().skip(1)).collect();
        let parts: Vec<String> = self.class().split('-').map(part).collect();
        Description {
            name: parts.concat(),
            class: self.class().into(),
            text: "What another program recorded.".into(),
            functions: Vec::new(),
            data: Vec::new(),
        }
    }
}

/// Whether these streams can be made of these files: those of others need them, ours have their own.
pub(super) fn check(recorded: &RecordedFiles, into: &[IntoStream]) -> Result<(), Failure> {
    if !recorded.are_others {
        return match into.first() {
            None => Ok(()),
            Some(one) => Err(format!(
                "--into {}={}: these files are of Rohrpost, and are played into the streams that they were recorded \
                 of; choose with --names",
                line(&one.topic),
                one.name()
            )
            .into()),
        };
    }
    let topics = recorded.all_topics();
    if into.is_empty() {
        return Err(format!(
            "{} was not recorded by Rohrpost: name streams for its messages, such as `--into {}=sensor.0/value`; it \
             has {}",
            recorded.infos[0].path.display(),
            line(topics.first().copied().unwrap_or_default()),
            listed(recorded)
        )
        .into());
    }
    if let Some(one) = into.iter().find(|one| !topics.contains(&*one.topic)) {
        let topic = line(&one.topic);
        return Err(
            format!("--into {topic}={}: nothing of it is recorded; it has {}", one.name(), listed(recorded)).into()
        );
    }
    for (at, later) in into.iter().enumerate() {
        let before = into[..at].iter().find(|one| one.topic == later.topic || one.name() == later.name());
        if let Some(before) = before {
            let what = if before.topic == later.topic { later.topic.clone() } else { later.name() };
            return Err(format!("--into names {} twice; a topic is played into one stream", line(&what)).into());
        }
    }
    Ok(())
}

/// Topics with their types.
fn listed(recorded: &RecordedFiles) -> String {
    let channels = || recorded.infos.iter().flat_map(|info| &info.channels).filter(|channel| channel.messages > 0);
    let told: BTreeSet<String> =
        channels().map(|channel| format!("{} ({})", channel.topic, type_of(channel))).collect();
    line(&told.into_iter().collect::<Vec<_>>().join(", ")).into_owned()
}

/// What others say of a type: its name, and how values and types are written.
fn type_of(channel: &ChannelInfo) -> String {
    let ChannelInfo { type_name, message_encoding, schema_encoding, .. } = channel;
    let words = [type_name, message_encoding, schema_encoding];
    let words: Vec<&str> = words.into_iter().filter(|word| !word.is_empty()).map(ForeignText::as_str).collect();
    words.join(" ").chars().take(TYPE_CHARS_MAX).collect()
}

/// A configuration with these modules alone, for files that have none.
pub(super) fn source(into: &[IntoStream]) -> Result<Installation, Failure> {
    let classes: BTreeSet<&str> = into.iter().map(IntoStream::class).collect();
    let modules: BTreeSet<&str> = into.iter().map(|one| one.module.as_str()).collect();
    let mut text =
        String::from("installation = \"others\"\n[system]\nname = \"robot\"\nid = 1\n[nodes.main]\n[classes]\n");
    text.push_str("tool = { id = 16, text = \"Programs run by hand\" }\n");
    for (id, class) in (CLASS_ID_MIN..).zip(classes) {
        text.push_str(&format!("{class} = {{ id = {id}, text = \"Recorded by another program\" }}\n"));
    }
    for module in modules {
        text.push_str(&format!("[[module]]\nname = \"{module}\"\nprogram = \"played\"\n"));
    }
    Ok(Installation::parse(&text, Path::new(CONFIG))?)
}

/// What is played, beside what runs.
pub(super) fn played(
    recorded: &RecordedFiles,
    into: &[IntoStream],
    installation: &Installation,
    running: &BTreeSet<String>,
) -> Result<PlayedModules, Failure> {
    let longest = longest(recorded, into)?;
    let mut played = PlayedModules::default();
    for one in into {
        let IntoStream { topic, module, item } = one;
        installation.classes.parse_module(module).map_err(|error| format!("--into {}: {error}", one.name()))?;
        if running.contains(module) {
            return Err(format!("--into {}: {module} runs; play into a stream of another module", one.name()).into());
        }
        let description = played.described.entry(module.clone()).or_insert_with(|| one.description());
        let channels = recorded.infos.iter().flat_map(|info| &info.channels);
        let said = channels.into_iter().find(|channel| channel.topic == *topic).map(type_of).unwrap_or_default();
        let topic_text: String = topic.chars().take(TYPE_CHARS_MAX).collect();
        let text = line(&format!("Messages of {topic_text}: {said}.")).into_owned();
        let field = Field::new(item, Type::Bytes).said(text, "");
        // There are no more topics than channels of MCAP, which have numbers of this size.
        let number = description.data.len() as u16 + 1;
        description.data.push(DataItem { number, kind: DataKind::Stream, field });
        let longest = longest.get(topic.as_str()).copied().unwrap_or_default();
        // A recording has no longer messages than a stream may have.
        played.streams.insert(one.name(), of_records((longest + LENGTH_BYTES_MAX) as u32));
        played.topics.insert(one.name());
        played.into.insert(topic.clone(), one.name());
    }
    Ok(played)
}

/// The longest message of each topic: no index tells.
fn longest<'a>(recorded: &RecordedFiles, into: &'a [IntoStream]) -> Result<BTreeMap<&'a str, usize>, Failure> {
    let mut longest: BTreeMap<&str, usize> = into.iter().map(|one| (one.topic.as_str(), 0)).collect();
    let mut progress = ProgressLine::new();
    for info in &recorded.infos {
        let mut reader = Reader::open(&info.path)?;
        loop {
            match reader.next() {
                Ok(Some((channel, message))) => {
                    if let Some(longest) = longest.get_mut(channel.topic.as_str()) {
                        *longest = message.data.len().max(*longest);
                    }
                }
                // The disk fails, and would again. It is told when it is to be played.
                Ok(None) | Err(ReadError::Io { .. }) => break,
                // Reading goes on behind a damage, with the next record, or ends there.
                Err(_) => {}
            }
            let (read, all) = reader.progress();
            progress.tell(read, all);
        }
    }
    Ok(longest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::schema::Bytes;

    #[test]
    fn a_topic_and_a_stream_are_read_and_what_is_neither_is_not() {
        let read = |text: &str| text.parse::<IntoStream>().map(|one| (one.topic.clone(), one.name()));
        for (text, topic, name) in [
            ("/scan=laser.0/scan", "/scan", "laser.0/scan"),
            ("/a=b/c d=wheel-left.255/_speed2", "/a=b/c d", "wheel-left.255/_speed2"),
        ] {
            assert_eq!(read(text), Ok((topic.to_owned(), name.to_owned())));
        }
        for wrong in [
            "",
            "/scan",
            "/scan=",
            "=laser.0/scan",
            "/scan=laser.0",
            "/scan=laser/scan",
            "/scan=laser.256/scan",
            "/scan=laser.0/2d",
            "/scan=laser.0/a/b",
            "/scan=La\"ser.0/scan",
            "/scan=.0/scan",
            "/scan=laser.0.0/scan",
        ] {
            assert!(read(wrong).is_err_and(|told| told.contains("TOPIC=MODULE/STREAM")), "{wrong}");
        }
    }

    #[test]
    fn a_configuration_has_the_modules_that_are_named() {
        let into = ["/a=laser.0/scan", "/b=laser.1/scan", "/d=camera.0/image"];
        let into: Vec<IntoStream> = into.iter().map(|text| text.parse().unwrap()).collect();
        let installation = source(&into).unwrap();
        for one in &into {
            installation.classes.parse_module(&one.module).unwrap();
        }
    }

    /// As the author of a module writes it that reads such streams.
    #[rohrpost::interface(class = "wheel-left")]
    trait WheelLeft {
        /// In CDR.
        #[stream(1)]
        fn speed() -> Bytes;

        /// In CDR, too.
        #[stream(2)]
        fn force() -> Bytes;
    }

    #[test]
    fn a_module_can_have_the_interface_of_such_streams() {
        let into = ["/a=wheel-left.0/speed", "/b=wheel-left.0/force"];
        let into: Vec<IntoStream> = into.iter().map(|text| text.parse().unwrap()).collect();
        let recorded = RecordedFiles { infos: Vec::new(), are_others: true, begin_ns: 0, end_ns: 0 };
        let played = played(&recorded, &into, &source(&into).unwrap(), &BTreeSet::new()).unwrap();
        assert_eq!(played.described["wheel-left.0"].hash(), WheelLeftInterface::hash());
        let runs = BTreeSet::from(["wheel-left.0".to_owned()]);
        let told = super::played(&recorded, &into, &source(&into).unwrap(), &runs).err().unwrap().to_string();
        assert!(told.contains("wheel-left.0 runs; play into a stream of another module"), "{told}");
    }
}
