//! How a recording goes, seen by tools.

use crate::interface;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// How a recording goes. All counts are since the recorder was switched on, and `written + lost + waiting` are all that
/// came.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct RecordingState {
    /// The file that is written now.
    pub file: Option<String>,
    /// Why nothing is written now; messages wait in memory, and are lost once it is full.
    pub problem: Option<String>,
    /// Channels.
    pub channels: u32,
    /// Messages that are in files.
    #[schema(unit = "messages")]
    pub written: u64,
    /// Of those, how many the disk has for certain.
    #[schema(unit = "messages")]
    pub synced: u64,
    /// Of those written, how many may be lost with the file or disk that had them.
    #[schema(unit = "messages")]
    pub unsure: u64,
    /// Messages that are in no file, though they should be.
    #[schema(unit = "messages")]
    pub lost: u64,
    /// Why they are in none.
    pub lost_by: LostBy,
    /// Messages in memory.
    #[schema(unit = "messages")]
    pub waiting: u64,
    /// Length of all files.
    #[schema(unit = "B")]
    pub bytes: u64,
    /// Files that were closed whole.
    #[schema(unit = "files")]
    pub files_closed: u64,
    /// Files that were given up after an error.
    #[schema(unit = "files")]
    pub files_torn: u64,
}

/// What became of the messages of one channel.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct RecordedMessages {
    /// Module and item: `laser.0/scan`.
    pub topic: String,
    /// Messages in files.
    #[schema(unit = "messages")]
    pub written: u64,
    /// Messages in no file.
    #[schema(unit = "messages")]
    pub lost: u64,
    /// Why they are in none.
    pub lost_by: LostBy,
}

/// Messages in no file, by cause.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct LostBy {
    /// Lost between two nodes.
    #[schema(unit = "messages")]
    pub way: u64,
    /// Came while no recorder ran.
    #[schema(unit = "messages")]
    pub away: u64,
    /// Came faster than the recorder takes them, which had its processor.
    #[schema(unit = "messages")]
    pub recorder: u64,
    /// Came while other programs had the recorder's processor.
    #[schema(unit = "messages")]
    pub processor: u64,
    /// Came faster than the disk takes them, or while it failed.
    #[schema(unit = "messages")]
    pub disk: u64,
    /// Longer than a recording, or the recorder's mailbox, takes.
    #[schema(unit = "messages")]
    pub long: u64,
}

/// Some of a recording's channels.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ChannelPage {
    /// All there are.
    pub total: u32,
    /// From the one that was asked for on, as many as fit in a reply.
    pub channels: Vec<RecordedMessages>,
}

/// Records what modules publish and say.
#[interface(class = "logd", crate = crate::macro_support)]
pub trait Recorder {
    /// How the recording goes.
    #[command(16, idempotent)]
    fn recording(&mut self) -> RecordingState;

    /// How its channels go, from this number on.
    #[command(17, idempotent)]
    fn channels(&mut self, from: u32) -> ChannelPage;

    /// Obeys a line of log control: `on`, `off`, `directory PATH`, `status`, `mark TEXT` or `rotate`. The number of its
    /// answer.
    #[command(18)]
    fn order(&mut self, line: String) -> u32;

    /// The answer to an order: `OK`, with what is to be told, or `ERR` and why. None: not yet.
    #[command(19, idempotent)]
    fn answer(&mut self, order: u32) -> Option<String>;

    /// How the recording goes, several times a second.
    #[data(1)]
    fn state() -> RecordingState;
}
