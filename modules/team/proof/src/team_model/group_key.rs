//! What the future of a group depends on. A private part of the core's `group`.

use super::super::team_model::key::Key;
use super::{Direct, Group, Hello, Member, Notice};
use super::super::RobotId;

impl Group {
    pub(crate) fn key(&self, now_ns: u64, key: &mut Key) {
        key.version(self.me, self.version);
        key.plain(self.has_raised);
        let kinds = [Notice::Duplicate, Notice::OtherMap, Notice::OtherTree, Notice::ClockOff];
        for robot in key.robots() {
            key.hash(&kinds.map(|kind| self.notices.contains(&kind(robot))));
            let Some(member) = self.members.get(&robot) else { continue };
            key.hash(&key.name(robot));
            member.key(robot, now_ns, self.settings, key);
        }
    }

    /// Whether it has gone above an earlier incarnation.
    pub(crate) fn has_raised(&self) -> bool {
        self.has_raised
    }
}

impl Member {
    fn key(&self, robot: RobotId, now_ns: u64, settings: super::GroupSettings, key: &mut Key) {
        let super::GroupSettings { beat_ns, max_age_ns } = settings;
        let allowed_ns = max_age_ns + beat_ns * u64::from(self.hops);
        key.version(robot, self.version);
        key.plain((now_ns - self.sent_ns).min(allowed_ns + 1));
        key.plain(self.hops);
        key.plain(self.agrees);
        key.plain(self.is_behind);
        key.version(robot, self.earlier.0);
        key.plain(self.earlier.1);
        key.plain(self.direct.is_some());
        if let Some(Direct { version, heard_ns, map, digests, hears }) = &self.direct {
            key.version(robot, *version);
            let age_ns = (now_ns - heard_ns).min(max_age_ns + 1);
            key.plain(age_ns);
            key.hash(&key.robots().map(|robot| hears.contains(&robot)).collect::<Vec<_>>());
            // Of a robot that is not heard nobody asks for these.
            key.hash(&(age_ns <= max_age_ns).then_some((map, digests)));
        }
    }
}

impl Hello {
    pub(crate) fn key(&self, key: &mut Key) {
        key.version(self.from, self.version);
        key.plain(self.agrees);
        key.hash(&self.digests);
        for robot in key.robots() {
            let Some(entry) = self.entries.iter().find(|entry| entry.robot == robot) else { continue };
            key.version(entry.robot, entry.version);
            key.plain(entry.hops);
            key.plain(entry.age_ns);
            key.plain(entry.agrees);
        }
    }
}
