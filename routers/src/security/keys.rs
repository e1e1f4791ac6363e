//! The keys of an installation, and those that are derived from them: one for each direction, port and pair of
//! incarnations. Random numbers that are fit for keys are the one thing that is asked of the system here.

use super::seal::Seal;
use crate::frame::NodeIndex;
use ring::aead::{CHACHA20_POLY1305, LessSafeKey, UnboundKey};
use ring::hkdf::{self, HKDF_SHA256, Prk, Salt};
use ring::rand::{SecureRandom, SystemRandom};
use std::fmt;
use std::num::NonZeroU8;

/// Bytes of an installation key.
pub const KEY_BYTES: usize = 32;
/// Tells these keys from whatever else may be derived from the same secret.
const SALT: &[u8] = b"rohrpost datagrams, version 1";

/// The system gave none.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the system has no random numbers (getrandom); is this a kernel before 3.17?")]
pub struct NoRandom;

/// Random bytes that are fit for keys, from the system. Just after booting it waits until there are any.
///
/// # Errors
/// [`NoRandom`]
pub fn random<const N: usize>() -> Result<[u8; N], NoRandom> {
    let mut bytes = [0; N];
    SystemRandom::new().fill(&mut bytes).map_err(|_| NoRandom)?;
    Ok(bytes)
}

/// Which key a datagram is sealed with: byte 7 of its head, where 0 says that it is not.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct KeyId(pub NonZeroU8);

/// What all nodes of an installation know, and nobody else.
pub struct InstallationKey {
    id: KeyId,
    secret: Prk,
}

impl InstallationKey {
    /// `bytes` come from a source of random numbers that is fit for keys.
    pub fn new(id: KeyId, bytes: &[u8; KEY_BYTES]) -> Self {
        Self { id, secret: Salt::new(HKDF_SHA256, SALT).extract(bytes) }
    }

    /// Shows people that two nodes have the same key, and nothing of the key itself.
    pub fn fingerprint(&self) -> [u8; 8] {
        let mut bytes = [0; 8];
        let okm = self.secret.expand(&[b"fingerprint"], FingerprintLength);
        okm.and_then(|okm| okm.fill(&mut bytes)).expect("a fingerprint is shorter than 255 hashes");
        bytes
    }
}

/// How long it is, as `ring` wants to know.
struct FingerprintLength;

impl hkdf::KeyType for FingerprintLength {
    fn len(&self) -> usize {
        8
    }
}

impl fmt::Debug for InstallationKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "key {}", self.id.0)
    }
}

/// The keys that are valid.
#[derive(Debug)]
pub struct KeyRing {
    /// One or two, the newest first.
    keys: Vec<InstallationKey>,
}

impl KeyRing {
    /// `older` is still valid while keys are changed.
    ///
    /// # Panics
    /// If both have one id: the reader of the key file rules that out.
    pub fn new(newest: InstallationKey, older: Option<InstallationKey>) -> Self {
        assert!(older.as_ref().is_none_or(|older| older.id != newest.id), "two keys with the id {}", newest.id.0);
        Self { keys: [Some(newest), older].into_iter().flatten().collect() }
    }

    pub(super) fn len(&self) -> usize {
        self.keys.len()
    }

    /// Byte 7 of what is sealed with the key at a place.
    pub(super) fn id(&self, place: usize) -> u8 {
        self.keys[place].id.0.get()
    }

    /// Where the key stands that byte 7 names.
    pub(crate) fn place(&self, id: u8) -> Option<usize> {
        self.keys.iter().position(|key| key.id.0.get() == id)
    }

    pub(super) fn derive(&self, place: usize, of: &Binding) -> Seal {
        let info = [&of.to_bytes()[..]];
        let okm = self.keys[place].secret.expand(&info, &CHACHA20_POLY1305);
        let okm = okm.expect("a key is shorter than 255 hashes");
        Seal::new(LessSafeKey::new(UnboundKey::from(okm)))
    }

    /// Derives a seal from every key.
    pub(super) fn derive_all(&self, of: &Binding) -> Vec<Seal> {
        (0..self.len()).map(|place| self.derive(place, of)).collect()
    }
}

/// What a derived key is for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(super) enum Purpose {
    /// Hellos: of any incarnation to any.
    Hello = 1,
    /// Packages.
    Packages = 2,
    /// Time.
    Time = 3,
    /// Packages that are not real time.
    Rest = 4,
    /// What the two ends of a replica send to each other.
    Replicas = 5,
    /// What an incarnation of a system's node sends to other systems.
    Team = 6,
}

/// One end of a direction.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Endpoint {
    pub(super) node: NodeIndex,
    /// Its incarnation; 0: any.
    pub(super) incarnation: u64,
}

impl Endpoint {
    /// Whatever incarnation the node has.
    pub(super) fn any(node: NodeIndex) -> Self {
        Self { node, incarnation: 0 }
    }
}

/// All that a derived key is bound to: no two of these have one key.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Binding {
    pub(super) purpose: Purpose,
    pub(super) system: u8,
    pub(super) from: Endpoint,
    pub(super) to: Endpoint,
}

impl Binding {
    fn to_bytes(self) -> [u8; 20] {
        let mut bytes = [0; 20];
        bytes[..4].copy_from_slice(&[self.purpose as u8, self.system, self.from.node, self.to.node]);
        bytes[4..12].copy_from_slice(&self.from.incarnation.to_le_bytes());
        bytes[12..].copy_from_slice(&self.to.incarnation.to_le_bytes());
        bytes
    }
}
