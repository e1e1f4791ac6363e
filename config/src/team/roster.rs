//! The hosts file of seed 000 (A.4): one file for all robots and stations of a team.
//!
//! ```text
//! 0 10.10.5.45  5000     id, from 0, gaps allowed; IP address, may repeat; UDP port, with a gap to the next of that
//! 1 10.10.5.123 5100     address, since each host may take several upward
//! 5 10.10.5.45  5200
//! ```

use std::net::{IpAddr, SocketAddr};

/// The greatest id of a host: its system is one more.
const ID_MAX: u8 = 253;
/// What a line should be.
const LINE: &str = "a line is an id, an IP address and a UDP port, such as `0 10.10.5.45 5000`";

/// A robot or station of a team.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TeamHost {
    /// Number of the host in its file.
    pub id: u8,
    /// Where it takes datagrams.
    pub address: SocketAddr,
}

impl TeamHost {
    /// First byte of the names that it hosts.
    pub const fn system(self) -> u8 {
        self.id + 1
    }
}

/// A mistake in a hosts file. Line and column count from 1.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: {what}")]
pub struct RosterMistake {
    /// Where.
    pub line: usize,
    /// Where in the line, in characters.
    pub column: usize,
    /// The mistake, and what would be right.
    pub what: String,
}

/// Reads a hosts file for its host `own`. What stands behind `#` is a remark.
///
/// ```
/// let hosts = rohrpost_config::roster(b"0 10.10.5.45 5000\n3 10.10.5.45 5100\n", 3).unwrap();
/// assert_eq!(hosts[1].system(), 4);
/// ```
///
/// # Errors
/// All mistakes, by line.
pub fn roster(text: &[u8], own: u8) -> Result<Vec<TeamHost>, Vec<RosterMistake>> {
    // Some editors begin a file with a mark of its byte order.
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let (mut reader, mut lines) = (RosterReader::default(), 0);
    for (line, number) in text.split(|byte| *byte == b'\n').zip(1..) {
        lines = number;
        match str::from_utf8(line) {
            Ok(line) => reader.take(number, line),
            Err(error) => {
                let column = String::from_utf8_lossy(&line[..error.valid_up_to()]).chars().count() + 1;
                reader.tell(number, column, format!("is no text in UTF-8; {LINE}"));
            }
        }
    }
    let RosterReader { hosts, mut mistakes } = reader;
    if mistakes.is_empty() && !hosts.iter().any(|(host, _)| host.id == own) {
        let ids: Vec<String> = hosts.iter().map(|(host, _)| host.id.to_string()).collect();
        let others = if ids.is_empty() { "none".into() } else { ids.join(", ") };
        let what = format!("host {own} is missing; add a line `{own} ADDRESS PORT`, or start one of those: {others}");
        mistakes.push(RosterMistake { line: lines, column: 1, what });
    }
    if mistakes.is_empty() { Ok(hosts.into_iter().map(|(host, _)| host).collect()) } else { Err(mistakes) }
}

#[derive(Default)]
struct RosterReader {
    /// With their lines.
    hosts: Vec<(TeamHost, usize)>,
    mistakes: Vec<RosterMistake>,
}

/// A word, and its column.
type Word<'a> = (usize, &'a str);

impl RosterReader {
    fn tell(&mut self, line: usize, column: usize, what: String) {
        self.mistakes.push(RosterMistake { line, column, what });
    }

    fn take(&mut self, line: usize, text: &str) {
        let text = text.split('#').next().unwrap_or_default().trim_end();
        let words = words(text);
        let end = text.chars().count() + 1;
        let host = match words[..] {
            [] => return,
            [id, address, port] => host(id, address, port),
            [_, _, _, (column, word), ..] => Err((column, format!("`{word}` is too much; {LINE}"))),
            [_] => Err((end, format!("the address is missing; {LINE}"))),
            [..] => Err((end, format!("the port is missing; {LINE}"))),
        };
        match host.and_then(|host| self.check(host, &words).map(|()| host)) {
            Ok(host) => self.hosts.push((host, line)),
            Err((column, what)) => self.tell(line, column, what),
        }
    }

    /// Compares a host with those before it.
    fn check(&self, host: TeamHost, words: &[Word<'_>]) -> Result<(), (usize, String)> {
        let port = host.address.port();
        for (other, line) in &self.hosts {
            if other.id == host.id {
                let what = format!("host {} stands in line {line} already; give each an id of its own", host.id);
                return Err((words[0].0, what));
            }
            let gap = other.address.port().abs_diff(port);
            if other.address.ip() == host.address.ip() && gap < 2 {
                let (ip, id) = (host.address.ip(), other.id);
                let taken = other.address.port();
                let how = if gap == 0 { "is" } else { "is too near to" };
                let what = format!(
                    "port {port} of {ip} {how} that of host {id}, {taken} in line {line}; several are taken upward \
                     from each, so leave a gap, for example {}",
                    if taken > 65_000 { taken - 100 } else { taken + 100 }
                );
                return Err((words[2].0, what));
            }
        }
        Ok(())
    }
}

fn host(id: Word<'_>, address: Word<'_>, port: Word<'_>) -> Result<TeamHost, (usize, String)> {
    let is_id = |id: &u8| *id <= ID_MAX;
    let no_id = || (id.0, format!("`{}` is no id; write a number from 0 to {ID_MAX}", id.1));
    let is_one = |address: &IpAddr| !address.is_unspecified() && !address.is_multicast();
    let no_address =
        || (address.0, format!("`{}` is not the IP address of one computer; write for example 10.10.5.45", address.1));
    let no_port = || (port.0, format!("`{}` is no port; write a number from 1024 to 65535", port.1));
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let known = (id.1.parse().ok(), address.1.parse().ok(), port.1.parse().ok());
    let id = known.0.filter(is_id).filter(|_| digits(id.1)).ok_or_else(no_id)?;
    let ip = known.1.filter(is_one).ok_or_else(no_address)?;
    let port = known.2.filter(|port| *port >= 1024).filter(|_| digits(port.1)).ok_or_else(no_port)?;
    Ok(TeamHost { id, address: SocketAddr::new(ip, port) })
}

fn words(text: &str) -> Vec<Word<'_>> {
    let mut words: Vec<Word<'_>> = Vec::new();
    let mut begins_at = None;
    for (column, (at, c)) in (1..).zip(text.char_indices().chain([(text.len(), ' ')])) {
        match (c.is_whitespace(), begins_at) {
            (false, None) => begins_at = Some((column, at)),
            (true, Some((column, from))) => {
                words.push((column, &text[from..at]));
                begins_at = None;
            }
            _ => {}
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_file_of_the_seed_is_read_as_it_stands() {
        let text = "0 10.10.5.45 5000\n1 10.10.5.123 5100\n2 10.10.5.234 5200\n3 10.10.5.45 5300\n5 10.10.5.123 5400\n";
        for text in
            [text.to_owned(), format!("\u{feff}# our team\n\n{}  # the last", text.replace('\n', "\r\n").trim())]
        {
            let hosts = roster(text.as_bytes(), 5).unwrap();
            let systems: Vec<u8> = hosts.iter().map(|host| host.system()).collect();
            assert_eq!(systems, [1, 2, 3, 4, 6]);
            assert_eq!(hosts[4].address.to_string(), "10.10.5.123:5400");
        }
    }

    #[test]
    fn each_mistake_is_told_with_line_column_and_what_would_be_right() {
        for (line, told) in [
            ("x 10.0.0.2 5000", "line 2, column 1: `x` is no id; write a number from 0 to 253"),
            (" 254 10.0.0.2 5000", "line 2, column 2: `254` is no id; write a number from 0 to 253"),
            ("+1 10.0.0.2 5000", "line 2, column 1: `+1` is no id; write a number from 0 to 253"),
            (
                "1",
                "line 2, column 2: the address is missing; a line is an id, an IP address and a UDP port, such as `0 \
                 10.10.5.45 5000`",
            ),
            (
                "1 10.0.0.2 # ours",
                "line 2, column 11: the port is missing; a line is an id, an IP address and a UDP port, such as `0 \
                 10.10.5.45 5000`",
            ),
            (
                "1 10.0.0.2 5000 ü b",
                "line 2, column 17: `ü` is too much; a line is an id, an IP address and a UDP port, such as `0 \
                 10.10.5.45 5000`",
            ),
            (
                "1\trobot.local 5000",
                "line 2, column 3: `robot.local` is not the IP address of one computer; write for example 10.10.5.45",
            ),
            (
                "1 0.0.0.0 5000",
                "line 2, column 3: `0.0.0.0` is not the IP address of one computer; write for example 10.10.5.45",
            ),
            ("1 10.0.0.2 80", "line 2, column 12: `80` is no port; write a number from 1024 to 65535"),
            ("1 10.0.0.2 70000", "line 2, column 12: `70000` is no port; write a number from 1024 to 65535"),
            ("0 10.0.0.2 5000", "line 2, column 1: host 0 stands in line 1 already; give each an id of its own"),
            (
                "1 10.0.0.1 5000",
                "line 2, column 12: port 5000 of 10.0.0.1 is that of host 0, 5000 in line 1; several are taken upward \
                 from each, so leave a gap, for example 5100",
            ),
            (
                "1 10.0.0.1 4999",
                "line 2, column 12: port 4999 of 10.0.0.1 is too near to that of host 0, 5000 in line 1; several are \
                 taken upward from each, so leave a gap, for example 5100",
            ),
            (
                "1 10.0.0.1 5002",
                "line 2, column 1: host 7 is missing; add a line `7 ADDRESS PORT`, or start one of those: 0, 1",
            ),
        ] {
            let mistakes = roster(format!("0 10.0.0.1 5000\n{line}").as_bytes(), 7).unwrap_err();
            let mistakes: Vec<String> = mistakes.iter().map(RosterMistake::to_string).collect();
            assert_eq!(mistakes, [told], "{line}");
        }
        let mistakes = roster(b"0 \xff\n1\n", 0).unwrap_err();
        assert_eq!((mistakes[0].line, mistakes[0].column, mistakes[1].line), (1, 3, 2));
        assert!(roster(b"", 0).unwrap_err()[0].what.ends_with("one of those: none"));
    }

    proptest! {
        #[test]
        fn whatever_stands_there_is_read_or_refused(text: Vec<u8>, own: u8) {
            for mistake in roster(&text, own).err().into_iter().flatten() {
                prop_assert!(mistake.line > 0 && mistake.column > 0);
            }
        }
    }
}
