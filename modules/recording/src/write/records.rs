//! Records of MCAP as bytes: type, length, and the fields of the body, all little-endian.

use std::collections::BTreeMap;

/// Appends a record of this type to `out`; `fill` writes its body.
pub(crate) fn put(out: &mut Vec<u8>, op: u8, fill: impl FnOnce(&mut Body<'_>)) {
    out.push(op);
    counted(out, |out| fill(&mut Body(out)), |len| (len as u64).to_le_bytes());
}

/// Appends what `fill` writes, behind its length.
fn counted<const N: usize>(out: &mut Vec<u8>, fill: impl FnOnce(&mut Vec<u8>), len: fn(usize) -> [u8; N]) {
    let at = out.len();
    out.extend_from_slice(&[0; N]);
    fill(out);
    let len = len(out.len() - at - N);
    out[at..at + N].copy_from_slice(&len);
}

/// The body of a record that is being written.
pub(crate) struct Body<'a>(&'a mut Vec<u8>);

impl Body<'_> {
    pub(crate) fn u8(&mut self, number: u8) -> &mut Self {
        self.raw(&[number])
    }

    pub(crate) fn u16(&mut self, number: u16) -> &mut Self {
        self.raw(&number.to_le_bytes())
    }

    pub(crate) fn u32(&mut self, number: u32) -> &mut Self {
        self.raw(&number.to_le_bytes())
    }

    pub(crate) fn u64(&mut self, number: u64) -> &mut Self {
        self.raw(&number.to_le_bytes())
    }

    /// Bytes without their length.
    pub(crate) fn raw(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.extend_from_slice(bytes);
        self
    }

    /// A text behind its length.
    pub(crate) fn text(&mut self, text: &str) -> &mut Self {
        self.bytes(text.as_bytes())
    }

    /// Bytes behind their length.
    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.list(|body| {
            body.raw(bytes);
        })
    }

    /// What `fill` writes, behind its length in bytes.
    pub(crate) fn list(&mut self, fill: impl FnOnce(&mut Body<'_>)) -> &mut Self {
        counted(self.0, |out| fill(&mut Body(out)), |len| (len as u32).to_le_bytes());
        self
    }

    pub(crate) fn texts(&mut self, texts: &BTreeMap<String, String>) -> &mut Self {
        self.list(|body| {
            for (key, text) in texts {
                body.text(key).text(text);
            }
        })
    }
}

/// The body that `fill` writes, in place of what `out` has.
pub(crate) fn body(out: &mut Vec<u8>, fill: impl FnOnce(&mut Body<'_>)) {
    out.clear();
    fill(&mut Body(out));
}
