//! How robots go to their places without touching each other: one core on each robot, and messages to all.
//!
//! ```text
//!  place, goal, intruders ──▶ Rounds: agree, share out, plan ─────────▶ next cell of the plan
//!                                                                             │
//!  TrafficMessage ◀── poll ◀── Claims: claim it, wait for all echoes ◀────────┘ ──▶ `next_cell`: go
//! ```
//!
//! [`claims`] keeps robots that hear each other out of each other's cells, whatever they plan. [`rounds`] makes them
//! plan the same, so that they do not block each other.

mod claims;
mod message;
mod planner;
mod rounds;
mod settings;

pub use message::{Claim, Stance, TrafficMessage};
pub use planner::Planner;
pub use settings::TrafficSettings;

use super::planning::NoWays;
use super::post::{Post, Target};
use super::sharing::{Duty, Sharing};
use crate::grid::Cell;
use crate::ids::{RobotId, Version};
use claims::Claims;
use rounds::{Known, RoundPlan};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A robot among others on a map. Times are ns of its own clock.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Traffic {
    me: RobotId,
    map: u64,
    settings: TrafficSettings,
    claims: Claims,
    goal: Option<Cell>,
    is_frozen: bool,
    is_lost: bool,
    post: Option<Post>,
    intruders: Vec<Target>,
    /// Robots with another map, and when they were heard.
    strangers: BTreeMap<RobotId, u64>,
    pushed: u32,
    /// No round begun yet. The others may go on in theirs with what this robot said before its restart.
    is_new: bool,
    round: u32,
    /// Of this round, and since when.
    stance: Option<(Stance, u64)>,
    plan: Option<Agreed>,
    /// Moment of the plan that is reached, and the one of the cell that is entered.
    moment: u32,
    next_moment: u32,
    /// When any robot of the plan went on.
    progress_ns: u64,
    version: Version,
    /// The last message, and when it was sent.
    sent: Option<(TrafficMessage, u64)>,
}

/// A plan, and what it was made from.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Agreed {
    since_ns: u64,
    known: Known,
    digest: u64,
    plan: Arc<RoundPlan>,
}

impl Traffic {
    /// A robot that starts, with the incarnation of its team core and the digest of its map. It does not move before it
    /// has listened for [`TrafficSettings::max_age_ns`].
    pub fn new(me: RobotId, incarnation: u32, map: u64, settings: TrafficSettings, now_ns: u64) -> Self {
        Self {
            me,
            map,
            settings,
            claims: Claims::new(me, settings, now_ns),
            goal: None,
            is_frozen: false,
            is_lost: true,
            post: None,
            intruders: Vec::new(),
            strangers: BTreeMap::new(),
            pushed: 0,
            is_new: true,
            round: 0,
            stance: None,
            plan: None,
            moment: 0,
            next_moment: 0,
            progress_ns: now_ns,
            version: Version { incarnation, counter: 0 },
            sent: None,
        }
    }

    /// The robot's body is in the middle of this cell; `None`: it does not know its cell, and stands still.
    pub fn set_place(&mut self, cell: Option<Cell>) {
        self.is_lost = cell.is_none();
        let Some(cell) = cell else { return };
        if self.claims.entering() == Some(cell) {
            self.moment = self.next_moment;
        }
        self.pushed += u32::from(!self.claims.place(cell));
    }

    /// The robot is back in the middle of its cell, and does not go on to the next one: something was in the way.
    pub fn turned_back(&mut self) {
        self.claims.turned_back();
    }

    /// Where the robot wants to go while there is no intruder; `None`: nowhere, but it lets others pass.
    pub fn set_goal(&mut self, goal: Option<Cell>) {
        self.goal = goal;
    }

    /// The robot does not move, whatever others do: it is halted.
    pub fn set_frozen(&mut self, is_frozen: bool) {
        self.is_frozen = is_frozen;
    }

    /// Intruders that are certain, as the agreed view has them. Robots share out their exits, instead of following
    /// goals of their own.
    pub fn set_intruders(&mut self, mut intruders: Vec<Target>) {
        intruders.sort_unstable_by_key(|intruder| intruder.id);
        self.intruders = intruders;
    }

    /// The cell that the robot may go to now. `None`: it stays in its own.
    pub fn next_cell(&self) -> Option<Cell> {
        self.claims.entering().filter(|_| !self.stands_still())
    }

    /// Cells to which the robot goes by the plan, the next one first; empty without a plan.
    pub fn way(&self) -> Vec<Cell> {
        self.plan.as_ref().map(|agreed| agreed.plan.way(self.me, self.moment)).unwrap_or_default()
    }

    /// What the robot has to do about intruders, and what the others do; `None` without one, or without a plan.
    pub fn sharing(&self) -> Option<&Sharing> {
        self.plan.as_ref().and_then(|agreed| agreed.plan.sharing.as_ref())
    }

    /// Robots that cannot get where they should, and why.
    pub fn given_up(&self) -> &[(RobotId, NoWays)] {
        self.plan.as_ref().map_or(&[], |agreed| &agreed.plan.given_up)
    }

    /// Cells of robots that are heard, and where they go.
    pub fn others(&self, now_ns: u64) -> impl Iterator<Item = Cell> {
        let placed = self.claims.placed(now_ns).map(|(_, message)| message);
        placed.flat_map(|message| message.held.iter().copied().chain(message.stance.and_then(|it| it.goal)))
    }

    /// Steps that the robot still has to go, as planned; `None` without a plan, or while it asks for another goal.
    pub fn steps_left(&self) -> Option<usize> {
        let agreed = self.plan.as_ref()?;
        let goal = agreed.known.stances.get(&self.me)?.goal;
        (goal == self.goal).then(|| agreed.plan.steps_left(self.me, self.moment))
    }

    /// How often the robot was in a cell that it had no right to enter: something moved it.
    pub fn pushed(&self) -> u32 {
        self.pushed
    }

    /// Robots that are heard and have another map: they take no part.
    pub fn strangers(&self, now_ns: u64) -> impl Iterator<Item = RobotId> {
        let max_age_ns = self.settings.max_age_ns;
        let heard = self.strangers.iter().filter(move |(_, at_ns)| now_ns.saturating_sub(**at_ns) <= max_age_ns);
        heard.map(|(robot, _)| *robot)
    }

    /// A message came.
    pub fn hear(&mut self, now_ns: u64, message: &TrafficMessage) {
        if message.map != self.map {
            self.strangers.insert(message.from, now_ns);
            return;
        }
        self.strangers.remove(&message.from);
        let before = self.claims.placed(now_ns).find(|(robot, _)| *robot == message.from);
        let has_moved = before.is_none_or(|(_, before)| before.held != message.held);
        if self.claims.hear(now_ns, message) && has_moved {
            self.progress_ns = now_ns;
        }
    }

    /// Goes on, and says what has to be sent to all now, if anything has to. Call it after what it is told, and often
    /// enough that beats are sent.
    pub fn poll(&mut self, now_ns: u64, planner: &mut Planner) -> Option<TrafficMessage> {
        self.follow_round(now_ns);
        self.agree(now_ns, planner);
        self.go_on(now_ns);
        let message = self.message(now_ns);
        if !self.is_news(now_ns, &message) {
            return None;
        }
        self.version = self.version.next();
        let message = TrafficMessage { version: self.version, ..message };
        self.sent = Some((message.clone(), now_ns));
        Some(message)
    }

    /// Whether a message has to go at once. Echoes for robots that do not wait for them go with the next one.
    fn is_news(&self, now_ns: u64, message: &TrafficMessage) -> bool {
        let Some((sent, at_ns)) = &self.sent else { return true };
        let (version, echoes) = (sent.version, sent.echoes.clone());
        let is_waited_for =
            |(robot, number): (&RobotId, &u32)| sent.echoes.get(robot) != Some(number) && self.claims.is_near(*robot);
        TrafficMessage { version, echoes, ..message.clone() } != *sent
            || message.echoes.iter().any(is_waited_for)
            || now_ns.saturating_sub(*at_ns) >= self.settings.beat_ns
    }

    /// Whether all that are heard take part in this round: before that, nobody knows what all plan from.
    fn all_take_part(&self, now_ns: u64) -> bool {
        self.claims.placed(now_ns).all(|(_, message)| message.round == self.round)
    }

    fn stands_still(&self) -> bool {
        self.is_frozen || self.is_lost
    }

    /// Begins a round, or goes over to that of another robot. The step that has begun goes on.
    fn follow_round(&mut self, now_ns: u64) {
        let greatest = self.claims.placed(now_ns).map(|(_, message)| message.round).max().unwrap_or(0);
        let starts = self.is_new && now_ns >= self.claims.has_listened_ns();
        self.is_new &= !starts;
        let round =
            if starts || self.wants_round(now_ns) { self.round.max(greatest).saturating_add(1) } else { greatest };
        if round > self.round {
            self.claims.want(now_ns, None);
            (self.round, self.stance, self.plan, self.moment, self.next_moment) = (round, None, None, 0, 0);
        }
        if let (None, Some(cell)) = (self.stance, self.stands_in()) {
            let stance = Stance { cell, goal: self.goal, post: self.post, is_frozen: self.stands_still() };
            self.stance = Some((stance, now_ns));
        }
    }

    /// Where the robot is, once its step has ended.
    fn stands_in(&self) -> Option<Cell> {
        self.claims.entering().filter(|_| !self.stands_still()).or(self.claims.here())
    }

    /// Whether this robot has a reason to plan anew: what it said in this round is no longer so.
    fn wants_round(&self, now_ns: u64) -> bool {
        let Some((stance, _)) = self.stance else { return false };
        let has_stopped = stance.is_frozen != self.stands_still();
        let Some(agreed) = &self.plan else { return has_stopped || self.stands_in() != Some(stance.cell) };
        let is_first = agreed.known.intruders.is_empty() && !self.intruders.is_empty();
        let is_other_goal = stance.goal != self.goal && self.intruders.is_empty();
        let is_other = is_other_goal || agreed.known.intruders != self.intruders;
        let is_time = is_first || now_ns.saturating_sub(agreed.since_ns) >= self.settings.extend_ns;
        let others = self.claims.placed(now_ns).map(|(robot, _)| robot);
        let is_other_team = !others.eq(agreed.known.stances.keys().copied().filter(|robot| *robot != self.me));
        let has_stalled = now_ns.saturating_sub(self.progress_ns) > self.settings.stall_ns;
        let place = self.claims.here().filter(|_| self.claims.entering().is_none());
        let was_pushed = place.is_some_and(|here| !agreed.plan.is_at(self.me, self.moment, here));
        has_stopped
            || (is_other || is_other_team) && is_time
            || was_pushed
            || has_stalled && agreed.plan.wants_more(self.me, self.moment)
    }

    /// Plans if all know the same, or do not come to for too long.
    fn agree(&mut self, now_ns: u64, planner: &mut Planner) {
        let Some((stance, since_ns)) = self.stance.filter(|_| self.plan.is_none()) else { return };
        let since_ns = since_ns.max(self.claims.has_listened_ns());
        let is_late = now_ns > since_ns.saturating_add(self.settings.agree_ns);
        if now_ns < self.claims.has_listened_ns() || !is_late && !self.all_take_part(now_ns) {
            return;
        }
        let known = self.known(now_ns, stance);
        let digest = known.digest();
        let mut others = self.claims.placed(now_ns).map(|(_, message)| message);
        let agrees = others.all(|message| message.round == self.round && message.digest == digest);
        if agrees || is_late {
            let plan = planner.plan(&known, self.settings.looks_max);
            self.post = plan.sharing.as_ref().and_then(|sharing| match sharing.duties.get(&self.me) {
                Some(Duty::Hold { post, .. }) => Some(*post),
                _ => None,
            });
            self.plan = Some(Agreed { since_ns: now_ns, known, digest, plan });
            (self.moment, self.progress_ns) = (0, now_ns);
        }
    }

    /// What this robot would plan from. A robot that has not said where it stands in this round stands where it is.
    fn known(&self, now_ns: u64, own: Stance) -> Known {
        let stance = |message: &TrafficMessage| {
            let said = message.stance.filter(|_| message.round == self.round);
            let stands = || {
                let cell = message.held.first().copied()?;
                Some(Stance { cell, goal: None, post: None, is_frozen: true })
            };
            said.or_else(stands)
        };
        let others = self.claims.placed(now_ns).filter_map(|(robot, message)| Some((robot, stance(message)?)));
        let stances = others.chain([(self.me, own)]).collect();
        let silent: BTreeSet<Cell> = self.claims.silent(now_ns).collect();
        Known { stances, intruders: self.intruders.clone(), silent }
    }

    /// Claims the next cell of the plan, and enters it.
    fn go_on(&mut self, now_ns: u64) {
        if self.claims.entering().is_some() || self.stands_still() {
            return self.claims.want(now_ns, None);
        }
        let next = self.plan.as_ref().and_then(|agreed| {
            let reached = |robot: RobotId| {
                let (_, message) = self.claims.placed(now_ns).find(|(other, _)| *other == robot)?;
                (message.round == self.round).then_some(message.moment)
            };
            agreed.plan.next(self.me, self.moment, |robot| reached(robot).unwrap_or(0))
        });
        self.claims.want(now_ns, next.map(|(cell, _)| cell));
        self.claims.enter(now_ns);
        if let Some((_, moment)) = next.filter(|(cell, _)| self.claims.entering() == Some(*cell)) {
            (self.next_moment, self.progress_ns) = (moment, now_ns);
        }
    }

    fn message(&self, now_ns: u64) -> TrafficMessage {
        let stance = self.stance.map(|(stance, _)| stance);
        let takes_part = stance.filter(|_| self.plan.is_none() && self.all_take_part(now_ns));
        let now_known = || takes_part.map_or(0, |stance| self.known(now_ns, stance).digest());
        TrafficMessage {
            from: self.me,
            version: self.version,
            map: self.map,
            held: self.claims.held(),
            claim: self.claims.claim(),
            echoes: self.claims.echoes(now_ns),
            round: self.round,
            stance,
            digest: self.plan.as_ref().map_or_else(now_known, |agreed| agreed.digest),
            moment: self.moment,
        }
    }
}
