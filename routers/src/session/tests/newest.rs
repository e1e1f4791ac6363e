//! Data of which only the newest counts, on their way through a connection that takes nothing for a while.

use super::ground::frames;
use super::plan::{QUOTA, module};
use super::world::{MS, S};
use crate::queue::QueueShare;
use crate::session::counts::Cause;
use crate::session::frame::SessionMessage;
use crate::session::outgoing::{Fates, Outgoing, Parcel};
use rohrpost_mailbox::{Head, Options, Priority, Type};

const DATA: Type = Type::data(1);
const COMMAND: Type = Type::command(16);

/// What became of packages, by the first byte of their bodies where that is known, else by id.
#[derive(Default)]
struct Log {
    passed: usize,
    replaced: Vec<u16>,
    lost: Vec<(u16, Cause)>,
}

impl Fates for Log {
    fn passed(&mut self, _: &Head) {
        self.passed += 1;
    }

    fn replaced(&mut self, head: &Head) {
        self.replaced.push(head.id);
    }

    fn lost(&mut self, head: &Head, _: &[u8], cause: Cause) {
        self.lost.push((head.id, cause));
    }
}

/// An end with a connection that takes nothing.
struct Stalled {
    outgoing: Outgoing,
    log: Log,
    now_ns: u64,
}

impl Stalled {
    fn new() -> Self {
        Self { outgoing: Outgoing::new(QUOTA), log: Log::default(), now_ns: 10 * S }
    }

    fn send(&mut self, head: Head, value: u8, len: usize) {
        let head = Head { to: module(0), priority: Priority(60), len: len as u16, ..head };
        let body = vec![value; len];
        let (published_ns, share) = (self.now_ns, QueueShare::default());
        let parcel = Parcel { head: &head, body: &body, published_ns, hops: 0, level: 8, share };
        self.outgoing.accept(None, &parcel, &mut self.log);
    }

    /// The connection takes all: what leaves, by id and value.
    fn leaves(&mut self) -> Vec<(u16, u8)> {
        let mut left = Vec::new();
        while self.outgoing.has_waiting() || !self.outgoing.ready().is_empty() {
            self.outgoing.refill(self.now_ns, 0, &mut self.log);
            let bytes = self.outgoing.ready().to_vec();
            self.outgoing.took(bytes.len());
            for (_, message) in frames(&bytes) {
                let SessionMessage::Package(carried) = message else { panic!("no package") };
                assert!(carried.body.iter().all(|byte| *byte == carried.body[0]), "the body is its own");
                left.push((carried.head.id, carried.body[0]));
            }
        }
        left
    }
}

fn newest(id: u16) -> Head {
    Head { kind: DATA, id, from: module(1), options: Options::NEWEST, ..Head::default() }
}

#[test]
fn of_data_of_which_only_the_newest_counts_that_goes_in_the_place_of_the_first() {
    let mut end = Stalled::new();
    end.send(newest(1), 10, 100);
    end.send(Head { kind: COMMAND, id: 7, from: module(1), ..Head::default() }, 70, 50);
    end.send(newest(2), 20, 100);
    for (value, len) in [(11, 3000), (12, 1), (13, 400)] {
        end.send(newest(1), value, len);
    }
    assert_eq!(end.log.replaced, [1, 1, 1]);
    assert_eq!(end.leaves(), [(1, 13), (7, 70), (2, 20)], "in the place of the first");
    // What has left is not replaced.
    end.send(newest(1), 14, 100);
    assert_eq!((end.leaves(), end.log.replaced.len(), end.log.passed), (vec![(1, 14)], 3, 4));
    assert_eq!(end.log.lost, []);
}

#[test]
fn nothing_else_is_replaced() {
    let unmarked = Head { options: Options::default(), ..newest(1) };
    let all = [
        (newest(1), "the first"),
        (newest(2), "another subscription"),
        (Head { kind: Type::data(2), ..newest(1) }, "another type"),
        (Head { from: module(2), ..newest(1) }, "another sender"),
        (unmarked, "each value counts"),
        (unmarked, "each of them"),
        (Head { kind: COMMAND, ..newest(1) }, "a command, such as the one that subscribes"),
        (Head { kind: COMMAND, ..newest(1) }, "a command that is repeated"),
        (Head { kind: Type::reply(16), ..newest(1) }, "an answer"),
        (Head { kind: Type::reply(16), ..newest(1) }, "and another"),
    ];
    let mut end = Stalled::new();
    for ((head, _), value) in all.into_iter().zip(0..) {
        end.send(head, value, 10);
    }
    let left: Vec<u8> = end.leaves().into_iter().map(|(_, value)| value).collect();
    let kept = all.iter().zip(0..).filter(|(_, value)| !left.contains(value));
    let missing: Vec<&str> = kept.map(|((_, what), _)| *what).collect();
    assert_eq!((missing, end.log.replaced), (vec![], vec![]));
}

#[test]
fn what_stands_behind_a_fresh_one_is_given_up_in_time() {
    let mut end = Stalled::new();
    end.send(newest(1), 1, 10);
    end.send(Head { kind: COMMAND, id: 7, from: module(1), ..Head::default() }, 70, 10);
    end.now_ns += S;
    end.send(newest(1), 2, 10);
    end.now_ns += 600 * MS;
    end.outgoing.look(end.now_ns, Cause::Stale, &mut end.log);
    assert_eq!(end.log.lost, [(7, Cause::Stale)], "though what stands before it is fresh");
    assert_eq!(end.leaves(), [(1, 2)]);
}

#[test]
fn of_more_states_than_have_hints_the_newest_goes_last() {
    let mut end = Stalled::new();
    for value in 0..3 {
        for id in 0..250 {
            end.send(newest(id), value, 10);
        }
    }
    let left = end.leaves();
    assert_eq!(left.len() + end.log.replaced.len() + end.log.lost.len(), 750);
    assert!(end.log.replaced.len() > 400, "{} of 500", end.log.replaced.len());
    for id in 0..250 {
        let of_id = left.iter().filter(|(left, _)| *left == id).map(|(_, value)| *value);
        let is_full = end.log.lost.contains(&(id, Cause::Full));
        assert!(of_id.clone().is_sorted() && (is_full || of_id.max() == Some(2)), "{id}");
    }
}
