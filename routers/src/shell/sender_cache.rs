//! Open mailboxes that a thread of the router sends to: a search in a small table replaces a system call.

use super::hosted::HostedNames;
use rohrpost_mailbox::{Head, Label, Name, Participant, SendError, Sender};
use std::sync::Arc;

/// Mailboxes kept open; the least recently used is closed first.
const WAYS_MAX: usize = 512;
/// Remembered names without a mailbox; others are looked up each time.
const ABSENT_MAX: usize = 64;

/// Where packages may go.
enum Reach {
    /// To mailboxes that configuration gives this node: packages from other nodes must not go back.
    Here(HostedNames),
    /// Also through this node's own router. Programs of this node choose the names. The absent ones hold while the
    /// registry has this epoch.
    Everywhere { absent: Vec<Name>, epoch: u32 },
}

struct CachedSender {
    to: Name,
    sender: Sender,
    used: u64,
}

/// Cache of senders to mailboxes.
pub(crate) struct SenderCache {
    participant: Arc<Participant>,
    reach: Reach,
    /// By name.
    sender_cache: Vec<CachedSender>,
    /// Counts packages, to find the least recently used sender.
    packages: u64,
    /// Lookups of mailboxes so far.
    #[cfg(test)]
    looks: u64,
}

impl SenderCache {
    /// A cache for mailboxes of this node alone, of these ranges.
    pub(crate) fn here(participant: &Arc<Participant>, hosts: &[(Name, Name)]) -> Self {
        Self::new(participant, Reach::Here(HostedNames::new(hosts)))
    }

    /// A cache for all mailboxes that are reached.
    pub(crate) fn everywhere(participant: &Arc<Participant>) -> Self {
        Self::new(participant, Reach::Everywhere { absent: Vec::with_capacity(ABSENT_MAX), epoch: 0 })
    }

    fn new(participant: &Arc<Participant>, reach: Reach) -> Self {
        Self {
            participant: participant.clone(),
            reach,
            sender_cache: Vec::with_capacity(WAYS_MAX),
            packages: 0,
            #[cfg(test)]
            looks: 0,
        }
    }

    /// Sends a package on, unchanged, to the mailbox in its head.
    pub(crate) fn send(&mut self, head: &Head, body: &[u8]) -> Result<(), SendError> {
        self.send_by(head.to, head, body)
    }

    /// Sends through a mailbox that is known to lead there: only that one is looked up.
    pub(crate) fn send_by(&mut self, router: Name, head: &Head, body: &[u8]) -> Result<(), SendError> {
        let Head { to, from, kind, id, priority, options, .. } = *head;
        let at = match self.sender_cache.binary_search_by_key(&router, |way| way.to) {
            Ok(at) => at,
            Err(at) => self.open(router, at)?,
        };
        self.packages += 1;
        self.sender_cache[at].used = self.packages;
        self.sender_cache[at].sender.readdress(to);
        let sent = self.sender_cache[at].sender.send(&Label { from, kind, id, priority, options }, &[body]);
        if let Err(SendError::NoMailbox(_) | SendError::NoRouter { .. } | SendError::Bad(..)) = sent {
            // Its memory has no owner any more.
            self.sender_cache.remove(at);
        }
        sent
    }

    #[cold]
    fn open(&mut self, to: Name, at: usize) -> Result<usize, SendError> {
        // Read before the lookup: a change meanwhile makes this epoch an old one.
        let now = self.participant.node().registry_epoch();
        let may_be_there = match &mut self.reach {
            Reach::Here(hosted) => hosted.may_be_there(to, now),
            Reach::Everywhere { absent, epoch } => {
                if *epoch != now {
                    absent.clear();
                    *epoch = now;
                }
                !absent.contains(&to)
            }
        };
        if !may_be_there {
            return Err(SendError::NoMailbox(to));
        }
        #[cfg(test)]
        {
            self.looks += 1;
        }
        let opened = match &mut self.reach {
            Reach::Here(_) => self.participant.sender_here(to),
            Reach::Everywhere { .. } => self.participant.sender(to),
        };
        let sender = opened.inspect_err(|error| match &mut self.reach {
            Reach::Here(hosted) if matches!(error, SendError::NoMailbox(_)) => hosted.is_absent(to),
            Reach::Everywhere { absent, .. }
                if matches!(error, SendError::NoMailbox(_)) && absent.len() < ABSENT_MAX =>
            {
                absent.push(to);
            }
            _ => {}
        })?;
        let at = if self.sender_cache.len() < WAYS_MAX { at } else { self.make_room(to) };
        self.sender_cache.insert(at, CachedSender { to, sender, used: 0 });
        Ok(at)
    }

    /// Closes the least recently used sender; returns where that of `to` belongs now.
    fn make_room(&mut self, to: Name) -> usize {
        if let Some((oldest, _)) = self.sender_cache.iter().enumerate().min_by_key(|(_, way)| way.used) {
            self.sender_cache.remove(oldest);
        }
        self.sender_cache.partition_point(|way| way.to < to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::TestNode;
    use rohrpost_mailbox::{Priority, Shape, Type};

    fn name(number: u16) -> Name {
        Name::new(1, 9, (number >> 8) as u8, number as u8)
    }

    fn head(to: Name) -> Head {
        let (from, kind, priority) = (Name::new(1, 7, 0, 1), Type::command(16), Priority(7));
        Head { to, from, len: 4, kind, id: 3, priority, ..Head::default() }
    }

    #[test]
    fn a_package_is_sent_on_as_it_is() {
        let ground = TestNode::new();
        let mut receiver = ground.mailbox(name(0), 2, 8);
        let mut sender_cache = SenderCache::here(&ground.join(), &[(name(0), name(u16::MAX))]);
        sender_cache.send(&head(name(0)), b"body").unwrap();
        let package = receiver.try_receive().unwrap();
        assert_eq!((package.head(), package.body()), (&head(name(0)), &b"body"[..]));
    }

    #[test]
    fn what_is_absent_is_found_when_it_comes_and_forgotten_when_it_goes() {
        let ground = TestNode::new();
        let mut sender_cache = SenderCache::here(&ground.join(), &[(name(0), name(u16::MAX))]);
        for _ in 0..2 {
            assert!(matches!(sender_cache.send(&head(name(0)), b"body"), Err(SendError::NoMailbox(_))));
            let mut receiver = ground.mailbox(name(0), 2, 8);
            sender_cache.send(&head(name(0)), b"body").unwrap();
            assert!(receiver.try_receive().is_some());
            receiver.close();
        }
    }

    #[test]
    fn whatever_names_others_write_each_is_looked_for_once_and_those_of_nobody_never() {
        let ground = TestNode::new();
        let (first, last) = (name(0), name(999));
        let mut sender_cache = SenderCache::here(&ground.join(), &[(first, last)]);
        for _ in 0..3 {
            for number in 0..4000 {
                assert!(matches!(sender_cache.send(&head(name(number)), b"body"), Err(SendError::NoMailbox(_))));
            }
        }
        assert_eq!(sender_cache.looks, 1000, "each of its own once");
        let mut receiver = ground.mailbox(name(998), 2, 8);
        sender_cache.send(&head(name(998)), b"body").unwrap();
        assert!(receiver.try_receive().is_some(), "what has come since is found");
    }

    #[test]
    fn names_that_a_router_leads_to_are_not_looked_for() {
        let ground = TestNode::new();
        let router = Name::new(1, 250, 0, 3);
        let mut transit = ground.mailbox(router, 2, 8);
        let mut sender_cache = SenderCache::everywhere(&ground.join());
        for number in 0..2000 {
            sender_cache.send_by(router, &head(name(number)), b"body").unwrap();
            assert_eq!(transit.try_receive().unwrap().head(), &head(name(number)));
        }
        assert_eq!((sender_cache.looks, sender_cache.sender_cache.len()), (1, 1), "but for the router's mailbox");
    }

    #[test]
    fn more_mailboxes_than_are_kept_open_are_all_reached() {
        let ground = TestNode::new();
        let me = ground.join();
        let shape = Shape { slots: 2, body_bytes_max: 8, ..Shape::default() };
        let count = WAYS_MAX as u16 + 20;
        let mut receivers: Vec<_> = (0..count).map(|number| me.receiver(name(number), shape).unwrap()).collect();
        let mut sender_cache = SenderCache::here(&ground.join(), &[(name(0), name(u16::MAX))]);
        // The first is in use all the time, so it is never closed.
        for number in 0..count {
            sender_cache.send(&head(name(number)), b"body").unwrap();
            assert!(receivers[usize::from(number)].try_receive().is_some());
            sender_cache.send(&head(name(0)), b"body").unwrap();
            assert!(receivers[0].try_receive().is_some());
            assert!(
                sender_cache.sender_cache.len() <= WAYS_MAX && sender_cache.sender_cache.is_sorted_by_key(|way| way.to)
            );
        }
        assert!(
            sender_cache.sender_cache.iter().any(|way| way.to == name(0))
                && sender_cache.sender_cache.iter().all(|way| way.to != name(1))
        );
    }
}
