//! Log control: what a connection says to a recorder, one command a line, and the line that answers it.
//!
//! ```text
//! bytes ──▶ ControlLines ──▶ ControlCommand ──▶ (recorder) ──▶ ControlAnswer ──▶ `OK key=value …` or `ERR why`
//!             │ a line that is too long, or no command
//!             └──────────────────────────────────────────────▶ ControlAnswer
//! ```
//!
//! Opens no socket. Any bytes may come: what is kept of them is less than [`CONTROL_LINE_BYTES_MAX`].

use std::fmt::{self, Write};
use std::str::FromStr;
use thiserror::Error;

/// Bytes of a line, with its end.
pub const CONTROL_LINE_BYTES_MAX: usize = 1024;
/// A line that begins with one of them is a request of HTTP, as any web page can have a browser send it.
const HTTP_METHODS: [&[u8]; 9] =
    [b"GET", b"POST", b"PUT", b"HEAD", b"OPTIONS", b"PATCH", b"DELETE", b"CONNECT", b"TRACE"];
/// So much of a wrong word is repeated in the answer.
const WORD_CHARS_MAX: usize = 20;

/// What a recorder is told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ControlCommand {
    /// Record.
    On,
    /// End the recording: its file is closed.
    Off,
    /// Make files in this folder from now on.
    Directory(String),
    /// Say how the recording goes.
    Status,
    /// Set a mark that says this.
    Mark(String),
    /// Close the file, and begin the next.
    Rotate,
}

/// Why a line is no command.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ControlError {
    /// It has no end within bounds.
    #[error("the line is too long; a command has at most {} bytes", CONTROL_LINE_BYTES_MAX - 1)]
    TooLong,
    /// It is no text, or has control characters.
    #[error("the line is no text; write one command in letters, and end it with a line feed")]
    NoText,
    /// It belongs to a request of HTTP. Nothing behind it is to be obeyed: it may be from a web page.
    #[error("this is HTTP, and nothing of it is obeyed; open a connection of its own, and send commands alone")]
    Http,
    /// A word that is no command.
    #[error("no command `{0}`; there are on, off, directory PATH, status, mark TEXT, rotate")]
    Unknown(String),
    /// The command wants something behind it.
    #[error("`{0}` needs {1}; write `{0} {2}`")]
    Missing(&'static str, &'static str, &'static str),
    /// The command wants nothing behind it.
    #[error("`{0}` stands alone; leave out what follows it")]
    Surplus(&'static str),
}

impl fmt::Display for ControlCommand {
    /// As a line has it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::On => f.write_str("on"),
            Self::Off => f.write_str("off"),
            Self::Directory(path) => write!(f, "directory {path}"),
            Self::Status => f.write_str("status"),
            Self::Mark(text) => write!(f, "mark {text}"),
            Self::Rotate => f.write_str("rotate"),
        }
    }
}

impl FromStr for ControlCommand {
    type Err = ControlError;

    /// Reads a line without its end.
    fn from_str(line: &str) -> Result<Self, ControlError> {
        if line.contains(char::is_control) {
            return Err(ControlError::NoText);
        }
        let line = line.trim();
        let (word, rest) = line.split_once(' ').map_or((line, ""), |(word, rest)| (word, rest.trim_start()));
        let alone =
            |word: &'static str, command| if rest.is_empty() { Ok(command) } else { Err(ControlError::Surplus(word)) };
        match word {
            "on" => alone("on", Self::On),
            "off" => alone("off", Self::Off),
            "status" => alone("status", Self::Status),
            "rotate" => alone("rotate", Self::Rotate),
            "directory" if rest.is_empty() => Err(ControlError::Missing("directory", "a folder", "PATH")),
            "directory" => Ok(Self::Directory(rest.to_owned())),
            "mark" if rest.is_empty() => Err(ControlError::Missing("mark", "a text", "TEXT")),
            "mark" => Ok(Self::Mark(rest.to_owned())),
            other => Err(ControlError::Unknown(other.chars().take(WORD_CHARS_MAX).collect())),
        }
    }
}

/// Lines of one connection, as their bytes come.
#[derive(Debug, Default)]
pub struct ControlLines {
    /// Of the line that has no end yet, and of those behind the one that was taken last.
    bytes: Vec<u8>,
    /// The rest of a line that was too long comes, and is passed over.
    skips: bool,
}

impl ControlLines {
    /// So many bytes are taken next; none while a command waits to be taken out.
    pub fn room(&self) -> usize {
        CONTROL_LINE_BYTES_MAX - self.bytes.len()
    }

    /// Takes bytes, as many as there is room for; how many.
    pub fn put(&mut self, bytes: &[u8]) -> usize {
        let taken = bytes.len().min(self.room());
        self.bytes.extend_from_slice(&bytes[..taken]);
        taken
    }

    /// The next command, or what is wrong with its line. None: more bytes are to come. Empty lines are passed over.
    pub fn next_command(&mut self) -> Option<Result<ControlCommand, ControlError>> {
        loop {
            let Some(end) = self.bytes.iter().position(|byte| *byte == b'\n') else {
                if self.skips {
                    self.bytes.clear();
                } else if self.room() == 0 {
                    let error = if is_http(&self.bytes) { ControlError::Http } else { ControlError::TooLong };
                    self.bytes.clear();
                    self.skips = true;
                    return Some(Err(error));
                }
                return None;
            };
            let line: Vec<u8> = self.bytes.drain(..=end).collect();
            if std::mem::take(&mut self.skips) {
                continue;
            }
            // As telnet ends a line.
            let line = &line[..end];
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            if is_http(line) {
                return Some(Err(ControlError::Http));
            }
            if !line.is_empty() {
                let text = std::str::from_utf8(line).map_err(|_| ControlError::NoText);
                return Some(text.and_then(str::parse));
            }
        }
    }
}

/// Whether a line, or what came of it, is of a request.
fn is_http(line: &[u8]) -> bool {
    let line = line.trim_ascii_start();
    let word = line.split(|byte| *byte == b' ').next().unwrap_or_default();
    HTTP_METHODS.contains(&word) || line.get(..5).is_some_and(|name| name.eq_ignore_ascii_case(b"Host:"))
}

/// The answer to one command: one line of ASCII.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ControlAnswer(String);

impl ControlAnswer {
    /// It was done; with what is to be told of it.
    pub fn ok() -> Self {
        Self("OK".into())
    }

    /// Tells a number, or a word.
    pub fn with(mut self, key: &str, value: impl fmt::Display) -> Self {
        self.0.push_str(&format!(" {key}={value}"));
        self
    }

    /// Tells a text: in quotes, as JSON has it.
    pub fn with_text(mut self, key: &str, text: &str) -> Self {
        self.0.push_str(&format!(" {key}=\""));
        push_escaped(&mut self.0, text, true);
        self.0.push('"');
        self
    }

    /// It was not done.
    pub fn err(why: &impl fmt::Display) -> Self {
        let mut line = "ERR ".to_owned();
        push_escaped(&mut line, &why.to_string(), false);
        Self(line)
    }

    /// Whether it was done.
    pub fn is_ok(&self) -> bool {
        self.0.starts_with("OK")
    }

    /// The line, without its end.
    pub fn line(&self) -> &str {
        &self.0
    }
}

/// Adds a text in ASCII, in one line.
fn push_escaped(line: &mut String, text: &str, is_quoted: bool) {
    for c in text.chars() {
        match c {
            '"' | '\\' if is_quoted => line.extend(['\\', c]),
            ' '..='~' => line.push(c),
            c => {
                for unit in c.encode_utf16(&mut [0; 2]) {
                    // A String takes whatever is written.
                    let _ = write!(line, "\\u{unit:04x}");
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn lines_are_commands_or_say_what_is_wrong() {
        for (line, command) in [
            ("on", ControlCommand::On),
            ("off\r", ControlCommand::Off),
            (" status ", ControlCommand::Status),
            ("rotate", ControlCommand::Rotate),
            ("directory  run 7", ControlCommand::Directory("run 7".into())),
            ("mark door open: 3\u{b0}", ControlCommand::Mark("door open: 3\u{b0}".into())),
            ("mark off", ControlCommand::Mark("off".into())),
        ] {
            assert_eq!(read(format!("{line}\n").as_bytes()), [Ok(command)], "{line}");
        }
        for (line, words) in [
            (&b"ON"[..], "no command `ON`; there are on, "),
            (b"mark", "`mark` needs a text; write `mark TEXT`"),
            (b"directory ", "`directory` needs a folder; write `directory PATH`"),
            (b"rotate now", "`rotate` stands alone"),
            (b"mark a\x07b", "no text"),
            (b"\xff\xfb\x01", "no text"),
            (&b"a".repeat(500), "no command `aaaaaaaaaaaaaaaaaaaa`;"),
            (&b"a".repeat(1500), "too long"),
            (b"POST /off HTTP/1.1\r", "this is HTTP"),
            (b"GET /\xff", "this is HTTP"),
            (b"host: 127.0.0.1:21121\r", "this is HTTP"),
            (&[&b"POST /"[..], &b"a".repeat(1500)].concat(), "this is HTTP"),
            (b"POSTS", "no command `POSTS`"),
        ] {
            let told = read(&[line, b"\nstatus\n"].concat());
            assert_eq!((told.len(), &told[1]), (2, &Ok(ControlCommand::Status)), "{told:?}");
            let error = told[0].clone().unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        assert_eq!(read(b"\n\r\n\n"), []);
        assert_eq!(read(b"status"), [], "its end may still come, and say more");
    }

    #[test]
    fn a_line_just_fits() {
        let line = format!("mark {}", "x".repeat(CONTROL_LINE_BYTES_MAX - 6));
        assert!(read(format!("{line}\n").as_bytes())[0].is_ok());
        assert_eq!(read(format!("{line}y\n").as_bytes()), [Err(ControlError::TooLong)]);
    }

    #[test]
    fn answers_are_one_line_of_ascii() {
        let answer = ControlAnswer::ok().with("lost", 3).with_text("file", "/a b/\"T\u{fc}r\"\n\u{1f6aa}\\");
        assert_eq!(answer.line(), r#"OK lost=3 file="/a b/\"T\u00fcr\"\u000a\ud83d\udeaa\\""#);
        assert!(answer.is_ok());
        let quoted = answer.line().split_once("file=").unwrap().1;
        assert_eq!(serde_json::from_str::<String>(quoted).unwrap(), "/a b/\"T\u{fc}r\"\n\u{1f6aa}\\");
        let answer = ControlAnswer::err(&"no \"T\u{fc}r\"\nhere");
        assert_eq!(answer.line(), r#"ERR no "T\u00fcr"\u000ahere"#);
        assert!(!answer.is_ok());
    }

    /// All that is said, given as a socket gives it.
    fn read(bytes: &[u8]) -> Vec<Result<ControlCommand, ControlError>> {
        read_in_parts(bytes, &[bytes.len().max(1)])
    }

    fn read_in_parts(mut bytes: &[u8], parts: &[usize]) -> Vec<Result<ControlCommand, ControlError>> {
        let (mut lines, mut told) = (ControlLines::default(), Vec::new());
        let mut parts = parts.iter().cycle();
        while !bytes.is_empty() {
            let part = bytes.len().min(*parts.next().unwrap());
            bytes = &bytes[lines.put(&bytes[..part])..];
            told.extend(std::iter::from_fn(|| lines.next_command()));
            assert!(lines.room() > 0, "or nothing would ever come again");
        }
        told
    }

    fn said() -> impl Strategy<Value = Vec<u8>> {
        let line = prop_oneof![
            "(on|off|status|rotate|mark|directory)( [ -~\u{e4}]{0,20})?\r?\n".prop_map(String::into_bytes),
            (0..3000_usize).prop_map(|len| [&b"y".repeat(len)[..], b"\n"].concat()),
            proptest::collection::vec(any::<u8>(), 0..40),
        ];
        proptest::collection::vec(line, 0..12).prop_map(|lines| lines.concat())
    }

    proptest! {
        #[test]
        fn it_does_not_matter_how_lines_are_divided(
            said in said(),
            parts in proptest::collection::vec(1..1500_usize, 1..20),
        ) {
            let whole = read(&said);
            prop_assert_eq!(&read_in_parts(&said, &parts), &whole);
            for command in whole.into_iter().flatten() {
                prop_assert_eq!(command.to_string().parse(), Ok(command));
            }
        }
    }
}
