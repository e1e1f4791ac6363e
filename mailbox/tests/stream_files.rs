//! The file of a stream when memory is full, and what may stand in its place: files that are cut off, damaged, copied,
//! of another version or not ours at all. Each is told with what is wrong with it, and stops nobody.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::small_memory::{may_mount, with_small_memory};
use common::{Ground, MAILBOX, shape, tell, unfinished};
use nix::fcntl::{FcntlArg, fcntl};
use rohrpost_mailbox::{
    BadFile, LAYOUT_VERSION, Next, Participant, Stamp, StreamError, StreamId, StreamReader, StreamShape, StreamWriter,
    WriteError,
};
use std::fs;
use std::io;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

const ID: StreamId = StreamId { name: MAILBOX, number: 3 };
const OTHER: StreamId = StreamId { name: MAILBOX, number: 4 };
/// Four pages.
const SMALL: StreamShape = StreamShape { record_bytes: 64, keep: 4, readers: 2, late: Duration::ZERO };
/// Its pages come when they are touched.
const LARGE: StreamShape = StreamShape { record_bytes: 64 << 10, keep: 24, ..SMALL };
/// Where the parts of a stream's first line lie.
const VERSION: usize = 8;
const NAME: usize = 12;
const NUMBER: usize = 16;
const RECORD: usize = 20;
const KEEP: usize = 24;
const READERS: usize = 28;
const FIRST: usize = 40;

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    assert_eq!(role, "fill");
    fill_a_small_memory(&ground);
    tell("well");
}

fn at(ns: u64) -> Stamp {
    Stamp { epoch: 1, ns }
}

fn file_of(ground: &Ground, id: StreamId) -> PathBuf {
    ground.path().join(format!("{:08x}.{}.ring", id.name.raw(), id.number))
}

/// Writes so many records, each of its number in all bytes.
fn write(writer: &mut StreamWriter, count: u64) {
    let len = writer.shape().record_bytes as usize;
    for _ in 0..count {
        let number = writer.written();
        writer.write(at(number + 1), &vec![number as u8; len]).unwrap();
    }
}

/// Reads all that is there, whole and in order; how many records were read.
fn read_on(reader: &mut StreamReader) -> u64 {
    let mut read = 0;
    loop {
        match reader.try_next().unwrap() {
            Next::Record(record) => {
                assert!(record.body().iter().all(|byte| *byte == record.info().sequence as u8), "torn");
                read += 1;
            }
            Next::Lost(_) => {}
            Next::Nothing => return read,
        }
    }
}

#[test]
fn without_memory_no_stream_is_half_made_and_those_that_are_there_go_on() {
    if !may_mount() {
        return rohrpost_test_report::skipped("a full /dev/shm; no mounts are allowed here");
    }
    let ground = Ground::new();
    let around = ground.path().parent().unwrap().to_owned();
    let pages = 40 + LARGE.segment_bytes() / 4096;
    let full = ground.start_with("fill", |command| with_small_memory(command, &around, pages));
    assert_eq!(full.hear(), "well");
    full.finish();
    assert!(!ground.path().exists(), "what it made was seen by itself alone");
}

/// In a process that sees a small memory of its own at the ground.
fn fill_a_small_memory(ground: &Ground) {
    let (node, me) = (ground.node(), ground.join());
    let mut large = me.stream_writer(ID, LARGE).unwrap();
    let ids = (OTHER.number..).map(|number| StreamId { number, ..ID });
    let mut small: Vec<_> = ids.map_while(|id| me.stream_writer(id, SMALL).ok()).collect();
    assert!(!small.is_empty());
    let there = node.streams().unwrap();
    let new = StreamId { number: 1000, ..ID };
    for (id, shape) in [(new, SMALL), (new, LARGE)] {
        assert_full(ground, &me, id, shape);
    }
    // A stream that has no room in its new shape stays as it was, and its next writer goes on.
    let (mut writer, mut reader) = (small.pop().unwrap(), me.stream_reader(there[there.len() - 1]).unwrap());
    write(&mut writer, 3);
    let id = writer.id();
    drop(writer);
    assert_full(ground, &me, id, LARGE);
    let mut writer = me.stream_writer(id, SMALL).unwrap();
    assert_eq!(writer.written(), 3);
    write(&mut writer, 1);
    assert_eq!(read_on(&mut reader), 4);
    small.push(writer);
    assert_eq!((unfinished(ground.path()), node.streams().unwrap()), (vec![], there.clone()));
    drop(reader);
    // Each frame is there to its last byte, although none was touched yet.
    let mut reader = me.stream_reader(ID).unwrap();
    for _ in 0..4 {
        write(&mut large, u64::from(LARGE.keep));
        assert_eq!(read_on(&mut reader), u64::from(LARGE.keep));
    }
    let last = small.pop().unwrap().id();
    assert!(node.remove_orphan_stream(last).unwrap());
    me.stream_writer(new, SMALL).unwrap();
}

/// There is no room for a stream.
fn assert_full(ground: &Ground, me: &Arc<Participant>, id: StreamId, shape: StreamShape) {
    let error = me.stream_writer(id, shape).err().unwrap();
    let (said, needed) = (error.to_string(), shape.segment_bytes());
    assert!(matches!(error, StreamError::Memory { bytes, .. } if bytes == needed), "{said}");
    let why = "No space left on device (os error 28)";
    let full = format!("{needed} bytes of shared memory: {why}; is it full (df {})?", ground.path().display());
    assert_eq!(said, format!("stream {id}: {full}"));
}

/// A stream's file with six records, as its maker leaves it.
fn whole() -> Vec<u8> {
    let ground = Ground::new();
    let mut writer = ground.join().stream_writer(ID, SMALL).unwrap();
    write(&mut writer, 6);
    fs::read(file_of(&ground, ID)).unwrap()
}

fn mailbox() -> Vec<u8> {
    let ground = Ground::new();
    let _receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    fs::read(ground.path().join(format!("{:08x}.mbx", MAILBOX.raw()))).unwrap()
}

fn garbage(bytes: u32) -> Vec<u8> {
    (0..bytes).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect()
}

fn bad(error: StreamError) -> BadFile {
    match error {
        StreamError::Bad(ID, why) => why,
        error => panic!("{error}"),
    }
}

#[test]
fn a_file_in_a_streams_place_is_told_by_what_is_wrong_with_it_and_replaced() {
    let whole = whole();
    let changed = |at: usize, bytes: &[u8]| {
        let mut changed = whole.clone();
        changed[at..][..bytes.len()].copy_from_slice(bytes);
        changed
    };
    let foreign = BadFile::Foreign("stream");
    let cut = |there: usize, whole: usize| BadFile::Cut { what: "stream", there: there as u64, whole: whole as u64 };
    let misnamed = |id: StreamId| BadFile::Misnamed(format!("stream {id}"));
    let (last, larger) = (whole.len() - 1, StreamShape { record_bytes: 1 << 16, ..SMALL }.segment_bytes());
    for (what, bytes, why) in [
        ("empty", vec![], foreign.clone()),
        ("a few bytes", whole[..100].to_vec(), foreign.clone()),
        ("garbage", garbage(20_000), foreign.clone()),
        ("zeroes", vec![0; 20_000], foreign.clone()),
        ("a mailbox", mailbox(), foreign.clone()),
        ("all but its last byte", whole[..last].to_vec(), cut(last, whole.len())),
        ("its first page", whole[..4096].to_vec(), cut(4096, whole.len())),
        ("larger records than there is room", changed(RECORD, &(1_u32 << 16).to_ne_bytes()), cut(whole.len(), larger)),
        ("another version", changed(VERSION, &[99]), BadFile::Version(99)),
        ("another version's, cut", changed(VERSION, &[99])[..4096].to_vec(), BadFile::Version(99)),
        ("another stream's", changed(NUMBER, &[4]), misnamed(OTHER)),
        ("another module's", changed(NAME, &[9]), misnamed(StreamId { name: ID.name.with_local(9), ..ID })),
        ("a number that no stream has", changed(NUMBER, &[3, 0, 1]), foreign.clone()),
        ("records of 0 bytes", changed(RECORD, &[0]), foreign.clone()),
        ("one record", changed(KEEP, &[1]), foreign.clone()),
        ("too many records", changed(KEEP, &[0xff; 4]), foreign.clone()),
        ("no readers", changed(READERS, &[0]), foreign.clone()),
        ("too many readers", changed(READERS, &[65]), foreign.clone()),
        ("a sequence that no stream comes to", changed(FIRST, &[0xff; 8]), foreign),
    ] {
        let (ground, me) = Ground::joined();
        let node = ground.node();
        let mut early = me.stream_reader(ID).unwrap();
        fs::write(file_of(&ground, ID), &bytes).unwrap();
        assert_eq!(bad(me.stream_reader(ID).err().unwrap()), why, "{what}");
        assert_eq!(bad(node.inspect_stream(ID).err().unwrap()), why, "{what}");
        // It looks again when the registry has changed.
        drop(me.stream_writer(OTHER, SMALL).unwrap());
        assert_eq!(bad(early.try_next().err().unwrap()), why, "{what}");
        assert_eq!(node.streams().unwrap(), [ID, OTHER], "{what}");
        let mut writer = me.stream_writer(ID, SMALL).unwrap_or_else(|error| panic!("{what}: {error}"));
        write(&mut writer, 2);
        assert_eq!((writer.written(), read_on(&mut early)), (2, 2), "{what} is replaced");
        fs::write(file_of(&ground, OTHER), bytes).unwrap();
        assert!(node.remove_orphan_stream(OTHER).unwrap(), "{what} can be removed");
    }
}

#[test]
fn what_is_said_of_a_bad_file_names_it_and_what_would_be_right() {
    let clean = "remove the file with `rohrpost clean`";
    for (why, said) in [
        (BadFile::Foreign("stream"), format!("its file is no stream, or damaged; end its owner, and {clean}")),
        (
            BadFile::Version(99),
            format!(
                "it was made by another version (layout 99, this program {LAYOUT_VERSION}); build both from the same \
                 version"
            ),
        ),
        (
            BadFile::Cut { what: "stream", there: 5, whole: 7 },
            format!("its file was cut: it has 5 bytes, and says that it is a stream of 7; end its owner, and {clean}"),
        ),
        (
            BadFile::Misnamed(format!("stream {OTHER}")),
            format!(
                "its file is that of stream {OTHER}: somebody copied or renamed it; remove it with `rohrpost clean`"
            ),
        ),
    ] {
        assert_eq!(StreamError::Bad(ID, why).to_string(), format!("stream {ID}: {said}"));
    }
}

/// A program of another version still writes there: it is not to be replaced.
#[test]
fn a_bad_file_that_somebody_owns_stays_and_is_told() {
    let mut bytes = whole();
    bytes[VERSION] = 99;
    let (ground, me) = Ground::joined();
    fs::write(file_of(&ground, ID), &bytes).unwrap();
    let owner = fs::File::options().read(true).write(true).open(file_of(&ground, ID)).unwrap();
    let first_byte = libc::flock {
        l_type: libc::F_WRLCK as libc::c_short,
        l_whence: libc::SEEK_SET as libc::c_short,
        l_start: 0,
        l_len: 1,
        l_pid: 0,
    };
    fcntl(&owner, FcntlArg::F_OFD_SETLK(&first_byte)).unwrap();
    assert_eq!(bad(me.stream_writer(ID, SMALL).err().unwrap()), BadFile::Version(99));
    assert!(!ground.node().remove_orphan_stream(ID).unwrap());
    assert_eq!(fs::read(file_of(&ground, ID)).unwrap(), bytes);
    drop(owner);
    me.stream_writer(ID, SMALL).unwrap();
}

#[test]
fn odd_things_in_a_streams_place_stop_nobody() {
    let pipe = |at: &Path| {
        let path = std::ffi::CString::new(at.as_os_str().as_bytes()).unwrap();
        // SAFETY: a valid C string that outlives the call.
        assert_eq!(unsafe { libc::mkfifo(path.as_ptr(), 0o600) }, 0);
    };
    for (what, put) in [
        ("a named pipe", &pipe as &dyn Fn(&Path)),
        ("a directory", &|at: &Path| fs::create_dir(at).unwrap()),
        ("a link", &|at: &Path| std::os::unix::fs::symlink("/etc/passwd", at).unwrap()),
    ] {
        let (ground, me) = Ground::joined();
        let node = ground.node();
        put(&file_of(&ground, ID));
        for error in [me.stream_reader(ID).err().unwrap(), node.inspect_stream(ID).err().unwrap()] {
            let said = format!(
                "stream {ID}: {what} stands where the file of the stream belongs; end what uses the node, and remove \
                 it: `rohrpost clean`"
            );
            assert_eq!(error.to_string(), said);
        }
        // It goes itself, and what a link leads to stays.
        assert!(node.remove_orphan_stream(ID).unwrap() && Path::new("/etc/passwd").exists(), "{what}");
        put(&file_of(&ground, ID));
        write(&mut me.stream_writer(ID, SMALL).unwrap(), 1);
        put(&file_of(&ground, OTHER));
        if what == "a directory" {
            let inside = file_of(&ground, OTHER).join("of a user");
            fs::write(&inside, "kept").unwrap();
            let said = format!("remove it: rm -r {}", file_of(&ground, OTHER).display());
            let error = node.remove_orphan_stream(OTHER).unwrap_err().to_string();
            assert!(error.ends_with(&said), "{error}");
            assert!(me.stream_writer(OTHER, SMALL).is_err() && inside.exists());
            fs::remove_file(inside).unwrap();
        }
        me.stream_writer(OTHER, SMALL).unwrap();
        drop(me);
        assert!(node.remove_if_dead().unwrap() && !ground.path().exists(), "{what}");
    }
    let ground = Ground::new();
    let _node = ground.node();
    for name in ["1.3.ring", "01c80100.03.ring", "01C80100.3.ring", "01c80100.70000.ring", "01c80100.ring", "a.ring"] {
        fs::write(ground.path().join(name), b"odd").unwrap();
    }
    assert_eq!(ground.node().streams().unwrap(), []);
}

/// What a program does with a stream, as far as it can: every refusal has a type.
fn use_it(me: &Arc<Participant>, shape: StreamShape) {
    let mut writer = me.stream_writer(ID, shape).unwrap();
    let mut reader = me.stream_reader(ID).unwrap();
    let (mut copy, max) = (Vec::new(), shape.record_bytes as usize);
    reader.seek(0);
    for ns in 1..100 {
        match writer.write(Stamp { epoch: u64::MAX, ns: u64::MAX - 100 + ns }, &[7; 40]) {
            Ok(_) | Err(WriteError::Damaged(ID)) => {}
            Err(error) => panic!("{error}"),
        }
        if let Next::Record(record) = reader.try_next().unwrap() {
            assert!(record.body().len() <= max);
        }
        reader.try_next_into(&mut copy).unwrap();
        assert!(copy.len() <= max);
        let newest = reader.newest().unwrap().map(|record| record.info().stamp);
        for stamp in newest.into_iter().chain([at(1), at(u64::MAX), Stamp { epoch: u64::MAX, ns: ns << 32 }]) {
            reader.around(stamp).unwrap();
        }
        reader.record(ns);
    }
    // No jump, however far, and nothing that a damaged file answers to it, comes to a sequence past counting.
    for _ in 0..3 {
        reader.seek(u64::MAX);
        assert_eq!(reader.position(), 1 << 56);
        reader.try_next_into(&mut copy).unwrap();
        assert!(reader.position() <= (1 << 56) + 1);
    }
    assert!(me.node().inspect_stream(ID).unwrap().is_some());
}

#[test]
fn garbage_behind_the_first_line_of_a_stream_is_survived() {
    for shape in [SMALL, StreamShape { record_bytes: 5000, late: Duration::from_secs(1), ..SMALL }] {
        let whole = {
            let ground = Ground::new();
            drop(ground.join().stream_writer(ID, shape).unwrap());
            fs::read(file_of(&ground, ID)).unwrap()
        };
        let garbage = garbage(whole.len() as u32);
        for (from, to, with) in [
            (64, whole.len(), &garbage[..]),
            (128, 136, &[0xff; 8]),
            (4096, 8192, &[0xff; 4096]),
            (4096, 8192, &garbage[..4096]),
            (8192, 12_288, &[0xff; 4096]),
            (8192, 12_288, &garbage[..4096]),
        ] {
            let mut bytes = whole.clone();
            bytes[from..to].copy_from_slice(&with[..to - from]);
            // Not retired, or it would just be replaced.
            bytes[80..84].fill(0);
            let (ground, me) = Ground::joined();
            fs::write(file_of(&ground, ID), &bytes).unwrap();
            use_it(&me, shape);
            // And while it is in use.
            let writer = me.stream_writer(ID, shape).unwrap();
            let mut reader = me.stream_reader(ID).unwrap();
            let file = fs::File::options().write(true).open(file_of(&ground, ID)).unwrap();
            write_at(&file, &bytes[64..], 64).unwrap();
            let _ = (reader.try_next().unwrap().map(|record| record.body().len()), reader.around(at(5)).unwrap());
            drop(writer);
            use_it(&me, shape);
        }
    }
}

fn write_at(file: &fs::File, bytes: &[u8], at: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, at)
}
