//! The router's mailbox: its name, its shape, and the names that are routed to it.

use crate::moving::MovingNames;
use rohrpost_config::TRANSIT;
use rohrpost_mailbox::{Name, Shape, local};
use rohrpost_network::Route;

/// The ranges of names on other nodes, or that may be there, as the mailboxes of a node want them; adjacent ones are
/// merged.
pub(super) fn ranges(routes: &[Route], moving: &MovingNames) -> Vec<(Name, Name)> {
    let mut all: Vec<_> = routes.iter().map(|route| (route.first, route.last)).chain(moving.ranges()).collect();
    all.sort_unstable();
    let mut ranges: Vec<(Name, Name)> = Vec::new();
    for (first, last) in all {
        match ranges.last_mut() {
            Some(before) if before.1.raw().checked_add(1) == Some(first.raw()) => before.1 = last,
            _ => ranges.push((first, last)),
        }
    }
    ranges
}

/// The mailbox of a router, by the router's name.
pub(crate) fn name(router: Name) -> Name {
    router.with_local(local::TRANSIT)
}

/// Shape of that mailbox: the same in each incarnation of the router, so that packages in it outlive the router.
pub(crate) fn shape() -> Shape {
    Shape {
        slots: TRANSIT.slots,
        body_bytes_max: TRANSIT.size.min(u16::MAX.into()) as u16,
        full: TRANSIT.full,
        max_age: TRANSIT.max_age,
        claims: TRANSIT.claims,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_ranges_become_one() {
        let name = |instance, local| Name::new(1, 9, instance, local);
        let route = |instance, node| Route { first: name(instance, 0), last: name(instance, 255), node };
        let routes = [route(0, 1), route(1, 2), route(3, 1)];
        let moving = MovingNames::default();
        assert_eq!(ranges(&routes, &moving), [(name(0, 0), name(1, 255)), (name(3, 0), name(3, 255))]);
        assert_eq!(ranges(&[], &moving), []);
    }
}
