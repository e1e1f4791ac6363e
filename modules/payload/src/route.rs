//! The next cell of a robot that plans for itself (seed 000, 3.3, 4.4.1 and 4.5.2).

use crate::mode::Mode;
use crate::state::State;
use rohrpost_team::grid::{Cell, Direction, Entrance, Grid, Obstacle, ObstacleKind, entrances};
use std::collections::BTreeSet;

/// A wandering robot that stays in one cell for so long takes another way, ns.
const STUCK_NS: u64 = 6_000_000_000;
/// Another place is searched after so long, ns.
const SEARCH_NS: u64 = 20_000_000_000;

/// Whether a robot may step into the cell ahead, by the seed's table 3.1.
fn is_free(grid: &Grid, obstacles: &[Obstacle], here: Cell, step: Direction) -> Option<Cell> {
    let next = here.next(step).filter(|next| grid.is_path(*next))?;
    let passes = |it: &Obstacle| it.cell != next || it.kind == ObstacleKind::Moving(step);
    obstacles.iter().all(passes).then_some(next)
}

impl State {
    /// Computes the next cell anew, if the robot plans for itself.
    pub(crate) fn reroute(&mut self, now_ns: u64) {
        if self.traffic.is_some() {
            return;
        }
        let Some(here) = self.cell() else { return self.navigation.next = None };
        let obstacles = self.obstacles(now_ns);
        self.navigation.next = match self.mode {
            Mode::Wandering => self.wander(now_ns, here, &obstacles),
            Mode::Searching => self.search(now_ns, here, &obstacles),
            Mode::Blocking => self.block(now_ns, here, obstacles),
        };
    }

    /// Robots as the wave meets them. Where a silent or lost robot was, one stands, unless the place is seen empty.
    pub(crate) fn obstacles(&self, now_ns: u64) -> Vec<Obstacle> {
        let heard: BTreeSet<_> = self.team.group().heard(now_ns).map(|(robot, _)| robot).collect();
        let obstacle = |(robot, member): (_, &rohrpost_team::group::Member)| {
            let (pose, at_ns) = member.last_pose?;
            let cell = self.ground.cell_at(pose.position)?;
            let is_told = member.direct.as_ref().is_some_and(|direct| direct.heard_ns == at_ns);
            if heard.contains(&robot) && is_told {
                let (heading_rad, speed_m_s) = (f64::from(pose.heading_mrad) * 1e-3, f64::from(pose.speed_mm_s) * 1e-3);
                return Some(Obstacle::robot(cell, heading_rad, speed_m_s));
            }
            let is_gone = now_ns.saturating_sub(at_ns) > self.friend_max_age_ns || self.can_see(now_ns, pose.position);
            (!is_gone).then_some(Obstacle { cell, kind: ObstacleKind::Stopped })
        };
        self.team.group().members().filter_map(obstacle).collect()
    }

    /// Straight on, now and then to a side where one opens, and back at the end.
    fn wander(&mut self, now_ns: u64, here: Cell, obstacles: &[Obstacle]) -> Option<Cell> {
        let heading_rad = self.fix?.pose.heading_rad;
        let grid = &self.ground.grid;
        let free = |step| is_free(grid, obstacles, here, step);
        let navigation = &mut self.navigation;
        let is_stuck = navigation.place.is_some_and(|(_, since_ns)| now_ns.saturating_sub(since_ns) > STUCK_NS);
        let kept = navigation.next.filter(|next| Direction::ALL.into_iter().any(|step| free(step) == Some(*next)));
        if kept.is_some() && !is_stuck {
            return kept;
        }
        if is_stuck {
            navigation.place = Some((here, now_ns));
        }
        let ahead = navigation.came.or_else(|| Direction::of_heading(heading_rad))?;
        let other = |step: Direction| free(step).filter(|next| !is_stuck || Some(*next) != kept);
        let [straight, back] = [other(ahead), other(ahead.reversed())];
        let sides: Vec<Cell> =
            Direction::ALL.into_iter().filter(|it| *it != ahead && *it != ahead.reversed()).filter_map(other).collect();
        let turns = straight.is_none() || navigation.once_in(4);
        let side = if turns { navigation.one_of(&sides) } else { None };
        side.or(straight).or(back)
    }

    /// To places near where the intruder was.
    fn search(&mut self, now_ns: u64, here: Cell, obstacles: &[Obstacle]) -> Option<Cell> {
        let is_over = |(cell, since_ns): (Cell, u64)| cell == here || now_ns.saturating_sub(since_ns) > SEARCH_NS;
        if self.navigation.destination.is_none_or(is_over) {
            let last = self.intruders(false);
            let chosen = self.navigation.one_of(&last);
            let near = chosen.map(|last| self.cells_near(last, self.settings.search_steps)).unwrap_or_default();
            self.navigation.destination = self.navigation.one_of(&near).map(|cell| (cell, now_ns));
        }
        let (goal, _) = self.navigation.destination?;
        let navigation = &mut self.navigation;
        navigation.wave.start(&self.ground.grid, here, [goal], obstacles.iter().copied());
        let Some(goal) = navigation.wave.next_goal() else {
            navigation.destination = None;
            return None;
        };
        navigation.wave.back_from(goal).take_while(|cell| *cell != here).last()
    }

    /// Paths that are 1 to `reach` steps away from one.
    pub(crate) fn cells_near(&mut self, middle: Cell, reach: u32) -> Vec<Cell> {
        let (grid, wave) = (&self.ground.grid, &mut self.navigation.wave);
        wave.start(grid, middle, [], []);
        while wave.next_goal().is_some() {}
        let cells = grid.cells().map(|(cell, _)| cell);
        cells.filter(|cell| wave.distance(*cell).is_some_and(|steps| (1..=reach).contains(&steps))).collect()
    }

    /// Paths to which this robot is nearer than all others: robots that go there do not have to pass each other.
    pub(crate) fn cells_nearest(&mut self, here: Cell, others: &[Cell]) -> Vec<Cell> {
        let (grid, wave) = (&self.ground.grid, &mut self.navigation.wave);
        let mut steps_from = |start: Cell| {
            wave.start(grid, start, [], []);
            while wave.next_goal().is_some() {}
            grid.cells().map(|(cell, _)| wave.distance(cell).unwrap_or(u32::MAX)).collect::<Vec<u32>>()
        };
        let own = steps_from(here);
        let mut least = vec![u32::MAX; own.len()];
        for other in others {
            least.iter_mut().zip(steps_from(*other)).for_each(|(least, steps)| *least = steps.min(*least));
        }
        let cells = grid.cells().map(|(cell, _)| cell).zip(own.into_iter().zip(least));
        cells.filter(|(_, (own, least))| (1..*least).contains(own)).map(|(cell, _)| cell).collect()
    }

    /// To the nearest entrance of any intruder of which the place is certain.
    fn block(&mut self, now_ns: u64, here: Cell, mut obstacles: Vec<Obstacle>) -> Option<Cell> {
        let intruders = self.intruders(true);
        let body = |cell: &Cell| Obstacle { cell: *cell, kind: ObstacleKind::Intruder };
        obstacles.extend(intruders.iter().map(body));
        let mut best: Option<(u32, Cell, Option<Cell>)> = None;
        for intruder in intruders {
            let (wave, grid) = (&mut self.navigation.wave, &self.ground.grid);
            let Ok(found) = entrances(wave, grid, &[intruder], here, &obstacles) else { continue };
            let Some(Entrance { cell, distance: Some(distance) }) = found.first().copied() else { continue };
            if best.is_none_or(|(known, ..)| distance < known) {
                best = Some((distance, cell, wave.back_from(cell).take_while(|cell| *cell != here).last()));
            }
        }
        self.navigation.destination = best.map(|(_, entrance, _)| (entrance, now_ns));
        best?.2
    }
}
