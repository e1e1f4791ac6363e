//! Names that move from node to node with their module, and where each is now.
//!
//! Launch knows the holder of the module's lease and tells the router, which writes it here; its threads read it for
//! each package. A name is taken from its present node alone: what another one sends under it is from a former holder.

use crate::frame::NodeIndex;
use rohrpost_config::holders;
use rohrpost_mailbox::Name;
use std::sync::atomic::{AtomicU8, Ordering};

/// No node: nothing is known yet.
const NOWHERE: u8 = u8::MAX;

/// The names that move. Their number never changes.
#[derive(Debug, Default)]
pub struct MovingNames {
    /// Sorted.
    places: Box<[(Name, AtomicU8)]>,
    /// Number of nodes; a place from there on is none.
    nodes: usize,
}

impl MovingNames {
    /// These names, local id 0, on so many nodes; it is not known where they are.
    pub fn new(mut names: Vec<Name>, nodes: usize) -> Self {
        names.sort_unstable();
        Self { places: names.into_iter().map(|name| (name, AtomicU8::new(NOWHERE))).collect(), nodes }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// The names, each with all its mailboxes.
    pub fn ranges(&self) -> impl Iterator<Item = (Name, Name)> {
        self.places.iter().map(|(name, _)| (name.with_local(0), name.with_local(u8::MAX)))
    }

    /// Where a name is: `None` if it does not move, `Some(None)` if nothing is known.
    pub fn node_of(&self, name: Name) -> Option<Option<NodeIndex>> {
        let at = self.places.binary_search_by_key(&name.module(), |(name, _)| *name).ok()?;
        // ORDERING: Relaxed; the byte is all that is told.
        Some(Some(self.places[at].1.load(Ordering::Relaxed)).filter(|node| *node != NOWHERE))
    }

    /// Takes where the names are from the text of launch's file. A name without a line there is nowhere: nobody is
    /// known to hold its lease. Names that do not move, and nodes that do not exist, change nothing.
    pub fn read(&self, text: &str) {
        for (name, place) in &self.places {
            let line = holders(text).filter(|(held, node)| held == name && usize::from(*node) < self.nodes).last();
            place.store(line.map_or(NOWHERE, |(_, node)| node), Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::Cause;
    use crate::settings::Settings;
    use rohrpost_mailbox::{Head, Type};
    use std::sync::Arc;

    #[test]
    fn a_name_is_where_the_last_line_says_and_without_one_nowhere() {
        let [pilot, mapper, motor] =
            [(140, 0), (96, 1), (200, 0)].map(|(class, instance)| Name::new(1, class, instance, 0));
        let moving = MovingNames::new(vec![pilot, mapper], 3);
        assert_eq!([pilot, motor].map(|name| moving.node_of(name)), [Some(None), None]);
        moving.read(&format!(
            "{} 2\n{} 1\n{} 0\nno line\n{} x\n",
            pilot.raw(),
            mapper.raw(),
            motor.raw(),
            mapper.raw()
        ));
        let found = [pilot.with_local(7), mapper, motor].map(|name| moving.node_of(name));
        assert_eq!(found, [Some(Some(2)), Some(Some(1)), None]);
        moving.read(&format!("{} 0\n{} 3\n{} 200\n", pilot.raw(), pilot.raw(), mapper.raw()));
        let found = [pilot, mapper].map(|name| moving.node_of(name));
        assert_eq!(found, [Some(Some(0)), Some(None)], "there is no node 3, nor 200");
        moving.read("");
        assert_eq!(moving.node_of(pilot), Some(None), "nobody is known to hold it");
    }

    #[test]
    fn packages_go_to_the_holder_and_come_from_it_alone() {
        let (pilot, motor) = (Name::new(1, 140, 0, 0), Name::new(1, 200, 0, 0));
        let moving = Arc::new(MovingNames::new(vec![pilot], 3));
        let settings = Settings { moving: moving.clone(), ..crate::harness::settings(0, 3) };
        let command = Head { to: motor, from: pilot.with_local(1), kind: Type::command(16), ..Head::default() };
        let refusing = |node| settings.refuses(node, &command, &[]);
        assert_eq!((settings.node_of(pilot), refusing(1)), (None, Some(Cause::ForeignName)), "nobody is known to hold");
        moving.read(&format!("{} 1", pilot.raw()));
        assert_eq!((settings.node_of(pilot), refusing(1), refusing(2)), (Some(1), None, Some(Cause::ForeignName)));
        moving.read(&format!("{} 2", pilot.raw()));
        assert_eq!((settings.node_of(pilot), refusing(2)), (Some(2), None));
        assert_eq!(refusing(1), Some(Cause::ForeignName), "a former holder, though nothing is sealed");
        moving.read(&format!("{} 0", pilot.raw()));
        assert_eq!((settings.node_of(pilot), refusing(2)), (None, Some(Cause::ForeignName)), "this node holds");
        moving.read("");
        let refused = [0, 1, 2].map(refusing);
        assert_eq!(refused, [Some(Cause::ForeignName); 3], "the lease is over, and nobody has taken it over");
    }
}
