//! A process that records, started by the test binary in a role, and what is found of its recordings.

#![allow(dead_code, reason = "each test binary uses its part")]
#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_recording::{
    ChannelId, ChannelSpec, Message, Options, Recovered, Rotation, Session, Writer, recover, recovered_path,
};
use rohrpost_schema::Type;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;

const ROLE: &str = "ROHRPOST_TEST_ROLE";
const FOLDER: &str = "ROHRPOST_TEST_FOLDER";

/// In a process of a test: what it is to do, and where.
pub(crate) fn role() -> Option<(String, PathBuf)> {
    Some((std::env::var(ROLE).ok()?, std::env::var_os(FOLDER)?.into()))
}

/// The test binary in a role: its test `role` looks for it.
pub(crate) fn in_role(role: &str, folder: &Path) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["role", "--exact", "--nocapture", "--test-threads", "1"]);
    command.env(ROLE, role).env(FOLDER, folder).stdout(Stdio::piped());
    command
}

/// A process, and its lines.
pub(crate) struct Running {
    pub(crate) child: Child,
    lines: BufReader<ChildStdout>,
}

impl Running {
    pub(crate) fn start(mut command: Command) -> Self {
        let mut child = command.spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap());
        Self { child, lines }
    }

    /// The next line that is for the test; none at the end.
    pub(crate) fn hear(&mut self) -> Option<String> {
        loop {
            let mut line = String::new();
            // A killed process may leave half a line.
            if self.lines.read_line(&mut line).unwrap() == 0 || !line.ends_with('\n') {
                return None;
            }
            // The harness says how the test is called, in front of the first one.
            if let Some((_, said)) = line.split_once("@ ") {
                return Some(said.trim().to_owned());
            }
        }
    }
}

/// Says a line to the test.
pub(crate) fn tell(line: &str) {
    let mut out = std::io::stdout().lock();
    writeln!(out, "@ {line}").unwrap();
    out.flush().unwrap();
}

/// Files of this many bytes, periods of milliseconds: rotating and syncing all the time.
pub(crate) fn busy_options(folder: &Path) -> Options {
    Options {
        rotation: Rotation { bytes_max: 200 << 10, age_max: Duration::from_millis(40) },
        flush: Duration::from_millis(2),
        sync: Duration::from_millis(4),
        retry: Duration::from_millis(5),
        leave_bytes: 0,
        ..Options::new(folder, "base")
    }
}

pub(crate) fn session() -> Session {
    Session { node: "base".into(), ..Session::default() }
}

pub(crate) fn channels(writer: &mut Writer) -> [ChannelId; 2] {
    ["laser.0", "motor.0"].map(|name| {
        let spec = ChannelSpec { name, item: "data", ty: &Type::Bytes, texts: BTreeMap::new() };
        writer.channel(&spec).unwrap()
    })
}

/// The message of a number: all of it follows from that.
pub(crate) fn with_message<T>(number: u32, take: impl FnOnce(usize, &Message<'_>) -> T) -> T {
    let mut state = u64::from(number) * 2 + 1;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    let data: Vec<u8> = (0..next() as usize * 8).map(|_| next()).collect();
    let ns = 1_000_000 + u64::from(number) * 1_000;
    let epoch = u64::from(number / 5_000);
    take(number as usize % 2, &Message { arrival_ns: ns, stamp_ns: ns - 500, epoch, sequence: number, data: &data })
}

/// The files of a folder, in their order.
pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// Recovers each file of a folder, in their order, and checks that their messages are those from 0 on. How many.
pub(crate) fn recover_all(folder: &Path) -> (u32, Vec<Recovered>) {
    let mut reports = Vec::new();
    let mut next = 0;
    for path in files(folder) {
        let to = recovered_path(&path);
        let report = recover(&path, &to, &mut |_, _| {}).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        next = check_messages(&to, next);
        reports.push(report);
    }
    (next, reports)
}

/// Checks a whole file with a reader that is not ours: its messages are those from `first` on. The number behind them.
pub(crate) fn check_messages(path: &Path, first: u32) -> u32 {
    let bytes = std::fs::read(path).unwrap();
    let (mut next, mut repeated) = (first, 0);
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        // Behind a step of time: what a file begins with, from the one before it.
        if message.channel.metadata.contains_key("repeated") {
            assert!(message.sequence < next, "{}", path.display());
            repeated += 1;
            continue;
        }
        with_message(next, |channel, expected| {
            assert_eq!(message.sequence, next, "{}", path.display());
            assert_eq!(message.channel.topic, ["laser.0/data", "motor.0/data"][channel]);
            assert_eq!((message.log_time, message.publish_time), (expected.arrival_ns, expected.stamp_ns));
            assert_eq!(message.channel.metadata["epoch"], expected.epoch.to_string());
            assert_eq!(message.data, expected.data);
        });
        next += 1;
    }
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.stats.unwrap().message_count, u64::from(next - first) + repeated);
    next
}
