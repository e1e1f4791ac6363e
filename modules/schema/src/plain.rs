//! What others wrote, as a terminal may have it. A module, a node or a program beyond may write anything; shown, it
//! must not move a cursor, ring a bell, change what is read from left to right, or begin a line that somebody else
//! seems to have written.
//!
//! What a terminal would obey is written out as JSON does it, such as `\u001b`: so a line of JSON means the same
//! afterwards.

use serde::Serialize;
use std::borrow::{Borrow, Cow};
use std::fmt::{self, Write};
use std::ops::Deref;

/// Whether a terminal obeys this character, or shows it nowhere: control characters (C0, DEL, C1), those that change
/// the direction of writing or separate lines, and those that have no width.
pub fn is_obeyed(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}'
            | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

/// A text of others in one line.
pub fn line(text: &str) -> Cow<'_, str> {
    if !text.contains(is_obeyed) {
        return Cow::Borrowed(text);
    }
    let mut plain = String::with_capacity(text.len() + 16);
    text.chars().for_each(|c| put(c, &mut plain));
    Cow::Owned(plain)
}

/// Appends a character as [`line`] writes it.
fn put(c: char, to: &mut String) {
    // Writing to a string does not fail.
    let _ = write_plain(c, to);
}

fn write_plain(c: char, to: &mut (impl Write + ?Sized)) -> fmt::Result {
    match c {
        '\n' => to.write_str("\\n"),
        '\r' => to.write_str("\\r"),
        '\t' => to.write_str("\\t"),
        c if is_obeyed(c) => c.encode_utf16(&mut [0; 2]).iter().try_for_each(|unit| write!(to, "\\u{unit:04x}")),
        c => to.write_char(c),
    }
}

/// A text of others, such as a topic that a file names. Shown, it is as [`line`] writes it: so no message with it can
/// forget to. Compared, looked up and serialised it is what it is.
///
/// ```
/// use rohrpost_schema::plain::ForeignText;
///
/// let topic = ForeignText::from("/scan\nall is well");
/// assert_eq!(topic.to_string(), "/scan\\nall is well");
/// assert_eq!(topic, "/scan\nall is well");
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(transparent)]
pub struct ForeignText(String);

impl ForeignText {
    /// As others wrote it; not for a terminal.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for ForeignText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&line(&self.0))
    }
}

impl Deref for ForeignText {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl Borrow<str> for ForeignText {
    fn borrow(&self) -> &str {
        &self.0
    }
}

impl From<String> for ForeignText {
    fn from(text: String) -> Self {
        Self(text)
    }
}

impl From<&str> for ForeignText {
    fn from(text: &str) -> Self {
        Self(text.to_owned())
    }
}

impl<T: AsRef<str> + ?Sized> PartialEq<T> for ForeignText {
    fn eq(&self, other: &T) -> bool {
        self.0 == other.as_ref()
    }
}

/// Lines that a tool has written, with texts of others in them: ends of lines and tabs are its own, all else that a
/// terminal obeys is not.
pub struct Lines<T>(pub T);

impl<T: fmt::Display> fmt::Display for Lines<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        struct Filter<'a, 'b>(&'a mut fmt::Formatter<'b>);

        impl Write for Filter<'_, '_> {
            fn write_str(&mut self, text: &str) -> fmt::Result {
                let is_kept = |c: char| matches!(c, '\n' | '\t') || !is_obeyed(c);
                if text.chars().all(is_kept) {
                    return self.0.write_str(text);
                }
                text.chars().try_for_each(|c| if is_kept(c) { self.0.write_char(c) } else { write_plain(c, self.0) })
            }
        }

        write!(Filter(f), "{}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of each kind, in a text that would move the cursor, ring, turn around and begin a line.
    const HOSTILE: &str = "a\u{1b}[2J\u{7}\r\u{9b}31m\u{202e}\u{2066}\u{200b}\u{2028}\u{7f}\u{e0041}\nforged\tü";

    #[test]
    fn nothing_that_a_terminal_obeys_is_left() {
        assert_eq!(
            line(HOSTILE),
            "a\\u001b[2J\\u0007\\r\\u009b31m\\u202e\\u2066\\u200b\\u2028\\u007f\\udb40\\udc41\\nforged\\tü"
        );
        let lines = Lines(HOSTILE).to_string();
        assert_eq!(lines, line(HOSTILE).replace("\\n", "\n").replace("\\t", "\t"));
        assert!(matches!(line("plain: ü, 漢, 5 µs"), Cow::Borrowed(_)));
    }

    #[test]
    fn json_means_the_same_afterwards() {
        let json = serde_json::json!({ HOSTILE: [HOSTILE] });
        let plain = Lines(serde_json::to_string(&json).unwrap()).to_string();
        assert!(!plain.contains(is_obeyed), "{plain}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&plain).unwrap(), json);
    }
}
