//! The mailboxes that a thread of the router sends to, kept open: finding one again takes a search of a small table, no system call.

use rohrpost_mailbox::{Head, Label, Name, Participant, SendError, Sender};
use std::sync::Arc;

/// Mailboxes kept open; the one not used for longest gives way.
const WAYS_MAX: usize = 512;
/// Names known to have no mailbox here; those beyond are looked for each time.
const ABSENT_MAX: usize = 64;

/// Where packages may go.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reach {
    /// To mailboxes of this node: what came from other nodes must not go back.
    Here,
    /// Also through this node's own router.
    Everywhere,
}

struct Way {
    to: Name,
    sender: Sender,
    used: u64,
}

/// Ways to mailboxes.
pub(crate) struct Ways {
    participant: Arc<Participant>,
    reach: Reach,
    /// By name.
    ways: Vec<Way>,
    /// Counts packages, to tell which way was not used for longest.
    packages: u64,
    /// Names without a mailbox while the registry has this epoch.
    absent: Vec<Name>,
    epoch: u32,
}

impl Ways {
    pub(crate) fn new(participant: &Arc<Participant>, reach: Reach) -> Self {
        let (ways, absent) = (Vec::with_capacity(WAYS_MAX), Vec::with_capacity(ABSENT_MAX));
        Self { participant: participant.clone(), reach, ways, packages: 0, absent, epoch: 0 }
    }

    /// Sends a package on, as it is, to the mailbox that its head names.
    pub(crate) fn send(&mut self, head: &Head, body: &[u8]) -> Result<(), SendError> {
        let Head { to, from, kind, id, priority, options, .. } = *head;
        let at = match self.ways.binary_search_by_key(&to, |way| way.to) {
            Ok(at) => at,
            Err(at) => self.open(to, at)?,
        };
        self.packages += 1;
        self.ways[at].used = self.packages;
        let sent = self.ways[at].sender.send(&Label { from, kind, id, priority, options }, &[body]);
        if let Err(SendError::NoMailbox(_) | SendError::NoRouter { .. } | SendError::Bad(..)) = sent {
            // Its memory is nobody's any more.
            self.ways.remove(at);
        }
        sent
    }

    #[cold]
    fn open(&mut self, to: Name, at: usize) -> Result<usize, SendError> {
        // Before it is looked for: what comes in between makes this number an old one.
        let epoch = self.participant.node().registry_epoch();
        if epoch != self.epoch {
            self.absent.clear();
            self.epoch = epoch;
        }
        if self.absent.contains(&to) {
            return Err(SendError::NoMailbox(to));
        }
        let opened = match self.reach {
            Reach::Here => self.participant.sender_here(to),
            Reach::Everywhere => self.participant.sender(to),
        };
        let sender = opened.inspect_err(|error| {
            if matches!(error, SendError::NoMailbox(_)) && self.absent.len() < ABSENT_MAX {
                self.absent.push(to);
            }
        })?;
        let at = if self.ways.len() < WAYS_MAX { at } else { self.make_room(to) };
        self.ways.insert(at, Way { to, sender, used: 0 });
        Ok(at)
    }

    /// Gives up the way not used for longest; where that of `to` belongs now.
    fn make_room(&mut self, to: Name) -> usize {
        if let Some((oldest, _)) = self.ways.iter().enumerate().min_by_key(|(_, way)| way.used) {
            self.ways.remove(oldest);
        }
        self.ways.partition_point(|way| way.to < to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_mailbox::{Node, Priority, Receiver, Shape, Type};

    struct Ground {
        _folder: tempfile::TempDir,
        node: Arc<Node>,
    }

    impl Ground {
        fn new() -> Self {
            let folder = tempfile::tempdir().unwrap();
            let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
            Self { _folder: folder, node }
        }

        fn join(&self) -> Arc<Participant> {
            Participant::join(&self.node, Name::NONE).unwrap()
        }

        fn mailbox(&self, name: Name) -> Receiver {
            self.join().receiver(name, Shape { slots: 2, body_bytes_max: 8, ..Shape::default() }).unwrap()
        }
    }

    fn name(number: u16) -> Name {
        Name::new(1, 9, (number >> 8) as u8, number as u8)
    }

    fn head(to: Name) -> Head {
        let (from, kind, priority) = (Name::new(1, 7, 0, 1), Type::command(16), Priority(7));
        Head { to, from, len: 4, kind, id: 3, priority, ..Head::default() }
    }

    #[test]
    fn a_package_is_sent_on_as_it_is() {
        let ground = Ground::new();
        let mut receiver = ground.mailbox(name(0));
        let mut ways = Ways::new(&ground.join(), Reach::Here);
        ways.send(&head(name(0)), b"body").unwrap();
        let package = receiver.try_receive().unwrap();
        assert_eq!((package.head(), package.body()), (&head(name(0)), &b"body"[..]));
    }

    #[test]
    fn what_is_absent_is_found_when_it_comes_and_forgotten_when_it_goes() {
        let ground = Ground::new();
        let mut ways = Ways::new(&ground.join(), Reach::Here);
        for _ in 0..2 {
            assert!(matches!(ways.send(&head(name(0)), b"body"), Err(SendError::NoMailbox(_))));
            let mut receiver = ground.mailbox(name(0));
            ways.send(&head(name(0)), b"body").unwrap();
            assert!(receiver.try_receive().is_some());
            receiver.close();
        }
    }

    #[test]
    fn more_mailboxes_than_are_kept_open_are_all_reached() {
        let ground = Ground::new();
        let me = ground.join();
        let shape = Shape { slots: 2, body_bytes_max: 8, ..Shape::default() };
        let count = WAYS_MAX as u16 + 20;
        let mut receivers: Vec<_> = (0..count).map(|number| me.receiver(name(number), shape).unwrap()).collect();
        let mut ways = Ways::new(&ground.join(), Reach::Here);
        // The first is in use all the time, so it never gives way.
        for number in 0..count {
            ways.send(&head(name(number)), b"body").unwrap();
            assert!(receivers[usize::from(number)].try_receive().is_some());
            ways.send(&head(name(0)), b"body").unwrap();
            assert!(receivers[0].try_receive().is_some());
            assert!(ways.ways.len() <= WAYS_MAX && ways.ways.is_sorted_by_key(|way| way.to));
        }
        assert!(ways.ways.iter().any(|way| way.to == name(0)) && ways.ways.iter().all(|way| way.to != name(1)));
    }
}
