//! Lines for the journal of systemd, in its own protocol: <https://systemd.io/JOURNAL_NATIVE_PROTOCOL/>.
//!
//! A line is one datagram of fields. The socket never blocks: a journal that hangs costs its own lines, not ours. The
//! crates that speak this protocol bring a logger of their own, or cryptography for other things systemd does.

use super::sink::{SinkChange, SinkHealth};
use rohrpost_config::Installation;
use rohrpost_modules::common::OutputLevel;
use rohrpost_modules::output::OutputLine;
use std::io;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Where the journal listens.
pub(super) const SOCKET: &str = "/run/systemd/journal/socket";

pub(super) struct Journal {
    socket: UnixDatagram,
    path: PathBuf,
    datagram: Vec<u8>,
    health: SinkHealth,
}

impl Journal {
    pub(super) fn new(path: &Path) -> io::Result<Self> {
        let socket = UnixDatagram::unbound()?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, path: path.to_owned(), datagram: Vec::with_capacity(1024), health: SinkHealth::default() })
    }

    pub(super) fn write(&mut self, line: &OutputLine, installation: &Installation, now: Instant) -> Option<SinkChange> {
        let Self { socket, path, datagram, health } = self;
        health.put(now, || {
            datagram.clear();
            fields(datagram, line, installation);
            // By name each time: a journal that was started again listens at a new socket of the same name.
            socket.send_to(datagram, &*path).map(drop)
        })
    }
}

fn fields(datagram: &mut Vec<u8>, line: &OutputLine, installation: &Installation) {
    let (module, classes) = (line.module(), &installation.classes);
    let priority = match line.level {
        OutputLevel::Error => "3",
        OutputLevel::Warn => "4",
        OutputLevel::Info => "6",
        OutputLevel::Debug | OutputLevel::Trace => "7",
    };
    field(datagram, "MESSAGE", &line.full_text());
    field(datagram, "PRIORITY", priority);
    field(datagram, "SYSLOG_IDENTIFIER", "rohrpost");
    field(datagram, "ROHRPOST_INSTALLATION", &installation.name);
    if let Some(node) = installation.node_of(module) {
        field(datagram, "ROHRPOST_NODE", node);
    }
    field(datagram, "ROHRPOST_MODULE", &classes.format(module));
    if let Some(class) = classes.name(module.class()) {
        field(datagram, "ROHRPOST_CLASS", class);
    }
    field(datagram, "ROHRPOST_TIME_NS", &line.time_ns.to_string());
    if let Some(number) = line.errno {
        // systemd has a field for it.
        field(datagram, "ERRNO", &number.to_string());
    }
    for (name, count) in [("ROHRPOST_LOST_BEFORE", line.lost), ("ROHRPOST_SUPPRESSED", line.suppressed)] {
        if count > 0 {
            field(datagram, name, &count.to_string());
        }
    }
}

/// `NAME=value`, or, for a value of several lines, its length in front.
fn field(datagram: &mut Vec<u8>, name: &str, value: &str) {
    datagram.extend_from_slice(name.as_bytes());
    if value.contains('\n') {
        datagram.push(b'\n');
        datagram.extend_from_slice(&(value.len() as u64).to_le_bytes());
    } else {
        datagram.push(b'=');
    }
    datagram.extend_from_slice(value.as_bytes());
    datagram.push(b'\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_mailbox::Name;
    use std::collections::BTreeMap;
    use std::time::Duration;

    const CONFIG: &str = r#"
installation = "said"
[system]
name = "robot"
id = 1
[classes]
motor = { id = 200 }
tool = { id = 16 }
[nodes.main]
[[module]]
name = "motor.0"
program = "motor"
optional = true
"#;

    /// Reads a datagram as the journal does.
    fn read(journal: &UnixDatagram) -> BTreeMap<String, String> {
        let mut bytes = [0; 4096];
        let len = journal.recv(&mut bytes).unwrap();
        let (mut rest, mut fields) = (&bytes[..len], BTreeMap::new());
        while !rest.is_empty() {
            let end = rest.iter().position(|byte| matches!(byte, b'=' | b'\n')).unwrap();
            let name = String::from_utf8(rest[..end].to_vec()).unwrap();
            let after = &rest[end + 1..];
            let (value, next) = if rest[end] == b'=' {
                let end = after.iter().position(|byte| *byte == b'\n').unwrap();
                (&after[..end], &after[end..])
            } else {
                let len = u64::from_le_bytes(after[..8].try_into().unwrap()) as usize;
                (&after[8..8 + len], &after[8 + len..])
            };
            assert_eq!(next[0], b'\n', "{name}");
            rest = &next[1..];
            fields.insert(name, String::from_utf8(value.to_vec()).unwrap());
        }
        fields
    }

    fn line(level: OutputLevel, text: &str) -> OutputLine {
        let module = Name::new(1, 200, 0, 0).raw();
        OutputLine { time_ns: 123, module, level, lost: 0, suppressed: 0, errno: None, text: text.into() }
    }

    #[test]
    fn lines_arrive_with_their_fields() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let listening = UnixDatagram::bind(&path).unwrap();
        let installation = Installation::parse(CONFIG, Path::new("said.toml")).unwrap();
        let mut journal = Journal::new(&path).unwrap();
        for (level, priority, text) in [
            (OutputLevel::Error, "3", "panicked at a.rs:1:2:\nPRIORITY=0\n"),
            (OutputLevel::Warn, "4", "warm = 1"),
            (OutputLevel::Info, "6", ""),
            (OutputLevel::Debug, "7", "ü"),
            (OutputLevel::Trace, "7", "t"),
        ] {
            assert!(journal.write(&line(level, text), &installation, Instant::now()).is_none());
            let fields = read(&listening);
            let expected = [
                ("MESSAGE", text),
                ("PRIORITY", priority),
                ("ROHRPOST_CLASS", "motor"),
                ("ROHRPOST_INSTALLATION", "said"),
                ("ROHRPOST_MODULE", "motor.0"),
                ("ROHRPOST_NODE", "main"),
                ("ROHRPOST_TIME_NS", "123"),
                ("SYSLOG_IDENTIFIER", "rohrpost"),
            ];
            let expected = expected.map(|(name, value)| (name.to_owned(), value.to_owned()));
            assert_eq!(fields.into_iter().collect::<Vec<_>>(), expected);
        }
        let told = OutputLine { lost: 2, suppressed: 5, errno: Some(28), ..line(OutputLevel::Warn, "x") };
        journal.write(&told, &installation, Instant::now());
        let fields = read(&listening);
        assert_eq!((fields["ROHRPOST_LOST_BEFORE"].as_str(), fields["ROHRPOST_SUPPRESSED"].as_str()), ("2", "5"));
        assert_eq!(fields["ERRNO"], "28");
    }

    #[test]
    fn a_journal_that_hangs_or_is_gone_costs_its_own_lines_and_no_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let installation = Installation::parse(CONFIG, Path::new("said.toml")).unwrap();
        let mut journal = Journal::new(&path).unwrap();
        let start = Instant::now();
        let mut second = 0;
        let mut write = || {
            second += 1;
            journal.write(&line(OutputLevel::Info, "x"), &installation, start + second * Duration::from_secs(1))
        };
        assert!(matches!(write(), Some(SinkChange::Fails(_))), "nobody listens");
        assert!(write().is_none(), "said once");

        let hangs = UnixDatagram::bind(&path).unwrap();
        assert!(matches!(write(), Some(SinkChange::Works(2))));
        // It reads nothing: its queue is full at some time, and the writer still returns.
        let full = (0..100_000).find_map(|_| write());
        let Some(SinkChange::Fails(error)) = full else { panic!("a queue without end: {full:?}") };
        assert_eq!(error.kind(), io::ErrorKind::WouldBlock);
        read(&hangs);
        assert!(matches!(write(), Some(SinkChange::Works(1))), "it reads again");
        drop(hangs);

        std::fs::remove_file(&path).unwrap();
        assert!(matches!(write(), Some(SinkChange::Fails(_))), "it was ended");
        let again = UnixDatagram::bind(&path).unwrap();
        assert!(matches!(write(), Some(SinkChange::Works(1))), "and started again");
        assert_eq!(read(&again)["MESSAGE"], "x");
    }
}
