//! Seeds of a wire that loses, doubles, delays and damages, both ways, and of ends that are started anew.
//!
//! Whatever happens: a record that is read is whole and as it was written, sequences do not go back within one life of
//! the stream, and lives do not go back. When all is well again, the newest record arrives.

use super::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;

/// A record of a life of the stream: its content says what it is.
fn body(life: u64, sequence: u64) -> Vec<u8> {
    let mix = (life << 32 | sequence).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let len = 16 + (mix >> 40) as usize % 5900;
    let mut body: Vec<u8> = (0..len).map(|at| (mix >> (at % 7 * 8)) as u8 ^ at as u8).collect();
    body[..8].copy_from_slice(&life.to_le_bytes());
    body[8..16].copy_from_slice(&sequence.to_le_bytes());
    body
}

/// Puts a datagram on a wire.
fn put(rng: &mut ChaCha8Rng, wire: &mut VecDeque<Vec<u8>>, mut datagram: Vec<u8>, harm: bool) {
    if harm && rng.random_bool(0.03) {
        return;
    }
    if harm && rng.random_bool(0.03) {
        wire.push_back(datagram.clone());
    }
    if harm && rng.random_bool(0.01) {
        let [one, other] = [0, 0].map(|_| rng.random_range(0..datagram.len()));
        datagram.swap(one, other);
    }
    let late = if harm && rng.random_bool(0.1) { rng.random_range(0..8) } else { 0 };
    let place = wire.len().saturating_sub(late);
    wire.insert(place, datagram);
}

struct World {
    rng: ChaCha8Rng,
    now_ns: u64,
    replicas: [ReplicaSettings; 1],
    origin: Origin,
    holder: Holder,
    writer: Option<StreamWriter>,
    reader: StreamReader,
    wire: VecDeque<Vec<u8>>,
    /// Requests on their way.
    back: VecDeque<Vec<u8>>,
    incarnation: u64,
    life: u64,
    /// Life and sequence of what was read last.
    last: Option<(u64, u64)>,
    read: u64,
}

impl World {
    fn new(seed: u64) -> Self {
        let replicas = [image()];
        let Both { origin, holder, writer, reader, now_ns } = Both::new(image());
        let (rng, writer) = (ChaCha8Rng::seed_from_u64(seed), Some(writer));
        let (wire, back) = (VecDeque::new(), VecDeque::new());
        let (incarnation, life, last, read) = (200, 1, None, 0);
        Self { rng, now_ns, replicas, origin, holder, writer, reader, wire, back, incarnation, life, last, read }
    }

    fn write(&mut self) {
        let Some(writer) = &mut self.writer else { return };
        let (sequence, stamp) = (writer.written(), at(self.now_ns));
        writer.write(stamp, &body(self.life, sequence)).unwrap();
    }

    /// Lets so many datagrams leave; `harm`: the wire is bad.
    fn send(&mut self, most: usize, harm: bool) {
        for _ in 0..most {
            let Ok((_, datagram)) = self.origin.router.poll(self.now_ns) else { return };
            put(&mut self.rng, &mut self.wire, datagram, harm);
        }
    }

    /// Lets so many datagrams arrive, and all requests.
    fn deliver(&mut self, most: usize, harm: bool) {
        for _ in 0..most.min(self.wire.len()) {
            let Some(datagram) = self.wire.pop_front() else { return };
            self.holder.take(self.now_ns, &datagram);
        }
        self.holder.pass(self.now_ns);
        while let Ok((to, datagram)) = self.holder.router.poll(self.now_ns) {
            assert_eq!(to, ORIGIN);
            put(&mut self.rng, &mut self.back, datagram, harm);
        }
        while let Some(datagram) = self.back.pop_front() {
            self.origin.router.take(self.now_ns, HOLDER, &datagram);
        }
    }

    fn check(&mut self) {
        loop {
            match self.reader.try_next().unwrap() {
                Next::Record(record) => {
                    let life = u64::from_le_bytes(*record.body().first_chunk().unwrap());
                    let sequence = record.info().sequence;
                    assert_eq!(record.body(), body(life, sequence), "record {sequence} of life {life}");
                    assert!(self.last < Some((life, sequence)), "{:?}, then {life}, {sequence}", self.last);
                    self.last = Some((life, sequence));
                    self.read += 1;
                }
                Next::Lost(_) => {}
                Next::Nothing => return,
            }
        }
    }

    fn happen(&mut self) {
        match self.rng.random_range(0..1000) {
            0..6 => {
                // A writer, with another incarnation.
                self.writer = None;
                self.writer = Some(self.origin.writer(ID, SHAPE));
            }
            6..10 => self.begin_holder(),
            10..14 => self.begin_origin(),
            14..16 => {
                // The stream is made anew.
                self.writer = None;
                assert!(self.origin.ground.node.remove_orphan_stream(ID).unwrap());
                self.life += 1;
                self.writer = Some(self.origin.writer(ID, SHAPE));
            }
            16..40 => self.origin.look(),
            _ => {}
        }
    }

    /// The router of the replica's node is started anew.
    fn begin_holder(&mut self) {
        let spare = Holder::new(&self.replicas);
        let old = std::mem::replace(&mut self.holder, spare);
        let Holder { ground, router } = old;
        drop(router);
        self.incarnation += 1;
        self.holder = Holder::on(ground, self.incarnation, &self.replicas);
        self.origin.router.stats.peer(HOLDER).link.incarnation.set(self.incarnation);
    }

    /// That of the origin's node.
    fn begin_origin(&mut self) {
        let spare = Origin::new(&self.replicas);
        let old = std::mem::replace(&mut self.origin, spare);
        let Origin { ground, .. } = old;
        self.incarnation += 1;
        self.origin = Origin::on(ground, self.incarnation, &self.replicas);
        self.origin.router.stats.peer(HOLDER).link.incarnation.set(self.incarnation);
        // What the router before has sent is through.
        self.wire.clear();
    }
}

#[test]
fn what_is_read_is_whole_and_sequences_do_not_go_back() {
    let (mut read, mut whole, mut incomplete, mut completed) = (0, 0, 0, 0);
    for seed in 0..30 {
        let mut world = World::new(seed);
        for _ in 0..1500 {
            world.now_ns += MS;
            if world.rng.random_bool(0.4) {
                world.write();
            }
            let (out, inn) = (world.rng.random_range(0..5), world.rng.random_range(0..6));
            world.send(out, true);
            world.deliver(inn, true);
            world.check();
            world.happen();
            incomplete = incomplete.max(world.holder.lost(ReplicaLoss::Incomplete));
        }
        // All is well again: descriptions come each second.
        world.origin.look();
        for _ in 0..2500 {
            world.now_ns += MS;
            world.send(50, false);
            world.deliver(usize::MAX, false);
            world.check();
        }
        world.write();
        for _ in 0..100 {
            world.now_ns += MS;
            world.send(50, false);
            world.deliver(usize::MAX, false);
        }
        world.check();
        let newest = (world.life, world.writer.as_ref().unwrap().written() - 1);
        assert_eq!(world.holder.lost(ReplicaLoss::Unwritable), 0, "seed {seed}");
        let lost = ReplicaLoss::ALL.map(|cause| (cause, world.holder.lost(cause), world.origin.lost(cause)));
        assert_eq!(world.last, Some(newest), "seed {seed}: the newest did not arrive; {lost:?}, now {}", world.now_ns);
        read += world.read;
        whole = whole.max(world.holder.records());
        completed += world.holder.counts().completed.get();
    }
    let is_all_seen = read > 3000 && incomplete > 0 && whole > 0 && completed > 0;
    assert!(is_all_seen, "{read} read, {incomplete} incomplete, {whole} whole, {completed} completed by asking");
}
