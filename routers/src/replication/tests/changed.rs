//! Only what has changed is sent: what is left out has the bytes of what is there.

use super::super::destination::UNCHANGED_EVERY_NS;
use super::requests::{ask, request};
use super::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn changes(sampling: Sampling) -> ReplicaSettings {
    ReplicaSettings { sampling, changed: true, ..image() }
}

/// Sequences that arrive when each of these bodies is written a millisecond after the other, and how many are left out.
fn arrive(replica: ReplicaSettings, bodies: &[&[u8]]) -> (Vec<u64>, u64) {
    let mut both = Both::new(replica);
    for (step, body) in (0..).zip(bodies) {
        both.now_ns = START + step * MS;
        both.send(100 + step, body);
    }
    (sequences(&mut both.reader), both.origin.lost(ReplicaLoss::Sampled))
}

#[test]
fn a_record_like_the_last_one_sent_is_left_out() {
    let (long, other) = (vec![7; 5000], [&[7; 4999][..], &[8]].concat());
    let [a, b, none, one, two]: [&[u8]; 5] = [b"a", b"b", b"", b"\0", b"\0\0"];
    let (long, other) = (&long[..], &other[..]);
    for (sampling, bodies, arrives, why) in [
        (Sampling::Each, vec![a, a, b, b, b, a], vec![0, 2, 5], "one that was there before counts as a change"),
        (Sampling::Each, vec![a, b, a, b], vec![0, 1, 2, 3], "all have changed"),
        (Sampling::Each, vec![none, none, one, two], vec![0, 2, 3], "the length is a change"),
        (Sampling::Each, vec![long, long, other, long], vec![0, 2, 3], "so is the last of many bytes"),
        (Sampling::Every(2), vec![a, b, a, b, b, a, a], vec![0, 4, 6], "what is sent counts, not what is written"),
        (Sampling::Rate(500.0), vec![a, a, a, b, b, b, a], vec![0, 3, 6], "what is left out takes no turn"),
    ] {
        let left_out = (bodies.len() - arrives.len()) as u64;
        assert_eq!(arrive(changes(sampling), &bodies), (arrives, left_out), "{sampling}: {why}");
    }
    assert_eq!(arrive(image(), &[a, a, a]), (vec![0, 1, 2], 0), "unless the file says so, each is sent");
}

#[test]
fn what_may_not_have_arrived_goes_again() {
    let mut both = Both::new(changes(Sampling::Each));
    let write = |both: &mut Both| {
        both.now_ns += 1;
        // What it has already is not a record once more.
        let came = |both: &Both| both.holder.records() + both.holder.lost(ReplicaLoss::Duplicate);
        let before = came(both);
        both.send(both.now_ns, b"a map");
        came(both) - before
    };
    let arrives = |both: &mut Both, records: [u64; 3], why: &str| {
        assert_eq!([(); 3].map(|()| write(both)), records, "{why}");
    };
    arrives(&mut both, [1, 0, 0], "it is there then");
    both.now_ns += UNCHANGED_EVERY_NS / 2;
    arrives(&mut both, [0, 0, 0], "nothing has happened");
    both.now_ns += UNCHANGED_EVERY_NS;
    arrives(&mut both, [1, 0, 0], "it is long ago");
    both.origin.router.stats.peer(HOLDER).link.incarnation.set(5);
    arrives(&mut both, [1, 0, 0], "its router began anew");
    both.now_ns += 2000 * MS;
    let Router { sender, outbound, .. } = &mut both.origin.router;
    let waits = sender.poll(both.now_ns, time, outbound, &mut [0; 1472]);
    assert!(matches!(waits, ReplicaStep::Idle { .. }), "{waits:?}");
    arrives(&mut both, [1, 0, 0], "it was silent");
    both.origin.ground.join().describe_replicas(CAMERA, &words(2)).unwrap();
    both.origin.look();
    arrives(&mut both, [1, 0, 0], "there is another interface, so its ring is made anew");
}

#[test]
fn what_was_overwritten_before_all_of_it_came_goes_again() {
    let mut origin = Origin::new(&[changes(Sampling::Each)]);
    let (mut now_ns, mut writer) = (START, origin.writer(ID, SHAPE));
    origin.leave(&mut now_ns);
    let mut write = |records: u64| {
        for _ in 0..records {
            writer.write(at(100), &[7; 6000]).unwrap();
        }
    };
    let sequences = |left: Vec<Vec<u8>>| left.iter().map(|datagram| datagram[56]).collect::<Vec<_>>();
    write(1);
    assert!(origin.router.poll(now_ns + MS).is_ok(), "its first part");
    // The ring turns.
    write(20);
    assert_eq!(sequences(origin.leave(&mut now_ns)), [20; 5], "nobody else has what it says");
    write(20);
    assert_eq!(sequences(origin.leave(&mut now_ns)), [0; 0]);
    assert!(ask(&mut origin, HOLDER, request(20, &[1])));
    assert_eq!(sequences(origin.leave(&mut now_ns)), [0; 0]);
    write(1);
    assert_eq!(sequences(origin.leave(&mut now_ns)), [41; 5]);
    let causes = [ReplicaLoss::Overwritten, ReplicaLoss::Passed, ReplicaLoss::Sampled];
    assert_eq!(causes.map(|cause| origin.lost(cause)), [1, 39, 1], "of twenty at once the newest is looked at");
}

/// Whatever is left out for whichever node, each has the bytes of the newest.
#[test]
fn each_node_has_what_the_newest_says() {
    for seed in 0..20 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let sampling = if rng.random_bool(0.5) { Sampling::Each } else { Sampling::Rate(300.0) };
        let replicas = [changes(sampling)];
        let (mut origin, mut holder) = (Origin::new(&replicas), Holder::new(&replicas));
        let (mut writer, mut incarnation, mut body) = (origin.writer(ID, SHAPE), 200, vec![0; 16]);
        let (mut now_ns, mut written) = (START, 0);
        let loss = if seed % 2 == 0 { 0.0 } else { 0.05 };
        for step in 0..400 {
            now_ns += MS;
            if rng.random_bool(0.2) {
                body = vec![rng.random_range(0..3); rng.random_range(1..4) * 1400];
            }
            writer.write(at(now_ns), &body).unwrap();
            written += 1;
            if rng.random_bool(0.02) {
                incarnation += 1;
                holder = Holder::on(holder.ground, incarnation, &replicas);
                origin.router.stats.peer(HOLDER).link.incarnation.set(incarnation);
            }
            let left = origin.leave(&mut now_ns);
            left.iter().filter(|_| !rng.random_bool(loss)).for_each(|datagram| holder.take(now_ns, datagram));
            if loss == 0.0 && sampling == Sampling::Each {
                assert_eq!(there(&holder), body, "seed {seed}, step {step}");
            }
        }
        // What was lost goes again; of what is due by its rate the next one does.
        for pause_ns in [UNCHANGED_EVERY_NS, 10 * MS] {
            now_ns += pause_ns;
            writer.write(at(now_ns), &body).unwrap();
            written += 1;
            holder.take_all(now_ns, &origin.leave(&mut now_ns));
            // What is asked for in vain is given up.
            now_ns += 1000 * MS;
            holder.pass(now_ns);
        }
        assert_eq!(there(&holder), body, "seed {seed}");
        let counts = &origin.router.sender.counts()[0];
        let sampled = counts.lost.of(ReplicaLoss::Sampled);
        assert!(sampled > 100 && counts.records.get() > 20, "seed {seed}: {sampled}, {}", counts.records.get());
        assert!(sampled + counts.records.get() >= written, "seed {seed}: each is sent or counted");
    }
}

/// The newest record of the replica.
fn there(holder: &Holder) -> Vec<u8> {
    let mut reader = holder.reader();
    let newest = reader.newest().unwrap();
    newest.map(|record| record.body().to_vec()).unwrap_or_default()
}
