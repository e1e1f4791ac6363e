//! Hostile datagrams: they are refused, or change nothing that a module could notice.

use crate::frame::{FrameHead, FrameKind};
use crate::harness::time_settings;
use crate::time::message::{MESSAGE_BYTES, Reply, Request, Sync, TimeMessage};
use crate::time::{Allowed, Clock, InSlots, SentId, Stamp, Step, TIME_BYTES, Term, TimeSettings};
use proptest::prelude::*;
use std::time::Duration;

const KINDS: [FrameKind; 4] = [FrameKind::Sync, FrameKind::WarmUp, FrameKind::Request, FrameKind::Reply];

fn settings() -> TimeSettings {
    time_settings(1, &[0, 1], Duration::from_millis(100))
}

fn head(kind: FrameKind, from: u8) -> FrameHead {
    FrameHead { kind, system: 1, from, to: 1, digest: 7, incarnation: 5, sequence: 0 }
}

/// Numbers at the edges, and near each other, so that they match now and then.
fn number() -> impl Strategy<Value = u64> {
    prop_oneof![0..4_u64, 250..260_u64, 500..520_u64, Just(u64::MAX), Just(i64::MAX as u64), any::<u64>()]
}

fn message() -> impl Strategy<Value = TimeMessage> {
    let numbers = (number(), number(), number(), number(), number(), number(), number(), number());
    let flags = (any::<bool>(), any::<bool>(), any::<bool>(), any::<u32>(), 0..4_usize);
    (numbers, flags).prop_map(|((id, a, b, c, error_ns, epoch, term, began), (x, y, z, doubt_ns, kind))| {
        let (term, began) = (Term(term), Term(began));
        match kind {
            0 => {
                let (cycle, nominal_ns, sent_ns, followed, replacement) = (a, b, c, x, y);
                let times = Sync { cycle, nominal_ns, sent_ns, error_ns, ..Sync::default() };
                TimeMessage::Sync(Sync { id, epoch, term, began, followed, replacement, ..times })
            }
            1 => TimeMessage::WarmUp,
            2 => TimeMessage::Request(Request { id, sent_ns: c, error_ns, epoch, term, eager: x, far: y, timed: z }),
            _ => TimeMessage::Reply(Reply {
                id,
                sync_ns: a,
                request_ns: b,
                sent_ns: c,
                error_ns,
                epoch,
                term,
                began,
                doubt_ns,
                sync_by_kernel: x,
                request_by_kernel: y,
            }),
        }
    })
}

proptest! {
    #[test]
    fn a_message_that_is_taken_has_these_bytes_and_no_others(message in message()) {
        let bytes = message.to_bytes();
        if let Ok(parsed) = TimeMessage::parse(message.kind(), &bytes) {
            prop_assert_eq!(parsed, message);
        }
    }

    #[test]
    fn any_bytes_are_a_message_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..100), kind in 0..4_usize) {
        if let Ok(message) = TimeMessage::parse(KINDS[kind], &bytes) {
            prop_assert_eq!(message.to_bytes().to_vec(), bytes);
        }
    }

    #[test]
    fn a_clock_survives_whatever_it_is_told_and_never_goes_back(
        told in prop::collection::vec(
            (message(), prop_oneof![Just(0_u8), Just(2)], 0..200_000_000_u64, 0..300_000_000_u64),
            1..60,
        ),
        in_slots in any::<bool>(),
    ) {
        let mut now_ns = 1_000_000_000;
        let mut clock = Clock::new(settings(), now_ns, 1_790_000_000_000_000_000, None);
        if in_slots {
            clock = clock.in_slots(InSlots {
                warm_ups: true,
                replies_in_synchronisation: false,
                delay_max_ns: 30_000,
                allowance_ns: 60_000,
                slot_every_ns: 5_000_000,
                asks_every_ns: 5_000_000,
                hello_every_ns: 20_000_000,
            });
        }
        let mut last = clock.reading(now_ns).time;
        for (message, from, waits_ns, came_before_ns) in told {
            now_ns += waits_ns;
            let came = Stamp { ns: now_ns - came_before_ns.min(now_ns), doubt_ns: 50, by_kernel: true };
            let _ = clock.handle(now_ns, came, &head(message.kind(), from), &message.to_bytes());
            let mut datagram = [0; TIME_BYTES];
            for sent in 0.. {
                prop_assert!(sent < 100, "it sends without end");
                let step = match sent % 3 {
                    _ if !in_slots => clock.poll(now_ns, &mut datagram),
                    0 => clock.poll_in(now_ns, Allowed::Slot, &mut datagram),
                    1 => {
                        let allowed = Allowed::Synchronisation { cycle: now_ns, nominal_ns: now_ns };
                        clock.poll_in(now_ns, allowed, &mut datagram)
                    }
                    _ => clock.poll_in(now_ns, Allowed::Nothing, &mut datagram),
                };
                match step {
                    Step::Send { stamp: Some(SentId { to, sequence }), .. } => {
                        clock.sent(SentId { to, sequence }, Stamp { ns: now_ns + 10, doubt_ns: 50, by_kernel: true });
                    }
                    Step::Send { .. } => {}
                    Step::Wait { until_ns } => {
                        prop_assert!(until_ns >= now_ns);
                        break;
                    }
                }
            }
            let time = clock.reading(now_ns).time;
            prop_assert!(
                time.epoch > last.epoch || (time.epoch == last.epoch && time.ns >= last.ns),
                "{:?} {:?}",
                last,
                time
            );
            last = time;
        }
    }
}

#[test]
fn a_reply_to_another_question_changes_nothing() {
    let mut clock = Clock::new(settings(), 0, 0, None);
    let sync = |id, ns| {
        let (cycle, nominal_ns, sent_ns) = (0, ns, ns);
        let (error_ns, epoch, term, began) = (0, 1, Term::new(1, 0), Term::new(1, 0));
        TimeMessage::Sync(Sync { id, cycle, nominal_ns, sent_ns, error_ns, epoch, term, began, ..Sync::default() })
    };
    let reply = |id| {
        let (sync_ns, request_ns, sent_ns) = (5_000_000, 5_200_000, 5_300_000);
        let reply = Reply { id, sync_ns, request_ns, sent_ns, epoch: 1, ..Reply::default() };
        TimeMessage::Reply(Reply { term: Term::new(1, 0), began: Term::new(1, 0), ..reply })
    };
    let mut tell = |now_ns: u64, message: TimeMessage| {
        let taken = clock.handle(now_ns, Stamp::by_us(now_ns), &head(message.kind(), 0), &message.to_bytes());
        let mut datagram = [0; TIME_BYTES];
        while let Step::Send { .. } = clock.poll(now_ns, &mut datagram) {}
        taken.is_ok()
    };
    assert!(tell(10_000_000, sync(1, 5_000_000)));
    assert!(!tell(10_400_000, reply(2)), "nobody asked");
    assert!(tell(10_400_000, reply(1)));
    assert!(!tell(10_400_000, reply(1)), "answered already");
    assert!(!tell(10_500_000, sync(1, 5_000_000)), "twice");
    assert!(!tell(10_500_000, TimeMessage::Request(Request { id: 3, ..Request::default() })), "it is no master");
    assert_eq!(MESSAGE_BYTES, 72);
}

#[test]
fn a_node_too_far_off_gets_an_epoch_though_it_followed_a_later_term() {
    let mut clock = Clock::new(settings(), 0, 0, None);
    let mut datagram = [0; TIME_BYTES];
    // It hears no other node, and becomes master.
    let syncs = (1..100).map(|n| n * 10_000_000).find_map(|now_ns| {
        while let Step::Send { to, .. } = clock.poll(now_ns, &mut datagram) {
            let (head, rest) = FrameHead::parse(&datagram).unwrap();
            if let (2, Ok(TimeMessage::Sync(sync))) = (to, TimeMessage::parse(head.kind, rest)) {
                return Some((now_ns, sync));
            }
        }
        None
    });
    let (now_ns, sync) = syncs.unwrap();
    let later = Term::new(sync.term.round() + 3, 0);
    let request = Request { id: sync.id, epoch: sync.epoch, term: later, far: true, ..Request::default() };
    let message = TimeMessage::Request(request);
    clock.handle(now_ns, Stamp::by_us(now_ns), &head(message.kind(), 2), &message.to_bytes()).unwrap();
    assert!(clock.term() > later, "all take it for the latest");
    assert_eq!(clock.record().epoch, sync.epoch + 1);
}
