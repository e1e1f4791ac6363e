//! The reader in Python of `docs/src/shared-memory.md`, as it stands there.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::records::Records;
use common::{Ground, LOW, MAILBOX, OTHER, label, shape};
use rohrpost_mailbox::{Stamp, StreamId, StreamShape, StreamWriter};
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The page.
const PAGE: &str = include_str!("../../docs/src/shared-memory.md");
/// That of the page's example.
const ID: StreamId = StreamId { name: MAILBOX, number: 3 };
const SHAPE: StreamShape = StreamShape { record_bytes: 8192, keep: 8, readers: 2, late: Duration::ZERO };
/// Records that are saved while the writer turns its ring.
const SAVED: u32 = 8;

/// What the page's only program prints.
fn run(arguments: &[&str]) -> String {
    let (_, program) = PAGE.split_once("```python\n").unwrap();
    let (program, rest) = program.split_once("```\n").unwrap();
    assert!(!rest.contains("```python"));
    let output = Command::new("python3").args(["-c", program]).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Ends the writer, also when a record is torn: else the test would wait for it.
struct End<'a>(&'a AtomicBool);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Relaxed);
    }
}

fn write(writer: &mut StreamWriter, records: &Records) {
    let number = writer.written();
    let mut open = writer.begin(Stamp { epoch: 1, ns: 1000 + number }).unwrap();
    records.fill(number, open.body_mut());
    open.finish(records.len(number)).unwrap();
}

#[test]
fn mailboxes_and_streams_are_listed_as_the_page_says() {
    let (ground, me) = Ground::joined();
    let (_first, _second) = (me.receiver(MAILBOX, shape(4)).unwrap(), me.receiver(OTHER, shape(65)).unwrap());
    let mut sender = me.sender(OTHER).unwrap();
    sender.send(&label(LOW, 1), &[b"five!"]).unwrap();
    let _empty = me.stream_writer(StreamId { number: 1, ..ID }, StreamShape { record_bytes: 64, ..SHAPE }).unwrap();
    let (mut writer, records) = (me.stream_writer(ID, SHAPE).unwrap(), Records::new([5000]));
    (0..75).for_each(|_| write(&mut writer, &records));
    let streams = "1.200.1.0/3 8 x 8192 B, 75 written\n    record 74: 5000 bytes, stamp 1074 ns of epoch 1\n";
    let mailboxes = "1.200.1.0 4 x 256 B\n1.201.1.0 65 x 256 B\n    slot 0: priority 10, ticket 0, type 16, 5 bytes\n";
    let expected = format!("{mailboxes}1.200.1.0/1 8 x 64 B, 0 written\n{streams}");
    assert_eq!(run(&[ground.path().to_str().unwrap()]), expected);
    assert!(PAGE.contains(streams), "the page's example is another one");
}

#[test]
fn the_newest_record_is_saved_whole_while_the_writer_turns_its_ring() {
    // In words that are copied while they are written; and so large, and so few, that reading one takes as long as
    // writing two, after which its frame is used again.
    for (record_bytes, keep) in [(4000, 64), (1 << 20, 2)] {
        let ground = Ground::in_memory();
        let me = ground.join();
        let mut writer = me.stream_writer(ID, StreamShape { record_bytes, keep, ..SHAPE }).unwrap();
        let (records, goes_on) = (Records::new([record_bytes as usize]), AtomicBool::new(true));
        write(&mut writer, &records);
        let (node, picture) = (ground.path().to_str().unwrap(), PathBuf::from(ground.path()).join("picture"));
        std::thread::scope(|scope| {
            let _end = End(&goes_on);
            scope.spawn(|| {
                while goes_on.load(Ordering::Relaxed) {
                    write(&mut writer, &records);
                }
            });
            for _ in 0..SAVED {
                assert_eq!(run(&[node, &ID.to_string(), picture.to_str().unwrap()]), "");
                let saved = std::fs::read(&picture).unwrap();
                let number = u64::from_le_bytes(*saved.first_chunk().unwrap());
                records.check(number, &saved);
            }
        });
    }
}
