//! Reports of the TCP router: refusals to senders of commands that go no further, and lines for people.

use crate::replication::LineReplicas;
use crate::session::frame::SessionRefusalReason;
use crate::session::server::{ServerEvent, ServerHost};
use crate::session::{Cause, EndHost};
use crate::tcp::fault_writer::FaultWriter;
use crate::tcp::line_throttle::{LineThrottle, Topic};
use rohrpost_mailbox::monotonic_ns;

/// Reports events, and answers for receivers that are not reached.
pub(super) struct ServerReporter {
    fault_writer: FaultWriter,
    pub(super) throttle: LineThrottle,
    /// Clients that took part and do not any more.
    pub(super) left: u64,
    /// Connections that might not take part.
    pub(super) refused: u64,
    /// The last of them, in words.
    pub(super) refusal: String,
    pub(super) line: Option<LineReplicas>,
}

impl ServerReporter {
    pub(super) fn new(fault_writer: FaultWriter) -> Self {
        let (throttle, refusal) = Default::default();
        Self { fault_writer, throttle, left: 0, refused: 0, refusal, line: None }
    }

    /// Says and keeps why one may not take part.
    pub(super) fn refuses(&mut self, topic: Topic, refusal: String) {
        self.says(topic, &refusal);
        self.refused += 1;
        self.refusal = refusal;
    }

    /// Says it, unless there was such a line a moment ago.
    pub(super) fn says(&mut self, topic: Topic, line: &str) {
        if let Some(line) = self.throttle.line(monotonic_ns(), topic, line) {
            tell(topic, &line);
        }
    }

    /// Says what was held back, as far as it is time.
    pub(super) fn says_held(&mut self, now_ns: u64) {
        while let Some((topic, line)) = self.throttle.next_held(now_ns) {
            tell(topic, &line);
        }
    }
}

fn tell(topic: Topic, line: &str) {
    match topic {
        Topic::Joined | Topic::Left(None) => tracing::info!("{line}"),
        Topic::Left(Some(SessionRefusalReason::Ending)) => tracing::debug!("{line}"),
        _ => tracing::warn!("{line}"),
    }
}

impl EndHost for ServerReporter {
    fn answer(&mut self, call: &[u8], why: Cause, holder: Option<&str>, answer: &mut Vec<u8>) -> bool {
        self.fault_writer.answer(call, why, holder, answer)
    }

    fn replicas(&mut self) -> Option<&mut LineReplicas> {
        self.line.as_mut()
    }
}

impl ServerHost for ServerReporter {
    fn event(&mut self, event: ServerEvent<'_>) {
        match event {
            ServerEvent::Joined { name } => self.says(Topic::Joined, &format!("{name} takes part")),
            ServerEvent::Left { name, why } => {
                self.left += 1;
                let line = match why {
                    None => format!("{name} takes part no more: its connection is closed"),
                    Some(SessionRefusalReason::Ending) => format!("{name} is told that the TCP router ends"),
                    Some(why) => format!("{name} takes part no more: {}", why.word()),
                };
                self.says(Topic::Left(why), &line);
            }
            ServerEvent::Refused { reason: SessionRefusalReason::Ending, .. } => {}
            ServerEvent::Refused { name, reason, digests: (theirs, ours), text } => {
                let refusal = match reason {
                    SessionRefusalReason::Common | SessionRefusalReason::System => format!(
                        "{name} may not take part: its {} is {theirs:016x}, that of {text} {ours:016x}; \
                         give both the same configuration (`rohrpost check`, on both)",
                        reason.word()
                    ),
                    _ if text.is_empty() => format!("{name} may not take part: {}", reason.word()),
                    _ => format!("{name} may not take part: {}: {text}", reason.word()),
                };
                self.refuses(Topic::Refused(reason), refusal);
            }
            ServerEvent::Objected { name, verdict } => {
                self.says(Topic::Objected, &format!("{name} may not host what it says: {verdict}"));
            }
        }
    }
}
