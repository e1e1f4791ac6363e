//! Which faults divide a network with time slots, which nodes they part, and for how long that excuses two nodes that
//! transmit at once.

use super::fault::{Fault, Planned};
use super::spans::MS;
use super::transmission::{Basis, Transmission};

/// A fault that divides the network for longer than this may leave it with two times: two masters that do not hear each
/// other.
pub(crate) const HOLDOVER_NS: u64 = 100 * MS;
/// So many cycles after such a fault no two nodes transmit at once any more.
pub(crate) const HEALED_CYCLES: u64 = 16;
/// So many cycles after the later of two began a time their Syncs meet no more: by then one has heard the other, and
/// yields.
pub(crate) const BEGINNERS_CYCLES: u64 = 4;

/// A fault because of which nodes do not hear each other, or too late.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Division {
    /// When it begins, true ns.
    pub(crate) from_ns: u64,
    /// When it is over, and what it kept up has come, true ns.
    pub(crate) until_ns: u64,
    /// The nodes that it parts.
    pub(crate) parts: Parts,
}

/// The nodes that a fault parts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Parts {
    /// These two: one does not hear the other, or too late.
    Cut(usize, usize),
    /// The nodes of which the bit is set from all others.
    Split(u64),
    /// This node from all others, while it is stalled or has not started. It counts only for nodes with another
    /// configuration; nodes with the same one know its slots.
    Still(usize),
}

impl Parts {
    /// The nodes that a fault parts; none if it leaves links as they are.
    fn of(fault: &Fault) -> Option<Self> {
        match *fault {
            Fault::Cut { from, to } | Fault::Bad { from, to, .. } => Some(Self::Cut(from, to)),
            Fault::Split { side } => Some(Self::Split(side)),
            Fault::Freeze { node, .. } => Some(Self::Still(node)),
            _ => None,
        }
    }

    /// Whether it parts any two of these.
    fn part_any(self, nodes: &[usize]) -> bool {
        match self {
            Self::Cut(one, other) => nodes.contains(&one) && nodes.contains(&other),
            Self::Still(node) => nodes.contains(&node),
            Self::Split(side) => nodes.iter().any(|node| side >> node & 1 != side >> nodes[0] & 1),
        }
    }
}

/// All faults of a plan that divide its network.
#[derive(Clone, Default, Debug)]
pub(crate) struct Divisions {
    all: Vec<Division>,
    cycle_ns: u64,
    /// Extra time, ns, that a node needs with rare slots: it must ask a peer that restarted during the division before
    /// it follows that peer's time.
    pub(super) asks_ns: u64,
}

impl Divisions {
    /// Those of such faults, where cycles are so long.
    pub(crate) fn of(faults: &[Planned], cycle_ns: u64) -> Self {
        let all = faults.iter().filter_map(|planned| {
            let parts = Parts::of(&planned.fault)?;
            // What it has kept up still comes, and nothing comes before it.
            let way_ns = if let Fault::Bad { quality, .. } = planned.fault { quality.way_ns_max() } else { 0 };
            Some(Division { from_ns: planned.from_ns, until_ns: planned.until_ns + way_ns, parts })
        });
        Self { all: all.collect(), cycle_ns, asks_ns: 0 }
    }

    /// Whether two nodes may not be blamed for transmitting at once. `began_ns`: when the times by which they go began.
    ///
    /// Nodes that go by one time never are excused, unless one of them only asks, by frames all of which were on their
    /// way for too long. Else a fault must part one from the other, or from a master of theirs, and that
    /// - for longer than [`HOLDOVER_NS`], or since before the times by which they go began; and
    /// - not have been over for [`HEALED_CYCLES`], or longer where slots are rare.
    ///
    /// Of two that begin a time neither can know of the other before it has heard it, for [`BEGINNERS_CYCLES`] at most.
    pub(crate) fn excuse(&self, one: &Transmission, other: &Transmission, began_ns: u64) -> bool {
        let at_ns = one.begin_ns;
        if let (Basis::Begins { since_ns }, Basis::Begins { since_ns: other_ns }) = (one.basis, other.basis)
            && at_ns <= since_ns.max(other_ns) + BEGINNERS_CYCLES * self.cycle_ns
        {
            return true;
        }
        if [one, other].iter().any(|sends| sends.basis.is_misled()) {
            return true;
        }
        let is_one_table = one.digest == other.digest;
        if is_one_table && one.term == other.term {
            return false;
        }
        let nodes: Vec<usize> =
            [one, other].into_iter().flat_map(|sends| [Some(sends.node), sends.master]).flatten().collect();
        let counts = |parts: Parts| parts.part_any(&nodes) && !(is_one_table && matches!(parts, Parts::Still(_)));
        let mut lasting = self.lasting(at_ns).filter(|division| counts(division.parts));
        lasting.any(|division| division.from_ns + HOLDOVER_NS <= at_ns || division.from_ns <= began_ns)
    }

    /// Those that are on, or have not been over for long.
    fn lasting(&self, at_ns: u64) -> impl Iterator<Item = &Division> {
        let healed_ns = HEALED_CYCLES * self.cycle_ns + self.asks_ns;
        self.all.iter().filter(move |division| (division.from_ns..division.until_ns + healed_ns).contains(&at_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_routers::time::Term;

    const CYCLE_NS: u64 = MS;
    const AT_NS: u64 = 1000 * MS;

    fn sends(node: usize, rank: u8, basis: Basis) -> Transmission {
        let (begin_ns, end_ns) = (AT_NS, AT_NS + 1000);
        Transmission { node, master: Some(rank.into()), digest: 1, term: Term::new(7, rank), basis, begin_ns, end_ns }
    }

    #[test]
    fn a_fault_excuses_the_nodes_that_it_parts_when_it_lasts_and_no_others() {
        let own = |node, rank| sends(node, rank, Basis::Own);
        let heard = |node, is_misled| sends(node, 0, Basis::Heard { is_misled });
        let begins = |node, since_ns| sends(node, node as u8, Basis::Begins { since_ns });
        let cut = Parts::Cut(0, 1);
        let long = (AT_NS - HOLDOVER_NS, AT_NS + 1);
        let healed = |cycles: u64| (AT_NS - S, AT_NS - cycles * CYCLE_NS);
        for (parts, (from_ns, until_ns), one, other, began_ns, excused, why) in [
            (cut, long, own(0, 0), own(1, 1), 0, true, "two masters that are parted"),
            (cut, long, own(2, 0), own(3, 1), 0, true, "followers of two masters that are parted"),
            (cut, long, own(0, 0), own(1, 0), 0, false, "one time"),
            (cut, long, own(2, 2), own(3, 1), 0, false, "a master of neither is at that end"),
            (cut, (long.0 + 1, long.1), own(0, 0), own(1, 1), 0, false, "too short for two times"),
            (cut, (long.0 + 1, long.1), own(0, 0), own(1, 1), AT_NS - 5, true, "two that began meanwhile"),
            (cut, healed(HEALED_CYCLES - 1), own(0, 0), own(1, 1), 0, true, "just fixed"),
            (cut, healed(HEALED_CYCLES), own(0, 0), own(1, 1), 0, false, "fixed long ago"),
            (Parts::Split(0b0101), long, own(0, 0), own(1, 1), 0, true, "on two sides"),
            (Parts::Split(0b0101), long, own(0, 0), own(2, 2), 0, false, "on one side"),
            (Parts::Split(0b0101), long, own(0, 0), own(2, 3), 0, true, "its master is on the other"),
            (cut, (0, 1), heard(1, true), own(2, 0), 0, true, "it asks by what came too late"),
            (cut, (0, 1), heard(1, false), own(2, 0), 0, false, "it asks by what came in time"),
            (cut, (0, 1), begins(0, AT_NS - BEGINNERS_CYCLES * CYCLE_NS), begins(1, 0), 0, true, "two that just began"),
            (cut, (0, 1), begins(0, AT_NS - BEGINNERS_CYCLES * CYCLE_NS - 1), begins(1, 0), 0, false, "long ago"),
            (cut, (0, 1), begins(0, AT_NS), own(1, 1), 0, false, "one of them has time"),
        ] {
            let divisions =
                Divisions { all: vec![Division { from_ns, until_ns, parts }], cycle_ns: CYCLE_NS, asks_ns: 0 };
            assert_eq!(divisions.excuse(&one, &other, began_ns), excused, "{why}");
        }
    }

    const S: u64 = 1000 * MS;
}
