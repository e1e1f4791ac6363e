//! The models of the core of streams. This file is compiled beside the real `stream/*.rs` and beside each broken one.

use crate::step::{dies_at, reached};
use crate::stream::lookup::{Answer, around};
use crate::stream::missed::Missed;
use crate::stream::omission::LeftOut;
use crate::stream::ring::{About, Look, Stamp};
use crate::stream::writing::Progress;
use crate::stream_rig::{Bytes, Reader, Stream, looked_at};
use crate::sync::Ordering;
use loom::thread;
use std::sync::Mutex;

/// The writer writes on while a reader copies: each record that it gets is whole, and the accounts are exact.
fn is_copied_whole(before: u64, during: u64) {
    let stream = Stream::new(2, 1);
    let mut progress = Progress::resume(&stream.ring());
    stream.writes(&mut progress, before, Bytes::Racing);
    let mut reader = Reader::new(&stream, 0);
    let writer = stream.spawn(move |stream| stream.writes(&mut progress, during, Bytes::Racing));
    reader.advance(Bytes::Racing);
    writer.join().unwrap();
    reader.settle(before + during, Bytes::Racing);
}

pub(crate) fn a_new_record_is_copied_whole() {
    is_copied_whole(0, 1);
}

/// The reader is at a record that the writer replaces, and it uses the frame again.
pub(crate) fn an_overwritten_copy_is_thrown_away() {
    is_copied_whole(2, 2);
}

/// A record is held in plain memory while the writer passes it: loom reports a race of the two.
pub(crate) fn the_writer_goes_round_what_is_held() {
    let (stream, mut progress, lines) = looked_at(1, Bytes::Plain);
    let writer = stream.spawn(move |stream| stream.writes(&mut progress, 2, Bytes::Plain));
    stream.read(0, &lines[0], Bytes::Plain);
    writer.join().unwrap();
}

/// One record after the other is held, so that the seat names another frame right after a release.
pub(crate) fn what_was_released_was_read() {
    let (stream, mut progress, lines) = looked_at(1, Bytes::Plain);
    let writer = stream.spawn(move |stream| stream.writes(&mut progress, 2, Bytes::Plain));
    lines.iter().for_each(|line| _ = stream.read(0, line, Bytes::Plain));
    writer.join().unwrap();
}

/// All seats are held: there still is a frame to write, and all that are kept are there.
pub(crate) fn there_always_is_a_free_frame() {
    let (stream, mut progress, lines) = looked_at(2, Bytes::Plain);
    let holder = stream
        .spawn(move |stream| lines.iter().enumerate().for_each(|(seat, line)| _ = stream.ring().hold(seat, line)));
    stream.writes(&mut progress, 3, Bytes::Plain);
    holder.join().unwrap();
    for sequence in 3..5 {
        assert!(matches!(stream.ring().look(sequence), Look::There(_)), "a kept record is missing");
    }
}

/// The writer dies at a step of its third record, and a successor goes on in front of a reader that copies or holds the
/// first.
fn a_writer_dies(fatal: &'static str, finished: u64, bytes: Bytes) {
    let (stream, mut progress, lines) = looked_at(1, bytes);
    let successor = stream.spawn(move |stream| {
        assert!(dies_at(fatal, || stream.writes(&mut progress, 1, bytes)));
        let mut progress = Progress::resume(&stream.ring());
        assert_eq!(progress.next(), finished, "a finished record is lost, or an unfinished one is none");
        stream.writes(&mut progress, 1, bytes);
    });
    match bytes {
        Bytes::Plain => _ = stream.read(0, &lines[0], Bytes::Plain),
        Bytes::Racing => {
            let mut reader = Reader::new(&stream, 0);
            reader.next = 2;
            reader.advance(Bytes::Racing);
        }
    }
    successor.join().unwrap();
    Reader::new(&stream, 0).settle(finished + 1, bytes);
}

pub(crate) fn a_successor_writes_what_was_begun() {
    a_writer_dies("entry: filled", 2, Bytes::Racing);
}

pub(crate) fn a_successor_counts_what_was_finished() {
    a_writer_dies("entry: published", 3, Bytes::Racing);
}

/// The dead one had taken the record's entry away, and the successor uses its frame.
pub(crate) fn a_successor_goes_round_what_is_held() {
    a_writer_dies("entry: filled", 2, Bytes::Plain);
}

/// The writer of a replica leaves out more records than are kept, and then writes into what that made free.
pub(crate) fn the_writer_goes_round_what_is_held_and_left_out() {
    let (stream, mut progress, lines) = looked_at(1, Bytes::Plain);
    let writer = stream.spawn(move |stream| {
        progress.skip_to(&stream.ring(), 5, 0);
        stream.writes(&mut progress, 2, Bytes::Plain);
    });
    stream.read(0, &lines[0], Bytes::Plain);
    writer.join().unwrap();
    Reader::new(&stream, 0).settle(7, Bytes::Plain);
}

/// A replica leaves out two that were sampled out, and its next record takes the place of the first while a reader
/// looks there: whatever it sees of that, it takes neither for one that was lost.
pub(crate) fn what_was_left_out_is_told_by_cause() {
    let stream = Stream::new(2, 1);
    let mut progress = Progress::resume(&stream.ring());
    stream.writes(&mut progress, 1, Bytes::Racing);
    let mut reader = Reader::telling(&stream, 0);
    reader.advance(Bytes::Racing);
    let writer = stream.spawn(move |stream| {
        progress.skip_to(&stream.ring(), 3, 2);
        stream.writes(&mut progress, 1, Bytes::Racing);
    });
    reader.advance(Bytes::Racing);
    writer.join().unwrap();
    reader.catch_up(Bytes::Racing);
    let missed = reader.missed.as_ref().map(|missed| missed.missed());
    let told = Some(Missed { lost: 0, sampled: 2, passed_over: 0 });
    assert_eq!(missed, told, "a cause is wrong");
    reader.settle(4, Bytes::Racing);
}

/// It dies at the first that it leaves out, and its successor writes in front of a reader that holds what was before.
pub(crate) fn a_successor_leaves_out_the_rest() {
    let (stream, mut progress, lines) = looked_at(1, Bytes::Plain);
    let successor = stream.spawn(move |stream| {
        assert!(dies_at("entry: published", || progress.skip_to(&stream.ring(), 5, 0)));
        let mut progress = Progress::resume(&stream.ring());
        assert_eq!(progress.next(), 4, "what was left out is not");
        let mut reader = Reader::new(&stream, 0);
        reader.next = 2;
        assert!(reader.advance(Bytes::Racing), "a reader waits for what was left out");
        stream.writes(&mut progress, 1, Bytes::Plain);
    });
    stream.read(0, &lines[0], Bytes::Plain);
    successor.join().unwrap();
    Reader::new(&stream, 0).settle(5, Bytes::Plain);
}

/// A reader of a stream with a writer that died in the middle does not see its half entry.
pub(crate) fn no_half_record_is_left() {
    let stream = Stream::new(2, 1);
    let mut progress = Progress::resume(&stream.ring());
    stream.writes(&mut progress, 2, Bytes::Racing);
    assert!(dies_at("entry: begun", || stream.writes(&mut progress, 1, Bytes::Racing)));
    let mut reader = Reader::new(&stream, 0);
    reader.catch_up(Bytes::Racing);
    assert_eq!((reader.read, reader.lost, reader.next), (1, 1, 2));
    assert_eq!(stream.ring().newest().map(|line| line.sequence), Some(1));
}

/// A dead reader's seat names a frame: the writer finds another each time, and the next reader there holds as if
/// nothing had been.
pub(crate) fn a_dead_holder_costs_nothing() {
    let (stream, mut progress, lines) = looked_at(1, Bytes::Plain);
    assert!(dies_at("release: before seat", || _ = stream.read(0, &lines[0], Bytes::Plain)));
    let next = stream.spawn(move |stream| {
        stream.ring().sit_down(0, 0);
        stream.read(0, &lines[1], Bytes::Plain);
    });
    stream.writes(&mut progress, 2, Bytes::Plain);
    next.join().unwrap();
}

/// As `wait_any`: the reader sleeps until the record is there.
pub(crate) fn no_wake_up_is_lost() {
    let stream = Stream::new(2, 1);
    let writer = stream.spawn(move |stream| stream.writes(&mut Progress::resume(&stream.ring()), 1, Bytes::Racing));
    let mut reader = Reader::new(&stream, 0);
    while !reader.advance(Bytes::Racing) {
        let seen = stream.rings.load(Ordering::Acquire);
        stream.ring().drowsy(0, 1);
        reached("wait: drowsy");
        if !stream.ring().is_due(reader.next) {
            // As the kernel: sleeps while nobody has rung since.
            while stream.rings.load(Ordering::Acquire) == seen {
                thread::yield_now();
            }
        }
        stream.ring().awake(0);
    }
    writer.join().unwrap();
    assert_eq!((reader.read, reader.lost), (1, 0));
}

/// A record that is late comes while a reader looks for the two around a time: a final answer is the same before and
/// after.
pub(crate) fn a_final_answer_stays() {
    let stream = Stream::new(4, 1);
    let mut progress = Progress::resume(&stream.ring());
    for ns in [10, 30] {
        stream.write(&mut progress, ns, Bytes::Racing);
    }
    let writer = stream.spawn(move |stream| [20, 40].map(|ns| stream.write(&mut progress, ns, Bytes::Racing)));
    // Of 18, 20 is the nearest after, and may come as long as 30 is the newest.
    let ask = || match around(&stream.ring(), Stamp { epoch: 1, ns: 18 }, 10) {
        Answer::Around { before, after } => Some((before.about.stamp.ns, after.about.stamp.ns)),
        Answer::NotYet { .. } => None,
        other => panic!("no answer for a time in the ring: {other:?}"),
    };
    let early = ask();
    assert!(early.is_none_or(|early| early == (10, 20)), "{early:?} was said to be final");
    writer.join().unwrap();
    assert_eq!(ask(), Some((10, 20)));
}

/// The writer passes a reader that looks for the two around a time: they are the right two, or are gone.
pub(crate) fn an_overwritten_look_says_so() {
    let stream = Stream::new(2, 1);
    let mut progress = Progress::resume(&stream.ring());
    stream.writes(&mut progress, 2, Bytes::Racing);
    let writer = stream.spawn(move |stream| stream.writes(&mut progress, 1, Bytes::Racing));
    match around(&stream.ring(), Stamp { epoch: 1, ns: 15 }, 0) {
        Answer::Around { before, after } => {
            assert_eq!((before.about.stamp.ns, after.about.stamp.ns), (10, 20), "not the nearest");
        }
        Answer::BeforeOldest { .. } => {}
        other => panic!("no answer for a time in the ring: {other:?}"),
    }
    writer.join().unwrap();
}

/// What a dead sleeper said is cleared, unless the next reader of the seat has said something since.
pub(crate) fn a_dead_sleeper_is_forgotten_alone() {
    let stream = Stream::new(2, 1);
    stream.ring().drowsy(0, 7);
    let next = stream.spawn(move |stream| {
        stream.ring().sit_down(0, 0);
        stream.ring().drowsy(0, 8);
    });
    let wakes = Mutex::new(0);
    stream.seats[0].forget(7);
    reached("sleeper: forgotten");
    next.join().unwrap();
    let mut progress = Progress::resume(&stream.ring());
    let frame = progress.claim(&stream.ring()).unwrap();
    let stamp = Stamp { epoch: 1, ns: 1 };
    let left_out = LeftOut::default();
    let about = About { stamp, before_ns: 0, written_ns: 0, len_bytes: 0, incarnation: 0, left_out };
    progress.publish(
        &stream.ring(),
        frame,
        about,
        |_| (),
        |_, sleeper| {
            assert_eq!(sleeper, 8);
            *wakes.lock().unwrap() += 1;
        },
    );
    assert_eq!(*wakes.lock().unwrap(), 1, "the living sleeper is not woken");
}
