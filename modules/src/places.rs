//! Places of something bounded, shared out by principal: the principals that hold them decide which one may take
//! another. Knows no clock and no mailbox.
//!
//! ```text
//!  │ own places of each named principal │ open places: for all others, and for what the named hold beyond their own │
//! ```
//!
//! A principal gets another open place only while it holds fewer open places than are free. So n greedy principals hold
//! 1/(n+1) of them each, and 1/(n+1) stays free.

use rohrpost_config::Principal;

/// How many places there are, and of which principals.
pub(crate) struct Places {
    named: Box<[Principal]>,
    /// Places of each named principal.
    own: usize,
    open: usize,
}

impl Places {
    /// `own` places for each of these, however often it is named, and `open` for all.
    pub(crate) fn new(named: &[Principal], own: usize, open: usize) -> Self {
        let is_first = |(at, principal): &(usize, &Principal)| !named[..*at].contains(principal);
        Self { named: named.iter().enumerate().filter(is_first).map(|(_, principal)| *principal).collect(), own, open }
    }

    /// Places in all.
    pub(crate) fn total(&self) -> usize {
        self.named.len() * self.own + self.open
    }

    /// Whether a principal may take one more; `held` has the holder of each place that is taken.
    pub(crate) fn allows(&self, principal: Principal, held: impl Iterator<Item = Principal> + Clone) -> bool {
        let holds = |principal| held.clone().filter(|holder| *holder == principal).count();
        let own = if self.named.contains(&principal) { self.own } else { 0 };
        let Some(beyond) = holds(principal).checked_sub(own) else { return true };
        let covered: usize = self.named.iter().map(|named| holds(*named).min(self.own)).sum();
        let free = self.open.saturating_sub(held.clone().count() - covered);
        beyond < free
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMED: Principal = Principal::Launch(0);

    /// Takes places until it is refused; how many it got.
    fn take_all(places: &Places, held: &mut Vec<Principal>, principal: Principal) -> usize {
        let before = held.len();
        while places.allows(principal, held.iter().copied()) {
            held.push(principal);
        }
        held.len() - before
    }

    #[test]
    fn a_principal_that_takes_all_it_can_leaves_as_much_to_the_next() {
        let places = Places::new(&[NAMED, NAMED], 2, 64);
        let mut held = Vec::new();
        let taken: Vec<usize> = (2..9).map(|n| take_all(&places, &mut held, Principal::System(n))).collect();
        assert_eq!(taken, [32, 16, 8, 4, 2, 1, 1]);
        // All open places are taken; its own are not.
        assert_eq!(take_all(&places, &mut held, Principal::System(9)), 0);
        assert_eq!((take_all(&places, &mut held, NAMED), held.len()), (2, places.total()));
    }

    #[test]
    fn principals_that_take_turns_hold_one_part_each_and_one_is_free() {
        let places = Places::new(&[], 0, 64);
        let mut held: Vec<Principal> = Vec::new();
        for _ in 0..64 {
            for n in 2..5 {
                if places.allows(Principal::System(n), held.iter().copied()) {
                    held.push(Principal::System(n));
                }
            }
        }
        let holds = |n| held.iter().filter(|holder| **holder == Principal::System(n)).count();
        assert_eq!([holds(2), holds(3), holds(4), 64 - held.len()], [16; 4]);
    }

    #[test]
    fn what_a_named_principal_holds_beyond_its_own_is_shared_with_all() {
        let places = Places::new(&[NAMED], 2, 8);
        let mut held = Vec::new();
        assert_eq!(take_all(&places, &mut held, NAMED), 2 + 4);
        assert_eq!(take_all(&places, &mut held, Principal::Unknown), 2);
        // Two of what it held are free for all again, and it holds more of them than others.
        held.remove(0);
        held.remove(0);
        assert_eq!(take_all(&places, &mut held, NAMED), 1);
    }
}
