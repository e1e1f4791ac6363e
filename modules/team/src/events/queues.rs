//! Events that wait: a ring of fixed size for each type and origin, and which event comes next.
//!
//! ```text
//!  own events of a type ───▶ ring ─┐ priority of the type
//!  own events of a type ───▶ ring ─┼─▶ the oldest ──▶ high   ──┐ turn 0 1 2 . 4 5 6 .
//!  teammates' events ──────▶ ring ─┼─▶ the oldest ──▶ normal ──┼─── turn . . . 3 . . . .   ──▶ next event
//!                                  └─▶ the oldest ──▶ low    ──┘ turn . . . . . . . 7
//! ```
//!
//! A ring for each type: a flood of one type loses events of that type alone. A turn that its class does not use goes
//! to the most urgent class with an event. So the oldest low event waits for at most seven others, however many come.

use super::names::{EventType, Priority, TYPES_MAX};
use crate::ids::RobotId;
use std::collections::VecDeque;

/// Turns after which the order of classes repeats.
const TURNS: usize = 8;

/// An event on its way to the leaves below a group.
pub(super) struct Event<E> {
    pub(super) event_type: EventType,
    /// Step of the group at which it starts.
    pub(super) path: u16,
    /// Leaves that ran one after the other to cause it.
    pub(super) depth: u8,
    /// The teammate that sent it.
    pub(super) from: Option<RobotId>,
    pub(super) payload: E,
}

struct Ring<E> {
    /// With their places in the order of all.
    events: VecDeque<(u64, Event<E>)>,
    room: usize,
}

/// Rings of which the oldest events can be taken in the order in which they came.
pub(super) struct Rings<E> {
    rings: Vec<Ring<E>>,
    next: u64,
}

impl<E> Rings<E> {
    pub(super) fn new(rooms: impl IntoIterator<Item = u16>) -> Self {
        let ring = |room: u16| Ring { events: VecDeque::with_capacity(room.into()), room: room.into() };
        Self { rings: rooms.into_iter().map(ring).collect(), next: 0 }
    }

    /// False if the ring is full: its older events stay, as chains that began are to end.
    pub(super) fn push(&mut self, ring: usize, event: Event<E>) -> bool {
        let Some(ring) = self.rings.get_mut(ring).filter(|ring| ring.events.len() < ring.room) else { return false };
        ring.events.push_back((self.next, event));
        self.next += 1;
        true
    }

    /// The oldest event of these rings.
    pub(super) fn pop(&mut self, rings: impl IntoIterator<Item = usize>) -> Option<Event<E>> {
        let front = |ring: usize| Some((self.rings[ring].events.front()?.0, ring));
        let (_, ring) = rings.into_iter().filter_map(front).min()?;
        self.rings[ring].events.pop_front().map(|(_, event)| event)
    }

    fn waiting(&self, rings: &[usize]) -> usize {
        rings.iter().map(|ring| self.rings[*ring].events.len()).sum()
    }

    fn room(&self, rings: &[usize]) -> usize {
        rings.iter().map(|ring| self.rings[*ring].room).sum()
    }
}

/// What waits for leaves.
pub(super) struct Queues<E> {
    rings: Rings<E>,
    /// Rings of each class, by [`Priority::ALL`].
    classes: [Vec<usize>; 3],
    /// Most events of each class that waited at a time.
    most: [usize; 3],
    turn: usize,
}

impl<E> Queues<E> {
    /// Queues for types with these priorities and rooms; the second room is for teammates' events.
    pub(super) fn new(types: &[(Priority, u16, u16)]) -> Self {
        let own = types.iter().map(|(_, own, _)| *own);
        let rings = Rings::new(own.chain(types.iter().map(|(.., heard)| *heard)));
        let of = |class| {
            let own = types.iter().enumerate().filter(move |(_, (it, ..))| *it == class).map(|(at, _)| at);
            let heard = types.len()..if class == Priority::Low { 2 * types.len() } else { types.len() };
            own.chain(heard).collect()
        };
        Self { rings, classes: Priority::ALL.map(of), most: [0; 3], turn: 0 }
    }

    pub(super) fn push(&mut self, event: Event<E>) -> bool {
        let heard = if event.from.is_some() { self.rings.rings.len() / 2 } else { 0 };
        let is_taken = self.rings.push(heard + usize::from(event.event_type.0), event);
        for (most, class) in self.most.iter_mut().zip(&self.classes) {
            *most = self.rings.waiting(class).max(*most);
        }
        is_taken
    }

    pub(super) fn most(&self, class: Priority) -> usize {
        self.most[class as usize]
    }

    pub(super) fn pop(&mut self) -> Option<Event<E>> {
        let order = match self.turn {
            3 => [1, 0, 2],
            7 => [2, 0, 1],
            _ => [0, 1, 2],
        };
        let event = order.into_iter().find_map(|class| self.rings.pop(self.classes[class].iter().copied()))?;
        self.turn = (self.turn + 1) % TURNS;
        Some(event)
    }

    /// Events that are taken at most until one of a class is taken that came into full queues, that one included.
    pub(super) fn longest_wait(&self, class: Priority) -> usize {
        let room = |class: Priority| self.rings.room(&self.classes[class as usize]);
        match class {
            Priority::High => room(class) + room(class).div_ceil(TURNS / 2 - 1),
            Priority::Normal | Priority::Low => room(class) * TURNS,
        }
    }
}

/// Why an event was lost.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum LossCause {
    /// As many events of its type wait as there may.
    QueueFull,
    /// As many events of its type wait to be sent as there may.
    OutboxFull,
    /// A chain of causes is longer than the leaf's exception allows, or than 255.
    TooDeep,
    /// The leaf does not declare that it produces this type in this way, or the plan has no such type.
    Undeclared,
    /// A group on its way from the root was off when its turn came.
    BranchOff,
}

impl LossCause {
    /// All causes.
    pub const ALL: [Self; 5] = [Self::QueueFull, Self::OutboxFull, Self::TooDeep, Self::Undeclared, Self::BranchOff];
}

/// What was lost, by type and cause.
#[derive(Default)]
pub(super) struct Losses([[u64; TYPES_MAX]; LossCause::ALL.len()]);

impl Losses {
    pub(super) fn count(&mut self, event_type: EventType, cause: LossCause) {
        self.0[cause as usize][usize::from(event_type.0)] += 1;
    }

    pub(super) fn get(&self, event_type: EventType, cause: LossCause) -> u64 {
        self.0[cause as usize][usize::from(event_type.0)]
    }
}
