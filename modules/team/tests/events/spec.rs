//! A random plan, and what its leaves do: the same for the tree and for the naive interpreter.

use rohrpost_team::events::Priority;

/// A group or a leaf. Parents are groups, by their number; 0 is the root.
#[derive(Clone, Debug)]
pub(crate) struct NodeSpec {
    pub(crate) is_leaf: bool,
    pub(crate) parents: Vec<usize>,
    pub(crate) consumes: Vec<usize>,
    pub(crate) emits: Vec<usize>,
    pub(crate) sends: Vec<usize>,
    pub(crate) cycles: Vec<(usize, u8)>,
}

#[derive(Clone, Debug)]
pub(crate) struct Spec {
    /// Priorities, and how many events may wait.
    pub(crate) types: Vec<(Priority, u16)>,
    pub(crate) nodes: Vec<NodeSpec>,
}

impl Spec {
    pub(crate) fn groups(&self) -> usize {
        1 + self.nodes.iter().filter(|node| !node.is_leaf).count()
    }
}

/// What a leaf asks for when it runs.
pub(crate) enum Wish {
    Emit(usize, u64),
    Send(usize, u64),
    Switch(usize, bool),
}

/// By the leaf's number and the payload alone. Now and then something that it does not declare.
pub(crate) fn wishes(spec: &Spec, leaf: usize, payload: u64) -> Vec<Wish> {
    let node = spec.nodes.iter().filter(|node| node.is_leaf).nth(leaf).unwrap();
    let chance = |salt: usize| mixed(payload ^ mixed((leaf * 1000 + salt) as u64));
    let emits = |it: usize| chance(it) % 3 > 0 && node.emits.contains(&it) || chance(it) % 40 == 0;
    let sends = |it: usize| chance(100 + it) % 3 > 0 && node.sends.contains(&it) || chance(100 + it) % 40 == 0;
    let mut wishes = Vec::new();
    for it in 0..spec.types.len() {
        wishes.extend(emits(it).then(|| Wish::Emit(it, chance(200 + it))));
        wishes.extend(sends(it).then(|| Wish::Send(it, chance(300 + it))));
    }
    let group = chance(400) as usize % spec.groups();
    if group > 0 && chance(401) % 4 == 0 {
        wishes.push(Wish::Switch(group, chance(402) % 2 == 0));
    }
    wishes
}

fn mixed(number: u64) -> u64 {
    let number = (number ^ number >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd).wrapping_add(0x9e37_79b9);
    (number ^ number >> 29).wrapping_mul(0xc4ce_b9fe_1a85_ec53) >> 7
}
