use super::*;
use proptest::prelude::*;
use rohrpost_mailbox::{Priority, Type};

const QUOTA: usize = 16 * BLOCK_BYTES;

fn waiting(id: u16, sender: u16, peer: NodeIndex, level: u8, len: usize) -> QueuedPackage {
    let head = Head { id, len: len as u16, priority: Priority(255 - level * 8), ..Head::default() };
    QueuedPackage { head, peer, sender, level, ..QueuedPackage::default() }
}

/// Queues a package; returns what was displaced for it, or itself.
fn push(queue: &mut Queue, id: u16, sender: u16, level: u8, len: usize) -> Vec<u16> {
    let mut gone = Vec::new();
    let body = vec![id as u8; len];
    let taken = queue.push(waiting(id, sender, id as u8 % 3, level, len), &body, |waiting, beginning| {
        assert_eq!(beginning, vec![waiting.head.id as u8; BLOCK_BYTES.min(waiting.head.len.into())]);
        gone.push(waiting.head.id);
    });
    gone.extend((!taken).then_some(id));
    gone
}

fn drain(queue: &mut Queue) -> Vec<u16> {
    let next = |queue: &mut Queue| {
        let place = queue.first()?;
        let QueuedPackage { head, .. } = *queue.at(place);
        let mut body = vec![0; head.len.into()];
        queue.read(place, &mut body);
        assert!(body.iter().all(|byte| *byte == head.id as u8), "the body is its own");
        Some(queue.remove(place).0.head.id)
    };
    std::iter::from_fn(|| next(queue)).collect()
}

#[test]
fn urgent_ones_go_first_and_equal_ones_in_order() {
    let mut queue = Queue::new(1, 3, QUOTA);
    for (id, level) in [(0, 31), (1, 4), (2, 4), (3, 0), (4, 31), (5, 4)] {
        assert_eq!(push(&mut queue, id, 0, level, 10), []);
    }
    assert_eq!(drain(&mut queue), [3, 1, 2, 5, 0, 4], "by level; in a level first in, first out, whatever the peer");
    assert!(queue.is_empty() && queue.used_bytes() == 0);
}

#[test]
fn a_sender_over_its_quota_loses_its_own_least_important_and_newest() {
    let mut queue = Queue::new(1, 3, QUOTA);
    for id in 0..16 {
        assert_eq!(push(&mut queue, id, 0, [20, 10][usize::from(id) % 2], 100), []);
    }
    for (id, level, len, gone, why) in [
        (16, 20, 100, vec![16], "it is of the least important level itself, and the newest"),
        (17, 21, 100, vec![17], "it is the least important"),
        (18, 19, 100, vec![14], "the newest of the least important"),
        (19, 10, 3 * BLOCK_BYTES, vec![12, 10, 8], "as many as it needs"),
        (20, 0, 16 * BLOCK_BYTES + 1, vec![20], "more than a quota, so nothing gives way for it"),
        (21, 10, 9 * BLOCK_BYTES, vec![21], "it would need some of its own level"),
    ] {
        assert_eq!(push(&mut queue, id, 0, level, len), gone, "{id}: {why}");
    }
    assert_eq!(drain(&mut queue), [1, 3, 5, 7, 9, 11, 13, 15, 19, 18, 0, 2, 4, 6]);
}

#[test]
fn no_sender_uses_up_anothers_memory() {
    let mut queue = Queue::new(3, 3, QUOTA);
    for id in 0..100 {
        push(&mut queue, id, 0, 0, 1000);
    }
    for id in 100..116 {
        assert_eq!(push(&mut queue, id, 1, 31, 1), [], "the other sender's flood leaves no trace");
    }
    assert_eq!(drain(&mut queue).len(), 4 + 16);
}

#[test]
fn every_package_that_gives_way_is_told() {
    let mut queue = Queue::new(1, 3, QUOTA);
    let told: usize = (0..64).map(|id| push(&mut queue, id, 0, 31 - id as u8 / 2, 100).len()).sum();
    assert_eq!(told + drain(&mut queue).len(), 64);
}

#[test]
fn what_has_left_in_part_does_not_give_way() {
    let mut queue = Queue::new(1, 3, QUOTA);
    assert_eq!(push(&mut queue, 0, 0, 31, 15 * BLOCK_BYTES), []);
    let place = queue.first().unwrap();
    queue.read(place, &mut [0; 100]);
    queue.part_left(place, 77);
    assert_eq!(push(&mut queue, 1, 0, 0, 2 * BLOCK_BYTES), [1]);
    assert_eq!(push(&mut queue, 2, 0, 0, BLOCK_BYTES), []);
    assert_eq!((queue.at(place).first, queue.at(place).fragments), (77, 1));
    let mut rest = vec![9; 15 * BLOCK_BYTES - 100];
    queue.read(place, &mut rest);
    assert!(rest.iter().all(|byte| *byte == 0));
    assert_eq!(queue.remove(place).0.head.id, 0);
    assert_eq!(drain(&mut queue), [2]);
}

#[test]
fn levels_of_a_peer_are_found_one_after_the_other() {
    let mut queue = Queue::new(1, 3, QUOTA);
    for (id, level) in [(0, 3), (3, 31), (1, 4)] {
        assert_eq!(push(&mut queue, id, 0, level, 0), []);
    }
    let found = |from| queue.next_level(0, from);
    assert_eq!([0, 3, 4, 31, 32].map(found), [Some(3), Some(3), Some(31), Some(31), None]);
    assert_eq!((queue.next_level(1, 0), queue.next_level(2, 0)), (Some(4), None));
}

/// Queues a package of a party's sender in a shared queue; returns what was displaced for it, or itself.
fn push_shared(queue: &mut Queue, id: u16, (party, sender): (u32, u32), level: u8) -> Vec<u16> {
    let share = QueueShare { sender, party };
    let new = QueuedPackage { share, sender: queue.sender_of(share), ..waiting(id, 0, 0, level, 200) };
    let mut gone = Vec::new();
    let taken = queue.push(new, &[0; 200], |waiting, _| gone.push(waiting.head.id));
    gone.extend((!taken).then_some(id));
    gone
}

#[test]
fn of_one_memory_each_sender_has_an_equal_part_whatever_its_level() {
    let mut queue = Queue::shared(QUOTA);
    (0..16).for_each(|id| assert_eq!(push_shared(&mut queue, id, (1, 1), 0), [], "alone it has all"));
    assert_eq!(push_shared(&mut queue, 16, (1, 1), 0), [16]);
    for (id, sender, gone) in [(20, 2, 15), (21, 2, 14), (22, 3, 13), (23, 2, 12), (24, 3, 11), (25, 4, 10)] {
        assert_eq!(push_shared(&mut queue, id, (1, sender), 31), [gone], "the largest user loses, to {id}");
    }
    for id in 30..34 {
        push_shared(&mut queue, id, (1, 2), 31);
    }
    let [one, two] = [0, 1].map(|sender| queue.used_by(sender) / BLOCK_BYTES as u64);
    assert!(one.abs_diff(two) <= 1, "{one} and {two}");
    assert_eq!(push_shared(&mut queue, 40, (1, 2), 31), [40], "beyond its part it is refused");
    assert_eq!(push_shared(&mut queue, 41, (1, 2), 0), [32], "or displaces what is less important of its own");
}

#[test]
fn on_one_line_parties_take_turns_and_within_one_importance_alone_counts() {
    // Two senders of one party, the first with urgent packages, and another party with the least important ones.
    let served = |parties: [u32; 2], window| {
        let mut queue = Queue::shared(QUOTA);
        (0..8).for_each(|id| assert_eq!(push_shared(&mut queue, id, (parties[0], 1), 0), []));
        (10..14).for_each(|id| assert_eq!(push_shared(&mut queue, id, (parties[1], 2), 31), []));
        let first = |_| {
            let place = queue.first_shared(window).unwrap();
            queue.serve(place).0.head.id
        };
        (0..12).map(first).collect::<Vec<_>>()
    };
    let by_level = [0, 1, 2, 3, 4, 5, 6, 7, 10, 11, 12, 13];
    assert_eq!(served([1, 1], 0), by_level, "one party");
    assert_eq!(served([1, 2], 10_000), by_level, "nobody is so far ahead");
    assert_eq!(served([1, 2], 0), [0, 10, 1, 11, 2, 12, 3, 13, 4, 5, 6, 7], "in turn");
    assert_eq!(served([1, 2], 300), [0, 1, 10, 2, 11, 3, 12, 4, 13, 5, 6, 7], "a little ahead");
}

#[test]
fn a_party_that_begins_to_wait_has_no_credit() {
    let mut queue = Queue::shared(QUOTA);
    let serve = |queue: &mut Queue| {
        let place = queue.first_shared(0).unwrap();
        queue.serve(place).0.head.id
    };
    (0..8).for_each(|id| assert_eq!(push_shared(&mut queue, id, (1, 1), 0), []));
    (0..4).for_each(|id| assert_eq!(serve(&mut queue), id));
    // The other was not served so far, and gets no more than turns from now on.
    (10..14).for_each(|id| assert_eq!(push_shared(&mut queue, id, (2, 2), 31), []));
    let order: Vec<u16> = (0..8).map(|_| serve(&mut queue)).collect();
    assert_eq!(order, [4, 10, 5, 11, 6, 12, 7, 13]);
    // Places of senders and parties are used again.
    for id in 0..1000 {
        assert_eq!(push_shared(&mut queue, id, (id.into(), id.into()), 0), []);
        serve(&mut queue);
    }
    assert!(queue.senders.len() < 5, "{} places", queue.senders.len());
}

/// A slow and simple model of the queue's promises.
#[derive(Default)]
struct Model {
    waiting: Vec<QueuedPackage>,
}

impl Model {
    fn pop_first(&mut self) -> Option<QueuedPackage> {
        let at = (0..self.waiting.len()).min_by_key(|at| (self.waiting[*at].level, *at))?;
        Some(self.waiting.remove(at))
    }

    /// Pushes a package; returns what was displaced for it, or itself.
    fn push(&mut self, new: QueuedPackage) -> Vec<QueuedPackage> {
        let blocks = |waiting: &QueuedPackage| usize::from(waiting.head.len).div_ceil(BLOCK_BYTES).max(1);
        let is_its_own = |waiting: &&QueuedPackage| waiting.sender == new.sender;
        let used = |all: &[QueuedPackage]| all.iter().filter(is_its_own).map(blocks).sum::<usize>();
        let is_older =
            |old: &QueuedPackage| counts_newest(&new.head) && (old.level, old.head.id) == (new.level, new.head.id);
        let older = self.waiting.iter().find(|old| is_older(old));
        let more = older.map_or(blocks(&new), |older| blocks(&new).saturating_sub(blocks(older)));
        let yields = |waiting: &&QueuedPackage| waiting.level > new.level;
        let yielding: usize = self.waiting.iter().filter(is_its_own).filter(yields).map(blocks).sum();
        if used(&self.waiting) - yielding + more > QUOTA / BLOCK_BYTES {
            return vec![new];
        }
        let mut gone = Vec::new();
        while used(&self.waiting) + more > QUOTA / BLOCK_BYTES {
            let own = self.waiting.iter().enumerate().filter(|(_, waiting)| is_its_own(waiting));
            let (at, _) = own.max_by_key(|(at, waiting)| (waiting.level, *at)).unwrap();
            gone.push(self.waiting.remove(at));
        }
        match self.waiting.iter_mut().find(|old| is_older(old)) {
            Some(old) => *old = new,
            None => self.waiting.push(new),
        }
        gone
    }
}

proptest! {
    #[test]
    fn it_does_what_the_slow_and_simple_one_does(
        steps in prop::collection::vec((0u16..3, 0u8..32, 0usize..2000, any::<bool>()), 1..200),
    ) {
        let (mut queue, mut model) = (Queue::new(3, 3, QUOTA), Model::default());
        for (id, (sender, level, len, take)) in steps.into_iter().enumerate() {
            let id = id as u16;
            let gone = push(&mut queue, id, sender, level, len);
            let displaced = model.push(waiting(id, sender, id as u8 % 3, level, len));
            prop_assert!(displaced.iter().map(|waiting| waiting.head.id).eq(gone));
            if take {
                let first = queue.first().map(|place| queue.remove(place).0.head.id);
                prop_assert_eq!(first, model.pop_first().map(|waiting| waiting.head.id));
            }
        }
        let rest: Vec<u16> = std::iter::from_fn(|| model.pop_first()).map(|waiting| waiting.head.id).collect();
        prop_assert_eq!(drain(&mut queue), rest);
        prop_assert_eq!(queue.used_bytes(), 0);
    }

    #[test]
    fn what_is_replaced_keeps_its_place_and_the_rest_is_as_without(
        steps in prop::collection::vec((0u16..6, 8u8..10, 0usize..2000, any::<bool>()), 1..200),
    ) {
        let (mut queue, mut model) = (Queue::shared(QUOTA), Model::default());
        for (tag, (state, level, len, take)) in steps.into_iter().enumerate() {
            // Of states from 3 on each value counts.
            let head = Head {
                kind: Type::data(1),
                id: state,
                len: len as u16,
                options: if state < 3 { Options::NEWEST } else { Options::default() },
                ..Head::default()
            };
            let sender = queue.sender_of(QueueShare::default());
            let new = QueuedPackage { head, level, sender, first: tag as u64, ..QueuedPackage::default() };
            let body = vec![tag as u8; len];
            let mut gone = Vec::new();
            let tell = |waiting: &QueuedPackage, _: &[u8]| gone.push(waiting.first);
            let taken = match queue.older(&new) {
                Some(older) => queue.replace(older, new, &body, tell),
                None => queue.push(new, &body, tell),
            };
            gone.extend((!taken).then_some(tag as u64));
            prop_assert!(model.push(new).iter().map(|waiting| waiting.first).eq(gone));
            if take && let Some(place) = queue.first() {
                let QueuedPackage { head, first, .. } = *queue.at(place);
                let mut body = vec![0; head.len.into()];
                queue.read(place, &mut body);
                prop_assert!(body.iter().all(|byte| *byte == first as u8));
                queue.remove(place);
                prop_assert_eq!(model.pop_first().map(|waiting| waiting.first), Some(first));
            }
            prop_assert_eq!(queue.len(), model.waiting.len());
        }
        while let Some(place) = queue.first() {
            let (waiting, _) = queue.remove(place);
            prop_assert_eq!(model.pop_first().map(|waiting| waiting.first), Some(waiting.first));
        }
        prop_assert_eq!((queue.used_bytes(), queue.len()), (0, 0));
    }
}
