//! Output of `doctor` for recorded computers and networks.

use super::lan::{LanView, PeerNode, Port, PortState, Reach, Stamps};
use super::machine::{Bridge, KernelFacts, NodeDirectory, NodeFound, Seat, StreamsFound, Supervisor};
use super::protection::{LanProtection, Tcp};
use super::*;
use rohrpost::interfaces::{ControlMode, ControlState, HeldHalt};
use rohrpost_launch::survey::Standing;
use rohrpost_mailbox::{LAYOUT_VERSION, NodeError, sys::Room};
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Unpacks a recorded computer: lines `== PATH`, each followed by that file's content.
fn unpack(text: &str, to: &Path) {
    for file in text.split("\n== ").skip(1) {
        let (path, content) = file.split_once('\n').unwrap_or((file, ""));
        let path = to.join(path.trim_start_matches('/'));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
}

fn examined(name: &str, (asked, needs): (KernelFacts, Needs)) -> Vec<Finding> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/doctor");
    let root = tempfile::tempdir().unwrap();
    unpack(&fs::read_to_string(folder.join(format!("{name}.machine"))).unwrap(), root.path());
    examine(&Machine::at(root.path(), asked), &needs)
}

fn said(name: &str, computer: (KernelFacts, Needs)) -> String {
    page(&examined(name, computer)) + "\n"
}

/// `UPDATE_GOLDEN=1 cargo test --bin rohrpost doctor` rewrites the texts; read the diff before you commit.
fn compare(name: &str, said: &str) {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../tests/doctor/{name}.txt"));
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        fs::write(&golden, said).unwrap();
    }
    assert_eq!(said, fs::read_to_string(&golden).unwrap(), "{}", golden.display());
}

/// A node directory of another user.
const THEIRS: &str = "/home/robot/nodes/theirs.main";
/// A clock that was set, ns since 1970.
const SET_NS: u64 = 1_795_733_218_000_000_000;
const PORTS: [&str; 3] = ["port of packages", "port of time", "port of the rest"];

fn lan(ports: [PortState; 3], peers: &[(&str, u32, Reach)]) -> LanView {
    let peer = |(host, (name, mtu, reach)): (u8, &(&str, u32, Reach))| PeerNode {
        name: (*name).into(),
        address: [10, 77, 0, host].into(),
        mtu: Some(*mtu),
        reach: reach.clone(),
    };
    LanView {
        node: "base".into(),
        address: [10, 77, 0, 1].into(),
        mtu: 1500,
        is_here: true,
        addresses: vec![("eth0".into(), [10, 77, 0, 1].into())],
        ports: (21117..).zip(PORTS).zip(ports).map(|((number, what), state)| Port { what, number, state }).collect(),
        runs: true,
        stamps: Stamps::Both,
        peers: (2..).zip(peers).map(peer).collect(),
    }
}

fn lan_that_works() -> LanView {
    lan(
        [PortState::InUse, PortState::Free, PortState::Free],
        &[("arm", 1500, Reach::NoRouter), ("desk", 9000, Reach::Neighbour)],
    )
}

fn lan_of_trouble() -> LanView {
    let refused = PortState::Refused("Permission denied (os error 13)".into());
    LanView {
        is_here: false,
        addresses: vec![("eth0".into(), [192, 168, 0, 7].into()), ("wlan0".into(), "fd00::7".parse().unwrap())],
        runs: false,
        stamps: Stamps::NoSent,
        ..lan([PortState::InUse, refused.clone(), refused], &[("arm", 1280, Reach::Neighbour)])
    }
}

/// What the kernel knows of the way to a peer that does not answer is no matter.
fn lan_with_peers_of_trouble() -> LanView {
    let no_way = Reach::NoWay("Network is unreachable (os error 101)".into());
    let peers = [("arm", 1280, Reach::Silent), ("desk", 1280, no_way), ("cart", 1280, Reach::NoRouter)];
    lan([PortState::InUse, PortState::Free, PortState::Free], &peers)
}

fn sealed(ids: Result<Vec<u8>, String>, lacking: Vec<String>) -> Protection {
    Protection {
        lan: Some(LanProtection::Keys { file: "keys/udp.keys".into(), ids }),
        tcp: Some(Tcp::Tls { folder: "certificates".into(), lacking }),
    }
}

fn open() -> Protection {
    Protection { lan: Some(LanProtection::Open), tcp: Some(Tcp::Open) }
}

/// A node with so many streams of 68 MiB.
fn node(path: &str, seen: NodeDirectory, number: usize) -> NodeFound {
    let streams = StreamsFound { number, bytes: number as u64 * (68 << 20) };
    NodeFound { path: path.into(), seen, streams, clock_set_by_ns: None }
}

/// One that runs.
fn wormhole(state: ControlState) -> Supervisor {
    Supervisor { module: "wormhole.0".into(), fifo: Some(39), says: Some(Ok(state)) }
}

fn seeing() -> ControlState {
    ControlState { sees: true, driven_by: "pilot.0".into(), ..ControlState::default() }
}

fn good() -> (KernelFacts, Needs) {
    let asked = KernelFacts {
        fifo: Ok(()),
        base: "/dev/shm/rohrpost-1000".into(),
        room: Some(Room { bytes: 8 << 30, free: 7 << 30 }),
        nodes: vec![node("/dev/shm/rohrpost-1000/arm.main", NodeDirectory::Launched(812), 2)],
        bridge: Some(Bridge { path: "/opt/rohrpost/rohrpost-gui-bridge".into(), pid: Some(820) }),
        viewer: Some("/usr/local/bin/rerun".into()),
        lan: Some(lan_that_works()),
        protection: sealed(Ok(vec![2, 1]), Vec::new()),
        wall_ns: SET_NS,
    };
    let from = Some("robot.toml".into());
    (
        asked,
        Needs {
            priority: 34,
            memory: 4 << 20,
            gui: true,
            bridge: None,
            processes: 6,
            supervisors: vec![wormhole(seeing())],
            seats: vec![seat(Standing::StandsBy)],
            from,
        },
    )
}

fn bad() -> (KernelFacts, Needs) {
    let asked = KernelFacts {
        fifo: Err("Operation not permitted (os error 1)".into()),
        base: "/home/robot/nodes".into(),
        room: Some(Room { bytes: 64 << 20, free: 1 << 20 }),
        nodes: vec![
            node("/home/robot/nodes/demo.main", NodeDirectory::Dead, 1),
            NodeFound {
                clock_set_by_ns: Some(20_785 * 86_400_000_000_000),
                ..node("/home/robot/nodes/slow.main", NodeDirectory::Launched(17), 0)
            },
            node("/home/robot/nodes/old.main", NodeDirectory::OtherVersion(99), 0),
            node(THEIRS, NodeDirectory::Foreign(NodeError::Foreign(THEIRS.into(), 1001).to_string()), 0),
        ],
        bridge: None,
        viewer: None,
        lan: Some(lan_of_trouble()),
        protection: sealed(
            Err("keys/udp.keys: keys cannot be read (No such file or directory (os error 2))".into()),
            vec!["certificates/base.system-1.key: is missing; `rohrpost keys new` makes it".into()],
        ),
        wall_ns: 61_000_000_000,
    };
    let from = Some("robot.toml".into());
    (
        asked,
        Needs {
            priority: 34,
            memory: 40 << 20,
            gui: true,
            bridge: None,
            processes: 6,
            supervisors: vec![wormhole(seeing())],
            seats: vec![Seat { holder: None, ..seat(Standing::StandsBy) }],
            from,
        },
    )
}

/// As in the systemd unit, in /run: the text must name /run, not /dev/shm.
fn too_little_room_in_run() -> (KernelFacts, Needs) {
    let asked = KernelFacts {
        base: "/run/rohrpost/main".into(),
        room: Some(Room { bytes: 64 << 20, free: 60 << 20 }),
        bridge: Some(Bridge { path: "/opt/rohrpost/rohrpost-gui-bridge".into(), pid: None }),
        lan: Some(lan_with_peers_of_trouble()),
        ..nothing_told()
    };
    (asked, Needs { memory: 70 << 20, from: Some("robot.toml".into()), ..Needs::default() })
}

fn elsewhere() -> (KernelFacts, Needs) {
    let peers = [("arm", 1400, Reach::Silent), ("desk", 1400, Reach::Neighbour)];
    let lan = LanView {
        addresses: Vec::new(),
        stamps: Stamps::None("Protocol not available".into()),
        ..LanView { is_here: false, ..lan([PortState::Unknown, PortState::Unknown, PortState::Unknown], &peers) }
    };
    let asked = KernelFacts { lan: Some(lan), protection: open(), ..nothing_told() };
    (asked, Needs { from: Some("robot.toml".into()), ..Needs::default() })
}

fn nothing_told() -> KernelFacts {
    KernelFacts {
        fifo: Ok(()),
        base: "/dev/shm/rohrpost-0".into(),
        room: None,
        nodes: Vec::new(),
        bridge: None,
        viewer: None,
        lan: None,
        protection: Protection::default(),
        wall_ns: SET_NS + 86_400_000_000_000,
    }
}

#[test]
fn a_well_configured_computer_has_no_warnings() {
    let said = said("good", good());
    assert!(!said.contains("\nwarn ") && !said.contains("\nbad "), "{said}");
    compare("good", &said);
}

#[test]
fn a_badly_configured_computer_fails_every_check() {
    // The layout version changes independently.
    compare("bad", &said("bad", bad()).replace(&format!("this program {LAYOUT_VERSION}"), "this program …"));
}

#[test]
fn a_computer_with_too_little_room_in_run() {
    compare("run", &said("run", too_little_room_in_run()));
}

#[test]
fn an_address_of_another_computer_is_reported() {
    let said = said("silent", elsewhere());
    let network = said.split_once("warn  network security").unwrap().1;
    compare("elsewhere", &format!("warn  network security{network}"));
}

/// A fact that the kernel does not report is not guessed.
#[test]
fn unknown_facts_are_left_out() {
    let said = said("silent", (nothing_told(), Needs::default()));
    assert!(!said.contains("\nbad "), "{said}");
    compare("silent", &said);
}

/// With or without a configuration, a node needs free space.
#[test]
fn full_shared_memory_is_bad() {
    for (free, state) in [(64 << 10, Grade::Bad), (8 << 20, Grade::Warn), (64 << 20, Grade::Ok)] {
        let asked = KernelFacts { room: Some(Room { bytes: 1 << 30, free }), ..nothing_told() };
        let found = examined("run", (asked, Needs::default()));
        let found = found.iter().find(|finding| finding.what == "shared memory").unwrap();
        assert_eq!(found.state, state, "{found:?}");
    }
}

/// Each of them is told by another line, with its own fix.
#[test]
fn what_keeps_a_wormhole_from_its_work_is_told() {
    let halts = vec![HeldHalt { holder: "anna@desk".into(), number: 1 }];
    let silent = Supervisor { says: Some(Err("no answer".into())), ..wormhole(seeing()) };
    let under_normal = Supervisor { fifo: None, ..wormhole(seeing()) };
    for (supervisor, state, fix) in [
        (wormhole(seeing()), Grade::Ok, None),
        (Supervisor { says: None, ..wormhole(seeing()) }, Grade::Ok, None),
        (under_normal, Grade::Warn, Some("128")),
        (silent, Grade::Bad, Some("rohrpost start wormhole.0")),
        (wormhole(ControlState { mode: ControlMode::Failed, ..seeing() }), Grade::Warn, Some("wormhole.0 reset")),
        (wormhole(ControlState { halts, ..seeing() }), Grade::Warn, Some("rohrpost resume")),
        (wormhole(ControlState::default()), Grade::Warn, Some("`laser` of wormhole.0")),
        (wormhole(ControlState { late_looks: 3, ..seeing() }), Grade::Warn, Some("`late-ms`")),
    ] {
        let (asked, needs) = good();
        let found = examined("good", (asked, Needs { supervisors: vec![supervisor], ..needs }));
        let found = found.iter().find(|finding| finding.what == "supervision").unwrap();
        let is_told = fix.is_none_or(|fix| found.fix.as_ref().is_some_and(|told| told.contains(fix)));
        assert!(found.state == state && is_told, "{found:?}");
    }
}

/// One that its holder and its witness have.
fn seat(standing: Standing) -> Seat {
    let [module, node, witness, holder] = ["pilot.0", "desk", "base", "brain"].map(str::to_owned);
    Seat { module, node, witness, holder: Some(holder), here: Some((standing, "why".into())) }
}

#[test]
fn what_keeps_a_standby_from_its_work_is_told() {
    let start = Some("rohrpost start pilot.0 --node desk");
    for (seat, state, fix) in [
        (seat(Standing::StandsBy), Grade::Ok, None),
        (seat(Standing::On), Grade::Ok, None),
        (Seat { here: None, ..seat(Standing::On) }, Grade::Ok, None),
        (seat(Standing::Failed), Grade::Bad, start),
        (seat(Standing::Stopped), Grade::Warn, start),
        (seat(Standing::Starting), Grade::Warn, Some("rohrpost log pilot.0")),
        (Seat { holder: None, ..seat(Standing::StandsBy) }, Grade::Bad, Some("rohrpost launch FILE --node base")),
    ] {
        let (asked, needs) = good();
        let found = examined("good", (asked, Needs { seats: vec![seat], ..needs }));
        let found = found.iter().find(|finding| finding.what == "standby").unwrap();
        let is_told = fix.is_none_or(|fix| found.fix.as_ref().is_some_and(|told| told.contains(fix)));
        assert!(found.state == state && is_told, "{found:?}");
    }
}

#[test]
fn late_wake_ups_are_reported() {
    let validate = |most| measure::validate(&[Duration::from_micros(60), Duration::from_micros(most)], Some(34));
    assert_eq!((validate(90).state, validate(6000).state), (Grade::Ok, Grade::Warn));
    assert_ne!(validate(90).is, validate(6000).is);
}

/// A line that is the same for every computer says nothing, or is wrong.
#[test]
fn each_line_is_tested_with_the_opposite_state() {
    // None of these is a problem: each describes a state, which differs between the computers.
    const NEVER_WRONG: [&str; 6] = ["fair server", "nice", "user", "container", "isolated cores", "systemd"];
    // These appear only for a problem.
    const NEVER_RIGHT: [&str; 3] = ["CPU quota", "real-time quota", "system time"];
    let computers = [
        ("good", good()),
        ("bad", bad()),
        ("run", too_little_room_in_run()),
        ("silent", elsewhere()),
        ("silent", (nothing_told(), Needs::default())),
    ];
    let found: Vec<Finding> = computers.into_iter().flat_map(|(name, computer)| examined(name, computer)).collect();
    for what in found.iter().map(|finding| finding.what) {
        let same = || found.iter().filter(|finding| finding.what == what);
        let (fine, wrong): (Vec<_>, Vec<_>) = same().partition(|finding| finding.state == Grade::Ok);
        if NEVER_RIGHT.contains(&what) {
            assert!(fine.is_empty(), "{what} appears although nothing is wrong");
            continue;
        }
        assert_eq!(wrong.is_empty(), NEVER_WRONG.contains(&what), "{what}: {wrong:?}");
        assert!(!fine.is_empty(), "{what} never appears with the grade ok");
        assert!(same().any(|other| other.is != fine[0].is), "{what} is the same for each computer: {}", fine[0].is);
    }
}
