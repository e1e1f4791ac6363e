//! The settings of the player, which `rohrpost replay` writes into the configuration of its node.

use serde::Deserialize;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;
use std::path::PathBuf;
use std::time::Duration;
use toml::Value;

/// A round takes so long at least, also if what is repeated is shorter: rounds of no length would take a processor.
pub const ROUND_MIN: Duration = Duration::from_millis(100);

/// What `rohrpost replay` writes into the configuration of its node.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct PlayerSettings {
    /// The recording, in order.
    pub(super) files: Vec<RecordingPath>,
    /// When the recording begins and ends, ns since 1970.
    pub(super) begin_ns: u64,
    pub(super) end_ns: u64,
    /// Names that it stands in for, and files with their descriptions.
    pub(super) described: Vec<(String, String)>,
    /// What it plays.
    pub(super) topics: BTreeSet<String>,
    /// Topics of another program, and those in which their messages are played as bytes.
    pub(super) into: Vec<(String, String)>,
    /// The file with the answers of modules.
    pub(super) answers: Option<String>,
    /// Times the recorded speed.
    pub(super) rate: f64,
    pub(super) from_ns: Option<u64>,
    pub(super) until_ns: Option<u64>,
    #[serde(default)]
    pub(super) repeats: bool,
}

/// Where a recording is. Names of files are bytes, and configurations are texts: of a name that is no text they have
/// the numbers of its bytes.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
pub enum RecordingPath {
    /// One that is a text.
    Text(String),
    /// Another one.
    Bytes(Vec<u8>),
}

impl From<PathBuf> for RecordingPath {
    fn from(path: PathBuf) -> Self {
        path.into_os_string().into_string().map_or_else(|name| Self::Bytes(name.into_vec()), Self::Text)
    }
}

impl From<RecordingPath> for PathBuf {
    fn from(path: RecordingPath) -> Self {
        match path {
            RecordingPath::Text(text) => text.into(),
            RecordingPath::Bytes(bytes) => OsString::from_vec(bytes).into(),
        }
    }
}

impl From<RecordingPath> for Value {
    fn from(path: RecordingPath) -> Self {
        match path {
            RecordingPath::Text(text) => text.into(),
            RecordingPath::Bytes(bytes) => bytes.into_iter().map(i64::from).collect::<Vec<_>>().into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use toml::Table;

    #[test]
    fn a_recording_may_have_any_name() {
        for name in [&b"main-0001.mcap"[..], b"T\xfcr.mcap", b"\xff", "T\u{fc}r.mcap".as_bytes()] {
            let path = PathBuf::from(OsString::from_vec(name.to_vec()));
            let written =
                toml::to_string(&Table::from_iter([("file".to_owned(), RecordingPath::from(path.clone()).into())]));
            let mut read: std::collections::BTreeMap<String, RecordingPath> =
                toml::from_str(&written.unwrap()).unwrap();
            assert_eq!(PathBuf::from(read.remove("file").unwrap()), path);
        }
    }
}
