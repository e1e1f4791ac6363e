//! A network with a delay that varies by more than the time from one small record to the next: they overtake each
//! other.

use super::stepped::Lines;
use super::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const S: u64 = 1_000_000_000;
/// From one pose to the next, ns.
const EVERY_NS: u64 = 10 * MS;
/// So much the delay varies, either way.
const VARIES_NS: u64 = 18 * MS;
/// Both ends look so often.
const LOOK_NS: u64 = MS / 2;

/// What came of poses that were written for a while.
struct Outcome {
    holder: Holder,
    written: u64,
    /// The longest time from writing to reading, ns.
    worst_ns: u64,
    lines: u64,
}

/// Writes poses, of which the wire loses this share and delays each datagram by its own time.
fn poses(seconds: u64, loss: f64) -> Outcome {
    poses_in(StreamShape { record_bytes: 64, keep: 256, ..SHAPE }, seconds, loss)
}

/// The same in rings of this shape.
fn poses_in(shape: StreamShape, seconds: u64, loss: f64) -> Outcome {
    let mut both = Both::new(ReplicaSettings { shape, ..image() });
    both.carry();
    let Both { mut origin, mut holder, mut writer, mut reader, mut now_ns } = both;
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let (mut there, mut back) = (Wire::default(), Wire::default());
    let (mut last, mut worst_ns, begin_ns) = (None, 0, now_ns);
    let lines = Lines::default();
    tracing::subscriber::with_default(lines.clone(), || {
        // At the end the last ones arrive.
        while now_ns < begin_ns + seconds * S + S {
            if (now_ns - begin_ns).is_multiple_of(EVERY_NS) && now_ns < begin_ns + seconds * S {
                writer.write(at(now_ns), &[7; 64]).unwrap();
            }
            let arrives =
                |random: &mut ChaCha8Rng| now_ns + VARIES_NS + random.random_range(0..=2 * VARIES_NS) - VARIES_NS;
            while let Ok((_, datagram)) = origin.router.poll(now_ns) {
                let arrives_ns = arrives(&mut random);
                if !random.random_bool(loss) {
                    there.put(arrives_ns, datagram);
                }
            }
            while let Some(datagram) = there.take(now_ns) {
                holder.take(now_ns, &datagram);
            }
            holder.pass(now_ns);
            while let Ok((_, request)) = holder.router.poll(now_ns) {
                back.put(arrives(&mut random), request);
            }
            while let Some(request) = back.take(now_ns) {
                origin.router.take(now_ns, HOLDER, &request);
            }
            while let Next::Record(record) = reader.try_next().unwrap() {
                let (sequence, stamp_ns) = (record.info().sequence, record.info().stamp.ns);
                assert!(last < Some(sequence), "{last:?}, then {sequence}");
                (last, worst_ns) = (Some(sequence), worst_ns.max(now_ns - stamp_ns));
            }
            now_ns += LOOK_NS;
        }
    });
    Outcome { written: writer.written(), holder, worst_ns, lines: lines.count() }
}

#[test]
fn poses_that_overtake_each_other_are_all_read_in_order() {
    let Outcome { holder, written, worst_ns, .. } = poses(60, 0.0);
    let lost = written - holder.records();
    assert!(lost * 100 <= written, "{lost} of {written} are lost, though the wire lost none");
    assert!(worst_ns <= 2 * VARIES_NS + 100 * MS, "and no pose waits for long: {} ms", worst_ns / MS);
    // Records of which two are open at most do lose some: so the wire is as bad as it should be.
    let two = poses_in(StreamShape { record_bytes: 6000, keep: 256, ..SHAPE }, 60, 0.0);
    let lost = two.written - two.holder.records();
    assert!(lost * 20 >= two.written, "{lost} of {}", two.written);
}

#[test]
fn missing_records_are_told_once_a_second_with_their_number() {
    let clean = poses(5, 0.0);
    let seconds = 5;
    let Outcome { holder, written, lines, .. } = poses(seconds, 0.4);
    let lost = written - holder.records();
    assert!(lost > 10 && (2..=seconds + 2).contains(&lines), "{lost} of {written} are lost, and {lines} lines say so");
    assert!(clean.lines <= 1, "{} lines of a wire that loses nothing", clean.lines);
}
