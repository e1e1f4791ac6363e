//! Records that a module read, and that the same recording holds whole: a journal has their sums, and not their bytes.
//!
//! For a replay they are put into a file, each once:
//!
//! ```text
//! len u64   little endian
//! sum u64
//! bytes
//! ```

use super::bytes::digest;
use super::question::AskedStream;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Bytes before those of a record.
const FRONT_BYTES: u64 = 16;

/// Length and sum of a record, by which it is found.
///
/// ```
/// use rohrpost_modules::journal::RecordSum;
///
/// assert_eq!(RecordSum::of(b"a picture"), RecordSum::of(b"a picture"));
/// assert_ne!(RecordSum::of(b"a picture"), RecordSum::of(b"a pictore"));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub struct RecordSum {
    /// Its bytes.
    pub len: u64,
    sum: u64,
}

impl RecordSum {
    /// Of these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self { len: bytes.len() as u64, sum: digest(0, bytes) }
    }
}

impl std::fmt::Display for RecordSum {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} bytes of sum {:016x}", self.len, self.sum)
    }
}

/// A record that the module is given next, and where it is from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) struct NamedRecord {
    pub(super) stream: AskedStream,
    pub(super) sequence: u64,
    pub(super) sum: RecordSum,
}

impl std::fmt::Display for NamedRecord {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "record {} of {}, {}", self.sequence, self.stream, self.sum)
    }
}

/// Writes the file.
///
/// ```
/// use rohrpost_modules::journal::{RecordSum, RecordWriter};
///
/// let folder = tempfile::tempdir()?;
/// let mut records = RecordWriter::create(&folder.path().join("records"))?;
/// records.add(RecordSum::of(b"a picture"), b"a picture")?;
/// records.finish()?;
/// # Ok::<(), std::io::Error>(())
/// ```
pub struct RecordWriter(BufWriter<File>);

impl RecordWriter {
    /// Without a record yet.
    ///
    /// # Errors
    /// The file cannot be made.
    pub fn create(path: &Path) -> io::Result<Self> {
        Ok(Self(BufWriter::new(File::create(path)?)))
    }

    /// Adds a record.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn add(&mut self, sum: RecordSum, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(&sum.len.to_le_bytes())?;
        self.0.write_all(&sum.sum.to_le_bytes())?;
        self.0.write_all(bytes)
    }

    /// All of them are there.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Finds records in the file. In memory is where each of them is.
#[derive(Default)]
pub(super) struct Records {
    file: Option<BufReader<File>>,
    places: BTreeMap<RecordSum, u64>,
}

impl Records {
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let mut file = BufReader::new(File::open(path)?);
        let (mut at, end) = (0, file.get_ref().metadata()?.len());
        let mut places = BTreeMap::new();
        while at < end {
            let [len, sum] = [word(&mut file)?, word(&mut file)?];
            places.insert(RecordSum { len, sum }, at + FRONT_BYTES);
            file.seek_relative(i64::try_from(len).map_err(io::Error::other)?)?;
            at = at.saturating_add(FRONT_BYTES).saturating_add(len);
        }
        Ok(Self { file: Some(file), places })
    }

    /// The bytes of a record; none if it is not there.
    pub(super) fn get(&mut self, sum: RecordSum) -> io::Result<Option<Vec<u8>>> {
        let (Some(at), Some(file)) = (self.places.get(&sum), &mut self.file) else { return Ok(None) };
        file.seek(SeekFrom::Start(*at))?;
        let mut bytes = Vec::new();
        file.by_ref().take(sum.len).read_to_end(&mut bytes)?;
        Ok(Some(bytes).filter(|bytes| RecordSum::of(bytes) == sum))
    }
}

fn word(file: &mut BufReader<File>) -> io::Result<u64> {
    let mut bytes = [0; 8];
    file.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_found_by_their_sums_and_only_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records");
        let all: Vec<Vec<u8>> = [0, 1, 5000, 70_000].map(|len| vec![len as u8; len]).into();
        let mut writer = RecordWriter::create(&path).unwrap();
        all.iter().for_each(|bytes| writer.add(RecordSum::of(bytes), bytes).unwrap());
        writer.finish().unwrap();
        let mut records = Records::open(&path).unwrap();
        for bytes in all.iter().rev() {
            assert_eq!(records.get(RecordSum::of(bytes)).unwrap().as_ref(), Some(bytes));
        }
        assert_eq!(records.get(RecordSum::of(b"another")).unwrap(), None);
        assert_eq!(Records::default().get(RecordSum::of(b"")).unwrap(), None, "no file");

        let mut bytes = std::fs::read(&path).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(Records::open(&path).unwrap().get(RecordSum::of(&all[3])).unwrap(), None, "it is damaged");
    }
}
