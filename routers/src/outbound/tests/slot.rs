//! Datagrams in a time slot.

use super::{ids, to};
use crate::counts::Cause;
use crate::frame::{ALIVE_BYTES, HEAD_BYTES, NodeIndex};
use crate::harness::{End, MS, START, slot, tdma};
use crate::link::ALIVE_EVERY_NS;
use crate::outbound::{DIRECT_HEAD_BYTES, WAIT_MAX_NS};
use crate::settings::Settings;
use rohrpost_mailbox::Priority;
use rohrpost_network::Tdma;

/// Slots of node 0 of these lengths, µs, on a wire of 100 Mbit/s.
pub(super) fn table(lengths_us: &[u64]) -> Tdma {
    let slots = (0..).zip(lengths_us).map(|(at, length_us)| slot(0, 1000 * (at + 1), *length_us));
    Tdma { link_bytes_s: 12_500_000, ..tdma([10_000, 300, 100], slots.collect()) }
}

fn in_slots(lengths_us: &'static [u64]) -> End {
    End::new(0, |settings: &mut Settings| settings.tdma = Some(table(lengths_us)))
}

impl End {
    /// Datagrams of a slot with this limit of each, and this limit of all together.
    fn slot(&mut self, now_ns: u64, room_bytes: usize) -> Vec<(NodeIndex, Vec<u8>)> {
        self.slot_before(now_ns, room_bytes, None)
    }

    /// The same while the first in the mailbox has this priority.
    fn slot_before(
        &mut self,
        now_ns: u64,
        mut room_bytes: usize,
        behind: Option<Priority>,
    ) -> Vec<(NodeIndex, Vec<u8>)> {
        let mut all = Vec::new();
        let mut datagram = vec![0; self.settings.network.datagram_bytes_max];
        while let Some((to, bytes)) =
            self.outbound.poll_slot(now_ns, (room_bytes, &mut datagram), behind, &mut self.log)
        {
            assert!(bytes <= room_bytes, "{bytes} B in {room_bytes} B");
            all.push((to, datagram[..bytes].to_vec()));
            room_bytes -= bytes;
        }
        all
    }

    fn ids_in_slot(&mut self, now_ns: u64, room_bytes: usize) -> Vec<(NodeIndex, Vec<u16>)> {
        let all = self.slot(now_ns, room_bytes);
        all.iter().map(|(to, datagram)| (*to, ids(datagram))).filter(|(_, ids)| !ids.is_empty()).collect()
    }
}

#[test]
fn a_package_that_does_not_fit_is_passed_by_no_less_important_one() {
    let mut end = in_slots(&[1000]);
    for (peer, priority, len) in [(1, 10, 10), (1, 90, 900), (2, 90, 600), (2, 20, 10)] {
        end.queue(START, to(peer, priority), &vec![0; len]);
    }
    // 1 leaves alone, since 2 waits for the other peer. 2 does not fit behind it; 0 and 3 would, and are less
    // important.
    assert_eq!(end.ids_in_slot(START, 1472), [(1, vec![1])]);
    assert_eq!(end.ids_in_slot(START, DIRECT_HEAD_BYTES + 599), []);
    assert_eq!(end.ids_in_slot(START, 1472), [(2, vec![2, 3]), (1, vec![0])]);
    // Behind the first of its level that does not fit into the datagram nothing else goes.
    for (priority, len) in [(90, 700), (90, 800), (10, 10)] {
        end.queue(START, to(1, priority), &vec![0; len]);
    }
    assert_eq!(end.ids_in_slot(START, 1472), [(1, vec![4])]);
    assert_eq!(end.ids_in_slot(START, 1472), [(1, vec![5, 6])]);
    end.assert_balanced();
}

#[test]
fn a_datagram_leaves_only_if_it_fits() {
    let mut end = in_slots(&[1000]);
    for len in [400, 500, 100] {
        end.queue(START, to(1, 90), &vec![0; len]);
    }
    let exactly = DIRECT_HEAD_BYTES + 400;
    for (room, leaves) in [(0, vec![]), (exactly - 1, vec![]), (exactly, vec![(1, vec![0])])] {
        assert_eq!(end.ids_in_slot(START, room), leaves, "{room} B");
    }
    assert_eq!(end.ids_in_slot(START, 1472), [(1, vec![1, 2])]);
    end.assert_balanced();
}

#[test]
fn company_is_no_less_important_than_what_waits_for_others() {
    let mut end = in_slots(&[1000]);
    for (peer, priority) in [(1, 200), (1, 90), (1, 40), (2, 90), (2, 10)] {
        end.queue(START, to(peer, priority), b"small");
    }
    // A package as important as the one that waits for another peer goes along; a less important one does not.
    assert_eq!(end.ids_in_slot(START, 1472), [(1, vec![0, 1]), (2, vec![3]), (1, vec![2]), (2, vec![4])]);
    end.assert_balanced();
}

#[test]
fn company_is_no_less_important_than_what_waits_in_the_mailbox() {
    let mut end = in_slots(&[1000]);
    for priority in [200, 90, 88, 40] {
        end.queue(START, to(1, priority), b"small");
    }
    let all = end.slot_before(START, 1472, Some(Priority(90)));
    let ids: Vec<_> = all.iter().map(|(_, datagram)| ids(datagram)).filter(|ids| !ids.is_empty()).collect();
    // Packages of the level of the first in the mailbox go along; the rest is asked for again when that was accepted.
    assert_eq!(ids, [vec![0, 1, 2], vec![3]]);
    end.assert_balanced();
}

#[test]
fn parts_go_on_in_the_next_slot_and_the_urgent_goes_between_them() {
    let mut end = in_slots(&[1000]);
    end.queue(START, to(1, 90), &[1; 5000]);
    end.queue(START, to(2, 10), b"less important");
    assert_eq!(end.ids_in_slot(START, 1471), [], "a part is as long as the others, or waits");
    assert_eq!(end.ids_in_slot(START, 2 * 1472), [(1, vec![0]), (1, vec![0])]);
    end.queue(START, to(2, 250), b"urgent");
    // The last fragment is short. The urgent one leaves alone, since the fragments are more important than what waits
    // for that peer.
    assert_eq!(end.ids_in_slot(START + MS, 5000), [(2, vec![2]), (1, vec![0]), (1, vec![0]), (2, vec![1])]);
    assert_eq!(end.stats.peer(1).sent.fragments.get(), 4);
    end.assert_balanced();
}

#[test]
fn datagrams_are_as_long_as_each_own_slot_holds() {
    // 12.5 B a µs except for the guard of 100 µs and 50 µs of a late beginning; 66 B for the headers of Ethernet, IP
    // and UDP.
    for (lengths_us, bytes) in
        [(&[1000][..], 1472), (&[250], 1250 - 66), (&[1000, 200], 625 - 66), (&[110], 528), (&[], 1472)]
    {
        let settings = Settings { tdma: Some(table(lengths_us)), ..crate::harness::settings(0, 2) };
        assert_eq!(settings.datagram_bytes(), bytes, "{lengths_us:?}");
    }
    let mut end = in_slots(&[1000, 250]);
    end.queue(START, to(1, 90), &[1; 5000]);
    let all = end.slot(START, 20_000);
    let lengths: Vec<_> = all.iter().map(|(_, datagram)| datagram.len()).collect();
    assert_eq!(lengths, [1184, 1184, 1184, 1184, 68 + 5000 - 4 * (1184 - 68)]);
}

#[test]
fn where_there_are_slots_nothing_leaves_at_once() {
    let mut end = in_slots(&[1000]);
    end.queue(START, to(1, 90), &[0; 1400]);
    assert_eq!(end.send(START, to(1, 90), b"alone", true), None);
    assert_eq!(end.ids_in_slot(START, 3000), [(1, vec![0]), (1, vec![1])]);
}

#[test]
fn peers_are_told_in_slots_that_we_are_still_there() {
    let mut end = in_slots(&[1000]);
    end.queue(START, to(1, 90), b"to one of them");
    end.slot(START + ALIVE_EVERY_NS / 2, 1472);
    let told = |end: &mut End, now_ns, room| end.slot(now_ns, room).iter().map(|(to, _)| *to).collect::<Vec<_>>();
    assert_eq!(told(&mut end, START + ALIVE_EVERY_NS, HEAD_BYTES + ALIVE_BYTES - 1), [0; 0]);
    assert_eq!(told(&mut end, START + ALIVE_EVERY_NS, 1472), [2]);
    assert_eq!(told(&mut end, START + ALIVE_EVERY_NS * 3 / 2, 1472), [1]);
}

#[test]
fn what_waits_too_long_for_a_slot_is_lost_between_slots_and_in_them() {
    for tidies in [false, true] {
        let mut end = in_slots(&[1000]);
        end.queue(START, to(1, 90), b"waits");
        let now_ns = START + WAIT_MAX_NS + 1;
        end.hears(1, now_ns);
        end.hears(2, now_ns);
        if tidies {
            end.outbound.tidy(now_ns, &mut end.log);
            assert_eq!(end.log.causes(), [Cause::Stale]);
        }
        assert_eq!(end.ids_in_slot(now_ns, 1472), []);
        assert_eq!(end.log.causes(), [Cause::Stale]);
        end.assert_balanced();
        assert_eq!(end.stats.waiting_in_all(), 0);
    }
}
