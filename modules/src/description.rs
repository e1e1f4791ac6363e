//! What modules say of themselves: noted on their own node, and asked for from others.

mod request;

pub use request::DescriptionRequest;

use crate::call::CallError;
use crate::common::DescriptionPart;
use rohrpost_mailbox::{Name, Node, local};
use rohrpost_schema::Description;
use std::time::Duration;

/// Longest description that is asked for, bytes.
const BYTES_MAX: usize = 1 << 20;

/// Puts a module's description together of its parts, all of which come within `timeout`. `elapsed` tells how much time
/// has passed since this began; `ask` is told how many bytes are there and how much time is left, and returns what
/// comes next.
///
/// ```
/// use rohrpost_mailbox::Name;
/// use rohrpost_modules::{call::CallError, common::DescriptionPart, description::assemble, schema::Description};
/// use std::time::{Duration, Instant};
///
/// fn of_one_part(module: Name, bytes: &[u8]) -> Result<Description, CallError> {
///     let (began, total) = (Instant::now(), bytes.len() as u32);
///     let ask = |from, _left| Ok(DescriptionPart { total, bytes: bytes[from as usize..].to_vec() });
///     assemble(module, Duration::from_secs(1), || began.elapsed(), ask)
/// }
/// ```
///
/// # Errors
/// Those of `ask`, [`CallError::BadReply`], and [`CallError::Timeout`].
pub fn assemble(
    module: Name,
    timeout: Duration,
    mut elapsed: impl FnMut() -> Duration,
    mut ask: impl FnMut(u32, Duration) -> Result<DescriptionPart, CallError>,
) -> Result<Description, CallError> {
    let mut bytes = Vec::new();
    let mut left = timeout;
    loop {
        let part = ask(bytes.len() as u32, left).map_err(|error| match error {
            CallError::Timeout(..) => CallError::Timeout(module, timeout),
            error => error,
        })?;
        // What it says of itself is a claim.
        if part.total as usize > BYTES_MAX {
            let text = format!("its description of {} bytes is longer than {BYTES_MAX}", part.total);
            return Err(CallError::BadReply(module, text));
        }
        bytes.extend_from_slice(&part.bytes);
        if bytes.len() >= part.total as usize || part.bytes.is_empty() {
            return Description::from_bytes(&bytes).map_err(|error| CallError::BadReply(module, error.to_string()));
        }
        left = timeout.saturating_sub(elapsed());
        if left.is_zero() {
            return Err(CallError::Timeout(module, timeout));
        }
    }
}

/// What the module under this name has noted of itself beside its command mailbox; asks nobody. None when it noted
/// nothing that can be read.
///
/// ```
/// # use rohrpost_mailbox::{Name, Node};
/// fn class(node: &Node, module: Name) -> Option<String> {
///     Some(rohrpost_modules::description::noted(node, module)?.class)
/// }
/// ```
pub fn noted(node: &Node, module: Name) -> Option<Description> {
    Description::from_bytes(&node.about(module.with_local(local::COMMANDS))?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    const TIMEOUT: Duration = Duration::from_secs(1);

    fn module() -> Name {
        Name::from_raw(0x0101_c800)
    }

    /// A module that gives a byte at a time, and takes so long for each.
    fn slow(bytes: &[u8], each: Duration) -> (Result<Description, CallError>, Vec<Duration>) {
        let (now, mut told) = (Cell::new(Duration::ZERO), Vec::new());
        let part = |from: u32, left| {
            told.push(left);
            now.set(now.get() + each);
            let at = from as usize;
            Ok(DescriptionPart { total: bytes.len() as u32, bytes: bytes[at..=at].to_vec() })
        };
        (assemble(module(), TIMEOUT, || now.get(), part), told)
    }

    fn described() -> Description {
        let (name, class, text) = ("Motor".into(), "motor".into(), String::new());
        Description { name, class, text, functions: Vec::new(), data: Vec::new() }
    }

    #[test]
    fn all_parts_of_a_description_share_one_timeout() {
        let bytes = described().to_bytes();
        let (found, told) = slow(&bytes, Duration::from_micros(1));
        assert_eq!((found.unwrap(), told.len()), (described(), bytes.len()), "each byte by itself");
        let each = TIMEOUT / 4;
        let (found, told) = slow(&bytes, each);
        assert!(matches!(found, Err(CallError::Timeout(_, TIMEOUT))), "{found:?}");
        assert_eq!(told, [TIMEOUT, each * 3, each * 2, each], "each part is asked for within what is left");
    }

    #[test]
    fn a_part_that_does_not_come_is_told_with_the_whole_timeout() {
        let late = |_, left| Err(CallError::Timeout(module(), left));
        let found = assemble(module(), TIMEOUT, || Duration::ZERO, late);
        assert!(matches!(found, Err(CallError::Timeout(_, TIMEOUT))), "{found:?}");
        let mut parts = 0;
        let second_late = |_, left| {
            parts += 1;
            if parts > 1 {
                return Err(CallError::Timeout(module(), left));
            }
            Ok(DescriptionPart { total: 9, bytes: vec![0] })
        };
        let found = assemble(module(), TIMEOUT, || TIMEOUT / 2, second_late);
        assert!(matches!(found, Err(CallError::Timeout(_, TIMEOUT))), "{found:?}");
    }
}
