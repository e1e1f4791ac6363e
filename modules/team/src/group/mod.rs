//! Which robots are alive, and which of them lead: computed by each robot from counters, never copied.
//!
//! A robot raises its counter with each hello, and hands on the newest counters that it knows. A robot is *fresh* while
//! its newest counter is young. Leader is the least fresh id, group the greatest, the robot itself included.
//!
//! - A counter's age is summed on its way from robot to robot, each by its own clock. A dead robot is fresh for
//!   `max_age`, and one beat more for each robot on the way.
//! - Only a counter above the last one makes fresh, and last ones are kept for ever: at most 253.
//! - Incarnations rise without a clock: a robot that hears of a greater own version goes above it once.

mod hello;

pub use hello::{Entry, HELLO_ENTRY_BYTES, HELLO_HEAD_BYTES, HOPS_MAX, Hello, PARTS, Pose, Reference};

use crate::ids::{RobotId, Run, Version};
use std::collections::{BTreeMap, BTreeSet};

/// Advancing hellos of an earlier incarnation that tell a duplicate from datagrams that were late.
const EARLIER_MAX: u8 = 3;

/// Times of a group; the same for all its robots.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct GroupSettings {
    /// From one hello to the next, ns.
    pub beat_ns: u64,
    /// Greatest age of the newest counter of a fresh robot, ns: ROBOT_MAX_AGE. For a robot that is heard through
    /// others, a beat more for each of them.
    pub max_age_ns: u64,
}

/// Something that a person should know, and that harms nobody.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Notice {
    /// Two robots have this id. One of them may be this one.
    Duplicate(RobotId),
    /// This robot has another map: its records are not merged.
    OtherMap(RobotId),
    /// This robot has another tree of events: its events are refused.
    OtherTree(RobotId),
    /// This robot's clock differs by more than clocks of one team should.
    ClockOff(RobotId),
}

/// What a robot has heard itself from another one.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Direct {
    /// Of its newest hello that came here.
    pub version: Version,
    /// When that came, ns.
    pub heard_ns: u64,
    /// Digest of its map.
    pub map: u64,
    /// Digests of its view.
    pub digests: [u32; PARTS],
    /// Robots that it hears itself, ascending.
    pub hears: Vec<RobotId>,
}

/// Another robot, fresh or not.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Member {
    /// Incarnation and counter of its newest hello.
    pub version: Version,
    /// When that hello was sent, ns of this robot's clock; the time on the air is not known, and not taken off.
    pub sent_ns: u64,
    /// Robots through which it came.
    pub hops: u8,
    /// Whether it says that its view is that of all that it hears.
    pub agrees: bool,
    /// The newest hello that came without help.
    pub direct: Option<Direct>,
    /// The last known place, and when that came, ns.
    pub last_pose: Option<(Pose, u64)>,
    /// Newest counter of an earlier incarnation that came late, and how many came in order.
    earlier: (Version, u8),
    /// Whether a hello came since the last beat that is older than the newest counter.
    is_behind: bool,
}

/// The robots of a team, as one of them knows them.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Group {
    me: RobotId,
    version: Version,
    has_raised: bool,
    settings: GroupSettings,
    members: BTreeMap<RobotId, Member>,
    notices: BTreeSet<Notice>,
}

impl Group {
    /// A robot that starts. `incarnation` is one more than the stored one; after each beat [`Self::version`] tells the
    /// one to be stored.
    pub fn new(me: RobotId, incarnation: u32, settings: GroupSettings) -> Self {
        let version = Version { incarnation, counter: 0 };
        Self { me, version, has_raised: false, settings, members: BTreeMap::new(), notices: BTreeSet::new() }
    }

    /// This robot.
    pub fn me(&self) -> RobotId {
        self.me
    }

    /// This robot's incarnation, and the counter of its last hello.
    pub fn version(&self) -> Version {
        self.version
    }

    /// What a person should know now.
    pub fn notices(&self) -> &BTreeSet<Notice> {
        &self.notices
    }

    /// Sets or takes back a notice.
    pub(crate) fn notice(&mut self, notice: Notice, holds: bool) {
        if holds {
            self.notices.insert(notice);
        } else {
            self.notices.remove(&notice);
        }
    }

    /// Takes a hello. False if it is this robot's own, or not newer than what came before.
    pub fn hear(&mut self, now_ns: u64, hello: &Hello) -> bool {
        if hello.from == self.me {
            self.hear_of_me(hello.version);
            return false;
        }
        if !self.is_new(hello) {
            return false;
        }
        self.advance(hello.from, hello.version, now_ns, 0, hello.agrees);
        for entry in &hello.entries {
            if entry.robot == self.me {
                self.hear_of_me(entry.version);
            } else if entry.hops < HOPS_MAX {
                let sent_ns = now_ns.saturating_sub(entry.age_ns);
                self.advance(entry.robot, entry.version, sent_ns, entry.hops + 1, entry.agrees);
            }
        }
        if let Some(member) = self.members.get_mut(&hello.from) {
            let hears = hello.entries.iter().filter(|entry| entry.hops == 0).map(|entry| entry.robot).collect();
            let (map, digests) = (hello.map, hello.digests);
            member.direct = Some(Direct { version: hello.version, heard_ns: now_ns, map, digests, hears });
            member.last_pose = hello.pose.map(|pose| (pose, now_ns)).or(member.last_pose);
        }
        true
    }

    /// Whether a hello tells anything new. One of an earlier incarnation does not, but may be a duplicate's.
    fn is_new(&mut self, hello: &Hello) -> bool {
        let Some(member) = self.members.get_mut(&hello.from) else { return true };
        member.is_behind |= hello.version < member.version;
        if hello.version.incarnation < member.version.incarnation {
            let (last, count) = member.earlier;
            if hello.version > last {
                member.earlier = (hello.version, (count + 1).min(EARLIER_MAX));
            }
            if member.earlier.1 == EARLIER_MAX {
                self.notices.insert(Notice::Duplicate(hello.from));
            }
            return false;
        }
        member.direct.as_ref().is_none_or(|direct| hello.version > direct.version)
    }

    /// Another robot's counter: only a newer one counts.
    fn advance(&mut self, robot: RobotId, version: Version, sent_ns: u64, hops: u8, agrees: bool) {
        let (direct, last_pose, earlier, is_behind) = (None, None, Default::default(), false);
        let new = Member { version, sent_ns, hops, agrees, direct, last_pose, earlier, is_behind };
        let Some(member) = self.members.get_mut(&robot) else {
            self.members.insert(robot, new);
            return;
        };
        if version > member.version {
            // What a restarted robot heard before does not count; where it was does.
            let is_same_run = version.incarnation == member.version.incarnation;
            let direct = member.direct.take().filter(|_| is_same_run);
            let earlier = if is_same_run { member.earlier } else { Default::default() };
            if !is_same_run {
                // Two robots of one id will be told again; one that was restarted will not.
                self.notices.remove(&Notice::Duplicate(robot));
            }
            *member = Member { direct, last_pose: member.last_pose, earlier, ..new };
        } else if version == member.version {
            member.hops = member.hops.min(hops);
            member.sent_ns = member.sent_ns.min(sent_ns);
        }
    }

    /// A greater version of this robot's own id is its forgotten incarnation: it goes above once. After that, it is
    /// another robot of this id.
    fn hear_of_me(&mut self, version: Version) {
        if version <= self.version {
            return;
        }
        match version.incarnation.checked_add(1).filter(|_| !self.has_raised) {
            Some(incarnation) => {
                self.has_raised = true;
                self.version = Version { incarnation, counter: 0 };
            }
            None => drop(self.notices.insert(Notice::Duplicate(self.me))),
        }
    }

    /// What a robot is known of, fresh or not.
    pub fn member(&self, robot: RobotId) -> Option<&Member> {
        self.members.get(&robot)
    }

    /// All other robots that were ever heard of, by ascending id.
    pub fn members(&self) -> impl Iterator<Item = (RobotId, &Member)> {
        self.members.iter().map(|(robot, member)| (*robot, member))
    }

    /// The other robots that are fresh, by ascending id.
    pub fn fresh(&self, now_ns: u64) -> impl Iterator<Item = (RobotId, &Member)> {
        let GroupSettings { beat_ns, max_age_ns } = self.settings;
        self.members().filter(move |(_, member)| {
            let allowed_ns = max_age_ns.saturating_add(beat_ns.saturating_mul(member.hops.into()));
            now_ns.saturating_sub(member.sent_ns) <= allowed_ns
        })
    }

    /// Fresh robots of which a hello came here itself within `max_age`, with that hello.
    pub fn heard(&self, now_ns: u64) -> impl Iterator<Item = (RobotId, &Direct)> {
        self.fresh(now_ns).filter_map(move |(robot, member)| {
            let direct = member.direct.as_ref()?;
            (now_ns.saturating_sub(direct.heard_ns) <= self.settings.max_age_ns).then_some((robot, direct))
        })
    }

    /// The fresh robot of the least id, this one included.
    pub fn leader(&self, now_ns: u64) -> RobotId {
        self.fresh(now_ns).map(|(robot, _)| robot).fold(self.me, RobotId::min)
    }

    /// The fresh robot of the greatest id, this one included: the group's name.
    pub fn group(&self, now_ns: u64) -> RobotId {
        self.fresh(now_ns).map(|(robot, _)| robot).fold(self.me, RobotId::max)
    }

    /// The present run of a robot.
    pub fn run(&self, robot: RobotId) -> Option<Run> {
        let version = if robot == self.me { Some(self.version) } else { self.member(robot).map(|it| it.version) };
        version.map(|version| Run { robot, incarnation: version.incarnation })
    }

    /// Raises this robot's counter, for its next hello, and says which entries that has.
    pub(crate) fn beat(&mut self, now_ns: u64) -> (Version, Vec<Entry>) {
        self.version = self.version.next();
        let entry = |(robot, member): (RobotId, &Member)| Entry {
            robot,
            version: member.version,
            hops: member.hops,
            age_ns: now_ns.saturating_sub(member.sent_ns),
            agrees: member.agrees,
        };
        let mut entries: Vec<Entry> = self.fresh(now_ns).map(entry).filter(Entry::is_tellable).collect();
        for (robot, member) in &mut self.members {
            let (version, hops, age_ns, agrees) = (member.version, HOPS_MAX, 0, false);
            if !std::mem::take(&mut member.is_behind) {
                continue;
            }
            // A robot that has lost its store is to hear of its earlier incarnation; nobody takes it for fresh.
            if let Err(index) = entries.binary_search_by_key(robot, |entry| entry.robot) {
                entries.insert(index, Entry { robot: *robot, version, hops, age_ns, agrees });
            }
        }
        (self.version, entries)
    }
}
