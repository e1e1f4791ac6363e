//! What a hello says: 32 bytes behind the head.
//!
//! ```text
//!                   challenge   answer
//!  challenge           a          0       shows nothing yet
//!  response            b          a       its sender lives now
//!  final response      0          b       the other one lives now, too
//! ```

pub use rohrpost_network::HELLO_BYTES;

/// A challenge of an incarnation to a peer, the response to it, or the final response.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Hello {
    /// A response to it proves that its sender lives now; 0: no response is wanted.
    pub challenge: u64,
    /// The challenge that this responds to; 0: to none.
    pub answer: u64,
    /// From which sequence on the receiver is to take what this incarnation sends it: of packages, and of time.
    pub next: [u64; 2],
}

impl Hello {
    pub(super) fn to_bytes(self) -> [u8; HELLO_BYTES] {
        let mut bytes = [0; HELLO_BYTES];
        let words = [self.challenge, self.answer, self.next[0], self.next[1]];
        for (place, word) in bytes.chunks_exact_mut(8).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        bytes
    }

    pub(super) fn parse(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; HELLO_BYTES] = bytes.try_into().ok()?;
        let (words, _) = bytes.as_chunks::<8>();
        let [challenge, answer, packages, time] = [0, 1, 2, 3].map(|at| u64::from_le_bytes(words[at]));
        let is_sound = (challenge, answer) != (0, 0) && packages.max(time) <= crate::frame::SEQUENCE_MAX;
        is_sound.then_some(Self { challenge, answer, next: [packages, time] })
    }
}
