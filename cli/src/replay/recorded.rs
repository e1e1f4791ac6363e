//! What the files of a replay say together: modules, configuration, times.

use crate::terminal::Failure;
use rohrpost::output::plain::line;
use rohrpost::schema::Description;
use rohrpost_recording::format::{MESSAGE_ENCODING, PROFILE};
use rohrpost_recording::{DescribedModule, Info, info};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// A text of the files, and the file's name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct RecordedText {
    pub(super) name: String,
    pub(super) text: String,
}

/// Files that are played one after the other.
pub(super) struct RecordedFiles {
    pub(super) infos: Vec<Info>,
    /// When the first message arrived, and the last.
    pub(super) begin_ns: u64,
    pub(super) end_ns: u64,
}

impl RecordedFiles {
    /// Reads what the files say of themselves.
    pub(super) fn read(files: &[PathBuf]) -> Result<Self, Failure> {
        let infos = files.iter().map(|file| info(file)).collect::<Result<Vec<Info>, _>>()?;
        if let Some(foreign) = infos.iter().find(|info| info.profile != PROFILE) {
            let (file, profile) = (foreign.path.display(), line(&foreign.profile));
            return Err(format!(
                "{file}: was not recorded by Rohrpost (profile `{profile}`): its messages are of no module that could \
                 publish them; name recordings of logd"
            )
            .into());
        }
        if let Some(old) = infos.iter().find(|info| info.messages > 0 && info.described.is_empty()) {
            return Err(format!(
                "{}: does not describe its modules, as it was recorded by an older version; nobody can stand in for \
                 them: record again, or draw it with `rohrpost record export`",
                old.path.display()
            )
            .into());
        }
        let begin_ns = infos.iter().filter_map(|info| info.first_ns).min();
        let end_ns = infos.iter().filter_map(|info| info.last_ns).max();
        let (Some(begin_ns), Some(end_ns)) = (begin_ns, end_ns) else {
            return Err("there is no message in these files; name others (`rohrpost record info FILE`)".into());
        };
        Ok(Self { infos, begin_ns, end_ns })
    }

    /// What modules said of themselves, by name.
    ///
    /// # Errors
    /// When one of those that are wanted said two things.
    pub(super) fn described(&self, is_wanted: impl Fn(&str) -> bool) -> Result<BTreeMap<String, Description>, Failure> {
        let mut described: BTreeMap<String, (Description, &Info)> = BTreeMap::new();
        for info in &self.infos {
            for DescribedModule { name, description } in info.described.iter().filter(|module| is_wanted(&module.name))
            {
                let (known, first) = described.entry(name.clone()).or_insert((description.clone(), info));
                if known.hash() != description.hash() {
                    let (name, first, second) = (line(name), first.path.display(), info.path.display());
                    return Err(format!(
                        "{name} has one interface ({:08x}) in {first} and another ({:08x}) in {second}; replay the \
                         files one by one, or `--names` without it",
                        known.hash(),
                        description.hash()
                    )
                    .into());
                }
            }
        }
        Ok(described.into_iter().map(|(name, (description, _))| (name, description)).collect())
    }

    /// Names of all modules that are described.
    pub(super) fn names(&self) -> BTreeSet<&str> {
        self.infos.iter().flat_map(|info| &info.described).map(|module| module.name.as_str()).collect()
    }

    /// Topics that can be played: recorded with the types that these descriptions say.
    pub(super) fn topics(&self, described: &BTreeMap<String, Description>) -> BTreeSet<String> {
        let channels = || self.infos.iter().flat_map(|info| &info.channels);
        let fits = |channel: &&rohrpost_recording::ChannelInfo| {
            let item = described.get(&channel.name).and_then(|description| description.data_item(&channel.item));
            let types = item.map(|item| &item.field.ty).zip(channel.ty.as_ref());
            channel.message_encoding == MESSAGE_ENCODING && types.is_some_and(|(one, other)| one.hash() == other.hash())
        };
        let with_messages = || channels().filter(|channel| channel.messages > 0 && channel.drawn_of.is_none());
        let other: BTreeSet<&str> =
            with_messages().filter(|channel| !fits(channel)).map(|channel| channel.topic.as_str()).collect();
        let topics = with_messages().map(|channel| &channel.topic);
        topics.filter(|topic| !other.contains(topic.as_str())).cloned().collect()
    }

    /// All topics with messages.
    pub(super) fn all_topics(&self) -> BTreeSet<&str> {
        let channels = self.infos.iter().flat_map(|info| &info.channels);
        channels.filter(|channel| channel.messages > 0).map(|channel| channel.topic.as_str()).collect()
    }

    /// The configuration that was recorded.
    pub(super) fn configuration(&self) -> Result<RecordedText, Failure> {
        let is_one = |text: &str| text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("installation"));
        let mut found: Option<RecordedText> = None;
        for (name, text) in self.infos.iter().flat_map(|info| &info.configuration) {
            if !is_one(text) {
                continue;
            }
            if found.as_ref().is_some_and(|found| found.text != *text) {
                return Err("the files were recorded with different configurations; name the one that is meant: \
                            --config FILE"
                    .into());
            }
            found = Some(RecordedText { name: name.clone(), text: text.clone() });
        }
        found.ok_or_else(|| "the files have no configuration; name it: --config FILE".into())
    }

    /// Another text that was recorded, by its file's name: the last one.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        self.infos.iter().rev().find_map(|info| info.configuration.get(name)).map(String::as_str)
    }
}
