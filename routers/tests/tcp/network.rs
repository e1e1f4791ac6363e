//! Sessions over a network of their own: a line with a low rate, and what an eavesdropper sees.

use crate::ground::{Router, System, module, wait};
use crate::sealed::{Authority, seal};
use rohrpost_mailbox::{Label, Priority, Type};
use rohrpost_routers::lab::{DEVICE, Lab, LabError, NodeSpec};
use rohrpost_routers::tcp::LinkState;
use rohrpost_testbed::report::skipped;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::process::{Command, Stdio};
use std::time::Duration;

pub(crate) const PORT: u16 = 21_443;
/// The largest package.
const LARGE_BYTES: usize = 65_000;
const LARGE: Priority = Priority(50);
/// Identities that clients send: beside the TCP router, and on node `far`.
pub(crate) const CLIENTS: [&str; 2] = ["the client of the arm", "the client of the tower"];
pub(crate) const ADDRESSES: [IpAddr; 2] =
    [IpAddr::V4(Ipv4Addr::new(10, 77, 0, 1)), IpAddr::V4(Ipv4Addr::new(10, 77, 0, 2))];
/// What nobody may read.
const SECRET: &[u8] = b"nobody may read this";

/// Two nodes, `base` and `far`; none where namespaces cannot be made.
pub(crate) fn lab() -> Option<Lab> {
    let spec = |name: &str, address| NodeSpec { name: name.into(), address };
    match Lab::new(&[spec("base", ADDRESSES[0]), spec("far", ADDRESSES[1])], 1500) {
        Ok(lab) => Some(lab),
        Err(LabError::NotAllowed(error)) => {
            skipped(&format!("network namespaces ({error})"));
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// The TCP router on `base`, system 2 beside it, and system 1 on `far`; both take part.
pub(crate) struct Joined {
    pub(crate) near: System,
    pub(crate) far: System,
    _server: Router,
}

impl Joined {
    pub(crate) fn new(lab: &Lab, authority: Option<&Authority>) -> Self {
        let address = SocketAddr::from((ADDRESSES[0], PORT));
        let (server, near) = {
            let _inside = lab.enter("base").unwrap();
            let server = Router::at(address, authority.map(Authority::server));
            (server, System::sealed(2, CLIENTS[0], address, seal(authority, 2)))
        };
        let far = {
            let _inside = lab.enter("far").unwrap();
            System::sealed(1, CLIENTS[1], address, seal(authority, 1))
        };
        near.wait_up();
        far.wait_up();
        Self { near, far, _server: server }
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
    let Some(lab) = lab() else { return };
    if !is_shaped(&lab, "far", line) {
        return skipped("a line that takes little (`tc` with tbf)");
    }
    let mut joined = Joined::new(&lab, authority);
    let far = &joined.far;
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
        joined.near.hear().filter(|number| *number == 2)
    });
    assert_eq!(joined.far.client.link().connections, 1);
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
    let lab = lab()?;
    let mut joined = Joined::new(&lab, authority);
    let mut capture = lab.capture().unwrap();
    // It begins anew, so that the beginning of a session is seen as well.
    lab.cut("far").unwrap();
    wait("far is away", || (joined.far.client.link().state == LinkState::Away).then_some(()));
    lab.fix("far").unwrap();
    joined.far.wait_up();
    let label = Label { from: module(1), kind: Type::data(1), priority: Priority(100), ..Label::default() };
    let mut sender = joined.far.sender(2);
    let (mut came, mut bytes, mut found) = (0, 0, [0; 3]);
    wait("packages cross", || {
        let _ = sender.send(&label, &[SECRET]);
        came += usize::from(joined.near.hear_bytes().is_some_and(|body| body == SECRET));
        capture.drain_frames(|frame| {
            bytes += frame.len();
            for (count, words) in found.iter_mut().zip([SECRET, CLIENTS[1].as_bytes(), b"RpTc"]) {
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
