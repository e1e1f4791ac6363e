//! Recordings that tests write and read themselves.

use crate::harness::Place;
use rohrpost::schema::Type;
use rohrpost_recording::{
    ChannelId, ChannelSpec, Message, Options, Reader, RecordedChannel, Session, Writer, is_closed,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Begins the recording `stem-0001.mcap`.
pub(crate) fn begin(place: &Place, stem: &str, session: Session) -> Writer {
    Writer::start(Options { leave_bytes: 0, ..Options::new(place.path(""), stem) }, session).unwrap()
}

/// A recording on this node, of a robot with a configuration of this text.
pub(crate) fn session(node: &str, file: &str, configuration: &str) -> Session {
    let configuration = BTreeMap::from([(file.to_owned(), configuration.to_owned())]);
    Session { node: node.into(), configuration, ..Session::default() }
}

/// A channel without further texts.
pub(crate) fn channel(writer: &mut Writer, name: &str, item: &str, ty: &Type) -> ChannelId {
    writer.channel(&ChannelSpec { name, item, ty, texts: BTreeMap::new() }).unwrap()
}

/// Closes the first file of a recording.
pub(crate) fn end(place: &Place, stem: &str, writer: Writer) -> PathBuf {
    writer.finish().1.unwrap();
    place.path(&format!("{stem}-0001.mcap"))
}

/// What is made of the messages of a whole file.
pub(crate) fn messages<T>(file: &Path, mut read: impl FnMut(&RecordedChannel, &Message<'_>) -> Option<T>) -> Vec<T> {
    let mut made = Vec::new();
    let mut reader = Reader::open(file).unwrap();
    while let Some((channel, message)) = reader.next().unwrap() {
        made.extend(read(&channel, &message));
    }
    made
}

/// What is made of the messages that are there so far, of a file that may be one that is being written.
pub(crate) fn messages_so_far<T>(
    file: &Path,
    mut read: impl FnMut(&RecordedChannel, &Message<'_>) -> Option<T>,
) -> Vec<T> {
    if is_closed(file).unwrap_or(false) {
        return messages(file, read);
    }
    let mut made = Vec::new();
    let Ok(mut reader) = Reader::open(file) else { return made };
    while let Ok(Some((channel, message))) = reader.next() {
        made.extend(read(&channel, &message));
    }
    made
}
