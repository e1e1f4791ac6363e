//! Halts that hold the robot. It stands until each of them is let go by its own number: an order to go on that comes
//! late ends no younger halt.

/// Halts held at a time. Each computer of a robot and each of its teammates may hold one, and this is a team of some.
const HALTS_MAX: usize = 32;

/// One halt. A repetition of the same one is no other; a second one of the same holder is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HaltId {
    /// The holder, as the number that names it.
    pub by: u32,
    /// The holder's own number of it.
    pub number: u32,
}

/// There is no room to remember the holder of this halt. It holds all the same, until all are let go at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{HALTS_MAX} halts are held already; the robot stands, and `resume` of all lets it go")]
pub struct TooManyHalts;

/// The halts that are held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Halts {
    held: [Option<HaltId>; HALTS_MAX],
    has_unnamed: bool,
}

impl Halts {
    /// Holds the robot from now on.
    ///
    /// # Errors
    /// [`TooManyHalts`]: it holds, but without a name.
    pub fn halt(&mut self, id: HaltId) -> Result<(), TooManyHalts> {
        if self.held().any(|held| held == id) {
            return Ok(());
        }
        match self.held.iter_mut().find(|place| place.is_none()) {
            Some(place) => *place = Some(id),
            None => {
                self.has_unnamed = true;
                return Err(TooManyHalts);
            }
        }
        Ok(())
    }

    /// Lets go this halt. Others hold on.
    pub fn resume(&mut self, id: HaltId) {
        self.held.iter_mut().filter(|place| **place == Some(id)).for_each(|place| *place = None);
    }

    /// Holds without a name, until [`Halts::resume_all`]: what is to be held is not known.
    pub fn halt_unnamed(&mut self) {
        self.has_unnamed = true;
    }

    /// Lets go all halts of all.
    pub fn resume_all(&mut self) {
        *self = Self::default();
    }

    /// Whether anybody holds the robot.
    pub fn is_held(&self) -> bool {
        self.has_unnamed || self.held().next().is_some()
    }

    /// Whether it is held without a name, until [`Halts::resume_all`].
    pub fn has_unnamed(&self) -> bool {
        self.has_unnamed
    }

    /// The halts that hold the robot.
    pub fn held(&self) -> impl Iterator<Item = HaltId> + '_ {
        self.held.iter().flatten().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(by: u32, number: u32) -> HaltId {
        HaltId { by, number }
    }

    #[test]
    fn each_halt_is_let_go_by_its_own_number_and_a_repetition_is_no_second_one() {
        let mut halts = Halts::default();
        for (by, number) in [(1, 1), (1, 1), (1, 2), (2, 1)] {
            halts.halt(id(by, number)).expect("there is room");
        }
        assert!(halts.held().eq([id(1, 1), id(1, 2), id(2, 1)]));
        halts.resume(id(1, 1));
        halts.resume(id(1, 1)); // one more that came late
        assert!(halts.is_held() && halts.held().eq([id(1, 2), id(2, 1)]));
        halts.resume(id(1, 2));
        halts.resume(id(2, 1));
        assert!(!halts.is_held());
    }

    #[test]
    fn a_halt_without_room_for_its_name_holds_until_all_are_let_go() {
        let mut halts = Halts::default();
        (0..HALTS_MAX as u32).for_each(|by| halts.halt(id(by, 0)).expect("there is room"));
        assert_eq!(halts.halt(id(99, 0)), Err(TooManyHalts));
        (0..=99).for_each(|by| halts.resume(id(by, 0)));
        assert!(halts.is_held() && halts.held().next().is_none());
        halts.resume_all();
        assert!(!halts.is_held());
    }
}
