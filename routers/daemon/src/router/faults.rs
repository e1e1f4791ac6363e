//! A router's answers to commands that it cannot deliver: faults of the modules' crate, which routers do not know.

use rohrpost_config::Installation;
use rohrpost_modules::call::CallEnvelope;
use rohrpost_modules::call::Fault;
use rohrpost_routers::counts::Cause;
use rohrpost_routers::report::BEGINNING_BYTES;
use rohrpost_routers::shell::{Faults, Undelivered, difference};

const _: () = assert!(BEGINNING_BYTES >= CallEnvelope::BYTES, "the answer needs the command's envelope");

/// Encodes them as modules encode theirs.
pub(crate) struct Encoded {
    /// This node's configuration.
    digest: u64,
    /// Its file, as messages name it.
    file: String,
}

impl Encoded {
    pub(crate) fn of(installation: &Installation) -> Self {
        Self { digest: installation.digest().lan(), file: installation.shown.display().to_string() }
    }

    fn fault(&self, why: &Undelivered<'_>) -> Option<Fault> {
        let node = || why.node.unwrap_or("?").to_owned();
        Some(match why.cause {
            // No route leads from another node to a router's own mailboxes.
            Cause::NoRoute | Cause::RoutersOwn => Fault::NoRoute,
            Cause::Silent => Fault::NodeSilent { node: node() },
            Cause::Unheard => Fault::NodeDeaf { node: node() },
            Cause::Refused => {
                let why = why.mismatch.map(|mismatch| difference(&mismatch, self.digest));
                Fault::NodeRefuses { node: node(), why: why.unwrap_or_default() }
            }
            Cause::Quota => Fault::RouterFull,
            Cause::Stale => Fault::Delayed,
            Cause::NoMailbox => Fault::NoMailbox,
            Cause::MailboxFull => Fault::MailboxFull,
            Cause::TooLarge => Fault::CommandTooLarge(why.takes_bytes.unwrap_or_default() as u32),
            Cause::NotAllowed => {
                Fault::NotAllowed { node: node(), rule: format!("{}:{}", self.file, why.rule.unwrap_or_default()) }
            }
            // A forged sender name gets no answer.
            Cause::ForeignName | Cause::BadPacket => return None,
            // After these, the caller's next try succeeds or gets another answer.
            Cause::Socket | Cause::Late | Cause::Incomplete => return None,
        })
    }
}

impl Faults for Encoded {
    fn write(&self, call: &[u8], why: &Undelivered<'_>, answer: &mut Vec<u8>) -> bool {
        self.fault(why).is_some_and(|fault| fault.answer(call, answer))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_modules::call::ReplyEnvelope;
    use rohrpost_modules::wire::append;
    use rohrpost_routers::frame::RefusalReason;
    use rohrpost_routers::report::Mismatch;

    fn encoded() -> Encoded {
        Encoded { digest: 0x123, file: "robot.toml".into() }
    }

    #[test]
    fn each_reported_cause_has_a_fault_with_a_remedy() {
        let call = CallEnvelope { interface: 1, incarnation: 7, sequence: 9, valid_for_us: 1, age_us: 0 }.to_bytes();
        let mismatch = Some(Mismatch { reason: RefusalReason::Digest, version: 1, digest: Some(0xabc) });
        for (cause, words) in [
            (Cause::NoRoute, "same configuration"),
            (Cause::RoutersOwn, "no router knows a way there"),
            (Cause::Silent, "node arm is silent"),
            (Cause::Unheard, "node arm is heard, but does not hear"),
            (Cause::Refused, "0000000000000abc, this node's 0000000000000123"),
            (Cause::Quota, "`quota`"),
            (Cause::Stale, "too long"),
            (Cause::NoMailbox, "rohrpost start"),
            (Cause::MailboxFull, "too few slots"),
            (Cause::TooLarge, "at most 99 bytes"),
            (Cause::NotAllowed, "node arm refuses it: robot.toml:41, [access]"),
        ] {
            let why = Undelivered { cause, node: Some("arm"), rule: Some(41), mismatch, takes_bytes: Some(99) };
            let mut answer = Vec::new();
            assert!(encoded().write(&call, &why, &mut answer));
            let (envelope, fault) = ReplyEnvelope::split(&answer).unwrap();
            assert_eq!(envelope, ReplyEnvelope { incarnation: 7, sequence: 9 });
            let said = encoded().fault(&why).unwrap();
            let mut bytes = Vec::new();
            append(&mut bytes, &said).unwrap();
            assert_eq!(fault, bytes, "{said}");
            assert!(said.to_string().contains(words) && said.is_of_this_try(), "{cause:?}: {said}");
        }
        let why = Undelivered { cause: Cause::NoMailbox, node: None, rule: None, mismatch: None, takes_bytes: None };
        assert!(!encoded().write(&call[..19], &why, &mut Vec::new()), "no whole command");
        let why = Undelivered { cause: Cause::Incomplete, ..why };
        assert!(!encoded().write(&call, &why, &mut Vec::new()), "nobody is told");
    }
}
