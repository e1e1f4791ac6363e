//! Both halves where datagrams are sealed, and an attacker that has recorded all of them: what it alters, mixes, brings
//! again or brings to another port is not taken, and disturbs nothing.

use super::damaged::{alter, attempts, one_of};
use super::*;
use crate::frame::{FrameKind, HEAD_BYTES, write_check};
use crate::harness::Log;
use crate::inbound::Envelope;
use crate::outbound::OutboundStep;
use crate::security::{
    Gate, HELLO_DATAGRAM_BYTES, Handshake, InstallationKey, KEY_BYTES, KeyId, KeyRing, Opened, Opening, PeerSessions,
    Port, Rejection, RouterIdentity, Sealing, TAG_BYTES,
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rohrpost_network::Security;
use std::num::NonZeroU8;

/// Between two records.
const ATTEMPTS: usize = 1000;

/// One incarnation of a router, as far as seals depend on it.
struct End {
    settings: Settings,
    stats: Arc<Stats>,
    all: Arc<PeerSessions>,
}

impl End {
    fn new(own: NodeIndex, incarnation: u64) -> Self {
        let mut settings = Settings { incarnation, ..settings(own, 3) };
        settings.network.security = Security::Keys;
        settings.network.datagram_bytes_max -= TAG_BYTES;
        let keys = KeyRing::new(InstallationKey::new(KeyId(NonZeroU8::MIN), &[7; KEY_BYTES]), None);
        let all = PeerSessions::new(RouterIdentity::of(&settings), keys);
        Self { stats: Stats::new(&settings, START), all, settings }
    }

    /// Each shows the other that it lives.
    fn meet(&self, other: &Self) {
        let hears =
            |end: &Self| (Handshake::new(&end.all, [end.settings.own; 32]), Opening::new(&end.all, Port::Packages));
        let (mut ends, mut hello) = ([other, self].map(hears), [0; HELLO_DATAGRAM_BYTES]);
        self.all.ask(other.settings.own, &mut hello).unwrap();
        for listens in [0, 1, 0] {
            let (handshake, opening) = &mut ends[listens];
            let Ok(Opened::Hello(head, asked)) = opening.open(&mut hello) else { panic!("no hello") };
            let mut reply = [0; HELLO_DATAGRAM_BYTES];
            handshake.receive(0, &head, &asked, &mut reply);
            handshake.begin();
            hello = reply;
        }
    }
}

/// The node that writes.
struct SealedOrigin {
    end: End,
    ground: Ground,
    outbound: Outbound,
    sender: ReplicaSender,
    sealing: Sealing,
}

impl SealedOrigin {
    fn new(end: End, replicas: &[ReplicaSettings]) -> Self {
        let ground = Ground::new();
        ground.join().describe_replicas(CAMERA, &words(1)).unwrap();
        let mut sender = ReplicaSender::new(&end.settings, replicas);
        sender.look(&ground.join(), &first_byte);
        let outbound = Outbound::new(&end.settings, end.stats.clone()).only_to(1 << HOLDER).sealed(end.all.clone());
        let sealing = Sealing::new(&end.all, Port::Replicas);
        Self { outbound, sender, sealing, ground, end }
    }

    /// All that leaves until nothing waits, sealed.
    fn leave(&mut self, now_ns: &mut u64) -> Vec<Vec<u8>> {
        let (mut all, mut log) = (Vec::new(), Log::default());
        let room = self.end.settings.network.datagram_bytes_max + TAG_BYTES;
        loop {
            self.end.stats.peer(HOLDER).link.heard_ns.set(*now_ns);
            let mut datagram = vec![0; room];
            let bytes = match self.outbound.poll(*now_ns, &mut datagram, &mut log) {
                OutboundStep::Send { to, bytes } => {
                    assert_eq!(to, HOLDER, "it sends to no other node");
                    bytes
                }
                OutboundStep::Wait { .. } => match self.sender.poll(*now_ns, time, &mut self.outbound, &mut datagram) {
                    ReplicaStep::Send { bytes, .. } => bytes,
                    ReplicaStep::Wait { .. } => {
                        *now_ns += MS;
                        continue;
                    }
                    ReplicaStep::Idle { .. } => return all,
                },
            };
            datagram.truncate(bytes + TAG_BYTES);
            self.sealing.close(&mut datagram).unwrap();
            all.push(datagram);
        }
    }
}

/// The node that has the replica.
struct SealedHolder {
    end: End,
    ground: Ground,
    inbound: Inbound,
    receiver: ReplicaReceiver,
    gate: Gate,
}

impl SealedHolder {
    fn new(end: End, replicas: &[ReplicaSettings], ground: Ground) -> Self {
        let receiver = ReplicaReceiver::new(&end.settings, replicas, ground.join(), Arc::new(first_byte));
        let inbound = Inbound::new(&end.settings, end.stats.clone());
        Self { gate: Gate::without_hellos(&end.all, Port::Replicas), inbound, receiver, ground, end }
    }

    fn take(&mut self, now_ns: u64, datagram: &[u8]) {
        let came = Envelope { source: address(ORIGIN), arrived_ns: now_ns, bytes: datagram.len() };
        let mut parts = Parts(&mut self.receiver, now_ns);
        let said = self.gate.take(now_ns, &came, &mut datagram.to_vec(), &mut self.inbound, &mut parts, &mut []);
        assert_eq!(said, None);
    }

    /// Datagrams that were opened, records that came whole, and parts that were refused for their content.
    fn taken(&self) -> [u64; 3] {
        let counts = &self.receiver.counts()[0];
        let refused = ReplicaLoss::ALL.iter().map(|cause| counts.lost.of(*cause)).sum();
        [self.end.stats.peer(ORIGIN).received.datagrams.get(), counts.records.get(), refused]
    }

    fn rejected(&self, why: Rejection) -> u64 {
        self.end.all.rejections(Port::Replicas).of(Some(ORIGIN), why)
    }
}

/// Two that know each other, and the origin's writer.
fn met(replicas: &[ReplicaSettings]) -> (SealedOrigin, SealedHolder, StreamWriter) {
    let (origin, holder) = (End::new(ORIGIN, 100), End::new(HOLDER, 200));
    origin.meet(&holder);
    let origin = SealedOrigin::new(origin, replicas);
    let writer = origin.ground.join().stream_writer(ID, SHAPE).unwrap();
    (origin, SealedHolder::new(holder, replicas, Ground::new()), writer)
}

struct Attacker {
    chance: ChaCha8Rng,
    /// All that came to the port of replicas.
    recorded: Vec<Vec<u8>>,
    /// What the origin sealed for other ports, and was never delivered.
    elsewhere: Vec<Vec<u8>>,
}

impl Attacker {
    fn datagram(&mut self) -> Vec<u8> {
        let Self { chance, recorded, elsewhere } = self;
        let mut datagram = one_of(chance, recorded).clone();
        match chance.random_range(0..8) {
            0 => return datagram,
            1 => return one_of(chance, elsewhere).clone(),
            // Another incarnation, or another sequence, by which nothing came before.
            2 => {
                let at = if chance.random_bool(0.5) { 16 } else { 24 };
                datagram[at..at + 8].copy_from_slice(&(chance.random::<u64>() >> 16).to_le_bytes());
            }
            _ => {
                let of = if chance.random_bool(0.5) { recorded } else { elsewhere };
                let other = one_of(chance, of);
                alter(chance, &mut datagram, other);
            }
        }
        if datagram.len() >= HEAD_BYTES && chance.random_bool(0.8) {
            write_check(&mut datagram);
        }
        datagram
    }
}

#[test]
fn of_what_was_recorded_and_altered_no_part_is_taken() {
    let attempts = attempts();
    let replicas = [image()];
    let (mut origin, mut holder, mut writer) = met(&replicas);
    let (mut now_ns, mut reader) = (START, holder.ground.join().stream_reader(ID).unwrap());
    let chance = ChaCha8Rng::seed_from_u64(22);
    let mut attacker = Attacker { chance, recorded: Vec::new(), elsewhere: Vec::new() };
    let mut others = [Port::Packages, Port::Time, Port::Rest].map(|port| Sealing::new(&origin.end.all, port));
    for round in 0..(attempts / ATTEMPTS) as u64 {
        let len = attacker.chance.random_range(0..=SHAPE.record_bytes as usize);
        let body: Vec<u8> = (0..len).map(|at| at as u8 ^ round as u8).collect();
        writer.write(at(100 + round), &body).unwrap();
        let datagrams = origin.leave(&mut now_ns);
        let Settings { system, digest, incarnation, .. } = origin.end.settings;
        for (at, sealing) in others.iter_mut().enumerate() {
            let kind = if at == 1 { FrameKind::Sync } else { FrameKind::RecordPart };
            let head = FrameHead { kind, system, from: ORIGIN, to: HOLDER, digest, incarnation, sequence: round };
            let mut datagram = datagrams[0].clone();
            sealing.seal(&head, &mut datagram).unwrap();
            attacker.elsewhere.push(datagram);
        }
        datagrams.iter().for_each(|datagram| holder.take(now_ns, datagram));
        attacker.recorded.extend(datagrams);
        let Next::Record(record) = reader.try_next().unwrap() else { panic!("record {round} is not there") };
        assert_eq!((record.info().sequence, record.body()), (round, &body[..]));
        drop(record);
        let before = holder.taken();
        for attempt in 0..ATTEMPTS {
            let datagram = attacker.datagram();
            holder.take(now_ns, &datagram);
            assert_eq!(holder.taken(), before, "round {round}, attempt {attempt}: {datagram:?} was taken");
        }
        assert!(matches!(reader.try_next().unwrap(), Next::Nothing));
    }
    let seen = [Rejection::Replay, Rejection::Forged, Rejection::OtherIncarnation].map(|why| holder.rejected(why));
    assert!(seen.iter().all(|count| *count > attempts as u64 / 1000), "{seen:?}");
    assert_eq!((reader.accounts().1, holder.taken()[2]), (0, 0), "nothing is lost, and no part was refused");
}

#[test]
fn after_an_end_has_begun_anew_nothing_from_before_is_taken_and_the_newest_arrives() {
    let replicas = [image()];
    let (mut origin, mut holder, mut writer) = met(&replicas);
    let mut now_ns = START;
    let mut recorded = Vec::new();
    for (incarnation, sequence) in (201..).zip(0..5) {
        writer.write(at(100 + sequence), &[sequence as u8; 4000]).unwrap();
        let datagrams = origin.leave(&mut now_ns);
        datagrams.iter().for_each(|datagram| holder.take(now_ns, datagram));
        recorded.extend(datagrams);
        // The replica's node, again.
        holder = SealedHolder::new(End::new(HOLDER, incarnation), &replicas, holder.ground);
        origin.end.meet(&holder.end);
        origin.end.stats.peer(HOLDER).link.incarnation.set(incarnation);
        recorded.iter().for_each(|datagram| holder.take(now_ns, datagram));
        assert_eq!(holder.taken(), [0; 3]);
        assert_eq!(holder.rejected(Rejection::Forged), recorded.len() as u64);
        let there = holder.ground.node.inspect_stream(ID).unwrap().unwrap();
        assert_eq!(there.newest.map(|newest| newest.sequence), Some(sequence));
    }
    writer.write(at(200), b"the newest").unwrap();
    let mut reader = holder.ground.join().stream_reader(ID).unwrap();
    origin.leave(&mut now_ns).iter().for_each(|datagram| holder.take(now_ns, datagram));
    let newest = read(&mut reader).0.pop();
    assert_eq!(newest, Some((5, b"the newest".len())));
}
