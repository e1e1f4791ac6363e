//! A type of C as others use it, and what members and variants are made of.

/// A type of C.
#[derive(Clone)]
pub(super) struct CType {
    pub(super) name: String,
    /// Its functions take it by pointer; others by value, with this word in their names.
    word: Option<&'static str>,
    /// About how many bytes one has in memory.
    pub(super) size: u64,
    /// Whether its values take bytes on the wire.
    pub(super) takes_bytes: bool,
}

impl CType {
    /// A statement that writes a value.
    pub(super) fn write(&self, place: &str) -> String {
        match self.word {
            Some(word) => format!("rp_pack_{word}(to, {place});"),
            None => format!("{}_write(to, &{place});", self.name),
        }
    }

    /// A statement that writes what `value` points to.
    pub(super) fn write_all(&self) -> String {
        match self.word {
            Some(word) => format!("rp_pack_{word}(to, *value);"),
            None => format!("{}_write(to, value);", self.name),
        }
    }

    /// A statement that reads what `value` points to.
    pub(super) fn read_all(&self) -> String {
        match self.word {
            Some(word) => format!("*value = rp_unpack_{word}(from);"),
            None => format!("{}_read(from, value);", self.name),
        }
    }

    /// A statement that reads a value.
    pub(super) fn read(&self, place: &str) -> String {
        match self.word {
            Some(word) => format!("{place} = rp_unpack_{word}(from);"),
            None => format!("{}_read(from, &{place});", self.name),
        }
    }

    /// One that has functions by pointer.
    pub(super) fn structured(name: String, size: u64, takes_bytes: bool) -> Self {
        Self { name, word: None, size, takes_bytes }
    }

    /// One that `postcard.h` reads and writes.
    pub(super) fn plain(name: &str, word: &'static str, size: u64) -> Self {
        Self { name: name.into(), word: Some(word), size, takes_bytes: word != "nothing" }
    }

    /// As other names have it in them.
    pub(super) fn short<'a>(&'a self, prefix: &str) -> &'a str {
        self.word.unwrap_or_else(|| self.name.strip_prefix(prefix).unwrap_or(&self.name))
    }
}

/// One member of a struct: what it is called, its type, and what is said of it.
pub(super) struct Member {
    pub(super) name: String,
    pub(super) ty: CType,
    pub(super) text: String,
}

/// A variant: its constant, and what it carries, as which member of the union.
pub(super) struct Carried {
    pub(super) constant: String,
    pub(super) text: String,
    pub(super) member: Option<(String, CType)>,
}
