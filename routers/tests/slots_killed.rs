//! The master of time slots dies, stands still or stumbles, as a process: the others go on in their slots and lose
//! nothing.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "slots_common/mod.rs"]
mod common;

use common::hog::{Hog, be_a_hog};
use common::kept::assert_kept;
use common::process::{Router, be_a_router};
use common::talk::{Listeners, talkers};
use common::{Capture, MASTERS, Segment};
use nix::sys::signal::Signal;
use rohrpost_mailbox::monotonic_ns;
use rohrpost_routers::link::PeerLinkState;
use rohrpost_testbed::report;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// What the processes run.
const PROCESS: &str = "in_a_process_of_its_own";
/// This node is in this process, and never master: it sees which node is.
const WITNESS: u8 = 2;
/// Longer than a takeover takes, and than anything may be late.
const FROZEN: Duration = Duration::from_millis(500);
/// A stumble, and the time between two: at most half of the windows are met by one.
const STUMBLE: Duration = Duration::from_millis(4);
const BETWEEN: Duration = Duration::from_millis(9);

/// How often it stands still, or stumbles.
const TIMES: u16 = 3;

/// How often it is killed: for a long run, `ROHRPOST_KILLS=100 cargo test -p rohrpost-routers --test slots_killed`.
fn kills() -> u16 {
    std::env::var("ROHRPOST_KILLS").ok().map_or(5, |kills| kills.parse().unwrap())
}

/// The masters' routers are processes.
struct Scene {
    routers: [Option<Router>; 2],
    listeners: Listeners,
    segment: Segment,
}

impl Scene {
    fn new() -> Option<Self> {
        let mut segment = Segment::at_rest(None)?;
        // By its time frames are checked, so its clock is the true one.
        segment.stations[usize::from(WITNESS)].skew = Default::default();
        let Segment { stations, lab, .. } = &mut segment;
        stations[usize::from(WITNESS)].start(lab);
        let routers = MASTERS.map(|own| Some(Router::start(&segment, own, PROCESS)));
        let scene = Self { routers, listeners: Listeners::new(&segment), segment };
        scene.wait_until_all_send();
        Some(scene)
    }

    /// From now on the witness hears each, and sends.
    fn wait_until_all_send(&self) {
        let since_ns = monotonic_ns();
        self.segment.wait_until("all send", |segment| {
            let witness = &segment.stations[usize::from(WITNESS)];
            let stats = witness.shell().stats();
            let is_heard = |own: &u8| {
                let is_new = stats.peer(*own).link.heard_ns.get() > since_ns;
                is_new && stats.state(*own, monotonic_ns()) == PeerLinkState::Alive
            };
            witness.slots().silent.is_none() && MASTERS.iter().all(is_heard)
        });
    }

    fn router(&self, own: u8) -> &Router {
        self.routers[usize::from(own)].as_ref().unwrap()
    }

    fn master(&self) -> u8 {
        let master = || self.segment.stations[usize::from(WITNESS)].clock().master;
        self.segment.wait_until("there is a master", |_| master().is_some());
        master().unwrap()
    }

    /// Until the witness follows another one.
    fn wait_for_another(&mut self, than: u8) {
        self.segment.wait_until(&format!("another than {than} is master"), |segment| {
            segment.stations[usize::from(WITNESS)].clock().master.is_some_and(|master| master != than)
        });
    }

    /// Something happens to the master; nodes that live throughout lose nothing, and send in their slots alone.
    fn round(&mut self, what: &str, happens: impl FnOnce(&mut Self, u8), ends: impl FnOnce(&mut Self, u8)) {
        let master = self.master();
        let others = [MASTERS[0] + MASTERS[1] - master, WITNESS];
        let capture = Capture::start(&self.segment.lab);
        let mut mouths_of_others = talkers(&self.segment, &others);
        self.listeners.say_all(&mut mouths_of_others, 0..20);
        happens(self, master);
        self.listeners.say_all(&mut mouths_of_others, 20..120);
        ends(self, master);
        self.listeners.say_all(&mut mouths_of_others, 120..160);
        self.listeners.hear_all(&self.segment, &others, 0..160);
        assert_kept(what, &self.segment, WITNESS, &capture.end());
    }

    /// All nodes hear each other, and lose nothing.
    fn all_talk(&mut self) {
        self.wait_until_all_send();
        let all = [MASTERS[0], MASTERS[1], WITNESS];
        let mut talkers = talkers(&self.segment, &all);
        self.listeners.acquaint(&mut talkers);
        self.listeners.say_all(&mut talkers, 0..20);
        self.listeners.hear_all(&self.segment, &all, 0..20);
    }
}

#[test]
fn in_a_process_of_its_own() {
    be_a_router();
    be_a_hog();
}

#[test]
fn the_master_is_killed_again_and_again_and_the_others_lose_nothing() {
    let Some(mut scene) = Scene::new() else { return };
    let mut terms = [0; 2];
    for time in 0..kills() {
        let kill = |scene: &mut Scene, master: u8| {
            terms[usize::from(master)] += 1;
            scene.routers[usize::from(master)].take().unwrap().kill(&scene.segment, master);
        };
        scene.round(&format!("killed, {time}"), kill, Scene::wait_for_another);
        let dead = scene.routers.iter().position(Option::is_none).unwrap() as u8;
        scene.routers[usize::from(dead)] = Some(Router::start(&scene.segment, dead, PROCESS));
        scene.all_talk();
    }
    assert!(kills() < 2 || terms.iter().all(|times| *times > 0), "each was master at a time: {terms:?}");
}

#[test]
fn a_master_that_stood_still_wakes_as_a_slave_and_sends_in_its_own_slots() {
    let Some(mut scene) = Scene::new() else { return };
    for time in 0..TIMES {
        let freeze = |scene: &mut Scene, master: u8| scene.router(master).signal(Signal::SIGSTOP);
        let wake = |scene: &mut Scene, master: u8| {
            scene.wait_for_another(master);
            std::thread::sleep(FROZEN);
            scene.router(master).signal(Signal::SIGCONT);
        };
        scene.round(&format!("frozen, {time}"), freeze, wake);
        scene.all_talk();
    }
}

#[test]
fn a_master_that_stumbles_disturbs_nobody() {
    let Some(mut scene) = Scene::new() else { return };
    for time in 0..TIMES {
        let ends = Arc::new(AtomicBool::new(false));
        let mut stumbles = None;
        let begin = |scene: &mut Scene, master: u8| {
            stumbles = Some(scene.router(master).stumble([STUMBLE, BETWEEN], ends.clone()));
        };
        scene.round(&format!("stumbles, {time}"), begin, |_, _| ends.store(true, Ordering::Relaxed));
        stumbles.unwrap().join().unwrap();
        scene.all_talk();
    }
}

#[test]
fn under_a_hog_that_goes_first_slots_are_left_out_and_counted() {
    let Some(mut scene) = Scene::new() else { return };
    let counts = |scene: &Scene| scene.segment.stations[usize::from(WITNESS)].slots().counts;
    let [mut before, mut after] = [counts(&scene); 2];
    let mut hog = None;
    let begin = |scene: &mut Scene, _| {
        before = counts(scene);
        hog = Hog::start(PROCESS, scene.segment.stations[usize::from(WITNESS)].slots().granted);
    };
    let end = |scene: &mut Scene, _| after = counts(scene);
    scene.round("beside a hog", begin, end);
    if hog.take().is_none() {
        return report::skipped("a hog that goes before routers");
    }
    let [left_out, used] = [
        after.late + after.skipped - before.late - before.skipped,
        after.used + after.empty - before.used - before.empty,
    ];
    println!("beside a hog: {left_out} slots left out, {used} used");
    assert!(left_out > 0, "{before:?}, then {after:?}");
    scene.all_talk();
}
