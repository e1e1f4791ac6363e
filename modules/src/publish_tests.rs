use super::*;

const MS: u64 = 1_000_000;

/// A moment at which both clocks say this.
fn at(ns: u64) -> WorkMoment {
    WorkMoment { monotonic_ns: ns, work_ns: ns }
}

fn wish(period_ms: u32) -> Subscribe {
    Subscribe { number: 1, id: 7, period_us: period_ms * 1000, lease_ms: 1000, mailbox: 2 }
}

fn asked(local: u8) -> RequestOrigin {
    let name = |local| Name::new(1, 9, 0, local);
    RequestOrigin {
        by: name(1),
        principal: Principal::Unknown,
        incarnation: 5,
        to: name(local),
        priority: Priority(9),
        newest: false,
    }
}

fn subscribed(period_ms: u32) -> Subscriptions {
    let mut all = Subscriptions::new(&[]);
    assert!(all.subscribe(0, asked(2), wish(period_ms), at(1)));
    all
}

fn publish(all: &mut Subscriptions, delivery: fn() -> Delivery) -> usize {
    let mut sent = 0;
    all.published(0, 1, |_| {
        sent += 1;
        delivery()
    });
    sent
}

fn tick(all: &mut Subscriptions, now_ns: u64) -> usize {
    let mut sent = 0;
    all.tick(at(now_ns), |_| {
        sent += 1;
        Delivery::Sent
    });
    sent
}

#[test]
fn each_value_goes_to_a_subscriber_of_each() {
    let mut all = subscribed(0);
    assert_eq!((publish(&mut all, || Delivery::Sent), publish(&mut all, || Delivery::Sent)), (1, 1));
    all.published(0, 2, |_| unreachable!("nobody asked for number 2"));
    assert_eq!(all.list[0].sequence, 2);
}

#[test]
fn a_period_delivers_the_newest_once_or_counts_a_miss() {
    let mut all = subscribed(10);
    assert_eq!(publish(&mut all, || Delivery::Sent), 0, "waits for its time");
    for (now_ms, fresh, sent, missed, why) in [
        (0, false, 1, 0, "due at once, and there is a value"),
        (5, true, 0, 0, "not due yet"),
        (10, false, 1, 0, "the value of before"),
        (20, false, 0, 1, "no new value"),
        (55, true, 1, 3, "two periods slept through, then the newest"),
        (60, false, 0, 4, "the grid stays where it was"),
    ] {
        if fresh {
            publish(&mut all, || Delivery::Sent);
        }
        let got = tick(&mut all, 1 + now_ms * MS);
        assert_eq!((got, all.missed()), (sent, missed), "at {now_ms} ms: {why}");
    }
}

#[test]
fn periods_are_those_of_one_clock_and_leases_those_of_the_other() {
    let mut all = Subscriptions::new(&[]);
    assert!(all.subscribe(0, asked(2), wish(10), WorkMoment { monotonic_ns: 1, work_ns: 500 * MS }));
    assert_eq!((all.due_ns(), all.lease_ns()), (Some(500 * MS), Some(1000 * MS + 1)));
    let mut sent = 0;
    // At ten times the pace, for 100 ms; then time stands still, until the lease ends.
    for monotonic_ms in 0..1001 {
        publish(&mut all, || Delivery::Sent);
        let work_ns = (500 + 10 * monotonic_ms.min(100)) * MS;
        all.tick(WorkMoment { monotonic_ns: monotonic_ms * MS, work_ns }, |_| {
            sent += 1;
            Delivery::Sent
        });
    }
    assert_eq!((sent, all.missed(), all.len()), (101, 0, 1));
    all.tick(WorkMoment { monotonic_ns: 1001 * MS, work_ns: 1500 * MS }, |_| unreachable!("nothing is due"));
    assert_eq!(all.len(), 0);
}

#[test]
fn a_step_of_the_clock_leaves_what_was_left_of_a_period_and_misses_nothing() {
    for to_ns in [0, 1, 90 * MS, 3_600_000 * MS] {
        let mut all = subscribed(10);
        assert_eq!((publish(&mut all, || Delivery::Sent), tick(&mut all, 1)), (0, 1));
        publish(&mut all, || Delivery::Sent);
        // 4 ms of the period were over.
        all.step(ClockStep { from_ns: 1 + 4 * MS, to_ns });
        assert_eq!(all.due_ns(), Some(to_ns + 6 * MS), "to {to_ns}");
        let at_once = |all: &mut Subscriptions, work_ns| {
            let mut sent = 0;
            all.tick(WorkMoment { monotonic_ns: 2, work_ns }, |_| {
                sent += 1;
                Delivery::Sent
            });
            sent
        };
        assert_eq!((at_once(&mut all, to_ns), at_once(&mut all, to_ns + 6 * MS), all.missed()), (0, 1, 0));
    }
}

#[test]
fn a_lease_ends_unless_it_is_renewed() {
    let mut all = subscribed(0);
    tick(&mut all, 999 * MS);
    assert!(all.subscribe(0, asked(2), wish(0), at(999 * MS)));
    assert_eq!(all.len(), 1, "renewed, not doubled");
    tick(&mut all, 1500 * MS);
    assert_eq!(all.len(), 1);
    tick(&mut all, 2000 * MS);
    assert_eq!(all.len(), 0);
}

#[test]
fn a_lease_is_a_minute_at_most_whatever_its_subscriber_says() {
    let mut all = Subscriptions::new(&[]);
    assert!(all.subscribe(0, asked(2), Subscribe { lease_ms: u32::MAX, ..wish(0) }, at(1)));
    let minute_ns = 60_000 * MS;
    tick(&mut all, minute_ns);
    assert_eq!(all.len(), 1);
    tick(&mut all, minute_ns + 1);
    assert_eq!(all.len(), 0);
}

#[test]
fn a_principal_that_takes_all_it_can_leaves_some_places_and_a_named_one_always_finds_its_own() {
    let named = Principal::Module(Name::new(1, 140, 0, 0));
    let mut all = Subscriptions::new(&[named]);
    let take = |all: &mut Subscriptions, principal: Principal, class: u8| {
        let places = |id: &u16| {
            let asked =
                RequestOrigin { principal, by: Name::new(1, class, 0, 1), to: Name::new(1, class, 0, 2), ..asked(2) };
            all.subscribe(0, asked, Subscribe { id: *id, lease_ms: u32::MAX, ..wish(0) }, at(1))
        };
        (0..200).filter(places).count()
    };
    let taken: Vec<usize> = (2..9).map(|n| take(&mut all, Principal::System(n), n)).collect();
    assert_eq!(taken, [32, 16, 8, 4, 2, 1, 1]);
    assert_eq!(take(&mut all, Principal::System(9), 9), 0, "all that are for all are taken");
    assert_eq!(take(&mut all, named, 140), OWN_SUBSCRIPTIONS);
    // Over, and not dropped yet.
    let again = RequestOrigin { principal: Principal::System(9), ..asked(2) };
    assert!(all.subscribe(0, again, wish(0), at(60_000 * MS + 1)));
}

#[test]
fn a_subscriber_that_was_started_again_has_none_of_its_earlier_subscriptions() {
    let mut all = subscribed(0);
    assert!(all.subscribe(0, asked(3), Subscribe { mailbox: 3, ..wish(0) }, at(1)));
    publish(&mut all, || Delivery::Full);
    let later = RequestOrigin { incarnation: 6, ..asked(2) };
    assert!(all.subscribe(0, later, Subscribe { number: 2, ..wish(0) }, at(2)));
    let left: Vec<_> = all.list.iter().map(|s| (s.wish.number, s.asked.incarnation, s.sequence)).collect();
    assert_eq!((left, all.missed()), (vec![(2, 6, 0)], 2), "and its numbers begin at 0");
}

#[test]
fn mailboxes_of_one_subscriber_have_ids_of_their_own() {
    let mut all = subscribed(0);
    let own = Name::new(1, 9, 0, 3);
    assert!(all.subscribe(0, asked(3), Subscribe { mailbox: 3, ..wish(0) }, at(1)));
    assert_eq!((all.len(), publish(&mut all, || Delivery::Sent)), (2, 2));
    all.unsubscribe(own, 7);
    assert_eq!((all.len(), all.list[0].asked.to.local()), (1, 2));
}

#[test]
fn no_period_is_too_short_to_live_with() {
    let mut all = Subscriptions::new(&[]);
    let hasty = Subscribe { period_us: 1, lease_ms: u32::MAX, ..wish(0) };
    assert!(all.subscribe(0, asked(2), hasty, at(1)));
    let mut now_ns = 1;
    for _ in 0..1000 {
        tick(&mut all, now_ns);
        let next_ns = all.due_ns().unwrap();
        assert!(next_ns >= now_ns + 1000 * u64::from(PERIOD_MIN_US), "never due again at once");
        now_ns = next_ns;
    }
}

#[test]
fn nothing_is_due_that_was_ticked() {
    // Whatever was slept through, what comes next lies in the future: else the loop would not sleep.
    for (period_ms, late_ms) in [(1, 0), (1, 1), (7, 6), (7, 7), (7, 100), (999, 998), (0, 500)] {
        let mut all = subscribed(period_ms);
        let now_ns = 1 + late_ms * MS;
        tick(&mut all, now_ns);
        let next_ns = [all.due_ns(), all.lease_ns()].into_iter().flatten().min();
        assert!(next_ns.is_none_or(|next_ns| next_ns > now_ns), "period {period_ms}, {late_ms} late");
    }
}

#[test]
fn what_does_not_fit_is_a_gap_and_keeps_the_subscription() {
    let mut all = subscribed(0);
    publish(&mut all, || Delivery::TooLarge);
    publish(&mut all, || Delivery::TooLarge);
    assert_eq!((all.len(), all.list[0].sequence, all.missed(), all.list[0].told), (1, 2, 2, true));
}

#[test]
fn full_is_a_gap_and_a_miss_and_gone_is_gone() {
    let mut all = subscribed(0);
    publish(&mut all, || Delivery::Full);
    assert_eq!((all.list[0].sequence, all.missed()), (1, 1));
    publish(&mut all, || Delivery::Gone);
    assert_eq!((all.len(), all.missed()), (0, 1), "what was missed stays counted");
}
