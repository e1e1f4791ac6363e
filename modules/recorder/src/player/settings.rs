//! The settings of the player, which `rohrpost replay` writes into the configuration of its node.

use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;
use std::path::PathBuf;
use std::time::Duration;

/// A round takes so long at least, also if what is repeated is shorter: rounds of no length would take a processor.
pub const ROUND_MIN: Duration = Duration::from_millis(100);

/// What `rohrpost replay` writes into the configuration of its node.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PlayerSettings {
    /// The recording, in order.
    pub files: Vec<RecordingPath>,
    /// When the recording begins, ns since 1970.
    pub begin_ns: u64,
    /// When it ends, likewise.
    pub end_ns: u64,
    /// Names that it stands in for, and files with their descriptions.
    pub described: Vec<(String, String)>,
    /// What it plays.
    pub topics: BTreeSet<String>,
    /// Topics of another program, and those in which their messages are played as bytes.
    pub into: Vec<(String, String)>,
    /// The file with the answers of modules.
    pub answers: Option<String>,
    /// Times the recorded speed.
    pub rate: f64,
    /// The part that is played: from when on, and up to when.
    pub from_ns: Option<u64>,
    /// See `from_ns`.
    pub until_ns: Option<u64>,
    /// Whether it begins again at its end.
    #[serde(default)]
    pub repeats: bool,
}

/// Where a recording is. Names of files are bytes, and configurations are texts: of a name that is no text they have
/// the numbers of its bytes.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn a_recording_may_have_any_name() {
        for name in [&b"main-0001.mcap"[..], b"T\xfcr.mcap", b"\xff", "T\u{fc}r.mcap".as_bytes()] {
            let path = PathBuf::from(OsString::from_vec(name.to_vec()));
            let written = toml::to_string(&BTreeMap::from([("file", RecordingPath::from(path.clone()))]));
            let mut read: BTreeMap<String, RecordingPath> = toml::from_str(&written.unwrap()).unwrap();
            assert_eq!(PathBuf::from(read.remove("file").unwrap()), path);
        }
    }
}
