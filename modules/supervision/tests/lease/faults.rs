//! What happens to an installation, and what it must do afterwards.

use crate::world::{MS, World};
use rand::Rng;
use rohrpost_supervision::lease::Number;

/// How long things go wrong, ns.
const SUFFERING_NS: u64 = 20_000 * MS;

impl World {
    /// Lets everything go wrong for a while.
    pub(crate) fn suffer(&mut self) {
        while self.now_ns < SUFFERING_NS {
            // Now and then long enough for a lease, and for a witness to grant again.
            let rest_ns = [100, 600, 4_000][self.random.random_range(0..3)] * MS;
            let until_ns = self.now_ns + self.random.random_range(0..rest_ns);
            self.run_until(until_ns, |_| {});
            let place = self.random.random_range(0..self.programs.len());
            let holder = self.holder().filter(|_| self.random.random_bool(0.5));
            let place = holder.map_or(place, |(holder, _)| holder);
            match self.random.random_range(0..15) {
                0 => self.programs[place] = None,
                1..=3 if self.programs[place].is_none() => self.start(place),
                1 => self.start(place),
                2 | 3 => self.stop(place),
                4..=6 => self.go_on(place),
                7 => {
                    let is_ready = self.random.random_bool(0.7);
                    self.set_ready(place, is_ready);
                }
                8 => {
                    // Off, and ready again before the release has come.
                    self.set_ready(place, false);
                    let until_ns = self.now_ns + self.random.random_range(0..10 * MS);
                    self.run_until(until_ns, |_| {});
                    self.set_ready(place, true);
                }
                9 => self.restart_witness(),
                10 => {
                    let fence = self.random.random_range(0..self.passed.len());
                    self.restart_fence(fence);
                }
                11 => {
                    let computer = self.random.random_range(0..self.programs.len() + 3);
                    self.drift(computer);
                }
                12 | 13 => {
                    let computers = self.programs.len() + 3;
                    let way = (self.random.random_range(0..computers), self.random.random_range(0..computers));
                    self.cuts.insert(way);
                }
                _ => self.cuts.clear(),
            }
        }
    }

    /// Ends all faults at one candidate; others stay dead, stopped, or cut off in one direction. Soon one holds.
    pub(crate) fn recover(&mut self) -> (usize, Number) {
        let delay_before_ns = self.delay_max_ns;
        let delay_ns = self.terms.ask_every_ns() / 4;
        (self.delay_max_ns, self.loss) = (delay_ns, 0.0);
        self.cuts.clear();
        let healthy = self.random.random_range(0..self.programs.len());
        let witness = self.programs.len();
        for place in 0..self.programs.len() {
            match if place == healthy { 4 } else { self.random.random_range(0..6) } {
                0 => self.programs[place] = None,
                1 => self.stop(place),
                2 => drop(self.cuts.insert((place, witness))),
                3 => drop(self.cuts.insert((witness, place))),
                _ => self.heal(place),
            }
        }
        // After the last late message: a lease that nobody knows of, the time in which a better choice that has died is
        // waited for, and questions.
        let settled_from_ns = self.witness_opens_ns().max(self.now_ns + delay_before_ns);
        let settling_ns = 2 * self.terms.lease_ns() + 4 * (self.terms.ask_every_ns() + delay_ns + MS);
        let error_ppm = u64::from(self.terms.rate_error_ppm());
        let settling_ns = settling_ns + settling_ns * 3 * error_ppm / 1_000_000;
        self.run_until(settled_from_ns + settling_ns, |_| {});
        let (seed, lease_ms) = (self.seed, self.terms.lease_ns() / MS);
        self.holder().unwrap_or_else(|| panic!("seed {seed}: nobody holds, though {healthy} can; {lease_ms} ms"))
    }

    /// Everything is well again, and the holder stays.
    pub(crate) fn stay(&mut self, holder: (usize, Number)) {
        self.cuts.clear();
        for place in (0..self.programs.len()).filter(|place| *place != holder.0) {
            self.heal(place);
        }
        let until_ns = self.now_ns + 4 * self.terms.lease_ns();
        self.run_until(until_ns, |world| {
            assert_eq!(
                world.holder(),
                Some(holder),
                "seed {}: the holder changes, though nothing is wrong",
                world.seed
            );
        });
        for passed in self.passed {
            assert_eq!(passed, Some(holder.1), "seed {}: the holder's data do not pass a fence", self.seed);
        }
    }

    fn heal(&mut self, place: usize) {
        if self.programs[place].is_none() {
            self.start(place);
        }
        self.go_on(place);
        self.set_ready(place, true);
    }
}
