//! Answers that take long, and records that come in pieces: what is asked for still comes.

use super::asked::{Pair, pictures, poses};
use super::*;

/// Of a lost record of one part the answer comes after it was given up, the first time.
#[test]
fn an_answer_that_takes_longer_than_was_waited_is_learned() {
    for seed in 0..4 {
        let mut pair = Pair::new(poses(), seed, [0.1, 0.0]);
        pair.slow_down(25 * MS);
        for _ in 0..200 {
            pair.write();
            pair.run(80 * MS);
        }
        pair.settle();
        let counts = pair.holder.counts();
        let (completed, incomplete) = (counts.completed.get(), counts.lost.of(ReplicaLoss::Incomplete));
        assert!(completed > 10 && completed > incomplete, "seed {seed}: {completed} of {completed} + {incomplete}");
    }
}

/// With time slots parts come a few in each cycle. One is lost, and no request gets through before the last has come.
#[test]
fn a_record_that_comes_in_many_slots_is_not_given_up_meanwhile() {
    let mut both = Both::new(pictures());
    both.carry();
    let Both { mut origin, mut holder, mut writer, mut reader, mut now_ns } = both;
    let bytes: Vec<u8> = (0..60_000).map(|at| (at / 7) as u8).collect();
    writer.write(at(now_ns), &bytes).unwrap();
    let parts = origin.leave(&mut now_ns);
    let mut asked = 0;
    for (slot, parts) in parts.chunks(2).enumerate() {
        let came: Vec<_> = parts.iter().enumerate().filter(|(at, _)| (slot, *at) != (2, 1)).collect();
        came.iter().for_each(|(_, part)| holder.take(now_ns, part));
        for _ in 0..50 {
            now_ns += MS;
            holder.pass(now_ns);
            while holder.router.poll(now_ns).is_ok() {
                asked += 1;
            }
        }
    }
    assert!(asked < 16, "{asked} requests while parts still came");
    for _ in 0..100 {
        now_ns += MS;
        holder.pass(now_ns);
        while let Ok((_, request)) = holder.router.poll(now_ns) {
            origin.router.take(now_ns, HOLDER, &request);
        }
        holder.take_all(now_ns, &origin.leave(&mut now_ns));
    }
    let Next::Record(record) = reader.try_next().unwrap() else { panic!("it was given up") };
    assert_eq!(record.body(), bytes);
    assert_eq!(holder.counts().completed.get(), 1);
}
