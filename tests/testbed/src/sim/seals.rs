//! Sealed datagrams in a simulated network: what the layers seal with, and what attackers do without the key.

use super::chance::Chance;
use rohrpost_routers::frame::{self, FrameHead};
use rohrpost_routers::security::{
    Gate, InstallationKey, KEY_BYTES, KeyId, KeyRing, PeerSessions, Port, Rejection, RouterIdentity, Sealing, TAG_BYTES,
};
use rohrpost_routers::settings::Settings;
use std::num::NonZeroU8;
use std::rc::Rc;
use std::sync::Arc;

/// Of all routers.
const KEY: [u8; KEY_BYTES] = [0x5a; KEY_BYTES];

/// The peer sessions of an incarnation of a router; none yet.
pub(super) fn peer_sessions(settings: &Settings) -> Arc<PeerSessions> {
    PeerSessions::new(RouterIdentity::of(settings), keys())
}

/// The key that all have.
pub(super) fn keys() -> KeyRing {
    KeyRing::new(InstallationKey::new(KeyId(NonZeroU8::MIN), &KEY), None)
}

/// What the layer of packages has.
pub(super) struct PackageSeals {
    pub(super) sealing: Sealing,
    pub(super) all: Arc<PeerSessions>,
}

impl PackageSeals {
    pub(super) fn new(all: &Arc<PeerSessions>) -> Self {
        Self { sealing: Sealing::new(all, Port::Packages), all: all.clone() }
    }

    /// What opens datagrams, of an incarnation that nobody can guess.
    pub(super) fn gate(&self, incarnation: u64) -> Gate {
        let mut seed = [0; 32];
        seed[..8].copy_from_slice(&incarnation.to_le_bytes());
        Gate::new(&self.all, seed)
    }

    /// Whether something can be sealed to a node.
    pub(super) fn knows(&self, node: u8) -> bool {
        self.all.reached() & 1 << node != 0
    }

    /// Datagrams that were not taken for that reason.
    pub(super) fn rejected(&self, peer: Option<u8>, why: Rejection) -> u64 {
        self.all.rejections(Port::Packages).of(peer, why)
    }
}

/// The same datagram, sealed; none if nobody is known there.
pub(super) fn sealed(sealing: &mut Sealing, datagram: &[u8]) -> Option<Rc<[u8]>> {
    let mut bytes = [datagram, &[0; TAG_BYTES]].concat();
    sealing.close(&mut bytes).ok().map(|()| Rc::from(bytes))
}

/// A datagram that was opened where it lies, as it was before it was sealed.
pub(super) fn opened(bytes: &[u8]) -> Rc<[u8]> {
    let mut clear = bytes[..bytes.len() - TAG_BYTES].to_vec();
    frame::write_key(0, &mut clear);
    checked(&clear)
}

/// A datagram with the check that it would have if it were not to be sealed.
pub(super) fn checked(datagram: &[u8]) -> Rc<[u8]> {
    let mut bytes = datagram.to_vec();
    frame::write_check(&mut bytes);
    Rc::from(bytes)
}

/// Incarnation in the head of a datagram, sealed or not.
pub(super) fn incarnation(datagram: &[u8]) -> u64 {
    FrameHead::read(datagram).map_or(0, |(head, _)| head.incarnation)
}

/// What an attacker makes of a datagram that knows the format, and not the key.
pub(super) fn altered(datagram: &[u8], chance: &mut Chance) -> Rc<[u8]> {
    let mut bytes = damage(datagram, chance).to_vec();
    frame::write_check(&mut bytes);
    Rc::from(bytes)
}

pub(super) fn damage(bytes: &[u8], chance: &mut Chance) -> Rc<[u8]> {
    let mut bytes = bytes.to_vec();
    for _ in 0..chance.between(1, 4) {
        let at = chance.below(bytes.len() as u64) as usize;
        if let Some(byte) = bytes.get_mut(at) {
            *byte ^= 1 << chance.below(8);
        }
    }
    if chance.percent(20) {
        bytes.truncate(chance.below(bytes.len() as u64) as usize);
    }
    Rc::from(bytes)
}
