//! Intruders: discs that no program drives.

use rohrpost_robot::surroundings::Disc;
use rohrpost_team::grid::{Cell, Direction, Grid, Placement, Wave};

/// How an intruder behaves.
#[derive(Clone, Debug, PartialEq)]
pub enum Conduct {
    /// Never moves.
    Stands,
    /// Goes to these cells, one after the other, by shortest paths; then it stands.
    Script {
        /// Metres a second.
        speed_m_s: f64,
        /// Cells to go to, the first one first.
        cells: Vec<Cell>,
    },
    /// Goes to the cell beside it that is furthest from all robots.
    Flees {
        /// Metres a second.
        speed_m_s: f64,
        /// Stands while no robot is so near, metres.
        fears_m: f64,
    },
}

/// A body and its conduct.
#[derive(Clone, Debug)]
pub(crate) struct Intruder {
    pub(crate) disc: Disc,
    conduct: Conduct,
    /// Steps of a script that are done.
    done: usize,
    /// The cell to the middle of which it goes.
    next: Option<Cell>,
}

impl Intruder {
    pub(crate) fn new(disc: Disc, conduct: Conduct) -> Self {
        Self { disc, conduct, done: 0, next: None }
    }

    /// Moves for `step_s` seconds, unless it would reach into a robot.
    pub(crate) fn step(&mut self, step_s: f64, grid: &Grid, placement: Placement, robots: &[Disc], wave: &mut Wave) {
        let speed_m_s = match self.conduct {
            Conduct::Stands => return,
            Conduct::Script { speed_m_s, .. } | Conduct::Flees { speed_m_s, .. } => speed_m_s,
        };
        let Some(here) = placement.cell(grid, self.disc.x_m, self.disc.y_m) else { return };
        let Some(next) = self.next.or_else(|| self.choose(here, grid, placement, robots, wave)) else { return };
        self.next = Some(next);
        let (x_m, y_m) = placement.middle_m(grid, next);
        let (ahead_m, aside_m) = (x_m - self.disc.x_m, y_m - self.disc.y_m);
        let apart_m = ahead_m.hypot(aside_m);
        let share = (speed_m_s * step_s / apart_m.max(f64::MIN_POSITIVE)).min(1.0);
        let (x_m, y_m) = (self.disc.x_m + share * ahead_m, self.disc.y_m + share * aside_m);
        if robots.iter().any(|robot| robot.contact(x_m, y_m, self.disc.radius_m).is_some()) {
            // Where a robot stands in the way, another cell may be better.
            self.next = None;
            return;
        }
        (self.disc.x_m, self.disc.y_m) = (x_m, y_m);
        if share >= 1.0 {
            self.next = None;
        }
    }

    fn choose(
        &mut self,
        here: Cell,
        grid: &Grid,
        placement: Placement,
        robots: &[Disc],
        wave: &mut Wave,
    ) -> Option<Cell> {
        match &self.conduct {
            Conduct::Stands => None,
            Conduct::Script { cells, .. } => {
                while cells.get(self.done) == Some(&here) {
                    self.done += 1;
                }
                wave.start(grid, here, cells.get(self.done).copied(), []);
                let goal = wave.next_goal()?;
                wave.back_from(goal).take_while(|cell| *cell != here).last()
            }
            Conduct::Flees { fears_m, .. } => flight(here, *fears_m, grid, placement, robots),
        }
    }
}

/// The neighbour that is furthest from the nearest robot, if that is further than the cell itself.
fn flight(here: Cell, fears_m: f64, grid: &Grid, placement: Placement, robots: &[Disc]) -> Option<Cell> {
    let nearest_m = |cell: Cell| {
        let (x_m, y_m) = placement.middle_m(grid, cell);
        robots.iter().map(|robot| (robot.x_m - x_m).hypot(robot.y_m - y_m)).min_by(f64::total_cmp)
    };
    let here_m = nearest_m(here).filter(|here_m| *here_m <= fears_m)?;
    let beside = Direction::ALL.into_iter().filter_map(|step| here.next(step)).filter(|cell| grid.is_path(*cell));
    let further = beside.filter_map(|cell| Some((nearest_m(cell)?, cell))).filter(|(cell_m, _)| *cell_m > here_m);
    further.reduce(|best, it| if it.0 > best.0 { it } else { best }).map(|(_, cell)| cell)
}
