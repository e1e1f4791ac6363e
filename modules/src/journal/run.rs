//! A module's run, as a file for the program that is to repeat it.

use super::bytes::Blob;
use super::entry::{Entries, NoEntry, VERSION};
use super::list;
use super::outputs::Begin;
use super::records::{NamedRecord, RecordSum, Records};
use super::replay::JournalReplay;
use super::tag::Tag;
use rohrpost_config::{Installation, Saved};
use rohrpost_mailbox::Name;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Variable of the environment with the path of an [`ExactRun`]: the module's program repeats it, and does nothing
/// else.
pub const VARIABLE: &str = "ROHRPOST_EXACT";
/// Bytes in a record of a journal before its entries.
pub(super) const PIECE_HEAD_BYTES: usize = 12;

/// What is in one record of a journal.
///
/// ```
/// use rohrpost_modules::journal::Piece;
///
/// let mut record = [0; 64];
/// let piece = Piece { incarnation: 7, offset: 4068, bytes: b"entries" };
/// let len = piece.write(&mut record);
/// assert_eq!(Piece::read(&record[..len]), Some(piece));
/// assert_eq!(Piece::read(&record[..5]), None);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Piece<'a> {
    /// Tells journals of one module from each other.
    pub incarnation: u32,
    /// Bytes of the journal before this piece.
    pub offset: u64,
    /// Of its entries.
    pub bytes: &'a [u8],
}

impl<'a> Piece<'a> {
    /// From the value of a record, which is postcard of bytes.
    pub fn read(value: &'a [u8]) -> Option<Self> {
        let body: Blob<'a> = postcard::from_bytes(value).ok()?;
        let (incarnation, rest) = body.0.split_first_chunk()?;
        let (offset, bytes) = rest.split_first_chunk()?;
        Some(Self { incarnation: u32::from_le_bytes(*incarnation), offset: u64::from_le_bytes(*offset), bytes })
    }

    /// As the value of a record, which has room for it; its length.
    pub fn write(&self, record: &mut [u8]) -> usize {
        let len = PIECE_HEAD_BYTES + self.bytes.len();
        // The journal's records are larger than its pieces.
        let Ok(front) = postcard::to_slice(&len, record).map(|front| front.len()) else { return 0 };
        let parts = [&self.incarnation.to_le_bytes()[..], &self.offset.to_le_bytes(), self.bytes];
        let mut at = front;
        for part in parts {
            record[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
        at
    }
}

/// A run that is to be repeated.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ExactRun {
    /// Where relative paths of the configuration start; none: where they did.
    pub folder: Option<String>,
    /// Where to write the `ReplayReport`.
    pub report: String,
    /// Why the journal ends before the module did; none if nothing is known to be missing.
    pub ends: Option<String>,
    /// File with all entries.
    pub journal: String,
    /// File of a [`RecordWriter`](super::RecordWriter) with the records that the journal names; none if it names none.
    pub records: Option<String>,
}

/// Why a run cannot be repeated at all.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{0}")]
pub struct RunError(String);

impl ExactRun {
    /// Of this process's environment; none: it is an ordinary one.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn from_environment() -> Result<Option<Self>, RunError> {
        let Some(path) = std::env::var_os(VARIABLE).map(PathBuf::from) else { return Ok(None) };
        let failed = |why: &dyn std::fmt::Display| RunError(format!("{VARIABLE}: {}: {why}", path.display()));
        let bytes = std::fs::read(&path).map_err(|error| failed(&error))?;
        postcard::from_bytes(&bytes).map(Some).map_err(|error| failed(&error))
    }

    /// Writes it for another process.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), RunError> {
        let failed = |why: &dyn std::fmt::Display| RunError(format!("{}: {why}", path.display()));
        let bytes = postcard::to_stdvec(self).map_err(|error| failed(&error))?;
        std::fs::write(path, bytes).map_err(|error| failed(&error))
    }

    /// All entries.
    pub(super) fn open(&self) -> Result<BufReader<File>, RunError> {
        let file = File::open(&self.journal).map_err(|error| RunError(format!("{}: {error}", self.journal)))?;
        Ok(BufReader::new(file))
    }

    /// Content of the first entry, if it is of this version.
    fn beginning(&self) -> Result<Vec<u8>, RunError> {
        let mut entries = Entries::new(self.open()?);
        let why = match entries.look() {
            Ok(Tag::Begin) => match postcard::take_from_bytes::<u32>(entries.content()) {
                Ok((VERSION, _)) => return Ok(entries.content().to_vec()),
                Ok((version, _)) => format!(
                    "it is of version {version}, and this program has {VERSION}; use the version of Rohrpost \
                     that recorded it (`rohrpost record info` says which)"
                ),
                Err(_) => "its beginning is damaged".into(),
            },
            Ok(_) => "its beginning is missing".into(),
            Err(NoEntry::End | NoEntry::Cut) => "it is cut off in its beginning".into(),
            Err(NoEntry::Sum | NoEntry::Long(_) | NoEntry::Tag(_)) => {
                "its beginning is damaged, or it is of another version (`rohrpost record info` says of which)".into()
            }
            Err(NoEntry::Unreadable(kind)) => format!("its file cannot be read: {kind}"),
        };
        Err(RunError(format!("the journal cannot be replayed: {why}")))
    }

    /// The configuration as it was then, and the module.
    ///
    /// # Errors
    /// The journal does not begin as one of this version does.
    pub fn installation(&self) -> Result<(Installation, Name), RunError> {
        let beginning = self.beginning()?;
        let failed = |error: &dyn std::fmt::Display| RunError(error.to_string());
        let Begin { module, config: (config, text), saved, .. } =
            postcard::from_bytes(&beginning).map_err(|error| failed(&format!("its beginning is damaged: {error}")))?;
        let mut installation = Installation::parse(text, &self.here(config)).map_err(|error| failed(&error))?;
        if let Some((path, text)) = saved {
            let saved = Saved::parse(text, &self.here(path), &installation).map_err(|error| failed(&error))?;
            installation.saved = Some(saved);
        }
        let name = installation.classes.parse_module(module).map_err(|error| failed(&error))?;
        Ok((installation, name))
    }

    /// Tells all entries of the journal in words, as far as they can be read, and until `tell` says false.
    ///
    /// # Errors
    /// The journal's file cannot be opened.
    pub fn each_entry(&self, tell: impl FnMut(&str) -> bool) -> Result<(), RunError> {
        list::each(Entries::new(self.open()?), tell);
        Ok(())
    }

    /// A file's path here.
    fn here(&self, path: &str) -> PathBuf {
        let path = Path::new(path);
        let name = path.file_name().unwrap_or_default();
        self.folder.as_ref().map_or_else(|| path.to_owned(), |folder| Path::new(folder).join(name))
    }

    /// Records that the journal names, since the recording has them.
    ///
    /// # Errors
    /// The journal's file cannot be opened.
    pub fn named_records(&self) -> Result<BTreeSet<RecordSum>, RunError> {
        let (mut entries, mut named) = (Entries::new(self.open()?), BTreeSet::new());
        while let Ok(tag) = entries.look() {
            let record = (tag == Tag::Named).then(|| postcard::from_bytes::<NamedRecord>(entries.content()).ok());
            named.extend(record.flatten().map(|record| record.sum));
            entries.pass();
        }
        Ok(named)
    }

    pub(crate) fn replay(self) -> Result<JournalReplay, RunError> {
        let records = match &self.records {
            Some(path) => Records::open(Path::new(path)).map_err(|error| RunError(format!("{path}: {error}")))?,
            None => Records::default(),
        };
        Ok(JournalReplay::new(Box::new(self.open()?), records, self.ends, self.report.into()))
    }
}
