//! Streams that a module writes: made when it starts, one for each that its interfaces have.

use super::encode::ends_with_bytes;
use super::error::{RecordError, in_words};
use crate::runtime::error::StartError;
use rohrpost_config::{Installation, Module};
use rohrpost_mailbox::{Name, Participant, StreamId, StreamWriter, WriteError};
use rohrpost_schema::Description;
use std::sync::Arc;
use std::time::Duration;

/// A stream in an interface.
#[derive(Clone)]
pub(crate) struct StreamItem {
    pub(crate) number: u16,
    pub(crate) name: String,
    /// Its values can be filled in place.
    pub(super) ends_with_bytes: bool,
}

impl StreamItem {
    /// Those of an interface.
    pub(crate) fn all_of(description: &Description) -> Vec<Self> {
        let item = |item: &rohrpost_schema::DataItem| Self {
            number: item.number,
            name: item.field.name.clone(),
            ends_with_bytes: ends_with_bytes(&item.field.ty),
        };
        description.streams().map(item).collect()
    }
}

/// What an error says of a stream, besides its name.
pub(crate) struct OwnAbout {
    pub(crate) endpoint: usize,
    pub(crate) item: StreamItem,
    /// The module or alias, as the configuration has it.
    pub(crate) module: String,
}

/// A stream that the module writes.
pub(crate) struct OwnStream {
    pub(crate) about: OwnAbout,
    pub(crate) writer: StreamWriter,
}

/// Streams of an interface that the module serves.
pub(in crate::runtime) struct ServedStreams<'a> {
    /// The module or alias.
    pub(in crate::runtime) name: Name,
    pub(in crate::runtime) items: &'a [StreamItem],
    /// The interface is another than the one that was served under this name before, as far as is known.
    pub(in crate::runtime) is_new: bool,
}

/// All of them.
pub(crate) type OwnStreams = Vec<OwnStream>;

/// Makes the streams of all interfaces that the module serves.
pub(in crate::runtime) fn make(
    participant: &Arc<Participant>,
    installation: &Installation,
    module: &Module,
    served: &[ServedStreams<'_>],
) -> Result<OwnStreams, StartError> {
    all_are_known(installation, module, served)?;
    let mut streams = Vec::new();
    for (endpoint, served) in served.iter().enumerate() {
        for item in served.items {
            let id = StreamId { name: served.name, number: item.number };
            if served.is_new {
                // Its records are of another type, perhaps. If somebody writes it, the next line says so.
                participant.node().remove_orphan_stream(id)?;
            }
            let spec = module.streams.get(&item.name).copied().unwrap_or_default();
            let writer = participant
                .stream_writer(id, spec.shape())
                .map_err(|error| StartError::Stream(in_words(&error, id, &item.name, &installation.classes)))?;
            let about = OwnAbout { endpoint, item: item.clone(), module: installation.classes.format(served.name) };
            streams.push(OwnStream { about, writer });
        }
    }
    Ok(streams)
}

/// Each stream of the configuration is one of an interface.
fn all_are_known(installation: &Installation, module: &Module, served: &[ServedStreams<'_>]) -> Result<(), StartError> {
    let mut known: Vec<&str> = served.iter().flat_map(|served| served.items).map(|item| item.name.as_str()).collect();
    known.sort_unstable();
    let unknown = module.streams.keys().find(|name| !known.contains(&name.as_str()));
    let Some(unknown) = unknown else { return Ok(()) };
    let known = if known.is_empty() { "it has none".into() } else { format!("it has `{}`", known.join("`, `")) };
    let place = format!("{}:{}", installation.path.display(), installation.document().stream_line(module, unknown));
    let module = installation.classes.format(module.name);
    Err(StartError::NoStream { place, module, stream: unknown.clone(), known })
}

/// Closes the streams and removes them: nobody writes them any more.
pub(in crate::runtime) fn remove(participant: &Participant, streams: OwnStreams) {
    for stream in streams {
        let id = stream.writer.id();
        drop(stream);
        if let Err(error) = participant.node().remove_orphan_stream(id) {
            tracing::debug!("stream {id} stays: {error}");
        }
    }
}

impl OwnStream {
    /// Whether it is this item of this endpoint.
    pub(crate) fn is(&self, endpoint: usize, number: u16) -> bool {
        (self.about.endpoint, self.about.item.number) == (endpoint, number)
    }
}

impl OwnAbout {
    /// The same with the names that people know.
    #[cold]
    pub(in crate::runtime) fn explain(&self, error: WriteError) -> RecordError {
        let (stream, module) = (self.item.name.clone(), self.module.clone());
        match error {
            WriteError::TooLarge { len: len_bytes, max: max_bytes, .. } => {
                RecordError::TooLarge { stream, module, len_bytes, max_bytes }
            }
            WriteError::Late { behind_ns, late_ns, .. } => {
                let (behind, late) = (Duration::from_nanos(behind_ns), Duration::from_nanos(late_ns));
                RecordError::Late { stream, module, behind, late }
            }
            WriteError::OldEpoch { epoch, newest, .. } => RecordError::OldEpoch { stream, module, epoch, newest },
            WriteError::Unstamped(_) => RecordError::Unstamped { stream, module },
            WriteError::Damaged(_) => RecordError::Damaged { stream, module },
        }
    }
}

/// Whether the interface of a mailbox, as it was before this start, is another than `hash`, or is not known.
pub(in crate::runtime) fn is_new(participant: &Participant, commands: Name, hash: u32) -> bool {
    let before = participant.node().about(commands).and_then(|about| Description::from_bytes(&about).ok());
    before.is_none_or(|before| before.hash() != hash)
}
