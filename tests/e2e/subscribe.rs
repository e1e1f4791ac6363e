//! A subscriber names the mailbox for the data, and takes only what it asked for there.

use crate::harness::{PATIENCE, Place, Robot, halt, probe, program, run_if_launched, signal, until, wait};
use crate::probe::{NEWEST, ProbingInterface, SWAPPED};
use nix::sys::signal::Signal;
use rohrpost::common::{DataHead, Refused, SUBSCRIBE, Subscribe};
use rohrpost::wire::{append, from_bytes};
use rohrpost::{Context, Module, ModuleError, ToolLink};
use rohrpost_mailbox::{Kind, Label, Loss, Name, Options, Participant, Shape, Type, local};
use rohrpost_modules::call::CallEnvelope;

/// The newest published beat: it has been sent to all subscribers of each beat.
fn beat(robot: &Robot, tool: &mut ToolLink) -> u64 {
    robot.newest(tool, "probe.0", ProbingInterface::BEAT).unwrap().1
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
    let (place, mut launch, robot) = Place::running(&[
        &probe("probe.0", "rate-hz = 100.0", ""),
        &probe("probe.1", "hears = \"probe.0\"", "calls = [\"probe.0\"]\nmailbox.data.slots = 1024"),
    ]);
    let mut tool = robot.tool(PATIENCE);
    until("beats come to both", || {
        let both = [heard(&place, "each"), heard(&place, "newest")];
        both.iter().all(|beats| !beats.is_empty())
    });
    let pid = robot.pid("probe.1");
    halt(pid);
    let (halted, before) = (beat(&robot, &mut tool), replaced(&robot));
    until("beats replace each other", || replaced(&robot) >= before + 20);
    let continued = beat(&robot, &mut tool);
    signal(pid, Signal::SIGCONT);
    until("newer beats come to both", || {
        let both = [heard(&place, "each"), heard(&place, "newest")];
        both.iter().all(|beats| beats.last().is_some_and(|last| *last > continued))
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

/// An older interface of probes: what they beat is another type.
#[rohrpost::interface(class = "probe")]
trait OldProbing {
    /// A beat.
    #[data(1)]
    fn beat() -> String;
}

/// Whatever the settings of a probe are.
#[derive(rohrpost::serde::Deserialize)]
#[serde(crate = "rohrpost::serde")]
struct AnySettings {}

struct OldProbe;

impl Module for OldProbe {
    type Settings = AnySettings;
    type Interfaces = OldProbingInterface;

    fn new(_: Self::Settings, _: &mut Context) -> Result<Self, ModuleError> {
        Ok(Self)
    }
}

impl OldProbing for OldProbe {}

/// Not a test: a module that launch starts. Run as a test it ends at once.
#[test]
fn old_probe() {
    run_if_launched::<OldProbe>();
}

/// The publisher is built anew with another interface, and then as it was.
#[test]
fn a_subscription_that_an_interface_ends_is_seen_by_all_tools_and_comes_back_when_they_agree() {
    let place = Place::new();
    let old = place.path("old");
    let [old_program, new_program] = ["subscribe::old_probe", "probe::module"].map(|test| {
        let program: Vec<String> = serde_json::from_str(&program(test)).unwrap();
        program.iter().map(|word| format!("'{word}'")).collect::<Vec<_>>().join(" ")
    });
    let choose = format!("if [ -e '{}' ]; then exec {old_program}; else exec {new_program}; fi", old.display());
    let publisher = probe("probe.0", "rate-hz = 100.0", "")
        .replace(&program("probe::module"), &format!("[\"/bin/sh\", \"-c\", {choose:?}]"));
    let subscriber = probe("probe.1", "hears = \"probe.0\"", "calls = [\"probe.0\"]");
    let (mut launch, robot) = place.launched(&[&publisher, &subscriber]);
    robot.wait_on(&mut launch);
    until("beats come", || !heard(&place, "each").is_empty());
    std::fs::write(&old, "").unwrap();
    place.say(&["restart", "probe.0"]).ok();
    let words = "subscription to `beat` of probe.0: interface differs";
    let what = "there, number 1 is `beat: text`; this program takes `beat: u64`";
    let error = |tool: &[&str]| {
        let told = place.say(&[tool, &["--json"]].concat()).json();
        let modules = told.get("modules").unwrap_or(&told).as_array().unwrap().clone();
        let line = modules.into_iter().find(|line| line["module"] == "probe.1").unwrap();
        assert_eq!(line["state"], "on", "{line}");
        line["error"].as_str().unwrap_or_default().to_owned()
    };
    for tool in [&["status"][..], &["list"], &["top"]] {
        until(format!("{tool:?} tells"), || {
            let error = error(tool);
            error.contains(words) && error.contains(what)
        });
    }
    launch.wait_for(words);
    std::fs::remove_file(&old).unwrap();
    let before = heard(&place, "each").len();
    place.say(&["restart", "probe.0"]).ok();
    until("beats come again", || heard(&place, "each").len() > before + 5);
    for tool in [&["status"][..], &["list"], &["top"]] {
        until(format!("{tool:?} complains of nothing"), || error(tool).is_empty());
    }
    launch.stop();
}

#[test]
fn data_do_not_go_where_commands_and_replies_go() {
    let (_place, mut launch, robot) = Place::running(&[&probe("probe.0", "rate-hz = 100.0", "")]);
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

/// Asks `probe.1` for its dropped data until the counts are these.
fn refuses(robot: &Robot, tool: &mut ToolLink, expected: Refused) {
    let module = robot.name("probe.1");
    wait(format!("{expected:?}"), || (tool.status(module).ok()?.refused == expected).then_some(()));
}

#[test]
fn data_that_nobody_asked_for_are_dropped_and_counted_by_cause() {
    // The test itself is the publisher: so it knows the subscription, and can send everything else.
    let (place, mut launch, robot) = Place::running(&[&probe("probe.1", "hears = \"probe.7\"", "")]);
    let mut tool = robot.tool(PATIENCE);
    let (module, publisher) = (robot.name("probe.1"), robot.name("probe.7"));
    let mut asked = Participant::join(&robot.node, publisher).unwrap().receiver(publisher, Shape::default()).unwrap();
    let (incarnation, wish) = wait("it subscribes", || {
        let package = asked.receive_timeout(PATIENCE)?;
        let (envelope, arguments) = CallEnvelope::split(package.body()).unwrap();
        let wish: Subscribe = from_bytes(arguments).unwrap();
        (package.head().kind.kind() == Kind::Command(SUBSCRIBE) && wish.mailbox == local::DATA)
            .then_some((envelope.incarnation, wish))
    });
    let mut send = |from: Name, id: u16, number: u16, incarnation: u32, beat: u64| {
        let head = DataHead { stamp_ns: 1, sequence: beat as u32, missed: 0, incarnation };
        let mut body = head.to_bytes().to_vec();
        append(&mut body, &beat).unwrap();
        let label = Label { from, id, kind: Type::data(number), options: Options::STAMPED, ..Label::default() };
        tool.link.send(module.with_local(local::DATA), &label, &[&body]).unwrap();
    };
    let Subscribe { id, number, .. } = wish;
    let stranger = Name::new(2, publisher.class().0, publisher.instance(), 0);
    send(stranger, id, number, incarnation, 1);
    send(robot.name("probe.1"), id, number, incarnation, 2);
    send(publisher, id + 7, number, incarnation, 3);
    // Of the other subscription, which has another mailbox.
    send(publisher, 0, number, incarnation, 4);
    send(publisher, id, number + 1, incarnation, 5);
    send(publisher, id, number, incarnation - 1, 6);
    send(publisher, id, number, 0, 7);
    send(publisher, id, number, incarnation, 8);
    let label = Label { from: publisher, kind: Type::data(number), ..Label::default() };
    tool.link.send(module.with_local(local::DATA), &label, &[b"short"]).unwrap();
    tool.link.send(module, &label, &[b"no command"]).unwrap();
    let expected = Refused {
        other_publisher: 2,
        unasked: 2,
        other_number: 1,
        earlier_incarnation: 2,
        malformed: 2,
        ..Refused::default()
    };
    refuses(&robot, &mut tool, expected);
    until("what it asked for comes", || !heard(&place, "each").is_empty());
    assert_eq!((heard(&place, "each"), heard(&place, "newest")), (vec![8], vec![]));
    tool.close();
    launch.stop();
}

#[test]
fn a_subscriber_that_restarts_with_its_subscriptions_in_another_order_takes_no_other_type() {
    const BLOB: u64 = 3000;
    let settings = format!("rate-hz = 100.0, blob-hz = 100.0, blob-bytes = {BLOB}");
    let (place, mut launch, robot) = Place::running(&[
        &probe("probe.0", &settings, ""),
        &probe("probe.1", "mixes = \"probe.0\"", "calls = [\"probe.0\"]"),
    ]);
    let mut tool = robot.tool(PATIENCE);
    let mixed = |what: &str| heard(&place, &format!("mixed {what}"));
    until("it hears both", || !mixed("beat").is_empty() && !mixed("blob").is_empty());
    place.write(SWAPPED, "");
    let pid = robot.pid("probe.1");
    let before = mixed("beat").len();
    signal(pid, Signal::SIGKILL);
    robot.wait_restarted("probe.1", pid);
    until("it hears again", || mixed("beat").len() > before + 20);
    // Data for its earlier incarnation arrived, and the beats are the publisher's own.
    let refused = tool.status(robot.name("probe.1")).unwrap().refused;
    let said = place.record().join("\n");
    assert!(refused.earlier_incarnation + refused.other_number > 0, "{refused:?}: nothing of before came");
    assert!(mixed("beat").windows(2).all(|two| two[0] < two[1]) && mixed("beat").last() < Some(&BLOB), "{said}");
    assert!(mixed("blob").iter().all(|blob| *blob == BLOB), "{said}");
    tool.close();
    launch.stop();
}
