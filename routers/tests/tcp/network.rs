//! Sessions over a network of their own: a line with a low rate, and what an eavesdropper sees.

use crate::ground::{System, module, node, start_sealed, wait};
use crate::sealed::{Authority, Holds};
use rohrpost_mailbox::{Label, Priority, Type};
use rohrpost_routers::lab::{DEVICE, Lab, LabError, NodeSpec};
use rohrpost_routers::tcp::{LinkState, ServerSeal, ServerShell};
use rohrpost_testbed::report::skipped;
use std::net::SocketAddr;
use std::process::{Command, Stdio};
use std::time::Duration;

const PORT: u16 = 21_443;
/// The largest package.
const LARGE_BYTES: usize = 65_000;
const LARGE: Priority = Priority(50);
/// The client of node `far`.
const FAR: &str = "the client of system 1";
/// What nobody may read.
const SECRET: &[u8] = b"nobody may read this";

/// The TCP router on `base`, system 2 beside it, and system 1 on `far`.
struct Network {
    lab: Lab,
    near: System,
    far: System,
    _server: ServerShell,
    _folder: tempfile::TempDir,
}

impl Network {
    /// `line`: what `tc` makes of the line of `far`. None where namespaces cannot be made, or it does not know that.
    fn new(authority: Option<&Authority>, line: Option<&str>) -> Option<Self> {
        let spec = |name: &str, last| NodeSpec { name: name.into(), address: [10, 77, 0, last].into() };
        let lab = match Lab::new(&[spec("base", 1), spec("far", 2)], 1500) {
            Ok(lab) => lab,
            Err(LabError::NotAllowed(error)) => {
                skipped(&format!("network namespaces ({error})"));
                return None;
            }
            Err(error) => panic!("{error}"),
        };
        if !line.is_none_or(|line| is_shaped(&lab, "far", line)) {
            skipped("a line that takes little (`tc` with tbf)");
            return None;
        }
        let server = SocketAddr::from(([10, 77, 0, 1], PORT));
        let seal = |system| authority.map(|authority| authority.seal(system, Holds::Now));
        let ((folder, own), sealed) = (node(), authority.map(|all| ServerSeal::load(all.path()).unwrap()));
        let (router, near) = {
            let _inside = lab.enter("base").unwrap();
            (start_sealed(server, &own, 1, sealed).unwrap(), System::sealed(2, "near", server, seal(2)))
        };
        let far = {
            let _inside = lab.enter("far").unwrap();
            System::sealed(1, FAR, server, seal(1))
        };
        near.wait_up();
        far.wait_up();
        Some(Self { lab, near, far, _server: router, _folder: folder })
    }
}

fn is_shaped(lab: &Lab, node: &str, line: &str) -> bool {
    let mut tc = Command::new("tc");
    let tc = tc.args(["qdisc", "add", "dev", DEVICE]).args(line.split(' ')).stderr(Stdio::null());
    lab.command(node, tc).is_ok_and(|mut tc| tc.wait().unwrap().success())
}

fn passed(system: &System, priority: Priority) -> u64 {
    let classes = system.client.link().out.into_iter().filter(|class| class.priority == priority);
    classes.map(|class| class.passed).sum()
}

/// 64 kbit/s: one of the largest packages takes eight seconds.
fn a_slow_uplink_stays_up(authority: Option<&Authority>) {
    let line = "root tbf rate 64kbit burst 1600 limit 20000";
    let Some(mut network) = Network::new(authority, Some(line)) else { return };
    let far = &network.far;
    let (mut large, mut small) = (far.sender(2), far.sender(2));
    let label = Label { from: module(1), kind: Type::data(1), priority: LARGE, ..Label::default() };
    // The third leaves when the first two have: sixteen seconds of nothing else.
    wait("large packages leave", || {
        let _ = large.send(&label, &[&[0; LARGE_BYTES]]);
        far.say(&mut small, 1);
        std::thread::sleep(Duration::from_millis(100));
        (passed(far, LARGE) > 2).then_some(())
    });
    let link = far.client.link();
    assert_eq!((link.connections, link.state), (1, LinkState::Up), "{}", link.why);
    wait("what is small crosses again", || {
        far.say(&mut small, 2);
        std::thread::sleep(Duration::from_millis(100));
        network.near.hear().filter(|number| *number == 2)
    });
    assert_eq!(network.far.client.link().connections, 1);
}

#[test]
fn a_line_of_64_kbit_a_second_stays_up_however_large_the_packages_are() {
    a_slow_uplink_stays_up(None);
}

#[test]
fn a_sealed_line_of_64_kbit_a_second_stays_up_too() {
    a_slow_uplink_stays_up(Some(&Authority::new()));
}

/// What an eavesdropper reads of it: the bodies of packages, the names of clients, the words that sessions begin with.
fn seen_on_the_wire(authority: Option<&Authority>) -> Option<[usize; 3]> {
    let mut network = Network::new(authority, None)?;
    let mut capture = network.lab.capture().unwrap();
    // It begins anew, so that the beginning of a session is seen as well.
    network.lab.cut("far").unwrap();
    wait("far is away", || (network.far.client.link().state == LinkState::Away).then_some(()));
    network.lab.fix("far").unwrap();
    network.far.wait_up();
    let label = Label { from: module(1), kind: Type::data(1), priority: Priority(100), ..Label::default() };
    let mut sender = network.far.sender(2);
    let (mut came, mut bytes, mut found) = (0, 0, [0; 3]);
    wait("packages cross", || {
        let _ = sender.send(&label, &[SECRET]);
        came += usize::from(network.near.hear_bytes().is_some_and(|body| body == SECRET));
        capture.drain_frames(|frame| {
            bytes += frame.len();
            for (count, words) in found.iter_mut().zip([SECRET, FAR.as_bytes(), b"RpTc"]) {
                *count += usize::from(frame.windows(words.len()).any(|part| part == words));
            }
        });
        (came >= 100).then_some(())
    });
    assert!(bytes > 100 * SECRET.len(), "all that crosses is seen: {bytes} bytes");
    Some(found)
}

#[test]
fn an_eavesdropper_reads_nothing_of_a_sealed_session_and_all_of_one_that_is_not() {
    let Some([bodies, names, words]) = seen_on_the_wire(None) else { return };
    assert!(bodies > 20 && names > 0 && words > 0, "{bodies} bodies, {names} names, {words} beginnings");
    assert_eq!(seen_on_the_wire(Some(&Authority::new())), Some([0; 3]));
}
