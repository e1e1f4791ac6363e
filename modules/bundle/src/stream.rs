//! A bundle as a stream: `rohrpost bundle push` on one end, `rohrpost bundle receive` on a node, ssh between them.
//!
//! ```text
//! push ─▶ rohrpost-bundle 1 BYTES BYTES⏎  manifest  signature
//!      ◀─ rohrpost-bundle send COUNT⏎  and so many lines, each the index of a file that the node lacks
//! push ─▶ the bytes of these files, as long as the manifest says
//! ```

use crate::bundle::Bundle;
use crate::disk::{self, At, FileError};
use crate::key::KEY_BYTES_MAX;
use crate::manifest::{FileEntry, MANIFEST_BYTES_MAX};
use crate::receive::Source;
use std::io::{self, BufRead, ErrorKind, Read, Write};

/// First words of the stream.
const HEAD: &str = "rohrpost-bundle 1 ";
/// First words of the node's answer.
const SEND: &str = "rohrpost-bundle send ";
/// Bytes of a line.
const LINE_BYTES_MAX: u64 = 200;
/// Lines that a shell of the node may print before the answer.
const OTHER_LINES_MAX: usize = 1000;

/// The node's end of a stream.
#[derive(Debug)]
pub struct StreamSource<R, W> {
    from: R,
    to: W,
}

impl<R: BufRead, W: Write> StreamSource<R, W> {
    /// `from`: what the other end sends. `to`: what it reads.
    pub fn new(from: R, to: W) -> Self {
        Self { from, to }
    }
}

impl<R: BufRead, W: Write> Source for StreamSource<R, W> {
    fn head(&mut self) -> io::Result<(Vec<u8>, Vec<u8>)> {
        let line = line(&mut self.from)?;
        let sizes = line.strip_prefix(HEAD).and_then(|sizes| sizes.split_once(' '));
        let size = |text: &str, most: usize| text.parse().ok().filter(|size| *size <= most);
        let sizes = sizes.and_then(|(a, b)| Some((size(a, MANIFEST_BYTES_MAX)?, size(b, KEY_BYTES_MAX)?)));
        let (manifest, signature) = sizes.ok_or_else(|| strange("no bundle; is the other rohrpost older?"))?;
        Ok((exactly(&mut self.from, manifest)?, exactly(&mut self.from, signature)?))
    }

    fn want(&mut self, files: &[usize]) -> io::Result<()> {
        let lines: String = files.iter().map(|index| format!("{index}\n")).collect();
        write!(self.to, "{SEND}{}\n{lines}", files.len())?;
        self.to.flush()
    }

    fn file(&mut self, file: &FileEntry) -> io::Result<Box<dyn Read + '_>> {
        Ok(Box::new((&mut self.from).take(file.size)))
    }
}

/// Why a bundle could not be sent.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// A file of the bundle.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file is not as the manifest says.
    #[error("`{0}` was changed since the bundle was made; `rohrpost bundle show` names all that differ")]
    Changed(String),
    /// The other end.
    #[error("the node has ended the transfer ({0}); what it says itself is above")]
    Node(#[from] io::Error),
}

/// Sends a bundle; `from` is what the node says, of which the rest is left to the caller. Returns how many files were
/// sent.
///
/// # Errors
/// A file that cannot be read or has another length, and a node that ends too early.
pub fn send(bundle: &Bundle, to: &mut impl Write, from: &mut impl BufRead) -> Result<usize, SendError> {
    let (manifest, signature) = (bundle.manifest_bytes(), bundle.signature().text());
    to.write_all(format!("{HEAD}{} {}\n", manifest.len(), signature.len()).as_bytes())?;
    to.write_all(manifest)?;
    to.write_all(signature.as_bytes())?;
    to.flush()?;
    let wanted = wanted(from, bundle.manifest().files().len())?;
    for file in wanted.iter().map(|index| &bundle.manifest().files()[*index]) {
        let path = file.path.below(bundle.folder());
        let open = disk::open(&path).at("read", &path)?;
        if io::copy(&mut open.take(file.size), to)? != file.size {
            return Err(SendError::Changed(file.path.to_string()));
        }
    }
    to.flush()?;
    Ok(wanted.len())
}

/// Reads which files the node lacks.
fn wanted(from: &mut impl BufRead, files: usize) -> io::Result<Vec<usize>> {
    let mut count = None;
    for _ in 0..OTHER_LINES_MAX {
        count = line(from)?.strip_prefix(SEND).and_then(|count| count.parse().ok());
        if count.is_some() {
            break;
        }
    }
    let count: usize = count.filter(|count| *count <= files).ok_or_else(|| strange("no answer to a bundle"))?;
    let index = |text: String| text.parse().ok().filter(|index| *index < files);
    (0..count).map(|_| index(line(from)?).ok_or_else(|| strange("no index of a file"))).collect()
}

/// One line without its end; whatever bytes, for its words are compared.
fn line(from: &mut impl BufRead) -> io::Result<String> {
    let mut bytes = Vec::new();
    from.take(LINE_BYTES_MAX).read_until(b'\n', &mut bytes)?;
    match bytes.pop() {
        Some(b'\n') => Ok(String::from_utf8_lossy(&bytes).into_owned()),
        Some(_) if bytes.len() as u64 + 1 == LINE_BYTES_MAX => Err(strange("a line that is too long")),
        _ => Err(ErrorKind::UnexpectedEof.into()),
    }
}

fn exactly(from: &mut impl Read, size: usize) -> io::Result<Vec<u8>> {
    let mut bytes = vec![0; size];
    from.read_exact(&mut bytes)?;
    Ok(bytes)
}

fn strange(why: &'static str) -> io::Error {
    io::Error::new(ErrorKind::InvalidData, why)
}
