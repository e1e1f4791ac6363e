//! Which cell a robot may enter: one that every robot which may be near has left to it.
//!
//! ```text
//!  robot i                                    robot j
//!  claim n on c ─────────────────────────────▶ c is not j's, and j does not claim it: echo n
//!  all echoes of n are there: enters c  ◀───── echo n
//!  in c: i echoes no claim on c ◀───────────── claim m on c: no echo, so j does not enter
//! ```
//!
//! **Why no two enter a cell.** For i to enter, j has echoed a claim of i; for j to enter, i has echoed one of j. Say i
//! echoed last. Then i was not in c and had no claim on it, so the claim that j had echoed was over. For its next one i
//! needs another echo of j, which j does not send while it has a claim on c or is in c. Lost and late messages do not
//! matter: a robot that does not get an echo stands. Robots that do not hear each other are not asked; their sensors
//! are.
//!
//! **Why no two swap.** Each would have to echo a claim on the cell that it is in.

use super::message::{Claim, TrafficMessage};
use super::settings::TrafficSettings;
use crate::grid::Cell;
use crate::ids::RobotId;
use std::collections::BTreeMap;

/// Robots that are nearer to a claimed cell are asked each time; others only when they were not heard for a while.
const NEAR_STEPS: u64 = 4;

/// What was heard of a robot last.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
struct Heard {
    message: TrafficMessage,
    /// When it came, ns.
    heard_ns: u64,
    /// When its present claim first came, ns.
    claimed_ns: u64,
}

/// Own cells, and what others said of theirs.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(super) struct Claims {
    me: RobotId,
    settings: TrafficSettings,
    /// Since when it listens, ns.
    started_ns: u64,
    /// Where it is.
    here: Option<Cell>,
    /// The cell that it goes to, and is in with a part of its body.
    entering: Option<Cell>,
    /// The present claim, and since when, ns.
    claim: Option<(Claim, u64)>,
    last_number: u32,
    others: BTreeMap<RobotId, Heard>,
}

impl Claims {
    pub(super) fn new(me: RobotId, settings: TrafficSettings, started_ns: u64) -> Self {
        let others = BTreeMap::new();
        Self { me, settings, started_ns, here: None, entering: None, claim: None, last_number: 0, others }
    }

    pub(super) fn here(&self) -> Option<Cell> {
        self.here
    }

    pub(super) fn entering(&self) -> Option<Cell> {
        self.entering
    }

    pub(super) fn held(&self) -> Vec<Cell> {
        self.here.into_iter().chain(self.entering).collect()
    }

    pub(super) fn claim(&self) -> Option<Claim> {
        self.claim.map(|(claim, _)| claim)
    }

    /// The body is in the middle of a cell. False if it had no right to go there: it was pushed.
    pub(super) fn place(&mut self, cell: Cell) -> bool {
        let is_allowed = self.here.is_none_or(|here| here == cell) || self.entering == Some(cell);
        if self.here != Some(cell) {
            (self.here, self.entering, self.claim) = (Some(cell), None, None);
        }
        is_allowed
    }

    /// When it has listened for so long that it has heard all robots that it can hear, ns.
    pub(super) fn has_listened_ns(&self) -> u64 {
        self.started_ns.saturating_add(self.settings.max_age_ns)
    }

    /// The last message of each robot that is heard.
    fn fresh(&self, now_ns: u64) -> impl Iterator<Item = (RobotId, &Heard)> {
        let max_age_ns = self.settings.max_age_ns;
        let is_fresh = move |heard: &Heard| now_ns.saturating_sub(heard.heard_ns) <= max_age_ns;
        self.others.iter().filter(move |(_, heard)| is_fresh(heard)).map(|(robot, heard)| (*robot, heard))
    }

    /// The last message of each robot that is heard, and has ever had a cell.
    pub(super) fn placed(&self, now_ns: u64) -> impl Iterator<Item = (RobotId, &TrafficMessage)> {
        let messages = self.fresh(now_ns).map(|(robot, heard)| (robot, &heard.message));
        messages.filter(|(_, message)| !message.held.is_empty())
    }

    /// Cells where robots stood that are silent now, until they are forgotten.
    pub(super) fn silent(&self, now_ns: u64) -> impl Iterator<Item = Cell> {
        let (max_age_ns, forget_ns) = (self.settings.max_age_ns, self.settings.forget_ns);
        let is_silent = move |heard: &&Heard| {
            let age_ns = now_ns.saturating_sub(heard.heard_ns);
            age_ns > max_age_ns && age_ns <= forget_ns
        };
        self.others.values().filter(is_silent).flat_map(|heard| heard.message.held.iter().copied())
    }

    /// Takes a message in; false if it is no newer than one that came before.
    pub(super) fn hear(&mut self, now_ns: u64, message: &TrafficMessage) -> bool {
        let old = self.others.get(&message.from);
        if message.from == self.me || old.is_some_and(|old| message.version <= old.message.version) {
            return false;
        }
        let since_ns = old.filter(|old| old.message.claim == message.claim).map(|old| old.claimed_ns);
        let claimed_ns = since_ns.unwrap_or(now_ns);
        self.others.insert(message.from, Heard { message: message.clone(), heard_ns: now_ns, claimed_ns });
        // Of two claims on a cell the one of the robot with the lower id stands.
        let is_contested = |own: Claim| message.claim.is_some_and(|other| other.cell == own.cell);
        let is_valid = self.others.get(&message.from).is_some_and(|heard| self.is_valid(now_ns, heard));
        if message.from < self.me && is_valid && self.claim().is_some_and(is_contested) {
            self.claim = None;
        }
        true
    }

    /// Claims of others that cells are left to.
    pub(super) fn echoes(&self, now_ns: u64) -> BTreeMap<RobotId, u32> {
        let held = self.held();
        let claims = self.fresh(now_ns).filter_map(|(robot, heard)| Some((robot, heard, heard.message.claim?)));
        let left = claims.filter(|(_, heard, claim)| {
            let is_claimed = self.claim().is_some_and(|own| own.cell == claim.cell);
            !held.contains(&claim.cell) && !is_claimed && self.is_valid(now_ns, heard)
        });
        left.map(|(robot, _, claim)| (robot, claim.number)).collect()
    }

    fn is_valid(&self, now_ns: u64, heard: &Heard) -> bool {
        now_ns.saturating_sub(heard.claimed_ns) <= self.settings.claim_ns
    }

    /// Claims a cell, or none; ends the claim on another cell, and one that is too old.
    pub(super) fn want(&mut self, now_ns: u64, cell: Option<Cell>) {
        let is_over = |(claim, since_ns): &(Claim, u64)| {
            Some(claim.cell) != cell || now_ns.saturating_sub(*since_ns) > self.settings.claim_ns
        };
        if self.claim.as_ref().is_some_and(is_over) {
            self.claim = None;
        }
        let Some(cell) = cell.filter(|_| self.claim.is_none() && self.entering.is_none()) else { return };
        if !self.is_barred(now_ns, cell) {
            self.last_number = self.last_number.wrapping_add(1);
            self.claim = Some((Claim { number: self.last_number, cell }, now_ns));
        }
    }

    /// Whether another robot is in the cell, or claims it and this one has left it to that.
    fn is_barred(&self, now_ns: u64, cell: Cell) -> bool {
        let is_in_it = |heard: &Heard| heard.message.held.contains(&cell);
        let claims_it =
            |heard: &Heard| self.is_valid(now_ns, heard) && heard.message.claim.is_some_and(|claim| claim.cell == cell);
        self.silent(now_ns).any(|silent| silent == cell)
            || self.fresh(now_ns).any(|(_, heard)| is_in_it(heard) || claims_it(heard))
    }

    /// Enters the cell that is claimed, if all have left it to this robot.
    pub(super) fn enter(&mut self, now_ns: u64) {
        let Some((claim, _)) = self.claim else { return };
        let leaves_it = |heard: &Heard| heard.message.echoes.get(&self.me) == Some(&claim.number);
        let all = self.fresh(now_ns).all(|(_, heard)| leaves_it(heard) || !self.can_reach(now_ns, heard, claim.cell));
        let is_silent = self.silent(now_ns).any(|cell| cell == claim.cell);
        if now_ns >= self.has_listened_ns() && all && !is_silent {
            (self.entering, self.claim) = (Some(claim.cell), None);
        }
    }

    /// The body is in the middle of its cell again, and does not go on to the next one.
    pub(super) fn turned_back(&mut self) {
        self.entering = None;
    }

    /// Whether a robot is so near to this one that it asks it for an echo also when it has just heard of it.
    pub(super) fn is_near(&self, robot: RobotId) -> bool {
        let claimed = self.others.get(&robot).and_then(|heard| heard.message.claim);
        let is_near = |claim: Claim| self.held().iter().any(|held| distance(*held, claim.cell) <= NEAR_STEPS);
        claimed.is_some_and(is_near)
    }

    /// Whether a robot may be in a cell by now, or beside it with a claim: as far as it drives since its last message.
    fn can_reach(&self, now_ns: u64, heard: &Heard, cell: Cell) -> bool {
        let age_ns = now_ns.saturating_sub(heard.heard_ns).saturating_add(self.settings.delay_max_ns);
        let steps = 2 + age_ns / self.settings.step_min_ns.max(1);
        heard.message.held.iter().any(|held| distance(*held, cell) <= steps)
    }
}

fn distance(one: Cell, other: Cell) -> u64 {
    u64::from(one.column.abs_diff(other.column)) + u64::from(one.row.abs_diff(other.row))
}
