//! Networks with time slots that share the wire with nodes of other tables: routers that were started anew from a file
//! that somebody has edited.

use super::chance::Chance;
use super::fault::{Fault, Planned};
use super::plan::Plan;
use super::slots::Slots;
use super::spans::{MS, S, US};
use rohrpost_network::TimeSlot;
use rohrpost_routers::frame::NodeIndex;
use std::time::Duration;

/// Edited files of a network.
const EDITIONS: u64 = 3;
/// A node that was refused, or heard another time, says nothing for so long; then all have the right file.
const LISTENS_NS: u64 = 10 * S;

/// What somebody has edited.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Edit {
    /// Nothing of the slots.
    Else,
    Cycle,
    /// Windows of synchronisation are longer, and slots begin later.
    Synchronisation,
    Guard,
    Offset,
    Length,
    /// A slot comes in every other cycle.
    Period,
    /// Two slots have changed hands.
    Owners,
    Fewer,
    /// Masters stand in another order.
    Masters,
    /// One more may be master.
    OneMore,
    /// Links are said to carry half.
    Link,
}

impl Edit {
    const ALL: [Self; 12] = [
        Self::Else,
        Self::Cycle,
        Self::Synchronisation,
        Self::Guard,
        Self::Offset,
        Self::Length,
        Self::Period,
        Self::Owners,
        Self::Fewer,
        Self::Masters,
        Self::OneMore,
        Self::Link,
    ];

    /// The slots as they are with it. What is drawn of a network has room for it.
    fn of(self, slots: &Slots, nodes: NodeIndex, chance: &mut Chance) -> Slots {
        let mut edited = slots.clone();
        let (table, masters) = (&mut edited.table, &mut edited.masters);
        let later = Duration::from_nanos(chance.between(20, 400) * US);
        let at = chance.below(table.slots.len() as u64) as usize;
        let shift = |slot: &mut TimeSlot, by: Duration| slot.offset += by;
        match self {
            Self::Else => {}
            Self::Cycle => table.cycle += later.max(Duration::from_millis(1)),
            Self::Synchronisation => {
                table.synchronisation += later;
                let all = later * masters.len() as u32;
                table.slots.iter_mut().for_each(|slot| shift(slot, all));
                table.cycle += all;
            }
            Self::Guard => table.guard -= Duration::from_micros(10),
            Self::Offset => {
                table.slots.iter_mut().for_each(|slot| shift(slot, later));
                table.cycle += later;
            }
            Self::Length => table.slots[at].length -= Duration::from_micros(30),
            Self::Period => {
                let slot = &mut table.slots[at];
                (slot.period, slot.phase) = (2 * slot.period, slot.phase + slot.period * chance.below(2) as u32);
            }
            Self::Owners => {
                let other = (at + 1) % table.slots.len();
                let (one, its) = (table.slots[at].node, table.slots[other].node);
                (table.slots[at].node, table.slots[other].node) = (its, one);
            }
            Self::Fewer => {
                if table.slots.iter().filter(|slot| slot.node == table.slots[at].node).count() > 1 {
                    table.slots.remove(at);
                }
            }
            Self::Masters => masters.rotate_left(1),
            Self::OneMore => {
                if let Some(more) = (0..nodes).find(|node| !masters.contains(node)) {
                    masters.push(more);
                    let room = table.synchronisation;
                    table.slots.iter_mut().for_each(|slot| shift(slot, room));
                    table.cycle += room;
                }
            }
            Self::Link => table.link_bytes_s /= 2,
        }
        edited
    }
}

impl Plan {
    /// A network with time slots in which some routers are started from edited files, one after the other or many at
    /// once; in the end all have the right one.
    pub fn edited(seed: u64) -> Self {
        let mut plan = Self::slotted_of(seed, (3, 6), 3);
        let mut chance = Chance::new(seed ^ 0xed_17);
        let nodes = plan.nodes.len() as NodeIndex;
        let Some(slots) = plan.slots.clone() else { return plan };
        let edits = (0..EDITIONS).map(|edition| match edition {
            // Each of them in turn.
            0 => Edit::ALL[seed as usize % Edit::ALL.len()],
            _ => chance.pick(&Edit::ALL),
        });
        plan.edited = edits.collect::<Vec<_>>().into_iter().map(|edit| edit.of(&slots, nodes, &mut chance)).collect();
        let all_at_once = chance.percent(20).then(|| chance.below(plan.fixed_ns / 4));
        for node in 0..plan.nodes.len() {
            let from_ns = all_at_once.unwrap_or_else(|| chance.below(plan.fixed_ns / 2));
            let until_ns = chance.between(from_ns + 300 * MS, plan.fixed_ns);
            let edition = 1 + chance.below(EDITIONS) as usize;
            if chance.percent(60) {
                plan.faults.push(Planned { from_ns, until_ns, fault: Fault::Edited { node, edition } });
            }
        }
        plan.fixed_ns += LISTENS_NS;
        plan.time_slots();
        plan.divide();
        plan
    }
}
