//! A receiver that lives and reads nothing.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, HIGH, LOW, MAILBOX, PATIENCE, accounted, label, lost, shape, tell, until};
use rohrpost_mailbox::{Loss, OverflowPolicy, SendError, Shape};

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    let full = OverflowPolicy::ALL.into_iter().find(|full| full.name() == role).unwrap();
    let mut receiver = ground.join().receiver(MAILBOX, Shape { full, ..shape(4) }).unwrap();
    tell("there");
    while let Some(package) = receiver.receive_timeout(PATIENCE) {
        let id = package.head().id;
        // Stopped from here on, it has none in hand.
        drop(package);
        tell(id);
    }
}

fn stands(pid: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
    stat.rsplit_once(") ").unwrap().1.starts_with('T')
}

#[test]
fn a_receiver_that_stops_reading_costs_what_is_counted_and_gets_the_rest_when_it_goes_on() {
    for full in OverflowPolicy::ALL {
        let ground = Ground::new();
        let receiver = ground.start(full.name());
        assert_eq!(receiver.hear(), "there");
        let mut sender = ground.sender();
        sender.send(&label(LOW, 0), &[]).unwrap();
        assert_eq!(receiver.hear(), "0");
        receiver.signal(libc::SIGSTOP);
        until("it stands", || stands(receiver.id()));
        let mut send = |priority, ids: std::ops::Range<u16>| {
            let sent = ids.map(|id| sender.send(&label(priority, id), &[]));
            sent.filter(|sent| match sent {
                Ok(()) => true,
                Err(error) => {
                    assert!(matches!(error, SendError::Full(MAILBOX)), "{error}");
                    false
                }
            })
            .count()
        };
        assert_eq!(send(LOW, 1..11), 4, "as many as there are slots, and nobody waits");
        let (urgent, displaced) = if full == OverflowPolicy::Reject { (0, 0) } else { (4, 4) };
        assert_eq!(send(HIGH, 11..17), urgent, "{full:?}: none gives way to its like");
        let info = ground.look();
        assert_eq!((info.depth, info.owner), (4, Some(receiver.id())));
        assert_eq!(lost(&info, Loss::Displaced), displaced, "{full:?}");
        assert_eq!(lost(&info, Loss::Refused), 16 - 4 - urgent as u64, "{full:?}: senders were told");
        assert_eq!(info.sent, accounted(&info));
        receiver.signal(libc::SIGCONT);
        let first = if full == OverflowPolicy::Reject { 1 } else { 11 };
        for id in first..first + 4 {
            assert_eq!(receiver.hear(), id.to_string(), "{full:?}");
        }
        sender.send(&label(LOW, 99), &[]).unwrap();
        assert_eq!(receiver.hear(), "99", "all is as before");
        until("the last is counted", || ground.look().depth == 0);
        let info = ground.look();
        assert_eq!(info.sent, accounted(&info));
        receiver.kill();
    }
}
