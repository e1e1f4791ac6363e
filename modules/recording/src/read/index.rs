//! The index at the end of a closed file.

use crate::error::{Damage, ReadError, Shown};
use crate::format::op;
use crate::read::definitions::{Definitions, Untaken};
use crate::read::frames::{Frames, HEAD_BYTES, Step};
use mcap::records::{AttachmentIndex, ChunkIndex, MessageIndex, MetadataIndex, Record, Statistics};

/// Footer: where the summary begins, where its offsets do, its sum.
const FOOTER_BYTES: usize = 8 + 8 + 4;

/// What a closed file says about itself.
#[derive(Default)]
pub(crate) struct Index {
    pub(crate) definitions: Definitions,
    /// These are in the order of the file, each once.
    pub(crate) chunks: Vec<ChunkIndex>,
    pub(crate) metadata: Vec<MetadataIndex>,
    pub(crate) attachments: Vec<AttachmentIndex>,
    /// Others may count nothing.
    pub(crate) statistics: Option<Statistics>,
    /// The index has a sum, which is right. Others may write none.
    pub(crate) is_checked: bool,
    /// Where the file's last record begins.
    footer_at: u64,
}

impl Index {
    /// Whether each message is in a chunk that is listed here, and these are apart. Others may write no chunks, or list
    /// none.
    pub(crate) fn knows_all_chunks(&self) -> bool {
        let listed = self.chunks.len() as u64;
        let behind = self.chunks.iter().skip(1).map(|chunk| chunk.chunk_start_offset).chain([self.footer_at]);
        let ends = |chunk: &ChunkIndex| chunk.chunk_start_offset.saturating_add(chunk.chunk_length);
        self.chunks.iter().zip(behind).all(|(chunk, behind)| ends(chunk) <= behind)
            && self
                .statistics
                .as_ref()
                .is_some_and(|its| listed == u64::from(its.chunk_count) && (listed > 0 || its.message_count == 0))
    }

    /// Whether each channel with messages is described here. Others may not describe them again.
    pub(crate) fn describes_all_channels(&self) -> bool {
        self.statistics.as_ref().is_some_and(|its| {
            let counts = &its.channel_message_counts;
            let counted = counts.values().try_fold(0_u64, |sum, count| sum.checked_add(*count));
            counted == Some(its.message_count) && counts.keys().all(|id| self.definitions.channel(*id).is_some())
        })
    }

    /// Whether metadata and attachments are all listed here.
    pub(crate) fn lists_what_is_no_message(&self) -> bool {
        self.statistics.as_ref().is_some_and(|its| {
            let listed = (self.metadata.len() as u64, self.attachments.len() as u64);
            listed == (its.metadata_count.into(), its.attachment_count.into())
        })
    }

    /// Whether it says of each channel with messages in which chunks they are.
    pub(crate) fn knows_all_channels(&self) -> bool {
        let has_offset = |id: &u16| self.chunks.iter().any(|chunk| chunk.message_index_offsets.contains_key(id));
        let counts = self.statistics.iter().flat_map(|its| &its.channel_message_counts);
        self.knows_all_chunks()
            && self.describes_all_channels()
            && counts.into_iter().all(|(id, messages)| *messages == 0 || has_offset(id))
    }

    /// Whether its times can be those of messages: the first is not behind the last.
    pub(crate) fn knows_times(&self) -> bool {
        self.statistics.as_ref().is_some_and(|its| its.message_start_time <= its.message_end_time)
    }

    /// Reads it, checked by its sum. A file that was closed need not have one; then nothing is in it.
    pub(crate) fn read(frames: &mut Frames) -> Result<Self, ReadError> {
        let not_closed = ReadError::NotClosed { path: Shown(frames.path().to_owned()) };
        let footer_at = frames.len().saturating_sub((HEAD_BYTES + FOOTER_BYTES + mcap::MAGIC.len()) as u64);
        let Some(tail) = frames.tail((HEAD_BYTES + FOOTER_BYTES + mcap::MAGIC.len()) as u64)? else {
            return Err(not_closed);
        };
        let (footer, magic) = tail.split_at(HEAD_BYTES + FOOTER_BYTES);
        if magic != mcap::MAGIC || footer[0] != op::FOOTER {
            return Err(not_closed);
        }
        let (head, body) = footer.split_at(HEAD_BYTES);
        let Ok(Record::Footer(footer)) = mcap::parse_record(op::FOOTER, body) else { return Err(not_closed) };
        if footer.summary_start > footer_at {
            return Err(not_closed);
        }
        let mut sum_end = head.to_vec();
        sum_end.extend_from_slice(&body[..FOOTER_BYTES - 4]);
        let mut read = Reading::default();
        frames.seek(mcap::MAGIC.len() as u64)?;
        if frames.step()? == Step::Record(op::HEADER)
            && let Ok(Record::Header(header)) = mcap::parse_record(op::HEADER, frames.body())
        {
            read.index.definitions.know(&header);
        }
        let from = if footer.summary_start == 0 { footer_at } else { footer.summary_start };
        let told = read.summary(frames, from, footer_at)?;
        read.sum.update(&sum_end);
        let is_right = footer.summary_crc == 0 || footer.summary_crc == read.sum.clone().finalize();
        match (told, is_right) {
            (Some(damage), _) => Err(damaged(frames, damage)),
            (None, false) => Err(damaged(frames, Damage::SummarySum)),
            (None, true) => {
                let Reading { mut index, .. } = read;
                sort_places(&mut index.chunks, |its| its.chunk_start_offset);
                sort_places(&mut index.metadata, |its| its.offset);
                sort_places(&mut index.attachments, |its| its.offset);
                Ok(Self { is_checked: footer.summary_crc != 0, footer_at, ..index })
            }
        }
    }
}

/// What is read so far.
#[derive(Default)]
struct Reading {
    index: Index,
    sum: crc32fast::Hasher,
}

impl Reading {
    /// All records up to the footer; what is wrong with them.
    fn summary(&mut self, frames: &mut Frames, from: u64, footer_at: u64) -> Result<Option<Damage>, ReadError> {
        frames.seek(from)?;
        while frames.at() < footer_at {
            let Step::Record(op) = frames.step()? else { return Ok(Some(Damage::SummarySum)) };
            let body = frames.body();
            self.sum.update(&[op]);
            self.sum.update(&(body.len() as u64).to_le_bytes());
            self.sum.update(body);
            match self.record(op, body) {
                Ok(()) => {}
                Err(Untaken::Damaged(damage)) => return Ok(Some(damage)),
                Err(Untaken::TooMuch(limit)) => {
                    return Err(ReadError::TooMuch { path: Shown(frames.path().to_owned()), limit });
                }
            }
        }
        Ok((frames.at() != footer_at).then_some(Damage::SummarySum))
    }

    fn record(&mut self, op: u8, body: &[u8]) -> Result<(), Untaken> {
        match op {
            op::SCHEMA | op::CHANNEL => match self.index.definitions.add(op, body) {
                // Others may describe channels here again and schemas not.
                Err(Untaken::Damaged(Damage::UnknownSchema(_))) => return Ok(()),
                told => return told,
            },
            op::CHUNK_INDEX | op::METADATA_INDEX | op::ATTACHMENT_INDEX | op::STATISTICS => {}
            _ => return Ok(()),
        }
        match mcap::parse_record(op, body).map_err(|_| Damage::Record { op })? {
            Record::ChunkIndex(its) => self.index.chunks.push(its),
            Record::MetadataIndex(its) => self.index.metadata.push(its),
            Record::AttachmentIndex(its) => self.index.attachments.push(its),
            Record::Statistics(its) => self.index.statistics = Some(its),
            _ => {}
        }
        Ok(())
    }
}

/// Puts parts in the order of the file. One that is listed twice is there once, and then they are not as many as the
/// file says it has.
fn sort_places<T>(listed: &mut Vec<T>, place: impl Fn(&T) -> u64) {
    listed.sort_by_key(&place);
    listed.dedup_by_key(|its| place(its));
}

/// When the first and the last of a channel's messages in a chunk came.
pub(crate) fn times_at(frames: &mut Frames, at: u64) -> Result<Option<(u64, u64)>, ReadError> {
    let times = log_times_at(frames, at)?;
    Ok(times.iter().copied().min().zip(times.iter().copied().max()))
}

/// When the last of them came that arrived before a time.
pub(crate) fn last_before(frames: &mut Frames, at: u64, before_ns: u64) -> Result<Option<u64>, ReadError> {
    Ok(log_times_at(frames, at)?.into_iter().filter(|log_ns| *log_ns < before_ns).max())
}

fn log_times_at(frames: &mut Frames, at: u64) -> Result<Vec<u64>, ReadError> {
    frames.seek(at)?;
    let what = Damage::Record { op: op::MESSAGE_INDEX };
    let parsed = match frames.step()? {
        Step::Record(op::MESSAGE_INDEX) => mcap::parse_record(op::MESSAGE_INDEX, frames.body()),
        _ => return Err(damaged(frames, what)),
    };
    let Ok(Record::MessageIndex(MessageIndex { records, .. })) = parsed else { return Err(damaged(frames, what)) };
    Ok(records.iter().map(|entry| entry.log_time).collect())
}

fn damaged(frames: &Frames, what: Damage) -> ReadError {
    ReadError::Damaged { path: Shown(frames.path().to_owned()), at: frames.at(), what }
}
