//! Who subscribes says into which of its mailboxes the data go.

use crate::harness::{PATIENCE, Place, Robot, halt, probe, signal, wait};
use crate::probe::{NEWEST, ProbingInterface};
use nix::sys::signal::Signal;
use rohrpost::ToolLink;
use rohrpost::common::{GET_DATA, SUBSCRIBE, Subscribe};
use rohrpost::macro_support::{append, from_bytes};
use rohrpost::mailbox::{Loss, local};

/// The newest beat that has been published: whoever subscribed to each of them has been sent it.
fn beat(robot: &Robot, tool: &mut ToolLink) -> u64 {
    let (module, hash) = (robot.name("probe.0"), ProbingInterface::hash());
    let number = ProbingInterface::BEAT.number;
    let (_stamp_ns, beat): (u64, u64) =
        tool.call(module, GET_DATA, hash, |body| append(body, &(number,)), |bytes| from_bytes(bytes)).unwrap();
    beat
}

/// Beats that `probe.1` has written down.
fn heard(place: &Place, how: &str) -> Vec<u64> {
    let said = format!("probe.1 {how} ");
    place.record().iter().filter_map(|line| line.strip_prefix(&said)?.parse().ok()).collect()
}

fn replaced(robot: &Robot) -> u64 {
    let mailbox = robot.node.look_at(robot.name("probe.1").with_local(NEWEST)).unwrap();
    mailbox.classes.iter().map(|class| class.lost(Loss::Replaced)).sum()
}

#[test]
fn a_mailbox_of_ones_own_holds_the_newest_and_the_other_holds_each() {
    let place = Place::new();
    let (mut launch, robot) = place.launched(&[
        &probe("probe.0", "rate-hz = 100.0", ""),
        &probe("probe.1", "hears = \"probe.0\"", "calls = [\"probe.0\"]\nmailbox.data.slots = 1024"),
    ]);
    let mut tool = robot.tool(PATIENCE);
    wait("beats come to both", || {
        let both = [heard(&place, "each"), heard(&place, "newest")];
        both.iter().all(|beats| !beats.is_empty()).then_some(())
    });
    let pid = robot.pid("probe.1");
    halt(pid);
    let (halted, before) = (beat(&robot, &mut tool), replaced(&robot));
    wait("beats replace each other", || (replaced(&robot) >= before + 20).then_some(()));
    let continued = beat(&robot, &mut tool);
    signal(pid, Signal::SIGCONT);
    wait("newer beats come to both", || {
        let both = [heard(&place, "each"), heard(&place, "newest")];
        both.iter().all(|beats| beats.last().is_some_and(|last| *last > continued)).then_some(())
    });
    let newest = heard(&place, "newest");
    let old: Vec<&u64> = newest.iter().filter(|beat| (halted + 1..continued).contains(beat)).collect();
    assert!(old.is_empty(), "{halted} when it stopped, {continued} when it went on, and it heard {old:?}");
    let each = heard(&place, "each");
    assert!(each.windows(2).all(|two| two[1] == two[0] + 1), "{each:?}");
    let status = tool.status(robot.name("probe.1")).unwrap();
    assert_eq!(status.lost, 0, "what newer ones replaced is no loss");
    let list = place.say(&["list", "-m"]).ok();
    assert!(list.lines().any(|line| line.contains("probe.1.3") && line.contains("latest")), "{list}");
    tool.close();
    launch.stop();
}

#[test]
fn data_do_not_go_where_commands_and_replies_go() {
    let place = Place::new();
    let (mut launch, robot) = place.launched(&[&probe("probe.0", "rate-hz = 100.0", "")]);
    let mut tool = robot.tool(PATIENCE);
    for mailbox in [local::COMMANDS, local::REPLIES] {
        let wish = Subscribe { number: 1, id: 1, period_us: 0, lease_ms: 60_000, mailbox };
        let write = |body: &mut Vec<u8>| append(body, &wish);
        let asked = tool.call(robot.name("probe.0"), SUBSCRIBE, ProbingInterface::hash(), write, |_| Ok(()));
        let why = asked.unwrap_err().to_string();
        assert!(why.contains(&format!("mailbox {mailbox} takes no data; name 2 or one above")), "{why}");
    }
    assert_eq!(tool.status(robot.name("probe.0")).unwrap().subscribers, 0);
    tool.close();
    launch.stop();
}
