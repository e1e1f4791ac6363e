use super::*;
use rohrpost_config::{LeaseTimes, holders};
use rohrpost_supervision::lease::{Number, Wish};
use std::path::Path;

const TEXT: &str = include_str!("../../../../../config/tests/standby.toml");

fn parsed(text: &str) -> Installation {
    Installation::parse(text, Path::new("standby.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// Brain, then desk run pilot.0; base grants its lease.
fn leases(of: &str) -> (Leases, std::sync::Arc<Node>, tempfile::TempDir) {
    let installation = parsed(TEXT);
    let directory = tempfile::tempdir().unwrap();
    let node = Node::create(&directory.path().join("node"), 0o700).unwrap();
    (Leases::begin(&installation, &node, of).unwrap(), node, directory)
}

/// An incarnation that no node begins with before the year 2065.
const AHEAD: u32 = 3_000_000_000;
const PILOT: Name = Name::new(1, 140, 0, 0);

/// What the file says of the pilot's place among the nodes base, brain and desk.
fn told(node: &Node) -> Option<u8> {
    let text = node.read_file(HOLDERS_FILE).unwrap().unwrap();
    holders(&String::from_utf8(text).unwrap()).find(|(name, _)| *name == PILOT).map(|(_, place)| place)
}

#[test]
fn the_router_of_the_witness_is_told_before_a_lease_is_granted() {
    let (mut leases, node, _directory) = leases("base");
    let mut answered_ns = None;
    let granted = loop {
        assert_eq!(told(&node), None, "nobody was granted it");
        let asked_ns = monotonic_ns();
        let ask = Ask { place: 1, run: 7, asked_ns, answered_ns, wish: Wish::Hold };
        let asks = LeaseMessage { incarnation: AHEAD, leases: vec![(PILOT.raw(), ask.to_bytes().to_vec())] };
        let message = leases.answer(&asks, &node);
        let answer = Answer::from_bytes(&message.leases[0].1).unwrap();
        answered_ns = Some(asked_ns);
        if answer.granted_ns.is_some() {
            break message;
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    assert_eq!(told(&node), Some(2), "desk");
    assert_eq!(granted.incarnation, AHEAD, "the next holder passes it");
}

#[test]
fn a_node_without_an_answer_for_one_lease_knows_no_holder() {
    let (mut leases, node, _directory) = leases("desk");
    let lease_ns = leases.lease_ns;
    let seat = leases.seats.iter_mut().find(|seat| seat.module == PILOT).unwrap();
    let now_ns = monotonic_ns();
    let look = seat.questions(now_ns, lease_ns).find(|ask| ask.wish == Wish::Look).unwrap();
    let newest = Number { witness: 1, count: 1 };
    let answer = Answer { run: look.run, asked_ns: now_ns, newest, holder: Some(0), granted_ns: None };
    seat.take(&answer, lease_ns);
    let seat = leases.seats.iter().find(|seat| seat.module == PILOT).unwrap();
    let holder = |after_ns| leases.holder_of(seat, now_ns + after_ns);
    assert_eq!([0, lease_ns - 1, lease_ns].map(holder), [Some(0), Some(0), None]);
    assert!(leases.tell(&node));
}

#[test]
fn a_node_passes_the_incarnations_of_others_and_never_goes_back() {
    let (_, node, _directory) = leases("desk");
    let own = node.next_incarnation();
    node.pass_incarnation(own.wrapping_add(100));
    assert_eq!(node.next_incarnation(), own.wrapping_add(101));
    node.pass_incarnation(own);
    assert_eq!(node.last_incarnation(), own.wrapping_add(101), "an earlier one changes nothing");
}

/// The file with a cycle of so long, in which each node has a slot.
fn in_slots(cycle: Duration) -> Installation {
    let (cycle_us, first_us) = (cycle.as_micros(), 500);
    let each_us = (cycle_us - first_us) / 3;
    let slot = |(node, offset_us)| {
        format!("[[slot]]\nnode = \"{node}\"\noffset = \"{offset_us} us\"\nlength = \"{each_us} us\"\n")
    };
    let slots =
        [("base", first_us), ("brain", first_us + each_us), ("desk", first_us + 2 * each_us)].map(slot).concat();
    let tdma = format!(
        "mode = \"tdma\"\n[tdma]\ncycle = \"{cycle_us} us\"\nsynchronisation = \"500 us\"\nguard = \"150 us\"\n\
         link = \"100 Mbit/s\"\n{slots}"
    );
    let text = TEXT.replace("security = \"none\"\n", &format!("security = \"none\"\n{tdma}"));
    parsed(&text.replace("source = \"master\"\n", "source = \"master\"\nmasters = [\"base\"]\n"))
}

#[test]
fn in_time_slots_a_lease_is_counted_in_cycles_and_its_times_fit() {
    let ms = Duration::from_millis;
    for (cycle_ms, ask_every_ms, off_ms, lease_ms, why) in [
        (None, 150, 100, 900, "without slots"),
        (Some(5), 10, 20, 80, "a question every two cycles, six of them and four cycles to be off"),
        (Some(25), 50, 100, 400, "four cycles are as long as the longest time to be off"),
        (Some(50), 100, 100, 700, "off sooner than four cycles"),
        (Some(150), 300, 100, 1900, "the longest cycle"),
    ] {
        let times = cycle_ms.map_or_else(|| parsed(TEXT), |cycle| in_slots(ms(cycle))).lease_times();
        let LeaseTimes { lease, ask_every, off } = times;
        assert_eq!([ask_every, off, lease], [ask_every_ms, off_ms, lease_ms].map(ms), "{why}");
        let [lease_ns, ask_every_ns, off_ns] = [lease, ask_every, off].map(|time| time.as_nanos() as u64);
        assert!(Terms::new(lease_ns, ask_every_ns, off_ns, RATE_ERROR_PPM).is_ok(), "{why}");
    }
}
