//! A router's keys, and its identity under them.

use rohrpost_config::{Installation, Key, Keys, KeysError};
use rohrpost_mailbox::realtime_ns;
use rohrpost_routers::security::{InstallationKey, KeyId, KeyRing, NoRandom, random};
use std::path::Path;

/// The keys of an installation; none if nothing is sealed there.
///
/// # Errors
/// [`KeysError`]
pub fn of(installation: &Installation) -> Result<Option<KeyRing>, KeysError> {
    installation.keys.as_deref().map(read).transpose()
}

/// The keys in a folder.
///
/// # Errors
/// [`KeysError`]
pub(crate) fn read(folder: &Path) -> Result<KeyRing, KeysError> {
    let key = |key: &Key| InstallationKey::new(KeyId(key.id), &key.bytes);
    let Keys { newest, older } = Keys::load(&Keys::file(folder))?;
    Ok(KeyRing::new(key(&newest), older.as_ref().map(key)))
}

/// The random id of this incarnation of a router. Two sealed incarnations with one id would use a key twice in one
/// direction: so the id cannot be guessed.
///
/// # Errors
/// [`NoRandom`]
pub(crate) fn incarnation(is_sealed: bool) -> Result<u64, NoRandom> {
    if !is_sealed {
        return Ok(realtime_ns());
    }
    random().map(|bytes| u64::from_le_bytes(bytes).max(1))
}
