//! Meaning of a file with time slots for routers.

use rohrpost_config::{Installation, TimeSource, bounds, duration_text, explain, parse_duration, records_left};
use rohrpost_network::{TimeSlot, Tunnel};
use std::net::Ipv4Addr;
use std::path::Path;
use std::time::Duration;

const SLOTS: &str = include_str!("tdma.toml");

fn parse(text: &str) -> Installation {
    Installation::parse(text, Path::new("tdma.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

#[test]
fn every_key_arrives() {
    let installation = parse(SLOTS);
    let tdma = installation.tdma.unwrap();
    let us = Duration::from_micros;
    assert_eq!((tdma.cycle, tdma.synchronisation, tdma.guard), (us(5000), us(500), us(150)));
    assert_eq!(tdma.link_bytes_s, 12_500_000);
    assert_eq!(tdma.tunnel, Some(Tunnel { network: Ipv4Addr::new(10, 78, 0, 0), prefix: 24 }));
    assert_eq!(tdma.tunnel.unwrap().address(1), Ipv4Addr::new(10, 78, 0, 2));
    let slot =
        |node, offset, length, period, phase| TimeSlot { node, offset: us(offset), length: us(length), period, phase };
    assert_eq!(tdma.slots, [slot(0, 1000, 1000, 1, 0), slot(1, 2000, 500, 2, 1), slot(1, 3000, 1000, 1, 0)]);
    assert_eq!((0..4).map(|cycle| tdma.slots[1].is_in(cycle)).collect::<Vec<_>>(), [false, true, false, true]);
    assert_eq!(installation.time, TimeSource::Master { masters: vec![0, 1], interval: us(5000) }, "the cycle");
    assert_eq!(installation.network.unwrap().rate_bytes_s, 12_500_000, "the link's");
}

/// A seal takes a part of each slot, and so of each bound.
#[test]
fn what_leaves_in_slots_may_be_sealed_and_takes_longer() {
    let open = include_str!("../demo-tdma.toml");
    let sealed = open.replace("security = \"none\"", "security = \"keys\"");
    let worst =
        |text: &str| -> Duration { bounds(&parse(text)).into_iter().map(|bound| bound.latency.unwrap().latency).sum() };
    assert!(sealed != open && worst(&sealed) > worst(open));
    assert_ne!(parse(&sealed).digest(), parse(open).digest(), "a node that seals does not talk to one that does not");
}

#[test]
fn a_slot_holds_what_the_link_carries_before_the_guard() {
    let tdma = parse(SLOTS).tdma.unwrap();
    for (length_us, bytes, why) in
        [(1000, 10_625, "850 us"), (151, 12, "a microsecond"), (150, 0, "the guard"), (100, 0, "less")]
    {
        assert_eq!(tdma.budget_bytes(Duration::from_micros(length_us)), bytes, "{why}");
    }
}

#[test]
fn nodes_of_other_tables_do_not_understand_each_other() {
    let free = SLOTS.split_once("[tdma]").unwrap();
    let (before, after) = (free.0.replace("mode = \"tdma\"", ""), free.1.split_once("[time]").unwrap().1);
    let free =
        format!("{before}[time]\n{}", after.replace("source = \"master\"", "source = \"master\"\ninterval = \"1 s\""));
    let own = parse(SLOTS).digest().lan();
    assert_ne!(parse(&free).digest().lan(), own, "free mode");
    for (old, new) in [
        ("cycle = \"5 ms\"", "cycle = \"6 ms\""),
        ("synchronisation = \"500 us\"", "synchronisation = \"499 us\""),
        ("guard = \"150 us\"", "guard = \"151 us\""),
        ("link = \"100 Mbit/s\"", "link = \"1 Gbit/s\""),
        ("10.78.0.0/24", "10.79.0.0/24"),
        ("tunnel = \"10.78.0.0/24\"", ""),
        ("offset = \"3 ms\"", "offset = \"3.1 ms\""),
        ("length = \"500 us\"", "length = \"501 us\""),
        ("period = 2", "period = 3"),
        ("phase = 1", "phase = 0"),
    ] {
        assert_eq!(SLOTS.matches(old).count(), 1, "{old}");
        assert_ne!(parse(&SLOTS.replace(old, new)).digest().lan(), own, "{old} or {new}");
    }
    let [head, base, brain, last] = SLOTS.splitn(4, "[[slot]]").collect::<Vec<_>>()[..] else { panic!() };
    let (last, rest) = last.split_once("[time]").unwrap();
    let turned = format!("{head}[[slot]]{last}\n[[slot]]{brain}\n[[slot]]{base}\n[time]{rest}");
    assert_eq!(parse(&turned).digest().lan(), own, "their order in the file does not count");
}

/// A line of messages, without file and line.
fn message(text: &str) -> String {
    let errors = Installation::parse(text, Path::new("tdma.toml")).expect_err("something is wrong");
    errors.problems().iter().map(|problem| problem.message.clone()).collect::<Vec<_>>().join("\n")
}

/// What stands in quotes behind a key in a message.
fn quoted<'m>(message: &'m str, key: &str) -> &'m str {
    let (_, behind) = message.rsplit_once(&format!("`{key} = \"")).expect("a remedy with this key");
    behind.split('"').next().unwrap_or_default()
}

#[test]
fn what_a_message_says_is_a_remedy_and_less_is_none() {
    let short = SLOTS.replacen("length = \"1 ms\"", "length = \"420 us\"", 1);
    let soon = short.replacen("deadline = \"20 ms\"", "deadline = \"6 ms\"", 1);
    let said = message(&soon);
    assert!(said.contains("lengthen that of `base` at 1 ms (line 34)"), "{said}");
    let length = parse_duration(quoted(&said, "length")).unwrap();
    let with = |length| soon.replacen("420 us", &duration_text(length), 1);
    parse(&with(length));
    message(&with(length - Duration::from_micros(10)));

    let soon = SLOTS.replacen("deadline = \"20 ms\"", "deadline = \"4 ms\"", 1);
    let said = message(&soon);
    let (offset, length) = (quoted(&said, "offset"), quoted(&said, "length"));
    let slot = |length| format!("[[slot]]\nnode = \"base\"\noffset = \"{offset}\"\nlength = \"{length}\"\n\n[time]");
    parse(&soon.replacen("[time]", &slot(length), 1));
    let less = duration_text(parse_duration(length).unwrap() - Duration::from_micros(10));
    message(&soon.replacen("[time]", &slot(&less), 1));

    let soon = SLOTS.replacen("deadline = \"20 ms\"", "deadline = \"1 ms\"", 1);
    let said = message(&soon);
    parse(&soon.replacen("deadline = \"1 ms\"", &format!("deadline = \"{}\"", quoted(&said, "deadline")), 1));
}

/// By hand.
#[test]
fn bounds_are_what_the_book_derives() {
    let installation = parse(SLOTS);
    let [scan, drive] = &bounds(&installation)[..] else { panic!() };
    assert_eq!((scan.flow, drive.flow, scan.level, drive.level), (0, 1, 14, 14), "both at the pilot's class, 140");
    let ns = |us: &[u64]| Duration::from_nanos(us.iter().sum());

    // Published just after a slot's packages were taken, 100 us before its beginning, the scan waits a cycle and these
    // 100 us; a slew of 0.125 % a cycle is 6.25 us longer. Two frames of time, one keep-alive and a refusal take 20 us
    // each to hand over. Of its 2048 bytes 1404 go first, in a datagram of 1472, with headers 1538 B, 123.04 us; then
    // 644 in one of 712, 778 B, 62.24 us. The slot may have begun 50 us late. A switch forwards the last one.
    let bound = scan.latency.unwrap();
    assert_eq!((bound.waits, bound.slots, bound.said), (ns(&[5_106_250]), 1, ns(&[80_000])));
    assert_eq!((bound.datagrams, bound.own, bound.forward), (2, ns(&[123_040, 62_240]), ns(&[62_240])));
    assert_eq!(bound.latency, ns(&[5_106_250, 50_000, 80_000, 123_040, 62_240, 62_240]));

    // The command may catch the slot at 3 ms or, in each other cycle, that at 2 ms. Just after the one at 3 ms of a
    // cycle without the other it waits longest. Others may follow it in its datagram, to 1538 B.
    let bound = drive.latency.unwrap();
    assert_eq!(
        (bound.waits, installation.tdma.as_ref().unwrap().slots[bound.slot].offset),
        (ns(&[5_106_250]), Duration::from_millis(3))
    );
    assert_eq!(bound.latency, ns(&[5_106_250, 50_000, 80_000, 123_040, 123_040]));
}

#[test]
fn without_slots_there_are_no_bounds() {
    let free = include_str!("full.toml");
    assert_eq!(bounds(&parse(free)), []);
    assert_eq!(records_left(&parse(free)), []);
}

#[test]
fn programs_get_the_records_that_check_prints() {
    let installation = parse(include_str!("replica-slots.toml"));
    let left: Vec<f64> = records_left(&installation).into_iter().flatten().collect();
    assert_eq!(left.len(), installation.replicas.len());
    let page = explain(&installation, None);
    for (replica, left) in installation.replicas.iter().zip(left) {
        let name = format!("  {} ", replica.text(&installation));
        let line = page.lines().find(|line| line.starts_with(&name) && line.contains("base"));
        assert!(line.is_some_and(|line| line.ends_with(&format!(" {left:.2}"))), "{left} of {line:?}");
    }
}

/// Alone each takes two thirds of what slots leave.
#[test]
fn of_replicas_that_do_not_fit_together_the_less_important_is_refused_whatever_their_order() {
    let (head, _) = include_str!("broken/replica-slots.toml").split_once("[[replica]]").unwrap();
    let head = format!("{head}[[module]]\nname = \"pilot.1\"\nnode = \"base\"\nprogram = \"./pilot\"\n");
    let replica = |stream: &str, rate: f64| {
        format!("[[replica]]\nstream = {{ name = \"{stream}\", rate = {rate:.2} }}\nto = [\"brain\"]\n")
    };
    let streams = ["pilot.1/plan", "motor.0/turns"];
    let seldom = streams.map(|stream| replica(stream, 0.01)).concat();
    let left = records_left(&parse(&[head.as_str(), &seldom].concat()));
    let [plan, turns] = [0, 1].map(|at: usize| replica(streams[at], left[at].unwrap() / 1.5));
    for all in [[&plan, &turns], [&turns, &plan]] {
        let errors = Installation::parse(&[head.as_str(), all[0], all[1]].concat(), Path::new("robot.toml"));
        let errors = errors.expect_err("both do not fit").to_string();
        let is_plan = errors.contains("of `pilot.1/plan`") && errors.contains("and more important replicas");
        assert!(is_plan && errors.trim().lines().count() == 1, "{errors}");
    }
}

/// Useless tables: each is refused with a message, or has bounds, but nothing overflows or loops forever.
#[test]
fn absurd_flows_are_checked_in_time() {
    let flow = SLOTS
        .split_once("[[flow]]")
        .unwrap()
        .0
        .replace("program = \"./pilot\"", "program = \"./pilot\"\nmailbox.data.size = \"65519 B\"");
    let periods = ["1 ns", "1 us", "99 us", "100 us", "1 ms", "24 h", "5000000 h"];
    let mut accepted = Vec::new();
    for (period, quick) in periods.iter().flat_map(|period| periods.iter().map(move |quick| (period, quick))) {
        for size in ["1 B", "65519 B"] {
            let text = format!(
                "{flow}[[flow]]\nfrom = \"laser.0\"\nto = \"pilot.0\"\nsize = \"{size}\"\nperiod = \"{period}\"\n\
                 [[flow]]\nfrom = \"pilot.0\"\nto = \"motor.0\"\nsize = \"1 B\"\nperiod = \"{quick}\"\n\
                 [[flow]]\nfrom = \"motor.0\"\nto = \"pilot.0\"\nsize = \"1 B\"\nperiod = \"{quick}\"\n"
            );
            match Installation::parse(&text, Path::new("absurd.toml")) {
                Ok(installation) => {
                    assert!(rohrpost_config::explain(&installation, None).contains("Time slots"));
                    accepted.push((*period, *quick, size));
                }
                Err(errors) => assert!(errors.to_string().contains("absurd.toml:"), "{errors}"),
            }
        }
    }
    assert_eq!(accepted, [("24 h", "24 h", "1 B"), ("24 h", "24 h", "65519 B")]);
}

/// Packages wait for a slot in the mailbox of the node's router, which has its size.
#[test]
fn no_more_flows_of_a_node_are_declared_than_its_router_has_room_for() {
    let (head, _) = SLOTS.split_once("[[flow]]").unwrap();
    let of = |count: u32| {
        let subscriber = |n| {
            format!(
                "[[module]]\nname = \"pilot.{n}\"\nnode = \"brain\"\nprogram = \"./pilot\"\ncalls = [\"laser.0\"]\n"
            )
        };
        let flow = |n| {
            format!(
                "[[flow]]\nfrom = \"laser.0\"\nto = \"pilot.{n}\"\nsize = \"8 B\"\nperiod = \"400 ms\"\ndeadline = \
                 \"400 ms\"\n"
            )
        };
        let subscribers: String = (1..=count).map(subscriber).collect();
        let flows: String = (1..=count).map(flow).collect();
        Installation::parse(&format!("{head}{subscribers}{flows}"), Path::new("tdma.toml"))
    };
    assert_eq!(of(64).map_err(|errors| errors.to_string()).map(|file| file.flows.len()), Ok(64));
    for count in [65, 150] {
        let said = of(count).unwrap_err().to_string();
        let of_them = format!("[[flow]]s from `base`: {count} of their packages may wait for its slots at once");
        assert!(said.contains(&of_them) && said.contains("holds 64"), "{said}");
    }
}
