//! Two routers that seal, and a wire that keeps all datagrams and has any faults: an opened datagram was sealed by the
//! present incarnation of one for the present incarnation of the other, is unchanged, and opens once; and an
//! incarnation begins only by datagrams sent since the last one began.

use crate::frames::checked;
use crate::split::Bytes;
use rohrpost_routers::frame::{FrameHead, FrameKind, HEAD_BYTES, NodeIndex};
use rohrpost_routers::security::{
    HELLO_DATAGRAM_BYTES, Handshake, InstallationKey, KeyId, KeyRing, Opened, Opening, PeerSessions, Port,
    RouterIdentity, Sealing, TAG_BYTES,
};
use std::num::NonZeroU8;
use std::sync::Arc;

/// Steps of one program.
const STEPS_MAX: usize = 300;

pub(crate) fn run(data: &[u8]) {
    let mut bytes = Bytes(data);
    let mut world = World { routers: [0, 1].map(|own| Router::new(own, 1, 0)), wire: Vec::new(), step: 0 };
    while !bytes.is_empty() && world.step < STEPS_MAX {
        world.step += 1;
        world.step(&mut bytes);
    }
}

/// One incarnation of a router.
struct Router {
    own: NodeIndex,
    incarnation: u64,
    all: Arc<PeerSessions>,
    handshake: Handshake,
    sealing: [Sealing; Port::ALL.len()],
    opening: [Opening; Port::ALL.len()],
    next: [u64; Port::ALL.len()],
    /// The step at which the peer's last incarnation began: the challenge is no older.
    drawn: usize,
    /// Places on the wire of the datagrams that it has opened.
    opened: Vec<usize>,
}

impl Router {
    fn new(own: NodeIndex, life: u64, step: usize) -> Self {
        let incarnation = life << 8 | u64::from(own);
        let router = RouterIdentity { system: 1, own, nodes: 2, digest: 7, incarnation };
        let key = |id| InstallationKey::new(KeyId(NonZeroU8::MIN.saturating_add(id)), &[id; 32]);
        let all = PeerSessions::new(router, KeyRing::new(key(1), Some(key(0))));
        let mut seed = [0; 32];
        seed[..8].copy_from_slice(&incarnation.to_le_bytes());
        Self {
            own,
            incarnation,
            handshake: Handshake::new(&all, seed),
            sealing: Port::ALL.map(|port| Sealing::new(&all, port)),
            opening: Port::ALL.map(|port| Opening::new(&all, port)),
            all,
            next: [0; Port::ALL.len()],
            drawn: step,
            opened: Vec::new(),
        }
    }
}

/// A datagram on the wire, with its sender and receiver.
struct Sent {
    datagram: Vec<u8>,
    from: NodeIndex,
    port: Port,
    /// Incarnations of the sender, and of the receiver that it sealed to; 0 in a hello.
    lives: (u64, u64),
    text: Vec<u8>,
    step: usize,
}

struct World {
    routers: [Router; 2],
    wire: Vec<Sent>,
    step: usize,
}

impl World {
    fn step(&mut self, bytes: &mut Bytes<'_>) {
        match bytes.byte() % 8 {
            0 => self.ask(bytes.byte() % 2),
            1 | 2 => self.seal(bytes),
            3 => self.arrive(self.wire.len().wrapping_sub(1)),
            4 => self.arrive(bytes.half().into()),
            5 => {
                let own = bytes.byte() % 2;
                let life = (self.routers[usize::from(own)].incarnation >> 8) + 1;
                self.routers[usize::from(own)] = Router::new(own, life, self.step);
            }
            6 => self.alter(bytes),
            _ => {
                let forged = bytes.take(200).to_vec();
                [0, 1].into_iter().for_each(|to| self.strange(to, &forged));
            }
        }
    }

    fn ask(&mut self, own: NodeIndex) {
        let mut room = [0; HELLO_DATAGRAM_BYTES];
        let said = self.routers[usize::from(own)].all.ask(1 - own, &mut room);
        self.hello(own, &room[..said.unwrap_or_default()]);
    }

    fn hello(&mut self, from: NodeIndex, datagram: &[u8]) {
        let lives = (self.routers[usize::from(from)].incarnation, 0);
        self.wire.push(Sent {
            datagram: datagram.to_vec(),
            from,
            port: Port::Packages,
            lives,
            text: Vec::new(),
            step: self.step,
        });
    }

    fn seal(&mut self, bytes: &mut Bytes<'_>) {
        let (from, at) = (bytes.byte() % 2, usize::from(bytes.byte()) % Port::ALL.len());
        let (port, len) = (Port::ALL[at], usize::from(bytes.byte()));
        let router = &mut self.routers[usize::from(from)];
        let kind = match port {
            Port::Packages | Port::Rest => FrameKind::Packages,
            Port::Time => FrameKind::Sync,
            Port::Replicas => FrameKind::RecordPart,
        };
        let (incarnation, sequence) = (router.incarnation, router.next[at]);
        let head = FrameHead { kind, system: 1, from, to: 1 - from, digest: 7, incarnation, sequence };
        let text = vec![bytes.byte(); len];
        let mut datagram = [&[0; HEAD_BYTES], &text[..], &[0; TAG_BYTES]].concat();
        // Gaps, too.
        router.next[at] += 1 + u64::from(bytes.byte() / 64) * 400;
        let known = router.all.incarnation(1 - from);
        assert_eq!(router.sealing[at].seal(&head, &mut datagram).is_ok(), known.is_some());
        if let Some(to) = known {
            let lives = (router.incarnation, to);
            self.wire.push(Sent { datagram, from, port, lives, text, step: self.step });
        }
    }

    /// A datagram on the wire arrives, perhaps a second time.
    fn arrive(&mut self, place: usize) {
        let Some(sent) = self.wire.get(place) else { return };
        let router = &mut self.routers[usize::from(1 - sent.from)];
        let known = router.all.incarnation(sent.from);
        let mut datagram = sent.datagram.clone();
        let mut room = [0; HELLO_DATAGRAM_BYTES];
        let answer = match router.opening[sent.port as usize].open(&mut datagram) {
            Ok(Opened::Frame(head, text)) => {
                assert_eq!(sent.lives.0, head.incarnation, "of this incarnation");
                // Time is sealed to a node, so any incarnation of it opens it.
                assert!(sent.port == Port::Time || sent.lives.1 == router.incarnation, "to this incarnation");
                assert_eq!((known, text), (Some(head.incarnation), &sent.text[..]));
                assert!(!router.opened.contains(&place), "it was opened before");
                router.opened.push(place);
                None
            }
            Ok(Opened::Hello(head, hello)) => {
                let reply = router.handshake.receive(0, &head, &hello, &mut room);
                router.handshake.begin();
                if reply.begins {
                    assert!(sent.step >= router.drawn, "an incarnation began by what was said before");
                    router.drawn = self.step;
                }
                reply.reply_bytes
            }
            Err(_) => None,
        };
        let own = router.own;
        if let Some(bytes) = answer {
            self.hello(own, &room[..bytes]);
        }
    }

    fn alter(&mut self, bytes: &mut Bytes<'_>) {
        let Some(sent) = self.wire.get(usize::from(bytes.half())) else { return };
        let (mut datagram, to) = (sent.datagram.clone(), 1 - sent.from);
        let (at, change) = (usize::from(bytes.half()) % datagram.len().max(1), bytes.byte().max(1));
        // The check alone is not part of the signed bytes.
        if (HEAD_BYTES - 4..HEAD_BYTES).contains(&at) {
            return;
        }
        if let Some(byte) = datagram.get_mut(at) {
            *byte ^= change;
            self.strange(to, &datagram);
        }
    }

    /// A datagram changed after sealing opens nowhere.
    fn strange(&mut self, to: NodeIndex, datagram: &[u8]) {
        let Some((head, rest)) = datagram.split_first_chunk::<HEAD_BYTES>() else { return };
        let datagram = [&checked(head, rest)[..], rest].concat();
        if self.wire.iter().any(|sent| sent.datagram == datagram) {
            return;
        }
        for opening in &mut self.routers[usize::from(to)].opening {
            assert!(opening.open(&mut datagram.clone()).is_err());
        }
    }
}
