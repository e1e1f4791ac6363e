//! What an author declares, and its mistakes.

use super::cycles::{self, Cycle};
use super::names::{EventType, GROUPS_MAX, GroupId, LEAVES_MAX, LeafId, Priority, STEPS_MAX, TYPES_MAX, TypeSet};
use super::shape::{LeafShape, Node, Shape, TypeShape};
use super::tree::{Action, Leaf, Products, Tree, Turn, TypeRooms};

/// What a leaf takes and produces.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Flow<'a> {
    /// Types of events that run it.
    pub consumes: &'a [EventType],
    /// Types that it produces for this robot.
    pub emits: &'a [EventType],
    /// Types that it produces for teammates.
    pub sends: &'a [EventType],
    /// Exceptions: types that may cause it to run again, with the greatest causal depth at which it produces them. An
    /// event's depth is how many leaves ran one after the other to cause it, those of teammates included.
    pub cycles: &'a [(EventType, u8)],
}

/// Why a plan is no tree.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum PlanError {
    /// A name that is none.
    #[error("`{name}` is no name: 1 to 64 of a-z, 0-9 and -")]
    Name {
        /// What was given.
        name: &'static str,
    },
    /// A name that two have.
    #[error("two of the plan are named `{name}`: give one of them another name")]
    Duplicate {
        /// Their name.
        name: &'static str,
    },
    /// More than a plan may have.
    #[error("`{name}` is one too many: a plan has at most {max} {what}")]
    TooMany {
        /// The first that has no place.
        name: &'static str,
        /// What there are too many of.
        what: &'static str,
        /// How many there may be.
        max: usize,
    },
    /// A type of which no event may wait.
    #[error("event `{name}` has room for none: at least 1 has to wait")]
    NoRoom {
        /// The type.
        name: &'static str,
    },
    /// A group or leaf below nothing.
    #[error("`{name}` has no parent, so no event reaches it: name one, such as ROOT")]
    NoParent {
        /// The group or leaf.
        name: &'static str,
    },
    /// A handle that another plan gave.
    #[error("`{name}` names a group or an event of another plan")]
    Foreign {
        /// What names it.
        name: &'static str,
    },
    /// An exception for what the leaf does not produce.
    #[error("leaf `{name}` has an exception for event `{event}`, which it does not produce: take one of both away")]
    IdleException {
        /// The leaf.
        name: &'static str,
        /// The type.
        event: &'static str,
    },
    /// Leaves that would run each other for ever.
    #[error("events would go in cycles: {}. Take a link away, or declare it in `cycles` of its leaf with a depth",
        .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    Cycles(Vec<Cycle>),
}

/// Types of events, groups and leaves, declared one after the other. A mistake is told when the tree is built.
pub struct Plan<S, E> {
    shape: Shape,
    actions: Vec<Action<S, E>>,
    mistake: Option<PlanError>,
}

impl<S, E> Default for Plan<S, E> {
    fn default() -> Self {
        Self::new()
    }
}

impl<S, E> Plan<S, E> {
    /// A plan with the group [`ROOT`] alone.
    pub fn new() -> Self {
        let shape = Shape { types: Vec::new(), groups: vec![("root", Vec::new())], leaves: Vec::new() };
        Self { shape, actions: Vec::new(), mistake: None }
    }

    /// Declares a type of events, of which so many may wait: of this robot, as many of teammates, and as many to them.
    pub fn event(&mut self, name: &'static str, priority: Priority, room: u16) -> EventType {
        self.check_name(name, self.shape.types.iter().any(|it| it.name == name));
        self.demand(room > 0, || PlanError::NoRoom { name });
        let number = self.place(name, "events", self.shape.types.len(), TYPES_MAX);
        self.shape.types.push(TypeShape { name, priority, room });
        EventType(number)
    }

    /// Declares a group, below one or several others.
    pub fn group(&mut self, name: &'static str, parents: &[GroupId]) -> GroupId {
        self.check_name(name, self.is_node(name));
        let group = GroupId(self.place(name, "groups", self.shape.groups.len(), GROUPS_MAX));
        self.put_below(name, parents, Node::Group(group));
        self.shape.groups.push((name, Vec::new()));
        group
    }

    /// Declares a leaf, below one or several groups, with what it does. If it runs through one of them, what it
    /// produces starts there.
    pub fn leaf(
        &mut self,
        name: &'static str,
        parents: &[GroupId],
        flow: Flow<'_>,
        action: impl FnMut(&mut S, &E, &mut Turn<'_, E>) + 'static,
    ) {
        self.check_name(name, self.is_node(name));
        let leaf = LeafId(self.place(name, "leaves", self.shape.leaves.len(), LEAVES_MAX));
        self.put_below(name, parents, Node::Leaf(leaf));
        let Flow { consumes, emits, sends, cycles } = flow;
        let exempt = cycles.iter().map(|(it, _)| it);
        let is_known = consumes.iter().chain(emits).chain(sends).chain(exempt).all(|it| self.knows(*it));
        self.demand(is_known, || PlanError::Foreign { name });
        let set = |types: &[EventType]| types.iter().copied().collect::<TypeSet>();
        let (consumes, emits, sends) = (set(consumes), set(emits), set(sends));
        let idle = cycles.iter().find(|(it, _)| !emits.union(sends).contains(*it)).filter(|_| is_known);
        let event = idle.map_or("", |(it, _)| self.shape.types[usize::from(it.0)].name);
        self.demand(idle.is_none(), || PlanError::IdleException { name, event });
        self.shape.leaves.push(LeafShape { name, consumes, emits, sends, cycles: cycles.to_vec() });
        self.actions.push(Box::new(action));
    }

    /// Checks all and makes the tree; all its groups are on.
    ///
    /// # Errors
    /// The first mistake of the declarations, or all cycles of events.
    pub fn build(self) -> Result<Tree<S, E>, PlanError> {
        let Self { shape, actions, mistake } = self;
        if let Some(mistake) = mistake {
            return Err(mistake);
        }
        let name = shape.groups.last().map_or("root", |(name, _)| name);
        let too_many = PlanError::TooMany { name, what: "ways from the root to groups and leaves", max: STEPS_MAX };
        let steps = shape.steps().ok_or(too_many)?;
        let cycles = cycles::find(&shape);
        if !cycles.is_empty() {
            return Err(PlanError::Cycles(cycles));
        }
        let sent = shape.leaves.iter().fold(TypeSet::default(), |all, leaf| all.union(leaf.sends));
        let rooms = |(number, it): (u8, &TypeShape)| {
            let remote = if sent.contains(EventType(number)) { it.room } else { 0 };
            TypeRooms { priority: it.priority, own: it.room, remote }
        };
        let types: Vec<_> = (0..).zip(&shape.types).map(rooms).collect();
        let (groups, digest) = (shape.groups.len(), shape.digest());
        let leaf = |(shape, action): (LeafShape, _)| {
            let LeafShape { consumes, emits, sends, cycles, .. } = shape;
            Leaf { consumes, products: Products { emits, sends, cycles }, action, visited: 0 }
        };
        let leaves = shape.leaves.into_iter().zip(actions).map(leaf).collect();
        Ok(Tree::new(steps, groups, leaves, &types, digest))
    }

    /// Notes the first mistake.
    fn demand(&mut self, holds: bool, mistake: impl FnOnce() -> PlanError) {
        if !holds {
            self.mistake.get_or_insert_with(mistake);
        }
    }

    fn check_name(&mut self, name: &'static str, is_taken: bool) {
        let is_letter = |it: u8| matches!(it, b'a'..=b'z' | b'0'..=b'9' | b'-');
        self.demand(matches!(name.len(), 1..=64) && name.bytes().all(is_letter), || PlanError::Name { name });
        self.demand(!is_taken, || PlanError::Duplicate { name });
    }

    fn is_node(&self, name: &str) -> bool {
        self.shape.groups.iter().any(|it| it.0 == name) || self.shape.leaves.iter().any(|it| it.name == name)
    }

    /// The number of the next one; 0, and a mistake, if there is none.
    fn place(&mut self, name: &'static str, what: &'static str, count: usize, max: usize) -> u8 {
        self.demand(count < max, || PlanError::TooMany { name, what, max });
        if count < max { count as u8 } else { 0 }
    }

    fn knows(&self, event_type: EventType) -> bool {
        usize::from(event_type.0) < self.shape.types.len()
    }

    fn put_below(&mut self, name: &'static str, parents: &[GroupId], node: Node) {
        self.demand(!parents.is_empty(), || PlanError::NoParent { name });
        for parent in parents {
            match self.shape.groups.get_mut(usize::from(parent.0)) {
                Some((_, children)) if !children.contains(&node) => children.push(node),
                Some(_) => {}
                None => self.demand(false, || PlanError::Foreign { name }),
            }
        }
    }
}
