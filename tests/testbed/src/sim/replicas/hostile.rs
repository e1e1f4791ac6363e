//! Parts and requests that nobody should send, from a node of the installation.

use super::super::plan::{SYSTEM, incarnation};
use super::super::seals::checked;
use super::super::station::{Arrived, Origin};
use super::super::world::{Event, World};
use super::super::{clock::Now, packages::digest, spans::MS};
use super::leaving::PORT;
use rohrpost_routers::frame::{DescriptionPart, FrameHead, FrameKind, PART_REQUEST_BYTES_MAX, PartRequest, RecordPart};
use rohrpost_routers::security::Port as RouterPort;

impl World<'_> {
    /// A node sends another one what it should not.
    pub(in crate::sim) fn send_hostile(&mut self, from: usize, to: usize, count: u64) {
        self.oracle.saw("hostile parts");
        let life = self.stations[from].router.as_ref().map_or(0, |router| router.life);
        // Behind all that it has sent there by this port.
        let first = RouterPort::Replicas.first_sequence() + self.now_ns / 1_000_000;
        for number in 0..count {
            let (kind, content) = self.hostile_content();
            let head = FrameHead {
                kind,
                system: SYSTEM,
                from: from as u8,
                to: to as u8,
                digest: digest(self.stations[to].edition),
                incarnation: incarnation(self.plan.seed, life),
                sequence: first + number,
            };
            let bytes = checked(&[&head.to_bytes(&[&content])[..], &content].concat());
            let arrived =
                Arrived { port: PORT, source: Some(from), bytes, stamp: Now::default(), origin: Origin::Made };
            let at_ns = self.now_ns + self.chance.below(50 * MS);
            self.at(at_ns, Event::Arrive { to, arrived });
        }
    }

    fn hostile_content(&mut self) -> (FrameKind, Vec<u8>) {
        let places = self.plan.streams.len() as u64 + 1;
        let chance = &mut self.chance;
        let (place, generation) = (chance.below(places) as u16, chance.below(3) as u16);
        let sequence = chance.pick(&[0, 1, 7, u64::MAX]).min(chance.bits());
        let mut noise = vec![0; chance.below(400) as usize];
        chance.fill(&mut noise);
        let any = |chance: &mut super::super::chance::Chance, bound: u64| chance.below(bound) as u32;
        match chance.below(3) {
            0 => {
                let offset = chance.pick(&[0, 0, 1, 1376]);
                let len = offset + noise.len() as u32 + any(chance, 2) * any(chance, 5000);
                let part = RecordPart {
                    place,
                    generation,
                    description: any(chance, 1 << 32),
                    incarnation: any(chance, 40),
                    len,
                    offset,
                    sequence,
                    epoch: chance.below(3),
                    stamp_ns: chance.bits(),
                    written_ns: 0,
                    error_ns: 0,
                    step: any(chance, 3),
                    sampled: any(chance, 5),
                    bytes: &noise,
                };
                (FrameKind::RecordPart, [&part.head_bytes()[..], &noise].concat())
            }
            1 => {
                let (check, written) = (any(chance, 1 << 32), chance.below(1000));
                let len = noise.len() as u32 + any(chance, 100);
                let part = DescriptionPart { place, generation, check, len, offset: 0, written, bytes: &noise };
                (FrameKind::Description, [&part.head_bytes()[..], &noise].concat())
            }
            _ => {
                let mut parts = [0; 16];
                parts.iter_mut().for_each(|word| *word = chance.bits());
                let (first, router) = (any(chance, 1000), chance.bits());
                let request = PartRequest { place, generation, first, router, sequence, parts };
                let mut bytes = [0; PART_REQUEST_BYTES_MAX];
                let len = request.write(&mut bytes);
                (FrameKind::PartRequest, bytes[..len].to_vec())
            }
        }
    }
}
