//! What the module publishes of its robot.

use rohrpost_modules::interfaces::{
    PayloadBeats, PayloadExit, PayloadIdle, PayloadMode, PayloadState, TeamCell, TeamPlace,
};
use rohrpost_modules::types;
use rohrpost_payload::{Ground, Mode, Payload};
use rohrpost_team::coordination::{Duty, Sharing};
use rohrpost_team::grid::Cell;
use rohrpost_team::group::Pose;

use crate::team::state::{object_id, position};

/// How late beats are.
pub(super) struct Beats {
    beat_ns: u64,
    /// When the next one is due, ns of the robot's clock.
    due_ns: Option<u64>,
    told: PayloadBeats,
}

impl Beats {
    pub(super) fn new(beat_ms: u32) -> Self {
        Self { beat_ns: u64::from(beat_ms) * 1_000_000, due_ns: None, told: PayloadBeats::default() }
    }

    /// A beat is now. One that is left out makes the next one late, and no other.
    pub(super) fn note(&mut self, now_ns: u64) {
        let due_ns = self.due_ns.unwrap_or(now_ns);
        let late_us = now_ns.saturating_sub(due_ns) / 1000;
        self.told.beats += 1;
        self.told.over_10_ms += u64::from(late_us > 10_000);
        self.told.over_50_ms += u64::from(late_us > 50_000);
        self.told.latest_us = self.told.latest_us.max(late_us);
        let next_ns = due_ns + self.beat_ns;
        self.due_ns = Some(if next_ns > now_ns { next_ns } else { now_ns + self.beat_ns });
    }

    pub(super) fn told(&self) -> PayloadBeats {
        self.told
    }
}

/// The robot's program as it is now.
pub(super) fn of(payload: &Payload, beats: PayloadBeats) -> PayloadState {
    let (ground, sharing) = (payload.ground(), payload.sharing());
    let destination = payload.destination_m().map(|(x_m, y_m)| TeamPlace { x_m, y_m });
    PayloadState {
        robot: payload.team().group().me().get(),
        mode: match payload.mode() {
            Mode::Wandering => PayloadMode::Wandering,
            Mode::Searching => PayloadMode::Searching,
            Mode::Blocking => PayloadMode::Blocking,
        },
        lost: payload.lost().map(|cause| cause.to_string()).unwrap_or_default(),
        pose: payload.pose(),
        cell: payload.cell().map(cell),
        destination,
        way: payload.way().into_iter().map(|cell| place(ground, cell)).collect(),
        exits: sharing.map(|sharing| exits(ground, sharing)).unwrap_or_default(),
        idle: sharing.map(idle).unwrap_or_default(),
        beats,
    }
}

fn exits(ground: &Ground, sharing: &Sharing) -> Vec<PayloadExit> {
    let held = sharing.duties.iter().filter_map(|(robot, duty)| match duty {
        Duty::Hold { post, cell, .. } => Some((*post, *cell, Some(robot.get()), String::new())),
        _ => None,
    });
    let open = sharing.open.iter().map(|open| (open.post, open.cell, None, open.why.to_string()));
    let exit = |(post, at, holder, why_open): (rohrpost_team::coordination::Post, Cell, _, _)| PayloadExit {
        intruder: object_id(post.intruder),
        cell: cell(at),
        place: place(ground, at),
        holder,
        why_open,
    };
    held.chain(open).map(exit).collect()
}

fn idle(sharing: &Sharing) -> Vec<PayloadIdle> {
    let of = |(robot, duty): (&rohrpost_team::RobotId, &Duty)| match duty {
        Duty::Idle(why) => Some(PayloadIdle { robot: robot.get(), why: why.to_string() }),
        _ => None,
    };
    sharing.duties.iter().filter_map(of).collect()
}

/// A cell as it is published.
pub(crate) fn cell(Cell { column, row }: Cell) -> TeamCell {
    TeamCell { column, row }
}

fn place(ground: &Ground, cell: Cell) -> TeamPlace {
    let (x_m, y_m) = ground.middle_m(cell);
    TeamPlace { x_m, y_m }
}

/// A pose as hellos tell it; `None` of what is no place.
pub(super) fn told(pose: types::Pose) -> Option<Pose> {
    let turned_rad = pose.heading_rad.sin().atan2(pose.heading_rad.cos());
    let heading_mrad = (turned_rad * 1000.0).round() as i16;
    Some(Pose { position: position(pose.x_m, pose.y_m)?, heading_mrad, speed_mm_s: 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_beat_that_is_late_is_counted_once() {
        let mut beats = Beats::new(500);
        for now_ms in [1000, 1500, 2020, 2500, 3060, 3500, 5700, 6200] {
            beats.note(now_ms * 1_000_000);
        }
        let PayloadBeats { beats, over_10_ms, over_50_ms, latest_us } = beats.told();
        assert_eq!((beats, over_10_ms, over_50_ms, latest_us), (8, 3, 2, 1_700_000));
    }
}
