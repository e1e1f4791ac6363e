//! One robot of a team: what it sends each beat, and what it makes of what it hears.

use crate::group::{Group, GroupSettings, Hello, Notice, PARTS, Pose, Reference};
use crate::ids::{Position, RobotId, Run, Version};
use crate::time::{Offset, TeamTime};
use crate::view::{Friend, Object, ObjectId, Records, View, ViewSettings, part_bit};
use std::collections::BTreeMap;

/// Times and distances; the same for all robots of a team.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct TeamSettings {
    /// Of hellos.
    pub group: GroupSettings,
    /// Of objects.
    pub view: ViewSettings,
    /// No clock runs faster or slower than true time by more, ns a second.
    pub drift_ppb: u32,
    /// A clock that differs from this robot's by more is told, ns.
    pub clock_off_ns: u64,
}

/// What a robot sends in a beat, in this order. All go to every robot in range, and any may be lost.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Beat {
    /// New records of its own.
    pub objects: Option<Records>,
    /// What the digest of a robot that hears it shows missing there.
    pub synchro: Option<Records>,
    /// That it lives.
    pub hello: Hello,
}

/// A silent robot that an object may be. Shown as "may be robot 4, silent for 31 s".
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Suspicion {
    /// The robot.
    pub robot: RobotId,
    /// Since its newest counter came; `None` if none ever came here.
    pub silent_ns: Option<u64>,
}

impl std::fmt::Display for Suspicion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "may be robot {}, ", self.robot)?;
        match self.silent_ns {
            Some(silent_ns) => write!(f, "silent for {} s", silent_ns / 1_000_000_000),
            None => f.write_str("never heard here"),
        }
    }
}

/// A robot of a team. Times are ns of its own clock, which never goes back and may be years off.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Team {
    now_ns: u64,
    clock_off_ns: u64,
    group: Group,
    view: View,
    time: TeamTime,
    /// Part of the digest of the tree of events; 0: none.
    tree: u16,
    /// Parts of the views of robots in range, on the same map, that are to be completed, a bit for each.
    missing: BTreeMap<RobotId, u8>,
    /// The hello that followed the last synchro: a robot that has not heard it may not have had the synchro yet.
    last_synchro: Version,
}

impl Team {
    /// A robot that starts, with an incarnation above the stored one and the digest of its map.
    pub fn new(me: RobotId, incarnation: u32, map: u64, settings: TeamSettings) -> Self {
        Self {
            now_ns: 0,
            clock_off_ns: settings.clock_off_ns,
            group: Group::new(me, incarnation, settings.group),
            view: View::new(me, incarnation, map, settings.view),
            time: TeamTime::new(me, settings.drift_ppb),
            tree: 0,
            missing: BTreeMap::new(),
            last_synchro: Version::default(),
        }
    }

    /// The payload runs this tree of events: [`crate::events::Tree::short_digest`]. Teammates with another one are told
    /// by [`Notice::OtherTree`].
    pub fn set_tree(&mut self, short_digest: u16) {
        self.tree = short_digest;
    }

    /// Which robots are fresh. Its [`Group::version`] has the incarnation to be stored.
    pub fn group(&self) -> &Group {
        &self.group
    }

    /// The records.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// Times, never backwards: a clock that goes back stands still here.
    fn pass(&mut self, now_ns: u64) -> u64 {
        self.now_ns = self.now_ns.max(now_ns);
        self.now_ns
    }

    /// A hello came.
    pub fn hear_hello(&mut self, now_ns: u64, hello: &Hello) {
        let now_ns = self.pass(now_ns);
        let from = hello.from;
        let is_first = !self.group.heard(now_ns).any(|(robot, _)| robot == from);
        if !self.group.hear(now_ns, hello) {
            return;
        }
        self.time.hear(now_ns, hello, self.leader_run(now_ns));
        let off = self
            .neighbour_clock(now_ns, from)
            .is_some_and(|it| it.offset_ns.unsigned_abs() > self.clock_off_ns.saturating_add(it.bound_ns));
        self.group.notice(Notice::ClockOff(from), off);
        let is_same_map = hello.map == self.view.map();
        self.group.notice(Notice::OtherMap(from), !is_same_map);
        let has_other_tree = self.tree != 0 && hello.tree != 0 && hello.tree != self.tree;
        self.group.notice(Notice::OtherTree(from), has_other_tree);
        // A robot that does not hear this one, or not yet what it sent last, cannot be helped now. Of one that is heard
        // for the first time nobody knows: it is tried once.
        let entry = hello.entry(self.group.me()).filter(|entry| entry.hops == 0);
        let can_help = is_first || entry.is_some_and(|entry| entry.version >= self.last_synchro);
        if is_same_map {
            self.missing.insert(from, if can_help { self.differing(&hello.digests) } else { 0 });
        } else {
            self.missing.remove(&from);
        }
    }

    /// Records came. What is new here goes on, once, to robots in range that the sender does not hear.
    pub fn hear_records(&mut self, now_ns: u64, records: Records) {
        let now_ns = self.pass(now_ns);
        let from = records.from;
        let whole = records.ledgers.keys().filter(|_| records.is_synchro).fold(0, |parts, it| parts | part_bit(*it));
        let changed = self.view.join(now_ns, records);
        let direct = |robot| self.group.member(robot).and_then(|member| member.direct.as_ref());
        for (robot, missing) in self.missing.iter_mut().filter(|(robot, _)| **robot != from) {
            if direct(from).is_some_and(|sender| sender.hears.contains(robot)) {
                *missing &= !whole;
            } else {
                *missing |= changed;
            }
        }
    }

    /// The robot looks around, once a beat: see [`View::look`].
    pub fn look(&mut self, now_ns: u64, obstacles: &[Position], can_see: impl Fn(Position) -> bool) {
        let now_ns = self.pass(now_ns);
        self.view.look(now_ns, obstacles, &self.friends(now_ns), can_see);
    }

    /// A station makes up an intruder.
    pub fn add_fake(&mut self, now_ns: u64, position: Position) -> ObjectId {
        let now_ns = self.pass(now_ns);
        self.view.add_fake(now_ns, position)
    }

    /// A station moves an intruder that it has made up. False if it has none of this id.
    pub fn move_fake(&mut self, now_ns: u64, id: ObjectId, position: Position) -> bool {
        let now_ns = self.pass(now_ns);
        self.view.move_fake(now_ns, id, position)
    }

    /// A station ends an intruder that it has made up. False if it has none of this id.
    pub fn end_fake(&mut self, now_ns: u64, id: ObjectId) -> bool {
        let now_ns = self.pass(now_ns);
        self.view.end_fake(now_ns, id)
    }

    /// What is to be sent now, once a beat. `pose` is `None` while the robot does not know where it is.
    pub fn beat(&mut self, now_ns: u64, pose: Option<Pose>) -> Beat {
        let now_ns = self.pass(now_ns);
        let (version, entries) = self.group.beat(now_ns);
        self.view.raise_incarnation(version.incarnation);
        self.age(now_ns);
        let objects = self.view.take_unsent(now_ns);
        let hello = Hello {
            from: self.group.me(),
            version,
            map: self.view.map(),
            sent_ns: now_ns,
            digests: self.view.digests(),
            tree: self.tree,
            agrees: self.agrees_with_heard(now_ns),
            pose,
            reference: self.reference(now_ns),
            entries,
        };
        self.time.sends(now_ns, version);
        Beat { objects, synchro: self.synchro(now_ns, version), hello }
    }

    fn age(&mut self, now_ns: u64) {
        let me = self.group.me();
        let is_leader = self.group.leader(now_ns) == me;
        let fresh: Vec<RobotId> = self.group.fresh(now_ns).map(|(robot, _)| robot).collect();
        let is_mine = |observer| observer == me || is_leader && !fresh.contains(&observer);
        self.view.age(now_ns, &self.friends(now_ns), is_mine);
    }

    fn synchro(&mut self, now_ns: u64, version: Version) -> Option<Records> {
        let heard = self.group.heard(now_ns).filter_map(|(robot, _)| self.missing.get(&robot));
        let parts = heard.fold(0, |parts, missing| parts | missing);
        self.missing.values_mut().for_each(|missing| *missing = 0);
        let records = (parts != 0).then(|| self.view.synchro(now_ns, parts));
        // Where this robot has nothing, it is the other one's turn.
        let records = records.filter(|records| !records.ledgers.is_empty())?;
        self.last_synchro = version;
        Some(records)
    }

    /// Parts in which these digests differ from the own ones, a bit for each.
    fn differing(&self, digests: &[u32; PARTS]) -> u8 {
        let own = self.view.digests();
        (0..PARTS).filter(|part| own[*part] != digests[*part]).fold(0, |parts, part| parts | 1 << part)
    }

    fn agrees_with_heard(&self, now_ns: u64) -> bool {
        let (map, digests) = (self.view.map(), self.view.digests());
        self.group.heard(now_ns).all(|(_, direct)| direct.map == map && direct.digests == digests)
    }

    /// Whether this robot's view is that of all fresh robots: it equals those of all that it hears, and each fresh
    /// robot says the same of those that it hears.
    pub fn agrees(&self, now_ns: u64) -> bool {
        let now_ns = self.now_ns.max(now_ns);
        self.agrees_with_heard(now_ns) && self.group.fresh(now_ns).all(|(_, member)| member.agrees)
    }

    /// Teammates, where they were last.
    fn friends(&self, now_ns: u64) -> Vec<Friend> {
        let friend = |(robot, pose, heard_ns): (RobotId, Pose, u64)| Friend {
            robot,
            position: pose.position,
            age_ns: now_ns.saturating_sub(heard_ns),
        };
        let posed = |(robot, pose): (RobotId, Option<(Pose, u64)>)| pose.map(|(pose, at_ns)| (robot, pose, at_ns));
        self.group.members().map(|(robot, member)| (robot, member.last_pose)).filter_map(posed).map(friend).collect()
    }

    /// The silent robot that an object may be.
    pub fn suspicion(&self, now_ns: u64, object: &Object) -> Option<Suspicion> {
        let robot = object.may_be?;
        let silent_ns = self.group.member(robot).map(|member| now_ns.saturating_sub(member.sent_ns));
        Some(Suspicion { robot, silent_ns })
    }

    fn leader_run(&self, now_ns: u64) -> Run {
        let own = Run { robot: self.group.me(), incarnation: self.group.version().incarnation };
        self.group.run(self.group.leader(now_ns)).unwrap_or(own)
    }

    fn reference(&self, now_ns: u64) -> Option<Reference> {
        let Run { robot, incarnation } = self.leader_run(now_ns);
        let Offset { offset_ns, bound_ns } = self.team_clock(now_ns)?;
        Some(Reference { robot, incarnation, offset_ns, bound_ns })
    }

    /// The clock of a robot, if its hellos come here and it knows this robot's.
    pub fn neighbour_clock(&self, now_ns: u64, robot: RobotId) -> Option<Offset> {
        self.time.neighbour(now_ns, self.group.run(robot)?)
    }

    /// The leader's clock: the team's time.
    pub fn team_clock(&self, now_ns: u64) -> Option<Offset> {
        self.time.team(now_ns, self.leader_run(now_ns))
    }
}
