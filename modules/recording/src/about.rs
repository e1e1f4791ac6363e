//! What a file says besides its messages, as it is kept for a description of the file.

use crate::error::ReadError;
use crate::format::{self, metadata};
use crate::loss::Losses;
use crate::read::contents::Contents;
use crate::read::cost::DescribedBytes;
use mcap::records::{AttachmentIndex, Metadata};
use std::collections::BTreeMap;

/// What was read of that.
#[derive(Default)]
pub(crate) struct About {
    pub(crate) metadata: Vec<Metadata>,
    /// What they take.
    pub(crate) memory: DescribedBytes,
    /// Of its losses it tells often; the last counts.
    pub(crate) lost: BTreeMap<String, u64>,
    pub(crate) losses: BTreeMap<String, Losses>,
    pub(crate) attachments: Vec<AttachmentIndex>,
}

impl About {
    /// Takes metadata.
    pub(crate) fn add(&mut self, contents: &Contents, its: Metadata) -> Result<(), ReadError> {
        match its.name.as_str() {
            metadata::LOST if contents.heeds(&its) => self.lost = format::counts(&its.metadata),
            metadata::LOST_BY if contents.heeds(&its) => self.losses = Losses::of_texts(&its.metadata),
            _ => {
                self.memory.add_metadata(&its).map_err(|limit| contents.too_much(limit))?;
                self.metadata.push(its);
            }
        }
        Ok(())
    }
}
