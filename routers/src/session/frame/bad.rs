//! Why bytes are no frame of ours.

use crate::frame::BadFrame;

/// The version of this format; the head, the first eight bytes of a hello, and a refusal mean the same in all of them.
pub const VERSION: u8 = 1;

/// Why bytes are no frame of ours; nothing that follows them can be read.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum BadSessionFrame {
    /// The stream does not begin as one of ours.
    #[error("no session of Rohrpost; is this the port of its TCP router?")]
    Foreign,
    /// TLS (RFC 8446, 5.1), where nothing is sealed.
    #[error("it speaks TLS; write the same `security` in [tcp] at both ends")]
    Tls,
    /// Another version of the format.
    #[error("session format {theirs}, ours is {VERSION}; run the same version of Rohrpost at both ends", theirs = .0)]
    Version(u8),
    /// More than a frame of its kind may have.
    #[error("a frame of {0} bytes is too long")]
    TooLong(u32),
    /// Wrong in itself.
    #[error("damaged: {0}")]
    Damaged(&'static str),
}

impl From<BadFrame> for BadSessionFrame {
    fn from(bad: BadFrame) -> Self {
        match bad {
            BadFrame::Damaged(what) => Self::Damaged(what),
            _ => Self::Damaged("a part of a replica is none"),
        }
    }
}
