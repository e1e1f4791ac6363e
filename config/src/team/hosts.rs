//! Peers by system and address, from the section itself or from a file of hosts.
//!
//! ```text
//! # system  address of its router, with a port if it is another than ours
//! 2         10.0.0.2
//! 3         10.0.0.3:4000
//! ```

use crate::errors::{Errors, Problem};
use std::fs::File;
use std::io::Read;
use std::net::{IpAddr, SocketAddr};
use std::path::Path;

/// Longest file of hosts.
const FILE_BYTES_MAX: u64 = 64 << 10;

/// Addresses of peers in a file, in all.
pub const TEAM_PEERS_MAX: usize = 256;

/// A node of another system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TeamPeer {
    /// First byte of the names that it hosts.
    pub system: u8,
    /// Where its router takes datagrams.
    pub address: SocketAddr,
}

/// Peers as they are read.
pub(super) struct Peers {
    own: u8,
    port: u16,
    all: Vec<TeamPeer>,
}

impl Peers {
    /// None yet. `own`: the system that reads; `port`: of those that say none.
    pub(super) fn new(own: u8, port: u16) -> Self {
        Self { own, port, all: Vec::new() }
    }

    /// Adds one, or says what is wrong.
    pub(super) fn add(&mut self, system: &str, address: &str) -> Result<(), String> {
        let wrong = || format!("`{system}` is no system; write its id, a number from 1 to 254");
        let system = system.parse().ok().filter(|system| (1..=254).contains(system)).ok_or_else(wrong)?;
        if system == self.own {
            return Err(format!("system {system} is this one; drop it"));
        }
        let with_port = || address.parse::<IpAddr>().map(|address| SocketAddr::new(address, self.port));
        let parsed = address.parse().or_else(|_| with_port()).ok();
        let is_one = |address: &SocketAddr| {
            !address.ip().is_unspecified() && !address.ip().is_multicast() && address.port() >= 1024
        };
        let address = parsed.filter(is_one).ok_or_else(|| {
            format!(
                "\"{address}\" is not the IP address of one computer, with a port from 1024 on or without one; write \
                 for example \"10.0.0.{system}\" or \"10.0.0.{system}:{}\"",
                self.port
            )
        })?;
        if let Some(other) = self.all.iter().find(|other| other.address == address) {
            return Err(format!("{address} is given for system {} already; drop one", other.system));
        }
        if self.all.len() == TEAM_PEERS_MAX {
            return Err(format!("there are more than {TEAM_PEERS_MAX}; let the systems use a `group`"));
        }
        self.all.push(TeamPeer { system, address });
        Ok(())
    }

    /// All of them, by system.
    pub(super) fn into_all(mut self) -> Vec<TeamPeer> {
        self.all.sort_unstable();
        self.all
    }
}

/// Reads the text of a file of hosts, as system `own` with the port `port`.
///
/// # Errors
/// What is wrong, by line.
pub fn hosts(text: &str, own: u8, port: u16) -> Result<Vec<TeamPeer>, Vec<Problem>> {
    let (mut peers, mut problems) = (Peers::new(own, port), Vec::new());
    for (line, number) in text.lines().zip(1..) {
        let mut words = line.split('#').next().unwrap_or_default().split_whitespace();
        let added = match (words.next(), words.next(), words.next()) {
            (None, ..) => continue,
            (Some(system), Some(address), None) => peers.add(system, address),
            _ => Err("no host; a line is a system and an address, such as `2 10.0.0.2`".into()),
        };
        problems.extend(added.err().map(|message| Problem { line: Some(number), message }));
    }
    if problems.is_empty() { Ok(peers.into_all()) } else { Err(problems) }
}

/// Reads a file of hosts, as system `own` with the port `port`.
pub(super) fn read(path: &Path, own: u8, port: u16) -> Result<Vec<TeamPeer>, Errors> {
    let mut text = String::new();
    let read = File::open(path).and_then(|file| file.take(FILE_BYTES_MAX + 1).read_to_string(&mut text));
    let told = |message| Errors::new(path, vec![Problem { line: None, message }]);
    match read {
        Err(error) => Err(told(format!(
            "cannot be read ({error}); `peers` of [team] names it: a line for each host, such as `2 10.0.0.2`"
        ))),
        Ok(bytes) if bytes as u64 > FILE_BYTES_MAX => {
            Err(told(format!("is longer than {FILE_BYTES_MAX} bytes; is it a file of hosts?")))
        }
        Ok(_) => hosts(&text, own, port).map_err(|problems| Errors::new(path, problems)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_file_of_hosts_says_where_each_system_is() {
        let text = "# all\n\n 3\t10.0.0.3:4000 # the far one\n2 10.0.0.2\n2 [fe80::1]:5000\n";
        let peer = |system, address: &str| TeamPeer { system, address: address.parse().unwrap() };
        let expected = [peer(2, "10.0.0.2:21121"), peer(2, "[fe80::1]:5000"), peer(3, "10.0.0.3:4000")];
        assert_eq!(hosts(text, 1, 21_121).unwrap(), expected);
        assert_eq!(hosts("", 1, 21_121).unwrap(), []);
    }

    #[test]
    fn each_mistake_names_its_line() {
        for (line, why) in [
            ("2", "a line is a system and an address"),
            ("2 10.0.0.2 robot", "a line is a system and an address"),
            ("0 10.0.0.2", "from 1 to 254"),
            ("255 10.0.0.2", "from 1 to 254"),
            ("robot 10.0.0.2", "from 1 to 254"),
            ("1 10.0.0.2", "is this one"),
            ("2 robot.local", "not the IP address"),
            ("2 239.1.2.3", "IP address of one computer"),
            ("2 10.0.0.2:80", "a port from 1024"),
            ("2 0.0.0.0", "IP address of one computer"),
            ("3 10.0.0.9", "given for system 2 already"),
        ] {
            let problems = hosts(&format!("2 10.0.0.9\n{line}\n"), 1, 21_121).unwrap_err();
            assert!(problems.len() == 1 && problems[0].line == Some(2), "{line}: {problems:?}");
            assert!(problems[0].message.contains(why), "{line}: {problems:?}");
        }
        let all: String = (0..=TEAM_PEERS_MAX).map(|at| format!("2 10.0.{}.{}\n", at / 200, at % 200 + 1)).collect();
        assert!(hosts(&all, 1, 21_121).unwrap_err()[0].message.contains("more than 256"));
    }

    proptest! {
        #[test]
        fn whatever_stands_there_is_read_or_refused(text: String) {
            let _ = hosts(&text, 1, 21_121);
        }
    }
}
