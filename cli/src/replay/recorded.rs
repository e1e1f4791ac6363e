//! What the files of a replay say together: modules, configuration, times.

use crate::terminal::Failure;
use rohrpost::schema::Description;
use rohrpost_modules::journal::JOURNAL_NAME;
use rohrpost_recording::format::{MESSAGE_ENCODING, PROFILE, session_key};
use rohrpost_recording::{ChannelInfo, DescribedModule, Info, info, recovered_path};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Longer than this nothing is waited for between two files of another program.
const GAP_MAX_NS: u64 = 60_000_000_000;

/// A text of the files, and the file's name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct RecordedText {
    pub(super) name: String,
    pub(super) text: String,
}

/// Files that are played one after the other.
pub(super) struct RecordedFiles {
    pub(super) infos: Vec<Info>,
    /// They were recorded by another program, such as rosbag2.
    pub(super) are_others: bool,
    /// When the first message arrived, and the last.
    pub(super) begin_ns: u64,
    pub(super) end_ns: u64,
}

impl RecordedFiles {
    /// Reads what the files say of themselves.
    pub(super) fn read(files: &[PathBuf]) -> Result<Self, Failure> {
        let files = without_torn(files);
        let infos = files.into_iter().map(|file| info(file)).collect::<Result<Vec<Info>, _>>()?;
        in_order(&infos)?;
        let are_others = are_others(&infos)?;
        let is_old = |info: &&Info| !are_others && info.begins_ns.is_some() && info.described.is_empty();
        if let Some(old) = infos.iter().find(is_old) {
            return Err(format!(
                "{}: does not describe its modules, as it was recorded by an older version; nobody can stand in for \
                 them: record again, or draw it with `rohrpost record export`",
                old.path.display()
            )
            .into());
        }
        let begin_ns = infos.iter().filter_map(|info| info.begins_ns).min();
        let end_ns = infos.iter().filter_map(|info| info.last_ns.or(info.begins_ns)).max();
        let (Some(begin_ns), Some(end_ns)) = (begin_ns, end_ns) else {
            return Err("there is no message in these files; name others (`rohrpost record info FILE`)".into());
        };
        Ok(Self { infos, are_others, begin_ns, end_ns })
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
                let (known, first) = described.entry(name.as_str().to_owned()).or_insert((description.clone(), info));
                if known.hash() != description.hash() {
                    let (first, second) = (first.path.display(), info.path.display());
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
        let fits = |channel: &&ChannelInfo| {
            let item =
                described.get(channel.name.as_str()).and_then(|description| description.data_item(&channel.item));
            let types = item.map(|item| &item.field.ty).zip(channel.ty.as_ref());
            channel.message_encoding == MESSAGE_ENCODING && types.is_some_and(|(one, other)| one.hash() == other.hash())
        };
        let with_messages = || channels().filter(|channel| has_messages(channel));
        let other: BTreeSet<&str> =
            with_messages().filter(|channel| !fits(channel)).map(|channel| channel.topic.as_str()).collect();
        let topics = with_messages().map(|channel| channel.topic.as_str());
        topics.filter(|topic| !other.contains(topic)).map(str::to_owned).collect()
    }

    /// All topics with messages, but for what was drawn of others.
    pub(super) fn all_topics(&self) -> BTreeSet<&str> {
        let channels = self.infos.iter().flat_map(|info| &info.channels);
        channels.filter(|channel| has_messages(channel)).map(|channel| channel.topic.as_str()).collect()
    }

    /// Modules with a journal.
    pub(super) fn with_journal(&self) -> Vec<String> {
        let channels = self.infos.iter().flat_map(|info| &info.channels);
        let journals = channels.filter(|channel| !self.are_others && channel.item == JOURNAL_NAME);
        let names: BTreeSet<String> = journals.map(|channel| channel.name.as_str().to_owned()).collect();
        names.into_iter().collect()
    }

    /// The configuration that was recorded.
    pub(super) fn configuration(&self) -> Result<RecordedText, Failure> {
        let is_one = |text: &str| text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("installation"));
        let mut found: Option<RecordedText> = None;
        for (name, text) in self.infos.iter().flat_map(Info::configurations) {
            if !is_one(text) {
                continue;
            }
            if found.as_ref().is_some_and(|found| found.text != text) {
                return Err("the files were recorded with different configurations; name the one that is meant: \
                            --config FILE"
                    .into());
            }
            found = Some(RecordedText { name: name.to_owned(), text: text.to_owned() });
        }
        found.ok_or_else(|| "the files have no configuration; name it: --config FILE".into())
    }

    /// Another text that was recorded, by its file's name: the last one.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        self.infos.iter().rev().find_map(|info| info.configuration.get(name)).map(String::as_str)
    }
}

/// Whether there is something to play, and be it what the file repeats of earlier ones. What was drawn is not played.
fn has_messages(channel: &ChannelInfo) -> bool {
    (channel.messages > 0 || channel.repeated > 0) && channel.drawn_of.is_none()
}

/// Files without those of which a whole one was recovered, if that is named too: `main-*.mcap` means each message once.
fn without_torn(files: &[PathBuf]) -> Vec<&PathBuf> {
    let is_torn = |file: &&PathBuf| files.contains(&recovered_path(file));
    files.iter().filter(|file| !is_torn(file)).collect()
}

/// Whether the files are of another program. Those of two kinds have not much in common.
fn are_others(infos: &[Info]) -> Result<bool, Failure> {
    let is_other = |info: &&Info| info.profile != PROFILE;
    let Some(other) = infos.iter().find(is_other) else { return Ok(false) };
    if let Some(ours) = infos.iter().find(|info| !is_other(info)) {
        let (other, profile, ours) = (other.path.display(), &other.profile, ours.path.display());
        return Err(format!(
            "{other} was not recorded by Rohrpost (profile `{profile}`), and {ours} was; replay them one by one"
        )
        .into());
    }
    Ok(true)
}

/// Files of one recording come one after the other, each once. Those of others do not say of which one they are.
fn in_order(infos: &[Info]) -> Result<(), Failure> {
    for (at, later) in infos.iter().enumerate() {
        let recording = later.session.get(session_key::RECORDING);
        if later.profile != PROFILE {
            others_in_order(&infos[..at], later)?;
            continue;
        }
        let mut earlier = infos[..at].iter().filter(|info| info.session.get(session_key::RECORDING) == recording);
        let is_overlapped = |info: &&Info| {
            let last = info.epochs.iter().filter_map(|its| Some((its.epoch, its.last_ns?))).max();
            let first = later.epochs.iter().filter_map(|its| Some((its.epoch, its.first_ns?))).min();
            info.path == later.path || last.zip(first).is_some_and(|(last, first)| first < last)
        };
        if let Some(before) = earlier.find(is_overlapped).filter(|_| recording.is_some()) {
            return Err(format!(
                "{} begins before {} ends, and files are played one after the other; name each file once, in order",
                later.path.display(),
                before.path.display()
            )
            .into());
        }
    }
    Ok(())
}

/// Files of others that were split overlap a little; those of two recordings may be days apart.
fn others_in_order(earlier: &[Info], later: &Info) -> Result<(), Failure> {
    let is_later = |info: &&Info| info.path == later.path || info.first_ns > later.first_ns.or(info.first_ns);
    if let Some(before) = earlier.iter().find(is_later) {
        return Err(format!(
            "{} begins before {}, and files are played one after the other; name each file once, in order",
            later.path.display(),
            before.path.display()
        )
        .into());
    }
    let end_ns = earlier.iter().filter_map(|info| info.last_ns).max();
    let gap_ns = later.first_ns.zip(end_ns).map_or(0, |(first, end)| first.saturating_sub(end));
    if gap_ns > GAP_MAX_NS {
        return Err(format!(
            "{} begins {} s after the files before it end, and the replay would wait so long; replay them one by one",
            later.path.display(),
            gap_ns / 1_000_000_000
        )
        .into());
    }
    Ok(())
}

#[cfg(test)]
mod file_tests {
    use super::*;
    use rohrpost::schema::Type;
    use rohrpost_recording::{ChannelSpec, Message, Options, Session, Writer};

    /// Two files of one recording.
    fn two_files(folder: &std::path::Path) -> [PathBuf; 2] {
        let mut writer = Writer::start(Options::new(folder, "main"), Session::default()).unwrap();
        let spec = ChannelSpec { name: "motor.0", item: "speed", ty: &Type::U8, texts: Default::default() };
        let speed = writer.channel(&spec).unwrap();
        let write = |writer: &mut Writer, sequence: u32| {
            let arrival_ns = 1_000_000_000 * u64::from(sequence);
            writer.write(speed, &Message { arrival_ns, stamp_ns: arrival_ns, epoch: 1, sequence, data: &[7] }).unwrap();
        };
        write(&mut writer, 1);
        let rotated = writer.rotate().unwrap();
        write(&mut writer, 2);
        drop(rotated);
        writer.finish().1.unwrap();
        ["main-0001.mcap", "main-0002.mcap"].map(|name| folder.join(name))
    }

    #[test]
    fn files_of_one_recording_are_named_in_order_and_once() {
        let folder = tempfile::tempdir().unwrap();
        let [first, second] = two_files(folder.path());
        let infos = |files: &[&PathBuf]| files.iter().map(|file| info(file).unwrap()).collect::<Vec<_>>();
        assert!(in_order(&infos(&[&first, &second])).is_ok());
        for wrong in [[&second, &first], [&first, &first]] {
            let told = in_order(&infos(&wrong)).unwrap_err().to_string();
            assert!(told.contains("name each file once, in order"), "{told}");
        }
        let torn = [first.clone(), recovered_path(&first), second.clone()];
        assert_eq!(without_torn(&torn), [&recovered_path(&first), &second]);
    }

    #[test]
    fn files_of_others_may_overlap_and_are_not_far_apart() {
        let folder = tempfile::tempdir().unwrap();
        let [first, second] = two_files(folder.path()).map(|path| info(&path).unwrap());
        let file = |like: &Info, first_s: u64, last_s: u64| {
            let [first_ns, last_ns] = [first_s, last_s].map(|s| Some(s * 1_000_000_000));
            Info { profile: "ros2".into(), first_ns, last_ns, path: like.path.clone(), ..info(&like.path).unwrap() }
        };
        let told = |files: [Info; 2]| in_order(&files).map_err(|error| error.to_string());
        assert_eq!(told([file(&first, 1, 10), file(&second, 9, 20)]), Ok(()));
        assert_eq!(told([file(&first, 1, 10), file(&second, 70, 80)]), Ok(()));
        for (files, wanted) in [
            ([file(&second, 9, 20), file(&first, 1, 10)], "name each file once, in order"),
            ([file(&first, 1, 10), file(&first, 1, 10)], "name each file once, in order"),
            ([file(&first, 1, 10), file(&second, 86_410, 86_420)], "begins 86400 s after the files before it end"),
        ] {
            assert!(told(files).is_err_and(|told| told.contains(wanted)), "{wanted}");
        }
    }
}
