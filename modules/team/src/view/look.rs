//! What a robot writes itself: of what it sees, of what it does not see, and of what has become old.

use super::record::{Kind, NAMES_MAX, Named, ObjectId, Record, State};
use super::settings::{Friend, Track};
use super::standing::Standing;
use super::{RECORDS_MAX, View};
use crate::ids::{Position, RobotId, Version};

impl View {
    /// The robot looks around, once a beat: obstacles that it sees and that are no walls, and whether it would see
    /// something at a place (`can_see`: field of view, range and walls).
    ///
    /// An obstacle where a teammate can be is no intruder. Another one is, after some looks; if a teammate that has
    /// been silent for long could be there, the record says so.
    pub fn look(
        &mut self,
        now_ns: u64,
        obstacles: &[Position],
        friends: &[Friend],
        can_see: impl Fn(Position) -> bool,
    ) {
        for obstacle in obstacles {
            self.detect(now_ns, *obstacle, friends);
        }
        let age_max_ns = self.settings.certainty_max_age_ns;
        self.tracks.retain(|track| now_ns.saturating_sub(track.seen_ns) <= age_max_ns);
        self.refute(obstacles, can_see);
    }

    fn detect(&mut self, now_ns: u64, obstacle: Position, friends: &[Friend]) {
        let mut near = friends.iter().filter(|friend| friend.can_be_at(obstacle, &self.settings));
        let silent_ns = self.settings.friend_max_age_ns;
        let Some(may_be) = near.try_fold(None, |_, friend| (friend.age_ns >= silent_ns).then_some(Some(friend.robot)))
        else {
            return;
        };
        if self.see_again(now_ns, obstacle) {
            return;
        }
        let gate_mm = self.settings.gate_mm;
        let Some(track) = self.tracks.iter_mut().find(|track| track.position.is_within(obstacle, gate_mm)) else {
            if self.tracks.len() < RECORDS_MAX {
                self.tracks.push(Track { position: obstacle, sightings: 1, seen_ns: now_ns });
            }
            return self.confirm(now_ns, may_be);
        };
        // Several echoes in one look are one sighting.
        track.sightings += u32::from(track.seen_ns < now_ns);
        (track.position, track.seen_ns) = (obstacle, now_ns);
        self.confirm(now_ns, may_be);
    }

    /// Makes an intruder of the track that was seen just now, if it was seen often enough.
    fn confirm(&mut self, now_ns: u64, may_be: Option<RobotId>) {
        let enough = |track: &Track| track.seen_ns == now_ns && track.sightings >= self.settings.sightings;
        let Some(index) = self.tracks.iter().position(enough) else { return };
        let position = self.tracks.swap_remove(index).position;
        let names = self.followed(position);
        let (version, state, kind) = (Version::default(), State::Seen, Kind::Intruder);
        self.write(now_ns, None, Record { version, state, kind, position, may_be, names });
    }

    /// Sees an own intruder once more. A new version is written when it says something new, or soon is too old.
    fn see_again(&mut self, now_ns: u64, obstacle: Position) -> bool {
        let standing = Standing::of(&self.ledgers);
        let gate_mm = self.settings.gate_mm;
        let Some(own) = self.ledgers.get_mut(&self.me) else { return false };
        let is_it = |record: &Record| record.kind == Kind::Intruder && record.position.is_within(obstacle, gate_mm);
        let live = own.records.iter_mut().find(|(number, kept)| {
            let id = ObjectId { observer: self.me, number: **number };
            is_it(&kept.record) && !matches!(standing.state(id, &kept.record), State::Empty | State::Gone)
        });
        let Some((number, kept)) = live else { return false };
        let number = *number;
        let state = standing.state(ObjectId { observer: self.me, number }, &kept.record);
        let is_old = now_ns.saturating_sub(kept.seen_ns) >= self.settings.certainty_max_age_ns / 2;
        let has_moved = !kept.record.position.is_within(obstacle, gate_mm / 4);
        if !is_old && !has_moved && state == State::Seen {
            return true;
        }
        let record = kept.record.clone();
        let names = self.followed(obstacle);
        self.write(now_ns, Some(number), Record { state: State::Seen, position: obstacle, names, ..record });
        true
    }

    /// Records of others that a sighting at this place follows.
    fn followed(&self, place: Position) -> Vec<Named> {
        let live = Standing::of(&self.ledgers).live(&self.ledgers).into_iter();
        let near = live.filter(|live| {
            live.id.observer != self.me && live.kept.record.position.is_within(place, self.settings.gate_mm)
        });
        near.map(|live| Named { object: live.id, version: live.kept.record.version }).take(NAMES_MAX).collect()
    }

    /// Places that records call certain, and where the robot sees nothing.
    fn refute(&mut self, obstacles: &[Position], can_see: impl Fn(Position) -> bool) {
        let gate_mm = self.settings.gate_mm;
        let is_empty =
            |place: Position| can_see(place) && !obstacles.iter().any(|obstacle| obstacle.is_within(place, gate_mm));
        let live = Standing::of(&self.ledgers).live(&self.ledgers).into_iter();
        let wrong = live.filter(|live| live.is_certain && live.kept.record.kind == Kind::Intruder);
        let wrong: Vec<(ObjectId, Record, u64)> = wrong
            .filter(|live| is_empty(live.kept.record.position))
            .map(|live| (live.id, live.kept.record.clone(), live.kept.seen_ns))
            .collect();
        self.supersede(State::Empty, wrong);
    }

    /// Own records change their state; those of others are named by a new one.
    fn supersede(&mut self, state: State, records: Vec<(ObjectId, Record, u64)>) {
        let (own, others): (Vec<_>, Vec<_>) = records.into_iter().partition(|(id, ..)| id.observer == self.me);
        let own_state = if state == State::Empty { State::Uncertain } else { state };
        for (id, record, seen_ns) in own {
            self.write(seen_ns, Some(id.number), Record { state: own_state, ..record });
        }
        for chunk in others.chunks(NAMES_MAX) {
            let names = chunk.iter().map(|(id, record, _)| Named { object: *id, version: record.version }).collect();
            let (version, kind, may_be) = (Version::default(), Kind::Intruder, None);
            let (_, first, seen_ns) = &chunk[0];
            let record = Record { version, state, kind, position: first.position, may_be, names };
            self.write(*seen_ns, None, record);
        }
    }

    /// Once a beat: what is too old becomes uncertain, then ends. A robot does so for its own records, the leader for
    /// those of observers that are not fresh. What may have been a silent teammate ends when that is heard again.
    pub fn age(&mut self, now_ns: u64, friends: &[Friend], is_mine: impl Fn(RobotId) -> bool) {
        let settings = self.settings;
        let returned = |record: &Record| {
            let mut friends = friends.iter().filter(|friend| friend.age_ns < settings.friend_max_age_ns);
            friends.any(|it| record.may_be == Some(it.robot) && it.can_be_at(record.position, &settings))
        };
        let (mut uncertain, mut gone) = (Vec::new(), Vec::new());
        for live in Standing::of(&self.ledgers).live(&self.ledgers) {
            let record = &live.kept.record;
            if record.kind == Kind::Fake || !is_mine(live.id.observer) {
                continue;
            }
            let age_ns = now_ns.saturating_sub(live.kept.seen_ns);
            let it = || (live.id, record.clone(), live.kept.seen_ns);
            if age_ns > settings.intruder_max_age_ns || live.id.observer == self.me && returned(record) {
                gone.push(it());
            } else if live.is_certain && age_ns > settings.certainty_max_age_ns {
                uncertain.push(it());
            }
        }
        self.supersede(State::Empty, uncertain);
        self.supersede(State::Gone, gone);
    }
}
