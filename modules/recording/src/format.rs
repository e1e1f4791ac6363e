//! What of MCAP a recording uses, and the names that only recordings of Rohrpost have.

use mcap::records::Header;
pub(crate) use mcap::records::op;
use std::collections::BTreeMap;

/// The header's profile.
pub const PROFILE: &str = "rohrpost";
/// Library in the header of each file, before its version.
const LIBRARY: &str = "rohrpost-recording/";
/// Behind the library of another program, in a file that is made of its file.
const BY_WAY_OF: &str = ", by way of ";
/// How messages are encoded.
pub const MESSAGE_ENCODING: &str = "postcard";
/// How types are described: bytes of `rohrpost-schema`'s `Type`, by the table in `docs/src/wire.md`.
pub const SCHEMA_ENCODING: &str = "rohrpost-schema";
/// Version of these names, in each session's metadata.
pub const VERSION: u32 = 1;

/// A chunk before compression, unless a single message is longer.
pub const CHUNK_BYTES_MAX: usize = 1 << 20;
/// A message. Longer ones are refused.
pub const MESSAGE_BYTES_MAX: usize = 16 << 20;
/// A record that is read, and a chunk before compression: others write long ones. A reader has some of them in memory
/// at once.
pub const RECORD_BYTES_MAX: usize = 128 << 20;
/// Messages that wait for their turn take no more memory than this.
pub(crate) const HELD_BYTES_MAX: usize = 256 << 20;
/// Memory for the descriptions of types, channels and modules in one file. Those of a robot take some megabytes.
pub(crate) const DESCRIBED_BYTES_MAX: usize = 256 << 20;
/// What a message takes besides its data: type, length, channel, sequence and two times.
pub(crate) const MESSAGE_OVERHEAD_BYTES: usize = 9 + 22;

/// Names of metadata records.
pub mod metadata {
    /// Which node recorded, with which versions; first in each file.
    pub const SESSION: &str = "rohrpost.session";
    /// The texts of the configuration: file name and content; in each file.
    pub const CONFIGURATION: &str = "rohrpost.configuration";
    /// A module of which something is recorded, and what it offers: `name`, `class`, `interface`, `description`.
    pub const DESCRIPTION: &str = "rohrpost.description";
    /// System time has stepped: `epoch`, and `arrival-ns` of the first message of it.
    pub const EPOCH: &str = "rohrpost.epoch";
    /// Messages that are not in the file: a count for each topic, from the file's beginning. The last one counts.
    pub const LOST: &str = "rohrpost.lost";
    /// Why they are not in it: a count for each topic and [cause](crate::LossCause::name), with a blank between both,
    /// as in [`LOST`].
    pub const LOST_BY: &str = "rohrpost.lost-by";
    /// A mark that was set while it was recorded: `text`, `time-ns`, `epoch`.
    pub const MARK: &str = "rohrpost.mark";
    /// The file was closed: `reason`.
    pub const CLOSED: &str = "rohrpost.closed";
    /// The file was made by `recover`: from which, how much, why.
    pub const RECOVERED: &str = "rohrpost.recovered";
    /// The file was made by `cut`: from which, and what was taken.
    pub const CUT: &str = "rohrpost.cut";
    /// The file was made by `draw`: from which, and what was taken.
    pub const DRAWN: &str = "rohrpost.drawn";
    /// The file was made by `merge`: a number and a name for each.
    pub const MERGED: &str = "rohrpost.merged";
}

/// Keys of a session's metadata.
pub mod session_key {
    /// Tells recordings apart: the same in all files of one, another in each other.
    pub const RECORDING: &str = "recording";
}

/// Keys of a channel's metadata.
pub mod key {
    /// All of them.
    pub(crate) const ALL: [&str; 6] = [NAME, ITEM, EPOCH, REPEATED, DRAWN, REDUCED];
    /// The name of what publishes, as `laser.0`.
    pub const NAME: &str = "name";
    /// What it publishes, as `scan`.
    pub const ITEM: &str = "item";
    /// Of system time. A step begins another channel of the same topic, so each message says its epoch.
    pub const EPOCH: &str = "epoch";
    /// Of a channel with what came last before the file, from an earlier one, as a beginning: `true`. The log time of
    /// its messages is that of the file's first message, the publish time is the stamp.
    pub const REPEATED: &str = "repeated";
    /// What [`REPEATED`] says, in a file of another program, where that key means something else.
    pub(crate) const REPEATED_OF_OTHERS: &str = "rohrpost.repeated";
    /// Of a channel that was drawn of another one, for other programs: the topic of that.
    pub const DRAWN: &str = "drawn";
    /// Of a drawn channel with fewer pixels or points than what was recorded, so that nothing long is in a file twice:
    /// `true`.
    pub const REDUCED: &str = "reduced";
}

/// What names of our metadata begin with.
const METADATA: &str = "rohrpost.";

/// Whether metadata of this name are ours to say.
pub(crate) fn is_our_word(name: &str) -> bool {
    name.starts_with(METADATA)
}

/// Whether a file is of another program, by its header. Our words mean nothing there.
pub(crate) fn is_of_others(header: &Header) -> bool {
    header.profile != PROFILE && !header.library.starts_with(LIBRARY)
}

/// The header of our files.
pub(crate) fn our_header() -> Header {
    Header { profile: PROFILE.to_owned(), library: our_library() }
}

fn our_library() -> String {
    format!("{LIBRARY}{}", env!("CARGO_PKG_VERSION"))
}

/// The header of a file that is made of others. What only other programs wrote stays theirs: their profile, or none if
/// they have several, and their words.
pub(crate) fn header_of_made<'a>(old: impl IntoIterator<Item = Option<&'a Header>>) -> Header {
    let mut made: Option<Header> = None;
    for header in old {
        let Some(header) = header.filter(|header| is_of_others(header)) else { return our_header() };
        let library = match header.library.split(BY_WAY_OF).next() {
            None | Some("") => "unknown",
            Some(library) => library,
        };
        let library = || format!("{library}{BY_WAY_OF}{}", our_library());
        let made = made.get_or_insert_with(|| Header { profile: header.profile.clone(), library: library() });
        if made.profile != header.profile {
            made.profile.clear();
        }
    }
    made.unwrap_or_else(our_header)
}

/// The topic of an item.
pub fn topic(name: &str, item: &str) -> String {
    format!("{name}/{item}")
}

/// Counts by topic, as metadata has them.
pub(crate) fn counts(texts: &BTreeMap<String, String>) -> BTreeMap<String, u64> {
    texts.iter().filter_map(|(topic, count)| Some((topic.clone(), count.parse().ok()?))).collect()
}
