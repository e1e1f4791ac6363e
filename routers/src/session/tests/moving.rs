//! Names that move from node to node: each is at its present node alone.

use super::ground::{Ground, package};
use super::plan::{client_settings, module, ranges, server_settings, system_of};
use crate::moving::MovingNames;
use crate::session::Cause;
use crate::session::server::{MovingHosts, ServerSettings};
use rohrpost_mailbox::{ALL_SYSTEMS, Head, Name, Type};
use std::sync::Arc;

const MOVES: Name = Name::new(1, 70, 0, 0);

#[test]
fn a_name_that_moves_is_reached_at_its_present_node_and_no_other_sends_under_it() {
    let names = Arc::new(MovingNames::new(vec![MOVES], 2));
    // Clients 0 and 3 are nodes of the server's own system.
    assert_eq!([0, 3].map(system_of), [1, 1]);
    let moving = MovingHosts { names: names.clone(), clients: vec![module(0), module(3)] };
    let ends = (0..4).map(|client| (client_settings(client, 100 + client as u64), ranges(client)));
    let mut ground = Ground::with(ServerSettings { moving, ..server_settings(5) }, ends);
    let mut lost = [0, 0];
    for (holder, delivered, may, why) in [
        (None, [0, 0], [false, false], "nobody is known to hold it"),
        (Some(0), [2, 0], [true, false], "the first node has it"),
        (Some(1), [2, 2], [false, true], "the second one has taken over"),
        (None, [2, 2], [false, false], "the lease is over"),
        (Some(0), [4, 2], [true, false], "it is back"),
    ] {
        names.read(&holder.map_or_else(String::new, |node| format!("{} {node}", MOVES.raw())));
        ground.send(1, MOVES, 0);
        ground.send(1, Name::new(ALL_SYSTEMS, 70, 0, 0), 0);
        assert_eq!([0, 3].map(|node| ground.delivered(node).len()), delivered, "{why}");
        lost[0] += if holder.is_none() { 2 } else { 0 };
        let before = ground.delivered(2).len();
        for (node, may) in [0, 3].into_iter().zip(may) {
            let from = MOVES.with_local(1);
            ground.receives(
                node,
                &package(Head { to: module(2), from, kind: Type::command(16), ..Head::default() }, &[]),
            );
            lost[1] += u64::from(!may);
        }
        ground.settle();
        assert_eq!(ground.delivered(2).len() - before, may.iter().filter(|may| **may).count(), "{why}");
        let counted = [Cause::NoRoute, Cause::Foreign].map(|cause| ground.server.counts().lost_for(cause));
        assert_eq!(counted, lost, "{why}");
        let hosts = |node: usize| {
            let place = ground.ends[node].1;
            let mut all = ground.server.snapshots(ground.now_ns).filter(|(index, _)| Some(*index) == place);
            all.any(|(_, member)| member.hosts.iter().any(|(first, _)| *first == MOVES))
        };
        assert_eq!([0, 3].map(hosts), may, "{why}: people see where it is");
    }
}
