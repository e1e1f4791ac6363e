//! A tree that runs: events wait, and each runs the leaves below the group where it starts.

use super::message::EventHead;
use super::names::{EventType, GroupId, LeafId, Priority, TypeSet};
use super::queues::{Event, LossCause, Losses, Queues, Rings};
use super::shape::{Node, Step};
use crate::ids::RobotId;

/// What a leaf does with an event.
pub(super) type Action<S, E> = Box<dyn FnMut(&mut S, &E, &mut Turn<'_, E>)>;

/// A leaf with its function.
pub(super) struct Leaf<S, E> {
    pub(super) consumes: TypeSet,
    pub(super) products: Products,
    pub(super) action: Action<S, E>,
    /// Number of the last event that came to it: no event comes twice.
    pub(super) visited: u64,
}

/// What a leaf may produce.
pub(super) struct Products {
    pub(super) emits: TypeSet,
    pub(super) sends: TypeSet,
    pub(super) cycles: Vec<(EventType, u8)>,
}

/// Why a teammate's event does not enter a tree.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Refused {
    /// The teammate has another tree.
    #[error("event of robot {from} is of tree {theirs:016x}, this robot has {own:016x}: run the same program on both")]
    OtherTree {
        /// The teammate.
        from: RobotId,
        /// Digest of its tree.
        theirs: u64,
        /// Digest of the own tree.
        own: u64,
    },
    /// No leaf at this place sends such events.
    #[error("event of robot {from}: no leaf at step {path} of the tree sends events of type {event_type}")]
    NotSent {
        /// The teammate.
        from: RobotId,
        /// Step at which the event is to start.
        path: u16,
        /// Type of the event.
        event_type: u8,
    },
}

/// Groups and leaves, and the events that wait for them. `S` is the state that all leaves share, `E` a payload.
///
/// Nothing is allocated after the tree is built, but by leaves.
pub struct Tree<S, E> {
    leaves: Vec<Leaf<S, E>>,
    core: Core<E>,
    digest: u64,
    /// Number of the present event.
    round: u64,
    refused: u64,
}

/// What leaves may change while one of them runs.
struct Core<E> {
    steps: Vec<Step>,
    is_on: Vec<bool>,
    queues: Queues<E>,
    outbox: Rings<E>,
    types: usize,
    losses: Losses,
}

impl<E> Core<E> {
    fn lose(&mut self, event_type: EventType, cause: LossCause) -> bool {
        self.losses.count(event_type, cause);
        false
    }

    fn push(&mut self, event: Event<E>) -> bool {
        let event_type = event.event_type;
        self.queues.push(event) || self.lose(event_type, LossCause::QueueFull)
    }

    fn is_group_on(&self, step: u16) -> bool {
        match self.steps[usize::from(step)].node {
            Node::Group(group) => self.is_on[usize::from(group.0)],
            Node::Leaf(_) => false,
        }
    }

    /// Whether all groups from the root to this one are on.
    fn is_way_on(&self, path: u16) -> bool {
        let mut step = path;
        while self.is_group_on(step) {
            if step == 0 {
                return true;
            }
            step = self.steps[usize::from(step)].parent;
        }
        false
    }
}

/// One run of a leaf: what it may ask and do.
pub struct Turn<'a, E> {
    /// As [`Tree::dispatch`] was told, ns.
    pub now_ns: u64,
    /// Type of the event that the leaf has got.
    pub event_type: EventType,
    /// The teammate that sent it; `None` if it is this robot's own.
    pub from: Option<RobotId>,
    /// Leaves that ran one after the other to cause it.
    pub depth: u8,
    path: u16,
    products: &'a Products,
    core: &'a mut Core<E>,
}

impl<E> Turn<'_, E> {
    /// Produces an event for this robot: all below the leaf's group that consume it will run. False if it is lost,
    /// which is counted.
    pub fn emit(&mut self, event_type: EventType, payload: E) -> bool {
        let products = self.products;
        match self.produced(products.emits, event_type, payload) {
            Ok(event) => self.core.push(event),
            Err(cause) => self.lose(event_type, cause),
        }
    }

    /// Produces an event for all teammates, where it starts at the same place of the tree. False if it is lost, which
    /// is counted.
    pub fn send(&mut self, event_type: EventType, payload: E) -> bool {
        let products = self.products;
        let sent = self.produced(products.sends, event_type, payload).and_then(|event| {
            let is_room = self.core.outbox.push(event_type.0.into(), event);
            if is_room { Ok(()) } else { Err(LossCause::OutboxFull) }
        });
        sent.map_or_else(|cause| self.lose(event_type, cause), |()| true)
    }

    /// Switches a group: no event visits one that is off, nor starts below it.
    ///
    /// # Panics
    /// If the group is of another plan, which has more.
    pub fn switch(&mut self, group: GroupId, is_on: bool) {
        self.core.is_on[usize::from(group.0)] = is_on;
    }

    fn lose(&mut self, event_type: EventType, cause: LossCause) -> bool {
        self.core.lose(event_type, cause)
    }

    fn produced(&self, declared: TypeSet, event_type: EventType, payload: E) -> Result<Event<E>, LossCause> {
        if !declared.contains(event_type) {
            return Err(LossCause::Undeclared);
        }
        let exception = self.products.cycles.iter().find(|(it, _)| *it == event_type);
        let depth_max = exception.map_or(u8::MAX, |(_, depth_max)| *depth_max);
        let depth = self.depth.checked_add(1).filter(|depth| *depth <= depth_max).ok_or(LossCause::TooDeep)?;
        Ok(Event { event_type, path: self.path, depth, from: None, payload })
    }
}

impl<S, E> Tree<S, E> {
    /// A tree with all groups on. `types` have priorities, and rooms of own, teammates' and sent events.
    pub(super) fn new(
        steps: Vec<Step>,
        groups: usize,
        leaves: Vec<Leaf<S, E>>,
        types: &[TypeRooms],
        digest: u64,
    ) -> Self {
        let waiting: Vec<_> = types.iter().map(|it| (it.priority, it.own, it.remote)).collect();
        let core = Core {
            steps,
            is_on: vec![true; groups],
            queues: Queues::new(&waiting),
            outbox: Rings::new(types.iter().map(|it| it.remote)),
            types: types.len(),
            losses: Losses::default(),
        };
        Self { leaves, core, digest, round: 0, refused: 0 }
    }

    /// Digest of all that the plan declares but rooms: robots with equal digests understand each other's events.
    pub fn digest(&self) -> u64 {
        self.digest
    }

    /// Part of the digest that hellos carry; never 0, which stands for no tree.
    pub fn short_digest(&self) -> u16 {
        (self.digest as u16).max(1)
    }

    /// An event of this robot's hardware: starts at the root. False if it is lost, which is counted.
    pub fn hard(&mut self, event_type: EventType, payload: E) -> bool {
        if usize::from(event_type.0) >= self.core.types {
            return self.core.lose(event_type, LossCause::Undeclared);
        }
        self.core.push(Event { event_type, path: 0, depth: 0, from: None, payload })
    }

    /// A teammate's event: starts at the group of the leaf that sent it. False if it is lost, which is counted.
    ///
    /// # Errors
    /// If the event is of another tree, or its head says what no leaf sends. Counted, too: [`Self::refused`].
    pub fn hear(&mut self, head: &EventHead, payload: E) -> Result<bool, Refused> {
        let checked = self.check(head);
        self.refused += u64::from(checked.is_err());
        let EventHead { from, depth, path, .. } = *head;
        let event = Event { event_type: checked?, path, depth, from: Some(from), payload };
        Ok(self.core.push(event))
    }

    fn check(&self, head: &EventHead) -> Result<EventType, Refused> {
        let EventHead { from, event_type, path, tree, .. } = *head;
        if tree != self.digest {
            return Err(Refused::OtherTree { from, theirs: tree, own: self.digest });
        }
        let number = usize::from(event_type);
        let event_type = EventType(event_type);
        let sends = |step: &Step| match step.node {
            Node::Leaf(LeafId(leaf)) => {
                step.parent == path && self.leaves[usize::from(leaf)].products.sends.contains(event_type)
            }
            Node::Group(_) => false,
        };
        let is_sent = number < self.core.types && self.core.steps.iter().any(sends);
        if is_sent { Ok(event_type) } else { Err(Refused::NotSent { from, path, event_type: event_type.0 }) }
    }

    /// Takes the next event, and runs all leaves that it reaches and that consume it, each once, in the order of the
    /// walk. False if none waits.
    pub fn dispatch(&mut self, now_ns: u64, state: &mut S) -> bool {
        let Some(event) = self.core.queues.pop() else { return false };
        if !self.core.is_way_on(event.path) {
            self.core.lose(event.event_type, LossCause::BranchOff);
            return true;
        }
        self.round += 1;
        let (mut at, end) = (usize::from(event.path), usize::from(self.core.steps[usize::from(event.path)].end));
        while at < end {
            let step = self.core.steps[at];
            at = match step.node {
                Node::Group(group) if !self.core.is_on[usize::from(group.0)] => step.end.into(),
                Node::Group(_) => at + 1,
                Node::Leaf(leaf) => {
                    self.run(leaf, step.parent, &event, now_ns, state);
                    at + 1
                }
            };
        }
        true
    }

    fn run(&mut self, leaf: LeafId, path: u16, event: &Event<E>, now_ns: u64, state: &mut S) {
        let leaf = &mut self.leaves[usize::from(leaf.0)];
        if leaf.visited == self.round || !leaf.consumes.contains(event.event_type) {
            return;
        }
        leaf.visited = self.round;
        let (event_type, from, depth) = (event.event_type, event.from, event.depth);
        let (products, core) = (&leaf.products, &mut self.core);
        (leaf.action)(state, &event.payload, &mut Turn { now_ns, event_type, from, depth, path, products, core });
    }

    /// The oldest event that is to be broadcast to all teammates. Its payload follows the head's bytes.
    pub fn take_sent(&mut self, me: RobotId) -> Option<(EventHead, E)> {
        let Event { event_type, path, depth, payload, .. } = self.core.outbox.pop(0..self.core.types)?;
        Some((EventHead { from: me, depth, event_type: event_type.0, path, tree: self.digest }, payload))
    }

    /// Switches a group: no event visits one that is off, nor starts below it.
    ///
    /// # Panics
    /// If the group is of another plan, which has more.
    pub fn switch(&mut self, group: GroupId, is_on: bool) {
        self.core.is_on[usize::from(group.0)] = is_on;
    }

    /// Whether a group is on; groups above it may be off.
    ///
    /// # Panics
    /// If the group is of another plan, which has more.
    pub fn is_on(&self, group: GroupId) -> bool {
        self.core.is_on[usize::from(group.0)]
    }

    /// How many events of a type were lost by a cause.
    pub fn lost(&self, event_type: EventType, cause: LossCause) -> u64 {
        self.core.losses.get(event_type, cause)
    }

    /// How many events of a priority waited at a time at most.
    pub fn queued_most(&self, priority: Priority) -> usize {
        self.core.queues.most(priority)
    }

    /// How many events of teammates were refused.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Calls of [`Self::dispatch`] after which an event of a priority has run at the latest, whatever else comes.
    /// Each runs a leaf once at most.
    pub fn longest_wait(&self, priority: Priority) -> usize {
        self.core.queues.longest_wait(priority)
    }
}

/// How much of a type may wait.
pub(super) struct TypeRooms {
    pub(super) priority: Priority,
    pub(super) own: u16,
    /// For events of teammates, and once more for events to them.
    pub(super) remote: u16,
}
