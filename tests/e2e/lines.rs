//! The collector rejects lines in another's name, of future times, or without end.

use crate::harness::{OUTPUT, PATIENCE, Place, Robot, probe, until, wait};
use rohrpost::common::{DataHead, OutputLevel};
use rohrpost::interfaces::{CollectorInterface, RefusedLines};
use rohrpost::output::{LINES, OutputLine};
use rohrpost::wire::{append, from_bytes};
use rohrpost::{Class, ToolLink};
use rohrpost_mailbox::{Label, Name, Options, Type};

/// Number of `refused` in the collector's interface.
const REFUSED: u16 = 17;
const RING: usize = 100;

fn refused(robot: &Robot, tool: &mut ToolLink) -> RefusedLines {
    let (collector, hash) = (robot.name("output.0"), CollectorInterface::hash());
    tool.call(collector, REFUSED, hash, |_| Ok(()), |bytes| from_bytes(bytes)).unwrap()
}

/// Sends a line under this name; false if there was no room.
fn send(robot: &Robot, tool: &mut ToolLink, from: Name, line: &OutputLine) -> bool {
    let head = DataHead { stamp_ns: line.time_ns, sequence: 0, missed: line.lost, incarnation: 0 };
    let mut body = head.to_bytes().to_vec();
    append(&mut body, line).unwrap();
    let (kind, priority, options) = (Type::data(1), Class(32).priority(), Options::STAMPED);
    let label = Label { from, kind, priority, options, ..Label::default() };
    tool.link.send(robot.name("output.0").with_local(LINES), &label, &[&body]).is_ok()
}

/// The log as soon as it contains this: `output` reports a refusal by a line of its own, which takes the path of all
/// lines.
fn told(place: &Place, words: &str) -> String {
    wait(words, || {
        let log = place.say(&["log"]).ok();
        log.contains(words).then_some(log)
    })
}

#[test]
fn a_line_in_anothers_name_is_not_taken_and_what_cannot_be_is_marked() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    let mut tool = robot.tool(PATIENCE);
    let (me, victim) = (tool.link.me(), robot.name("probe.0"));
    let time_ns = tool.clock.now().ns;
    let line = |module: Name, text: &str| {
        let (level, text) = (OutputLevel::Info, text.into());
        OutputLine { time_ns, module: module.raw(), level, lost: 0, suppressed: 0, errno: None, text }
    };
    let stranger = Name::new(2, me.class().0, me.instance(), 0);
    for (from, line) in [
        (me, line(victim, "forged by a tool")),
        (robot.name("output.0"), line(victim, "forged by a module")),
        (stranger, line(victim, "forged by another system")),
        (stranger, line(stranger, "said by another system")),
        (me, line(me, "said in its own name")),
        (me, OutputLine { time_ns: u64::MAX, ..line(me, "said in the future") }),
        (me, OutputLine { lost: 4_000_000_000, ..line(me, "said after many") }),
    ] {
        assert!(send(&robot, &mut tool, from, &line));
    }
    let expected = RefusedLines { foreign_name: 2, other_system: 2, ahead: 1, losses: 1, ..RefusedLines::default() };
    until("all lines are checked", || refused(&robot, &mut tool) == expected);
    let log = told(&place, "lines in the name of others were dropped");
    assert!(!log.contains("forged") && !log.contains("by another system"), "{log}");
    assert!(log.contains(": said in its own name"), "{log}");
    assert!(log.contains("(says that it is of 2554-07-21T23:34:33.709551Z) said in the future"), "{log}");
    assert!(log.contains("(says that 4000000000 lines were lost) said after many"), "{log}");
    assert!(!log.contains("… 4000000000"), "{log}");
    tool.close();
    launch.stop();
}

#[test]
fn a_module_with_endless_lines_has_its_share_and_lines_of_others_stay() {
    let ring = format!("[output]\nring = {RING}\n");
    let (place, mut launch, robot) = Place::running(&[&ring, OUTPUT, &probe("probe.0", "", "")]);
    let mut tool = robot.tool(PATIENCE);
    let before = told(&place, "probe.0:");
    let of_probe: Vec<&str> = before.lines().filter(|line| line.contains("probe.0:")).collect();
    let me = tool.link.me();
    let time_ns = tool.clock.now().ns;
    let text = "noise".into();
    let line =
        OutputLine { time_ns, module: me.raw(), level: OutputLevel::Info, lost: 0, suppressed: 0, errno: None, text };
    until("its share is used up", || {
        (0..5000).for_each(|_| _ = send(&robot, &mut tool, me, &line));
        refused(&robot, &mut tool).beyond_share > 0
    });
    let after = told(&place, "more than the share of the principal of tool.");
    let noise = after.lines().filter(|line| line.ends_with("noise")).count();
    assert!(noise > RING / 2 && noise < RING, "{noise} of {RING}");
    assert!(of_probe.iter().all(|line| after.contains(line)), "{before}\n{after}");
    tool.close();
    launch.stop();
}
