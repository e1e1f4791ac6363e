//! What a plan declares, without the functions of the leaves: compared between robots by its digest.

use super::names::{EventType, GroupId, LeafId, Priority, ROOT, STEPS_MAX, TypeSet};
use siphasher::sip::SipHasher24;
use std::hash::Hasher;

/// A type of events, as declared.
pub(super) struct TypeShape {
    pub(super) name: &'static str,
    pub(super) priority: Priority,
    pub(super) room: u16,
}

/// A leaf, as declared.
pub(super) struct LeafShape {
    pub(super) name: &'static str,
    pub(super) consumes: TypeSet,
    pub(super) emits: TypeSet,
    pub(super) sends: TypeSet,
    /// Types that may come back to the leaf, with the greatest depth at which it still produces them.
    pub(super) cycles: Vec<(EventType, u8)>,
}

/// A child of a group.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Node {
    Group(GroupId),
    Leaf(LeafId),
}

/// A place in the walk over the tree: groups and leaves by depth first, a child of several parents once below each.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) node: Node,
    /// Step of the group above; the root's own.
    pub(super) parent: u16,
    /// First step that is not below.
    pub(super) end: u16,
}

/// A plan's declarations.
pub(super) struct Shape {
    pub(super) types: Vec<TypeShape>,
    /// Name and children, in the order of their declaration.
    pub(super) groups: Vec<(&'static str, Vec<Node>)>,
    pub(super) leaves: Vec<LeafShape>,
}

impl Shape {
    pub(super) fn children(&self, group: GroupId) -> &[Node] {
        &self.groups[usize::from(group.0)].1
    }

    pub(super) fn leaf(&self, leaf: LeafId) -> &LeafShape {
        &self.leaves[usize::from(leaf.0)]
    }

    /// The walk from the root; `None` if it has more than [`STEPS_MAX`] steps.
    pub(super) fn steps(&self) -> Option<Vec<Step>> {
        let mut steps = Vec::new();
        self.walk(ROOT, 0, &mut steps).then_some(steps)
    }

    fn walk(&self, group: GroupId, parent: u16, steps: &mut Vec<Step>) -> bool {
        let own = steps.len() as u16;
        steps.push(Step { node: Node::Group(group), parent, end: 0 });
        for node in self.children(group) {
            let is_room = steps.len() < STEPS_MAX;
            let goes_on = is_room
                && match node {
                    Node::Group(group) => self.walk(*group, own, steps),
                    Node::Leaf(_) => {
                        steps.push(Step { node: *node, parent: own, end: own });
                        true
                    }
                };
            if !goes_on {
                return false;
            }
        }
        steps[usize::from(own)].end = steps.len() as u16;
        true
    }

    /// SipHash-2-4 of the text in docs/src/wire.md.
    pub(super) fn digest(&self) -> u64 {
        let mut hasher = SipHasher24::new();
        hasher.write(self.text().as_bytes());
        hasher.finish()
    }

    fn text(&self) -> String {
        let mut text = String::from("rohrpost tree 1\n");
        for (number, TypeShape { name, priority, .. }) in self.types.iter().enumerate() {
            text += &format!("event {number} {name} {}\n", priority.name());
        }
        for (name, children) in &self.groups {
            let name_of = |node: &Node| match node {
                Node::Group(group) => self.groups[usize::from(group.0)].0,
                Node::Leaf(leaf) => self.leaf(*leaf).name,
            };
            let children: Vec<&str> = children.iter().map(name_of).collect();
            text += &format!("group {name}: {}\n", children.join(" "));
        }
        for LeafShape { name, consumes, emits, sends, cycles } in &self.leaves {
            text += &format!("leaf {name}");
            for (word, types) in [("consumes", consumes), ("emits", emits), ("sends", sends)] {
                types.iter().for_each(|it| text += &format!(" {word} {}", it.0));
            }
            cycles.iter().for_each(|(it, depth)| text += &format!(" cycles {} {depth}", it.0));
            text.push('\n');
        }
        text
    }
}
