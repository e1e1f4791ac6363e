//! What the TCP router has to say: to those whose commands go no further, and to people.

use crate::session::frame::Reason;
use crate::session::server::{Event, Host};
use crate::session::{Answers, Cause};
use crate::tcp::desk::Desk;

/// Says what happens, and answers for who is not reached.
pub(super) struct Voice {
    desk: Desk,
    /// Clients that took part and do not any more.
    pub(super) left: u64,
    /// Connections that might not take part.
    pub(super) refused: u64,
    /// The last of them, in words.
    pub(super) refusal: String,
}

impl Voice {
    pub(super) fn new(desk: Desk) -> Self {
        Self { desk, left: 0, refused: 0, refusal: String::new() }
    }

    /// Says and keeps why one may not take part.
    pub(super) fn refuses(&mut self, refusal: String) {
        tracing::warn!("{refusal}");
        self.refused += 1;
        self.refusal = refusal;
    }
}

impl Answers for Voice {
    fn answer(&mut self, call: &[u8], why: Cause, holder: Option<&str>, answer: &mut Vec<u8>) -> bool {
        self.desk.answer(call, why, holder, answer)
    }
}

impl Host for Voice {
    fn event(&mut self, event: Event<'_>) {
        match event {
            Event::Joined { name } => tracing::info!("{name} takes part"),
            Event::Left { name, why: None } => {
                self.left += 1;
                tracing::info!("{name} takes part no more: its connection is closed");
            }
            Event::Left { name, why: Some(Reason::Ending) } => {
                self.left += 1;
                tracing::debug!("{name} is told that the TCP router ends");
            }
            Event::Left { name, why: Some(why) } => {
                self.left += 1;
                tracing::warn!("{name} takes part no more: {}", why.word());
            }
            Event::Refused { reason: Reason::Ending, .. } => {}
            Event::Refused { name, reason, digests: (theirs, ours), text } => self.refuses(match reason {
                Reason::Common | Reason::System => format!(
                    "{name} may not take part: its {} is {theirs:016x}, that of {text} {ours:016x}; give both the same configuration \
                     (`rohrpost check`, on both)",
                    reason.word()
                ),
                _ if text.is_empty() => format!("{name} may not take part: {}", reason.word()),
                _ => format!("{name} may not take part: {}: {text}", reason.word()),
            }),
            Event::Objected { name, verdict } => tracing::warn!("{name} may not host what it says: {verdict}"),
        }
    }
}
