//! Which ways an intruder has: paths beside it that robots can reach, and in which none is.

use crate::arena::Arena;
use rohrpost_team::grid::{Cell, Direction, Obstacle, ObstacleKind, Wave};
use std::collections::BTreeSet;

impl Arena {
    /// The cell in which an intruder is; `None` if there is no such intruder, or it is on no path.
    pub fn intruder_cell(&self, number: usize) -> Option<Cell> {
        let disc = self.intruders().nth(number)?;
        self.placement().cell(&self.map().grid, disc.x_m, disc.y_m)
    }

    /// Paths beside an intruder that a robot can reach, and in which no robot is, in the order of the file.
    pub fn open_entrances(&self, number: usize) -> Vec<Cell> {
        let (grid, Some(here)) = (&self.map().grid, self.intruder_cell(number)) else { return Vec::new() };
        let bodies = (0..self.intruders().count()).filter_map(|other| self.intruder_cell(other));
        let bodies: Vec<Obstacle> = bodies.map(|cell| Obstacle { cell, kind: ObstacleKind::Intruder }).collect();
        let robots: BTreeSet<Cell> = self.robots().filter_map(|robot| self.cell(robot)).collect();
        let beside = Direction::ALL.into_iter().filter_map(|step| here.next(step));
        let free = beside.filter(|cell| grid.is_path(*cell) && !robots.contains(cell));
        let mut wave = Wave::default();
        let mut can_be_reached = |cell: &Cell| {
            wave.start(grid, *cell, robots.iter().copied(), bodies.iter().copied());
            wave.next_goal().is_some()
        };
        let mut open: Vec<Cell> = free.filter(|cell| can_be_reached(cell)).collect();
        open.sort_unstable_by_key(|cell| (cell.row, cell.column));
        open
    }
}

#[cfg(test)]
mod tests {
    use crate::{Arena, ArenaSettings, Conduct};
    use rohrpost_robot::simulator::Settings;
    use rohrpost_team::RobotId;
    use rohrpost_team::grid::{Cell, Direction, Map};

    #[test]
    fn an_entrance_is_open_until_a_robot_is_in_it_or_none_can_come_there() {
        let map = b"rohrpost-map 1\ncell_m 1\nmap\n########\n#      #\n########\n";
        let settings = ArenaSettings { cell_m: 1.0, robot: Settings::default(), intruder_radius_m: 0.25 };
        let mut arena = Arena::new(&Map::read(map).unwrap(), settings).unwrap();
        let at = |column| Cell { column, row: 1 };
        assert!(arena.open_entrances(0).is_empty(), "no intruder");
        let intruder = arena.add_intruder(at(4), Conduct::Stands);
        assert!(arena.open_entrances(intruder).is_empty(), "no robot");
        let [one, two] = [1, 2].map(|id| RobotId::new(id).unwrap());
        arena.add_robot(one, at(1), Direction::East).unwrap();
        assert_eq!(arena.open_entrances(intruder), [at(3)], "the other side is out of reach");
        arena.add_robot(two, at(6), Direction::West).unwrap();
        assert_eq!(arena.open_entrances(intruder), [at(3), at(5)]);
        arena.push(two, at(5)).unwrap();
        assert_eq!(arena.open_entrances(intruder), [at(3)]);
        assert_eq!(arena.intruder_cell(intruder), Some(at(4)));
    }
}
