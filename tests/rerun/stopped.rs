//! The bridge itself is stopped for a while, as on a computer that is too busy, and goes on.

use super::programs::{printed, rows, times_ns};
use super::robot::{Robot, until, wait};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_mailbox::{ClassTraffic, Loss, OverflowPolicy, local};

const SCAN: &str = "/world/scan/source.0";
/// The bridge's mailbox for states.
const NEWEST: u8 = 3;
/// Patches of the source's map.
const PATCHES: usize = 64;
/// Patches that arrive while the bridge is stopped: for a second, which is less than the lifetime of a subscription
/// without renewal.
const WAITING: u32 = 10;

fn is_stopped(pid: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
    stat.rsplit_once(") ").unwrap().1.starts_with('T')
}

#[test]
fn a_bridge_that_stood_still_goes_on_with_the_newest() {
    let mut robot = Robot::start("file = \"robot.rrd\"", "");
    let file = robot.folder().join("robot.rrd");
    until("scans are drawn", || !times_ns(&file, SCAN).is_empty());

    let pid = robot.bridge_pid();
    let signal = |signal| kill(Pid::from_raw(pid as i32), signal).unwrap();
    signal(Signal::SIGSTOP);
    until("the bridge stands still", || is_stopped(pid));
    let stopped_ns = robot.newest_scan_ns();
    // A published value with a later value that was sent has been sent itself, however slow the computer is.
    let (mut continued_ns, mut last) = (stopped_ns, (stopped_ns, u64::MAX));
    until("patches wait", || {
        let sent = robot.bridge_mailbox(NEWEST).sent;
        if sent > last.1 {
            continued_ns = last.0;
        }
        last = (robot.newest_scan_ns(), robot.bridge_mailbox(NEWEST).sent);
        robot.bridge_mailbox(local::DATA).depth >= WAITING
    });
    assert!(continued_ns > stopped_ns, "scans were sent meanwhile");
    signal(Signal::SIGCONT);

    let drawn = wait("it draws again", || {
        let drawn = times_ns(&file, SCAN);
        drawn.last().is_some_and(|last| *last >= continued_ns).then_some(drawn)
    });
    let first = drawn.into_iter().find(|ns| *ns > stopped_ns).unwrap();
    let late_s = continued_ns.saturating_sub(first) as f64 / 1e9;
    assert!(first >= continued_ns, "the first scan after the stop was {late_s:.3} s old; the newest was there");
    until("the map is whole", || {
        let rows = rows(&printed(&file, &[]));
        rows.keys().filter(|entity| entity.starts_with("/world/map/source.0/")).count() == PATCHES
    });

    let [newest, each] = [NEWEST, local::DATA].map(|local| robot.bridge_mailbox(local));
    let replaced = |classes: &[ClassTraffic]| classes.iter().map(|class| class.lost(Loss::Replaced)).sum::<u64>();
    assert_eq!((newest.shape.full, each.shape.full), (OverflowPolicy::Latest, OverflowPolicy::Displace));
    assert!(replaced(&newest.classes) > u64::from(WAITING), "{:?}", newest.classes);
    assert_eq!(replaced(&each.classes), 0, "patches do not replace each other");
    robot.assert_well();
    assert_eq!((robot.lost_by("gui.0"), robot.lost_by("sink.0")), (0, 0), "packages");
    let list = robot.say(&["list", "-m"]);
    assert!(list.lines().any(|line| line.contains("gui.0.3") && line.contains("latest")), "{list}");
}
