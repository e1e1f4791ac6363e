//! Principals: which of them a name's use of bounded resources is counted for.

use crate::installation::Installation;
use rohrpost_mailbox::Name;

/// A user of bounded resources: places for callers and subscriptions, lines of output. Each has one share, under
/// however many names it sends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Principal {
    /// A module of the file, under any of its names.
    Module(Name),
    /// Launch of a node, by the node's place in the installation.
    Launch(usize),
    /// All programs run by hand on a node.
    Tools(usize),
    /// All names of the own system that the file does not know.
    Unknown,
    /// All names of another system: a certificate stands for a system.
    System(u8),
}

impl Installation {
    /// The principal of a sender's name.
    pub fn principal(&self, name: Name) -> Principal {
        if name.system() != self.system.id {
            return Principal::System(name.system());
        }
        if let Some(module) = self.module(name) {
            return Principal::Module(module.name);
        }
        let node = self.node_of(name).and_then(|node| self.nodes.iter().position(|other| other.name == node));
        match node {
            Some(at) if self.launch_of(&self.nodes[at]) == name.module() => Principal::Launch(at),
            Some(at) => Principal::Tools(at),
            None => Principal::Unknown,
        }
    }

    /// Principals with a reserved place as a caller of this name: the modules that name it in `calls`, launch of its
    /// node, and the programs run by hand there.
    pub fn callers(&self, name: Name) -> Vec<Principal> {
        let called = |other: &&crate::Module| other.calls.contains(&name.module());
        let modules = self.modules.iter().filter(called).map(|module| Principal::Module(module.name));
        let node = self.node_of(name).and_then(|node| self.nodes.iter().position(|other| other.name == node));
        modules.chain(node.into_iter().flat_map(|at| [Principal::Launch(at), Principal::Tools(at)])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = include_str!("../tests/two_nodes.toml");

    #[test]
    fn each_name_uses_the_share_of_one_principal() {
        let installation = Installation::parse(FILE, "two_nodes.toml".as_ref()).unwrap();
        let (motor, pilot) = (Name::new(1, 200, 0, 0), Name::new(1, 140, 0, 0));
        for (name, principal, why) in [
            (motor, Principal::Module(motor), "a module"),
            (motor.with_local(9), Principal::Module(motor), "under each of its mailboxes"),
            (Name::new(1, 150, 0, 1), Principal::Module(motor), "and of its aliases"),
            (Name::new(1, 16, 0, 1), Principal::Launch(0), "launch"),
            (Name::new(1, 16, 4, 1), Principal::Launch(1), "of the other node"),
            (Name::new(1, 16, 1, 1), Principal::Tools(0), "a tool"),
            (Name::new(1, 16, 3, 1), Principal::Tools(0), "and another of the same node"),
            (Name::new(1, 16, 9, 1), Principal::Unknown, "a tool of no node"),
            (Name::new(1, 150, 7, 1), Principal::Unknown, "a module that the file does not have"),
            (Name::new(2, 200, 0, 0), Principal::System(2), "another system"),
            (Name::new(2, 16, 1, 0), Principal::System(2), "and its tools"),
        ] {
            assert_eq!(installation.principal(name), principal, "{why}");
        }
        let both = [Principal::Launch(0), Principal::Tools(0)];
        assert_eq!(installation.callers(motor), [&[Principal::Module(pilot)], &both[..]].concat());
        assert_eq!(installation.callers(Name::new(1, 150, 0, 0)), both, "its alias is called by nobody");
    }
}
