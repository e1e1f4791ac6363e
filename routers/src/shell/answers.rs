//! Error replies to senders of undeliverable commands: they need not wait for their timeout, and learn the cause.

use super::sender_cache::SenderCache;
use crate::counts::Cause;
use crate::frame::NodeIndex;
use crate::link::PeerLinkState;
use crate::report::Mismatch;
use crate::settings::Settings;
use crate::stats::Stats;
use rohrpost_mailbox::{Head, Kind, Name, Options, Participant, Type, monotonic_ns};
use std::sync::Arc;

/// Longest answer.
const ANSWER_BYTES_MAX: usize = 1024;

/// Why a command is not delivered.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Undelivered<'a> {
    /// What happened.
    pub cause: Cause,
    /// The receiving node; for one that came and is not allowed, this node.
    pub node: Option<&'a str>,
    /// For a command that is not allowed: line of the rule.
    pub rule: Option<usize>,
    /// The difference between that node and this one, if one of them refuses the other.
    pub mismatch: Option<Mismatch>,
    /// For a command that is too large: largest body of its mailbox.
    pub takes_bytes: Option<usize>,
}

/// Writes the bodies of such replies: routers do not know the format of a fault.
pub trait Faults: Send + Sync {
    /// Appends the reply to a command with a body that begins with these bytes, at least [`BEGINNING_BYTES`] of it;
    /// false when it cannot be answered.
    ///
    /// [`BEGINNING_BYTES`]: crate::report::BEGINNING_BYTES
    fn write(&self, call: &[u8], why: &Undelivered<'_>, answer: &mut Vec<u8>) -> bool;
}

/// Sends error replies on behalf of modules that cannot reply.
pub(super) struct ErrorReplier {
    settings: Arc<Settings>,
    stats: Arc<Stats>,
    faults: Arc<dyn Faults>,
    sender_cache: SenderCache,
    /// The router's own mailbox, which leads to other nodes.
    via: Name,
    body: Vec<u8>,
}

impl ErrorReplier {
    pub(super) fn new(
        settings: &Arc<Settings>,
        stats: &Arc<Stats>,
        faults: &Arc<dyn Faults>,
        participant: &Arc<Participant>,
        via: Name,
    ) -> Self {
        Self {
            settings: settings.clone(),
            stats: stats.clone(),
            faults: faults.clone(),
            sender_cache: SenderCache::everywhere(participant),
            via,
            body: Vec::with_capacity(ANSWER_BYTES_MAX),
        }
    }

    /// Replies to a command from another node, unless this incarnation of the router has just begun: then it may be a
    /// duplicate of one that the incarnation before has delivered, and its caller tries again. A caller with a name of
    /// no node gets none.
    pub(super) fn answer_arrived(
        &mut self,
        peer: Option<NodeIndex>,
        head: &Head,
        body: &[u8],
        cause: Cause,
        takes_bytes: Option<usize>,
    ) {
        if !self.stats.is_young(monotonic_ns()) && self.settings.node_of(head.from).is_some() {
            self.answer(peer, head, body, cause, takes_bytes);
        }
    }

    /// Replies to a command with this beginning of a body; no other package needs a reply. A command that is repeated
    /// after a crash gets none: the router's incarnation that died while handling it may have sent it.
    pub(super) fn answer(
        &mut self,
        peer: Option<NodeIndex>,
        head: &Head,
        body: &[u8],
        cause: Cause,
        takes_bytes: Option<usize>,
    ) {
        let Kind::Command(number) = head.kind.kind() else { return };
        if !head.from.is_mailbox() || head.options.has(Options::REDELIVERED) {
            return;
        }
        let settings = self.settings.clone();
        let node = peer.and_then(|peer| settings.nodes.get(usize::from(peer)));
        let mismatch = peer.and_then(|peer| match self.stats.state(peer, monotonic_ns()) {
            PeerLinkState::Refused(mismatch) => Some(mismatch),
            _ => None,
        });
        let rule = settings.admission.rule_against(head).filter(|_| cause == Cause::NotAllowed).map(|rule| rule.line);
        let node = if rule.is_some() { settings.nodes.get(usize::from(settings.own)) } else { node };
        let why = Undelivered { cause, node: node.map(|node| node.name.as_str()), rule, mismatch, takes_bytes };
        self.body.clear();
        if !self.faults.write(body, &why, &mut self.body) {
            return;
        }
        let answer = Head {
            to: head.from,
            from: head.to,
            len: self.body.len() as u16,
            kind: Type::reply(number),
            options: Options::ERROR,
            ..*head
        };
        // A caller that is gone or takes no replies waits for its timeout. Callers on other nodes choose the name, so
        // that it is not looked up.
        let _ = match settings.node_of(answer.to) {
            Some(_) => self.sender_cache.send_by(self.via, &answer, &self.body),
            None => self.sender_cache.send(&answer, &self.body),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::{TestNode, module, settings};
    use crate::stats::YOUNG_NS;
    use rohrpost_mailbox::{Name, Receiver, Shape, local};

    /// Writes the cause's word.
    struct Words;

    impl Faults for Words {
        fn write(&self, _: &[u8], why: &Undelivered<'_>, answer: &mut Vec<u8>) -> bool {
            answer.extend_from_slice(why.cause.word().as_bytes());
            true
        }
    }

    /// A router that began this long ago, ns, the mailbox of a caller on its node, and its own, for callers on others.
    struct Fixture {
        answers: ErrorReplier,
        replies: Receiver,
        transit: Receiver,
        _node: TestNode,
    }

    impl Fixture {
        fn new(age_ns: Option<u64>) -> Self {
            let node = TestNode::new();
            let bytes_max = Shape::default().body_bytes_max;
            let [replies, transit] = [caller(), transit()].map(|name| node.mailbox(name, 4, bytes_max));
            let settings = Arc::new(settings(0, 2));
            // A beginning that never is over.
            let started_ns = age_ns.map_or(u64::MAX, |age_ns| monotonic_ns() - age_ns);
            let faults: Arc<dyn Faults> = Arc::new(Words);
            let answers = ErrorReplier::new(
                &settings,
                &Stats::new(&settings, started_ns),
                &faults,
                &node.join(),
                self::transit(),
            );
            Self { answers, replies, transit, _node: node }
        }

        fn answered(&mut self) -> Option<String> {
            let package = self.replies.try_receive().or_else(|| self.transit.try_receive())?;
            assert!(package.head().options.has(Options::ERROR));
            Some(String::from_utf8_lossy(package.body()).into_owned())
        }
    }

    fn transit() -> Name {
        module(250, 0).with_local(local::TRANSIT)
    }

    /// A command that came: its caller is on the other node.
    fn arrived(options: Options) -> Head {
        Head { to: module(60, 0), from: module(50, 1).with_local(local::REPLIES), ..command(options) }
    }

    fn caller() -> Name {
        module(50, 0).with_local(local::REPLIES)
    }

    fn command(options: Options) -> Head {
        Head { to: module(60, 1), from: caller(), kind: Type::command(16), options, ..Head::default() }
    }

    #[test]
    fn of_a_command_that_is_handed_out_again_nothing_is_said() {
        let mut ground = Fixture::new(Some(YOUNG_NS));
        for cause in Cause::ALL {
            let again = command(Options::default().with(Options::REDELIVERED));
            ground.answers.answer(Some(1), &again, b"call", cause, None);
            let again = arrived(again.options);
            ground.answers.answer_arrived(Some(1), &again, b"call", cause, None);
            assert_eq!(ground.answered(), None, "{cause:?}: the incarnation before may have sent it");
        }
        ground.answers.answer(Some(1), &command(Options::default()), b"call", Cause::Silent, None);
        assert_eq!(ground.answered().as_deref(), Some(Cause::Silent.word()));
    }

    #[test]
    fn a_router_that_has_just_begun_answers_nothing_that_came() {
        let (came, left) = (arrived(Options::default()), command(Options::default()));
        let mut ground = Fixture::new(None);
        for cause in [Cause::NoMailbox, Cause::MailboxFull, Cause::TooLarge, Cause::Stale] {
            ground.answers.answer_arrived(Some(1), &came, b"call", cause, None);
            assert_eq!(ground.answered(), None, "{cause:?}: it may be a copy of what the incarnation before delivered");
        }
        ground.answers.answer(Some(1), &left, b"call", Cause::Stale, None);
        assert_eq!(ground.answered().as_deref(), Some(Cause::Stale.word()), "what is to leave is no copy");
        let mut ground = Fixture::new(Some(YOUNG_NS));
        ground.answers.answer_arrived(Some(1), &came, b"call", Cause::MailboxFull, None);
        assert_eq!(ground.answered().as_deref(), Some(Cause::MailboxFull.word()));
        for from in [caller(), Name::new(2, 50, 1, 1), Name::NONE] {
            ground.answers.answer_arrived(Some(1), &Head { from, ..came }, b"call", Cause::MailboxFull, None);
            assert_eq!(ground.answered(), None, "no other node has {from}");
        }
    }
}
