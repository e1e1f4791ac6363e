//! Launch shows its node page by page to tools without access to its shared memory. Here a tool with access compares.

use crate::harness::{OUTPUT, PATIENCE, Place, halt, probe, signal, until};
use nix::sys::signal::Signal;
use rohrpost::ToolLink;
use rohrpost::wire::{append, from_bytes};
use rohrpost_launch::launcher::{LauncherInterface, LookError, LookPage, SnapshotRequest};
use rohrpost_launch::survey::{LookFailure, MailboxSnapshot, Scope, Snapshot, Survey, look_at_all};
use rohrpost_mailbox::{FlowInfo, Name};
use std::time::{Duration, Instant};

const LOOK: u16 = 20;
const LOOK_ON: u16 = 21;

fn look(tool: &mut ToolLink, what: SnapshotRequest) -> Result<Snapshot, LookFailure> {
    let launcher = tool.launcher();
    look_at_all(&mut tool.link, &[launcher], what, PATIENCE).pop().unwrap()
}

fn survey(tool: &mut ToolLink, scope: Scope) -> Survey {
    match look(tool, SnapshotRequest::Survey(scope)).unwrap() {
        Snapshot::Survey(survey) => *survey,
        Snapshot::Mailbox(_) => panic!("a survey was asked for"),
    }
}

fn mailbox(tool: &mut ToolLink, name: Name) -> Option<Box<MailboxSnapshot>> {
    match look(tool, SnapshotRequest::Mailbox(name.raw())).unwrap() {
        Snapshot::Mailbox(look) => look,
        Snapshot::Survey(_) => panic!("a mailbox was asked for"),
    }
}

/// The flows without their counts, and without those of the observer, since snapshots cause flows themselves.
fn kinds(flows: &[FlowInfo], looker: Name) -> Vec<(u32, Name, Name, i16)> {
    let others = flows.iter().filter(|flow| ![flow.from.module(), flow.to.module()].contains(&looker));
    let mut kinds: Vec<_> = others.map(|flow| (flow.incarnation, flow.from, flow.to, flow.kind.0)).collect();
    kinds.sort_unstable();
    kinds
}

#[test]
fn a_look_from_afar_shows_what_a_look_from_near_does() {
    // No collector: launch's first line to it would be a flow that only some snapshots show.
    let (place, _launch, robot) = Place::running(&[&probe("probe.0", "rate-hz = 50.0", ""), &probe("probe.1", "", "")]);
    let mut tool = robot.tool(PATIENCE);
    tool.status(robot.name("probe.0")).unwrap();
    until("the probe publishes", || robot.node.traffic().iter().any(FlowInfo::is_publication));
    place.write("picture", "pixels");
    place.say(&["stream", "write", "probe.0", "7", "picture"]).ok();
    let before = survey(&mut tool, Scope::All);
    let near = Survey::new(&robot.node, &robot.installation, "main").unwrap();
    let after = survey(&mut tool, Scope::All);
    assert!(before.at_ns < near.at_ns && near.at_ns < after.at_ns);
    assert_eq!((before.node.as_str(), after.node.as_str()), ("main", "main"));
    let names = |survey: &Survey| survey.modules.iter().map(|module| module.name).collect::<Vec<_>>();
    assert_eq!(names(&before), names(&near));
    for (name, ((a, b), c)) in names(&near).iter().zip(before.modules.iter().zip(&near.modules).zip(&after.modules)) {
        assert_eq!((&a.process, &a.aliases, &a.node), (&b.process, &b.aliases, &b.node), "{name}");
        for (what, count) in [
            ("received", [a.received, b.received, c.received]),
            ("sent", [a.sent, b.sent, c.sent]),
            ("bytes in", [a.bytes_in, b.bytes_in, c.bytes_in]),
            ("waits", [a.waited.count(), b.waited.count(), c.waited.count()]),
        ] {
            assert!(count.is_sorted(), "{what} of {name}: {count:?}");
        }
        assert!(
            a.usage.is_some_and(|usage| usage.memory_bytes > 0) && a.scheduling.is_some(),
            "launch asks the kernel"
        );
    }
    let shapes = |survey: &Survey| survey.mailboxes.iter().map(|m| (m.name, m.shape, m.owner)).collect::<Vec<_>>();
    assert_eq!(shapes(&after), shapes(&near));
    let streams = |survey: &Survey| survey.streams.iter().map(|s| format!("{:?}", s.info)).collect::<Vec<_>>();
    assert_eq!((streams(&after), near.streams.len()), (streams(&near), 1));
    let me = tool.link.me();
    assert_eq!(kinds(&after.flows, me), kinds(&near.flows, me));
    let beat = |survey: &Survey| survey.flows.iter().find(|flow| flow.is_publication()).unwrap().clone();
    let (first, last) = (beat(&before), beat(&after));
    assert!(last.is_same(&first) && last.packages >= first.packages && !last.seconds.is_empty());
    tool.close();
}

#[test]
fn a_look_is_no_larger_than_what_is_asked_for() {
    let (place, _launch, robot) =
        Place::running(&[OUTPUT, &probe("probe.0", "rate-hz = 50.0", ""), &probe("probe.1", "", "")]);
    let mut tool = robot.tool(PATIENCE);
    let probe = robot.name("probe.0");
    until("the probe publishes", || robot.node.traffic().iter().any(FlowInfo::is_publication));
    place.write("picture", "pixels");
    for module in ["probe.0", "probe.1"] {
        place.say(&["stream", "write", module, "7", "picture"]).ok();
    }
    let modules = survey(&mut tool, Scope::Modules);
    assert_eq!((modules.modules.len(), modules.mailboxes.len(), modules.flows.len()), (3, 0, 0));
    assert!(modules.streams.is_empty());
    assert!(!modules.classes.is_empty());
    let mailboxes = survey(&mut tool, Scope::Mailboxes);
    assert!(mailboxes.mailboxes.len() > 3 && mailboxes.flows.is_empty());
    assert_eq!(mailboxes.streams.len(), 2);
    let streams = survey(&mut tool, Scope::Streams);
    assert_eq!((streams.streams.len(), streams.modules.len(), streams.mailboxes.len()), (2, 0, 0));
    let one = survey(&mut tool, Scope::Module(probe.raw()));
    assert_eq!((one.modules.len(), one.streams.len()), (1, 1));
    assert!(!one.flows.is_empty());
    assert!(one.flows.iter().all(|flow| [flow.from.module(), flow.to.module()].contains(&probe)));
    let sent: Vec<Name> = one.flows.iter().filter(|flow| flow.from.module() == probe).map(|flow| flow.to).collect();
    assert!(one.mailboxes.iter().all(|mailbox| mailbox.name.module() == probe || sent.contains(&mailbox.name)));
    tool.close();
}

#[test]
fn a_mailbox_is_shown_down_to_its_slots() {
    let (_place, _launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let mut tool = robot.tool(PATIENCE);
    let name = robot.name("probe.0");
    let pid = robot.pid("probe.0");
    halt(pid);
    robot.begin(&mut tool, "probe.0", 16, &(7u32,));
    let seen = mailbox(&mut tool, name).unwrap();
    let near = MailboxSnapshot::new(&robot.node, name).unwrap();
    assert_eq!(seen.detail.slots, near.detail.slots);
    assert_eq!((seen.detail.receiver, seen.detail.is_retired), (near.detail.receiver, near.detail.is_retired));
    assert_eq!((seen.detail.info.depth, seen.detail.info.shape), (1, near.detail.info.shape));
    assert_eq!(seen.stopped, [pid]);
    signal(pid, Signal::SIGCONT);
    assert!(mailbox(&mut tool, name.with_local(77)).is_none(), "there is none of this name");
    tool.close();
}

#[test]
fn another_version_is_refused_and_an_old_look_is_gone() {
    let (_place, _launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let mut tool = robot.tool(PATIENCE);
    let launcher = tool.launcher();
    let mut ask = |function, write: &dyn Fn(&mut Vec<u8>)| {
        let write = |body: &mut Vec<u8>| {
            write(body);
            Ok(())
        };
        let hash = LauncherInterface::hash();
        tool.call(launcher, function, hash, write, |bytes| from_bytes::<Result<LookPage, LookError>>(bytes)).unwrap()
    };
    let what = SnapshotRequest::Survey(Scope::Modules);
    let Err(LookError::Form(form)) = ask(LOOK, &|body| append(body, &(what, 1u32, 100u16)).unwrap()) else {
        panic!("the form of another version was taken");
    };
    let first = ask(LOOK, &|body| append(body, &(what, form, 100u16)).unwrap()).unwrap();
    assert_eq!((first.from, first.bytes.len()), (0, 100));
    let next = |from: u32| move |body: &mut Vec<u8>| append(body, &(first.look, from, 100u16)).unwrap();
    let (look, total) = (first.look, first.total);
    let second = ask(LOOK_ON, &next(100)).unwrap();
    assert_eq!((second.look, second.total, second.from), (look, total, 100));
    let beyond = ask(LOOK_ON, &next(u32::MAX)).unwrap();
    assert!(beyond.bytes.is_empty());
    // Sixteen newer ones replace it.
    for _ in 0..16 {
        ask(LOOK, &|body| append(body, &(what, form, 100u16)).unwrap()).unwrap();
    }
    assert_eq!(ask(LOOK_ON, &next(100)), Err(LookError::Gone));
    tool.close();
}

#[test]
fn a_launch_that_stands_is_silent_in_time() {
    let (_place, launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let mut tool = robot.tool(PATIENCE);
    let launcher = tool.launcher();
    halt(launch.pid());
    let (began, timeout) = (Instant::now(), Duration::from_millis(700));
    let seen = look_at_all(&mut tool.link, &[launcher], SnapshotRequest::Survey(Scope::All), timeout).pop().unwrap();
    assert!(matches!(seen, Err(LookFailure::Silent(_))), "{seen:?}");
    assert!(began.elapsed() >= timeout);
    signal(launch.pid(), Signal::SIGCONT);
    // An earlier question does not disturb the present one.
    assert_eq!(survey(&mut tool, Scope::Modules).modules.len(), 1);
    tool.close();
}
