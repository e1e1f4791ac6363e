//! Log control: what a connection says to a recorder, one command a line, and the line that answers it.
//!
//! ```text
//! bytes ──▶ ControlLines ──▶ ControlCommand ──▶ (recorder) ──▶ ControlAnswer ──▶ `OK key=value …` or `ERR why`
//!             │ a line that is too long, or no command: the last one
//!             └──────────────────────────────────────────────▶ ControlAnswer
//! ```
//!
//! Opens no socket. Any bytes may come: what is kept of them is less than [`CONTROL_LINE_BYTES_MAX`]. Behind a line
//! that is no command nothing is read: a program that speaks another protocol, such as HTTP, TLS or SMTP, may have been
//! made to send any lines in it. A web page has a browser do that.

use std::fmt::{self, Write};
use std::str::FromStr;
use thiserror::Error;

/// Bytes of a line, with its end.
pub const CONTROL_LINE_BYTES_MAX: usize = 1024;
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
    /// It is not in UTF-8.
    #[error("the line is not in UTF-8; write one command in UTF-8, and end it with a line feed")]
    NotUtf8,
    /// It has control characters.
    #[error("the line has control characters; write one command without any, and end it with a line feed")]
    ControlCharacters,
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
            return Err(ControlError::ControlCharacters);
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
    /// A line was no command: what comes behind it is passed over.
    is_over: bool,
}

impl ControlLines {
    /// So many bytes are taken next; none while a command waits to be taken out.
    pub fn room(&self) -> usize {
        CONTROL_LINE_BYTES_MAX - self.bytes.len()
    }

    /// Takes bytes, as many as there is room for; how many.
    pub fn put(&mut self, bytes: &[u8]) -> usize {
        let taken = bytes.len().min(self.room());
        if !self.is_over {
            self.bytes.extend_from_slice(&bytes[..taken]);
        }
        taken
    }

    /// The next command, or what is wrong with its line; nothing comes behind that. None: more bytes are to come. Empty
    /// lines are passed over.
    pub fn next_command(&mut self) -> Option<Result<ControlCommand, ControlError>> {
        let line = self.next_line()?;
        if line.is_err() {
            self.is_over = true;
            self.bytes.clear();
        }
        Some(line)
    }

    fn next_line(&mut self) -> Option<Result<ControlCommand, ControlError>> {
        loop {
            let Some(end) = self.bytes.iter().position(|byte| *byte == b'\n') else {
                return (self.room() == 0).then_some(Err(ControlError::TooLong));
            };
            let line: Vec<u8> = self.bytes.drain(..=end).collect();
            // As telnet ends a line.
            let line = &line[..end];
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            if !line.is_empty() {
                let text = std::str::from_utf8(line).map_err(|_| ControlError::NotUtf8);
                return Some(text.and_then(str::parse));
            }
        }
    }
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
            ("mark T\u{fc}r", ControlCommand::Mark("T\u{fc}r".into())),
            ("mark Tu\u{308}r \u{6f22}\u{1f6aa}", ControlCommand::Mark("Tu\u{308}r \u{6f22}\u{1f6aa}".into())),
            ("mark off", ControlCommand::Mark("off".into())),
        ] {
            let line = format!("{line}\n");
            assert_eq!(read(line.as_bytes()), [Ok(command.clone())], "{line}");
            assert_eq!(read_in_parts(line.as_bytes(), &[1]), [Ok(command)], "{line}, byte by byte");
        }
        for (line, words) in [
            (&b"ON"[..], "no command `ON`; there are on, "),
            (b"mark", "`mark` needs a text; write `mark TEXT`"),
            (b"directory ", "`directory` needs a folder; write `directory PATH`"),
            (b"rotate now", "`rotate` stands alone"),
            (b"mark a\x07b", "has control characters"),
            (b"mark T\xfcr", "not in UTF-8"),
            (b"\xff\xfb\x01", "not in UTF-8"),
            (&b"a".repeat(500), "no command `aaaaaaaaaaaaaaaaaaaa`;"),
            (&b"a".repeat(1500), "too long"),
        ] {
            let told = read(&[b"status\n", line, b"\n"].concat());
            assert_eq!((told.len(), &told[0]), (2, &Ok(ControlCommand::Status)), "{told:?}");
            let error = told[1].clone().unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        assert_eq!(read(b"\n\r\n\n"), []);
        assert_eq!(read(b"status"), [], "its end may still come, and say more");
    }

    /// What a program sends that speaks another protocol, and that somebody has made to send commands, too.
    #[test]
    fn behind_a_line_that_is_no_command_nothing_is_obeyed() {
        let hello = b"\x16\x03\x01\x00\xf4\x01\x00\x00\xf0\x03\x03";
        for (said, protocol) in [
            (&b"POST / HTTP/1.1\r\nHost: 127.0.0.1:21121\r\n\r\n"[..], "HTTP"),
            (b"hOST: 127.0.0.1\r\n", "a line of its head"),
            (&[&b"POST /"[..], &b"a".repeat(1500), b"\r\n"].concat(), "a long one"),
            (&[&hello[..], b"\n"].concat(), "TLS"),
            (&[&hello[..], &[7; 1500], b"\n"].concat(), "a long hello"),
            (b"EHLO robot\r\n", "SMTP"),
            (b"*1\r\n$3\r\n", "redis"),
            (b"SSH-2.0-OpenSSH_9.6\r\n", "SSH"),
            (b"USER anonymous\r\n", "FTP"),
            (b"{\"jsonrpc\":\"2.0\"}\n", "JSON"),
            (b"\n\n\0\n", "what begins with empty lines"),
        ] {
            let told = read(&[said, b"off\noff\r\n"].concat());
            assert!(matches!(told[..], [Err(_)]), "{protocol}: {told:?}");
        }
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
