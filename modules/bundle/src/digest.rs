//! SHA-256, the name of a bundle and the proof of its files.

use ring::digest;
use std::fmt;
use std::io::{self, Read, Write};

/// Bytes that are read, hashed and written at a time.
const CHUNK: usize = 1 << 16;

/// A SHA-256 digest; shown as 64 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Sha256([u8; 32]);

impl Sha256 {
    /// Digest of these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self::from_ring(&digest::digest(&digest::SHA256, bytes))
    }

    /// Reads 64 lower-case hexadecimal digits; `None` if the text is anything else.
    ///
    /// ```
    /// # use rohrpost_bundle::Sha256;
    /// let digest = Sha256::of(b"");
    /// assert!(digest.to_string().starts_with("e3b0c442") && Sha256::parse(&digest.to_string()) == Some(digest));
    /// ```
    pub fn parse(text: &str) -> Option<Self> {
        parse_hex(text).map(Self)
    }

    /// The first 12 digits, for people.
    pub fn short(&self) -> String {
        hex(&self.0[..6])
    }

    fn from_ring(digest: &digest::Digest) -> Self {
        let mut bytes = [0; 32];
        bytes.copy_from_slice(digest.as_ref());
        Self(bytes)
    }
}

impl fmt::Display for Sha256 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&hex(&self.0))
    }
}

impl fmt::Debug for Sha256 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Copies all bytes of a reader; how many there were, and their digest.
pub(crate) fn copy_hashed(from: &mut (impl Read + ?Sized), to: &mut impl Write) -> io::Result<(u64, Sha256)> {
    let (mut context, mut size, mut chunk) = (digest::Context::new(&digest::SHA256), 0, vec![0; CHUNK]);
    loop {
        let read = match from.read(&mut chunk) {
            Ok(0) => return Ok((size, Sha256::from_ring(&context.finish()))),
            Ok(read) => read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        context.update(&chunk[..read]);
        to.write_all(&chunk[..read])?;
        size += read as u64;
    }
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Exactly N bytes in lower-case hexadecimal digits.
pub(crate) fn parse_hex<const N: usize>(text: &str) -> Option<[u8; N]> {
    let is_digit = |digit: u8| digit.is_ascii_digit() || (b'a'..=b'f').contains(&digit);
    if text.len() != 2 * N || !text.bytes().all(is_digit) {
        return None;
    }
    let mut bytes = [0; N];
    for (byte, at) in bytes.iter_mut().zip((0..).step_by(2)) {
        *byte = u8::from_str_radix(&text[at..at + 2], 16).ok()?;
    }
    Some(bytes)
}
