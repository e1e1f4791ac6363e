//! Which messages of a file are taken.

use crate::error::ReadError;
use crate::format::key;
use crate::read::definitions::Definition;
use rohrpost_schema::plain::ForeignText;
use std::collections::BTreeMap;
use std::path::Path;
use thiserror::Error;

/// What is taken. The default takes all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// What arrived from then on, in nanoseconds of system time.
    pub from_ns: Option<u64>,
    /// What arrived before.
    pub until_ns: Option<u64>,
    /// Names (`laser.0`) or topics (`laser.0/scan`), each with what was drawn of it. None takes all.
    pub names: Vec<String>,
    /// Of each channel the first message of every such time, by its stamp; of output lines each.
    pub period_ns: Option<u64>,
}

/// Why nothing can be taken.
#[derive(Debug, Error)]
pub enum SelectError {
    /// The file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A typing mistake would make an empty file.
    #[error("the recording has no `{name}`; it has {}", listed(there))]
    NoName {
        /// What was asked for.
        name: String,
        /// All topics.
        there: Vec<ForeignText>,
    },
    /// The end is not behind the beginning.
    #[error("the time range is empty: it begins at {from_ns} ns and ends at {until_ns} ns")]
    NoTime {
        /// Begin.
        from_ns: u64,
        /// End.
        until_ns: u64,
    },
}

impl Selection {
    /// Whether anything can be in its time range.
    pub(crate) fn check_time(&self) -> Result<(), SelectError> {
        match (self.from_ns, self.until_ns) {
            (Some(from_ns), Some(until_ns)) if from_ns >= until_ns => Err(SelectError::NoTime { from_ns, until_ns }),
            _ => Ok(()),
        }
    }

    /// Whether each of its names is there.
    pub(crate) fn check_names<'a>(&self, channels: impl Iterator<Item = &'a Definition>) -> Result<(), SelectError> {
        let channels: Vec<&Definition> = channels.collect();
        let is_missing = |name: &&String| !channels.iter().any(|channel| is_of(channel, name));
        let Some(name) = self.names.iter().find(is_missing) else { return Ok(()) };
        let mut there: Vec<ForeignText> = channels.iter().map(|channel| channel.topic.as_str().into()).collect();
        there.sort();
        there.dedup();
        Err(SelectError::NoName { name: name.clone(), there })
    }

    pub(crate) fn has_time(&self, first_ns: u64, last_ns: u64) -> bool {
        self.from_ns.is_none_or(|from| last_ns >= from) && self.until_ns.is_none_or(|until| first_ns < until)
    }

    pub(crate) fn has_channel(&self, channel: &Definition) -> bool {
        self.names.is_empty() || self.names.iter().any(|name| is_of(channel, name))
    }

    /// For the new file: from which it was made, and what was taken.
    pub(crate) fn about(&self, path: &Path) -> BTreeMap<String, String> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut texts = BTreeMap::from([("file".to_owned(), name)]);
        let numbers = [("from-ns", self.from_ns), ("until-ns", self.until_ns), ("period-ns", self.period_ns)];
        texts.extend(numbers.into_iter().filter_map(|(key, ns)| Some((key.to_owned(), ns?.to_string()))));
        if !self.names.is_empty() {
            texts.insert("names".to_owned(), self.names.join(" "));
        }
        texts
    }
}

/// Topics in one line.
pub(crate) fn listed(topics: &[ForeignText]) -> String {
    topics.iter().map(ForeignText::to_string).collect::<Vec<_>>().join(", ")
}

fn is_of(channel: &Definition, name: &str) -> bool {
    let says = |key: &str| channel.texts.get(key).is_some_and(|its| its == name);
    channel.topic == name || says(key::NAME) || says(key::DRAWN)
}
