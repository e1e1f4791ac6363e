//! What a closed file describes, and where its parts are: by its index, as far as that lists them, else by reading all
//! of it. Files of others may have no index, or one without some kinds of records.

use crate::error::{Damage, ReadError, Shown};
use crate::format::op;
use crate::read::attachment::Attachment;
use crate::read::contents::{Contents, Ending, Item};
use crate::read::definitions::Definitions;
use crate::read::frames::Frames;
use crate::read::index::Index;
use mcap::records::ChunkIndex;

/// The parts of a closed file.
pub(crate) struct Outline {
    pub(crate) definitions: Definitions,
    /// Where metadata is.
    pub(crate) metadata: Vec<u64>,
    pub(crate) attachments: Vec<Attachment>,
    /// All chunks, if each message is in one that is listed.
    pub(crate) chunks: Option<Vec<ChunkIndex>>,
}

impl Outline {
    pub(crate) fn read(frames: &mut Frames) -> Result<Self, ReadError> {
        let index = Index::read(frames)?;
        let chunks = index.knows_all_chunks().then_some(index.chunks.clone());
        if !(index.describes_all_channels() && index.lists_what_is_no_message()) {
            return Self::read_through(frames, chunks);
        }
        let mut attachments = Vec::new();
        for its in &index.attachments {
            let told = Attachment::at(frames, its.offset, its.length)?;
            let damaged = |what| ReadError::Damaged { path: Shown(frames.path().to_owned()), at: its.offset, what };
            attachments.push(told.map_err(damaged)?);
        }
        let metadata = index.metadata.iter().map(|its| its.offset).collect();
        Ok(Self { definitions: index.definitions, metadata, attachments, chunks })
    }

    fn read_through(frames: &Frames, chunks: Option<Vec<ChunkIndex>>) -> Result<Self, ReadError> {
        let mut contents = Contents::open(frames.path())?;
        let (mut metadata, mut attachments) = (Vec::new(), Vec::new());
        while let Some(item) = contents.next()? {
            match item {
                Item::Message(_) => {}
                Item::Metadata(_) => metadata.push(contents.begins()),
                Item::Attachment(its) => attachments.push(its),
                Item::Damaged(at, what) => return Err(contents.damaged(at, what)),
            }
        }
        match contents.ending() {
            Some(Ending::Closed) => {
                Ok(Self { definitions: contents.definitions().clone(), metadata, attachments, chunks })
            }
            _ => Err(contents.damaged(contents.at(), Damage::Record { op: op::FOOTER })),
        }
    }
}
