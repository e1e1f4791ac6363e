//! Random numbers that are fit for keys, from the system: the one thing here that is asked of it.

use ring::rand::{SecureRandom, SystemRandom};

/// The system gave none.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the system has no random numbers (getrandom); is this a kernel before 3.17?")]
pub struct NoRandom;

/// Random bytes. Just after booting it waits until there are any.
///
/// # Errors
/// [`NoRandom`]
pub fn random<const N: usize>() -> Result<[u8; N], NoRandom> {
    let mut bytes = [0; N];
    SystemRandom::new().fill(&mut bytes).map_err(|_| NoRandom)?;
    Ok(bytes)
}
