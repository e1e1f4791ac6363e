//! The bytes before a command's arguments and before a reply's result. All numbers little-endian.
//!
//! ```text
//! command:  interface u32 │ incarnation u32 │ sequence u32 │ valid for u32 µs │ age u32 µs │ arguments (postcard)
//! reply:    incarnation u32 │ sequence u32 │ result, or a fault if the head's option `error` is set (postcard)
//! ```

use rohrpost_mailbox::Short;
use std::time::Duration;

/// Longest time that a command is on its way between two nodes, uncounted by its age.
pub const TRANSIT_MAX: Duration = Duration::from_secs(2);

/// Before a command's arguments.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CallEnvelope {
    /// Hash of the interface that the caller was compiled with.
    pub interface: u32,
    /// Tells this incarnation of the caller from earlier ones: later than that of the previous owner of its reply
    /// mailbox.
    pub incarnation: u32,
    /// Counts this incarnation's calls. A repeat carries the number of the first try.
    pub sequence: u32,
    /// How long after the first try the command may still be run, µs.
    pub valid_for_us: u32,
    /// How long ago the first try was, µs; 0 in the first try.
    pub age_us: u32,
}

/// Before a reply's result.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ReplyEnvelope {
    /// Incarnation of the caller, as its command had it.
    pub incarnation: u32,
    /// Sequence number of the command.
    pub sequence: u32,
}

/// A time as envelopes carry it; longer ones are cut to 71 minutes. (A server counts a minute of it at most.)
pub(crate) fn micros(time: Duration) -> u32 {
    u32::try_from(time.as_micros()).unwrap_or(u32::MAX)
}

impl CallEnvelope {
    /// Bytes of it.
    pub const BYTES: usize = 20;

    /// As it stands in a body.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let fields = [self.interface, self.incarnation, self.sequence, self.valid_for_us, self.age_us];
        bytes.chunks_exact_mut(4).zip(fields).for_each(|(to, field)| to.copy_from_slice(&field.to_le_bytes()));
        bytes
    }

    /// Splits a command's body into envelope and arguments.
    ///
    /// # Errors
    /// [`Short`] when there is no whole envelope.
    pub fn split(body: &[u8]) -> Result<(Self, &[u8]), Short> {
        let ([interface, incarnation, sequence, valid_for_us, age_us], rest) = split(body)?;
        Ok((Self { interface, incarnation, sequence, valid_for_us, age_us }, rest))
    }
}

impl ReplyEnvelope {
    /// Bytes of it.
    pub const BYTES: usize = 8;

    /// As it stands in a body.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        bytes[..4].copy_from_slice(&self.incarnation.to_le_bytes());
        bytes[4..].copy_from_slice(&self.sequence.to_le_bytes());
        bytes
    }

    /// Splits a reply's body into envelope and result.
    ///
    /// # Errors
    /// [`Short`] when there is no whole envelope.
    pub fn split(body: &[u8]) -> Result<(Self, &[u8]), Short> {
        let ([incarnation, sequence], rest) = split(body)?;
        Ok((Self { incarnation, sequence }, rest))
    }
}

fn split<const N: usize>(body: &[u8]) -> Result<([u32; N], &[u8]), Short> {
    let (front, rest) = body.split_at_checked(N * 4).ok_or(Short { have: body.len(), need: N * 4 })?;
    let mut words = front.chunks_exact(4).map(|four| u32::from_le_bytes([four[0], four[1], four[2], four[3]]));
    Ok((std::array::from_fn(|_| words.next().unwrap_or_default()), rest))
}

/// Appends a value as postcard.
///
/// # Errors
/// When the value cannot be written (a map of unknown length, say).
pub fn append<T: serde::Serialize + ?Sized>(to: &mut Vec<u8>, value: &T) -> Result<(), postcard::Error> {
    let taken = std::mem::take(to);
    *to = postcard::to_extend(value, taken)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn envelopes_come_back_and_short_ones_are_refused() {
        let call = CallEnvelope { interface: 1, incarnation: 2, sequence: 3, valid_for_us: 4, age_us: u32::MAX };
        let body = [&call.to_bytes()[..], b"args"].concat();
        assert_eq!(CallEnvelope::split(&body), Ok((call, &b"args"[..])));
        assert_eq!(CallEnvelope::split(&body[..19]), Err(Short { have: 19, need: 20 }));
        let reply = ReplyEnvelope { incarnation: 7, sequence: 8 };
        assert_eq!(ReplyEnvelope::split(&reply.to_bytes()), Ok((reply, &b""[..])));
        assert_eq!(ReplyEnvelope::split(&[0; 7]), Err(Short { have: 7, need: 8 }));
    }
}
