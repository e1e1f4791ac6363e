//! A router does not read, and the kernel's buffer of its socket overflows.

use super::Field;
use super::flow::{ALONE_BYTES, PLAIN, Sink, Source, URGENT, balance, carried, lost};
use crate::harness::{halt, signal, until, wait};
use nix::sys::signal::Signal;
use rohrpost::interfaces::LinkState;
use std::time::Duration;

#[test]
fn datagrams_for_which_a_socket_has_no_room_are_counted_and_the_urgent_ones_after_them_come() {
    let Some(mut field) = Field::new(2, "rate = \"4 GiB\"") else { return };
    field.launch(&["base", "arm"]);
    let mut sink = Sink::new(field.robot("arm"), "arm");
    let mut flood = Source::new(field.robot("base"), "base", "arm", PLAIN);
    let router = field.router("arm");
    // Datagrams of the base before the arm listened count as lost; the first one that the arm receives, at either
    // port, shows that it listens.
    field.wait_for_state("arm", "base", LinkState::Alive);
    until("the first of the flow", || {
        flood.send();
        sink.take(Duration::from_millis(10));
        !sink.came.is_empty()
    });
    let before = field.peer("arm", "base").counters.lost;
    // A busy computer may fail to flood it in the second until it counts as silent; then it tries again.
    until("the buffer runs over", || {
        field.wait_for_state("base", "arm", LinkState::Alive);
        halt(router);
        for _ in 0..20 {
            let room = (0..1000)
                .filter(|_| {
                    flood.send() || {
                        std::thread::yield_now();
                        flood.send()
                    }
                })
                .count();
            if room == 0 || field.dropped("arm") > 0 {
                break;
            }
        }
        let over = field.dropped("arm") > 0;
        signal(router, Signal::SIGCONT);
        sink.take(Duration::from_millis(1));
        over
    });
    let accounts = balance(&field, &flood, &mut sink, PLAIN);
    let dropped = field.dropped("arm");
    assert!(accounts.wire > 0 && accounts.wire <= dropped, "{accounts:?}, dropped: {dropped}");
    let counted = wait("the router counts what the kernel dropped", || {
        Some(field.peer("arm", "base").counters.lost - before).filter(|lost| *lost >= dropped)
    });
    assert_eq!(counted, dropped);
    let numbers = sink.numbers(PLAIN);
    assert!(numbers.is_sorted_by(|one, next| one < next), "in order, none twice");

    field.wait_for_state("base", "arm", LinkState::Alive);
    let mut urgent = Source::new(field.robot("base"), "base", "arm", URGENT);
    while urgent.sent < 100 {
        assert!(urgent.send(), "there is room for {ALONE_BYTES} bytes");
        sink.take(Duration::from_millis(20));
    }
    balance(&field, &urgent, &mut sink, URGENT);
    assert_eq!(sink.numbers(URGENT), (0..100).collect::<Vec<_>>());
    let at_base = carried(&field.links("base"), URGENT);
    assert_eq!(lost(&at_base), 0, "{at_base:?}");
    field.wait_counted("base", "probe.1", 1);
    drop((flood, urgent, sink));
    field.stop();
}
