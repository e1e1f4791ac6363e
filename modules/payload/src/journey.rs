//! Where a robot has come from and where it goes.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use rohrpost_team::grid::{Cell, Direction, Wave};

/// The way of one robot.
pub(crate) struct Navigation {
    /// The cell to enter; `None`: stand in the middle of the own one.
    pub(crate) next: Option<Cell>,
    /// Where the way ends, if the mode has such a place, and since when, ns.
    pub(crate) destination: Option<(Cell, u64)>,
    /// When it looked for such a place last, ns.
    pub(crate) chose_ns: Option<u64>,
    /// The cell in which the robot was last, and since when, ns.
    pub(crate) place: Option<(Cell, u64)>,
    /// The step by which it came there.
    pub(crate) came: Option<Direction>,
    /// The cell that it enters with a claim, and since when, ns.
    pub(crate) enters: Option<(Cell, u64)>,
    /// Something was in the way: the robot goes back to the middle of its own cell.
    pub(crate) turns_back: bool,
    random: ChaCha8Rng,
    pub(crate) wave: Wave,
}

impl Navigation {
    pub(crate) fn new(seed: u64) -> Self {
        let (random, wave) = (ChaCha8Rng::seed_from_u64(seed), Wave::default());
        let (enters, turns_back) = (None, false);
        Self {
            next: None,
            destination: None,
            chose_ns: None,
            place: None,
            came: None,
            enters,
            turns_back,
            random,
            wave,
        }
    }

    /// Another mode has other destinations.
    pub(crate) fn forget(&mut self) {
        (self.destination, self.chose_ns) = (None, None);
    }

    /// The robot is in a cell. True if it was in another one.
    pub(crate) fn arrive(&mut self, now_ns: u64, cell: Cell) -> bool {
        let before = self.place.map(|(before, _)| before);
        if before == Some(cell) {
            return false;
        }
        self.came = before.and_then(|before| Direction::ALL.into_iter().find(|step| before.next(*step) == Some(cell)));
        self.place = Some((cell, now_ns));
        true
    }

    /// One of some cells, by chance.
    pub(crate) fn one_of(&mut self, cells: &[Cell]) -> Option<Cell> {
        let at = self.random.next_u64().checked_rem(cells.len() as u64)?;
        cells.get(at as usize).copied()
    }

    /// True once in so many cases, by chance.
    pub(crate) fn once_in(&mut self, cases: u64) -> bool {
        self.random.next_u64().is_multiple_of(cases)
    }
}
