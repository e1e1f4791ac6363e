//! What a file of time slots means for routers.

use rohrpost_config::{Installation, TimeSlot, TimeSource, Tunnel};
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
    let slot = |node, offset, length, period, phase, line| TimeSlot {
        node,
        offset: us(offset),
        length: us(length),
        period,
        phase,
        line,
    };
    assert_eq!(
        tdma.slots,
        [slot(0, 1000, 1000, 1, 0, 34), slot(1, 2000, 500, 2, 1, 39), slot(1, 3000, 1000, 1, 0, 46)]
    );
    assert_eq!((0..4).map(|cycle| tdma.slots[1].is_in(cycle)).collect::<Vec<_>>(), [false, true, false, true]);
    assert_eq!(installation.time, TimeSource::Master { masters: vec![0, 1], interval: us(5000) }, "the cycle");
    assert_eq!(installation.network.unwrap().rate_bytes_s, 12_500_000, "the link's");
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
