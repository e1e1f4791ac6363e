//! Replicas: what routers tell of streams that other nodes have, drawn beside packages in the tab *Network*; and below
//! a picture that comes by a replica how late it is.
//!
//! ```text
//!   network/records/STREAM FROM → TO              records a second that came whole
//!   network/records lost/CAUSE, STREAM FROM → TO  since start, as both ends count them
//!   network/delay/STREAM FROM → TO                from writing to arrival, ms: mean of those since the last report
//! ```

use crate::blueprint::Tab;
use crate::error::DrawError;
use crate::network;
use crate::nodes::RATE_INTERVAL_MIN;
use crate::scene::{Scene, entity};
use crate::view::{Datum, View, is};
use rerun::EntityPath;
use rohrpost::interfaces::{ReplicaState, ReplicaStates};
use rohrpost::schema::{DataItem, Description};
use std::collections::HashMap;

/// Replicas, as the routers on both of their ends see them.
#[derive(Default)]
pub(crate) struct Replicas {
    /// By name: records that had come, and when, system time, ns.
    last: HashMap<String, (u64, u64)>,
}

impl View for Replicas {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<ReplicaStates>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        let states: ReplicaStates = datum.read()?;
        for sent in &states.sent {
            lost(scene, &name(&sent.stream, &states.node, &sent.node), sent);
        }
        for received in &states.received {
            let name = name(&received.stream, &received.node, &states.node);
            if let Some(per_s) = self.per_s(&name, received.records, scene.time_ns) {
                scene.curve(&["network", "records", &name], per_s);
            }
            if let Some(delay_ns) = received.delay_recent_ns {
                scene.curve(&["network", "delay", &name], delay_ns as f64 / 1e6);
            }
            lost(scene, &name, received);
        }
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![network::tab_with_replicas()]
    }
}

impl Replicas {
    /// None for the first report, when the router began anew or time went back, and too soon after another report.
    fn per_s(&mut self, name: &str, records: u64, now_ns: u64) -> Option<f64> {
        let Some((before, at_ns)) = self.last.get(name).copied() else {
            self.last.insert(name.into(), (records, now_ns));
            return None;
        };
        let (more, apart_ns) = (records.checked_sub(before), now_ns.checked_sub(at_ns));
        if more.is_some() && apart_ns.is_some_and(|ns| u128::from(ns) < RATE_INTERVAL_MIN.as_nanos()) {
            return None;
        }
        self.last.insert(name.into(), (records, now_ns));
        Some(more? as f64 / (apart_ns? as f64 / 1e9))
    }
}

fn lost(scene: &mut Scene, name: &str, state: &ReplicaState) {
    for lost in &state.lost {
        // In one part, so that the chart's legend has the cause.
        scene.curve(&["network", "records lost", &format!("{}, {name}", lost.cause)], lost.times as f64);
    }
}

fn name(stream: &str, from: &str, to: &str) -> String {
    format!("{stream} {from} → {to}")
}

/// Where the delay of a stream's records from node to node is drawn.
pub(crate) fn delay_of(stream: &str, [from, to]: [&str; 2]) -> EntityPath {
    entity(&["network", "delay", &name(stream, from, to)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestScene;
    use rohrpost::interface::Interface;
    use rohrpost::interfaces::{ReplicaCause, RouterInterface, TcpInterface};
    use rohrpost::wire::append;
    use rohrpost_config::Installation;
    use std::path::Path;

    const MS: u64 = 1_000_000;

    fn state(node: &str, records: u64, delay_recent_ns: Option<u64>, lost: &[(&str, u64)]) -> ReplicaState {
        let cause = |(cause, times): &(&str, u64)| ReplicaCause { cause: (*cause).into(), times: *times };
        ReplicaState {
            stream: "camera.0/image".into(),
            node: node.into(),
            records,
            delay_recent_ns,
            lost: lost.iter().map(cause).collect(),
            ..ReplicaState::default()
        }
    }

    #[test]
    fn both_ends_of_a_replica_are_drawn_under_one_name() {
        let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo-nodes.toml");
        let (installation, description) = (Installation::load(&demo).unwrap(), RouterInterface::description());
        let item = description.data_item("replicas").unwrap();
        let (mut drawing, mut view) = (TestScene::new(), Replicas::default());
        assert!(view.wants(&description, item));
        let by_tcp = TcpInterface::description();
        assert!(view.wants(&by_tcp, by_tcp.data_item("replicas").unwrap()), "of the TCP router and its clients");
        let mut draw = |drawing: &mut TestScene, second, node: &str, sent, received| {
            let mut bytes = Vec::new();
            append(&mut bytes, &ReplicaStates { node: node.into(), sent, received }).unwrap();
            let from = installation.router_of(node).unwrap();
            drawing.at_s(second);
            view.draw(
                &mut drawing.scene,
                &Datum { from, module: "", item, installation: &installation, bytes: &bytes },
            )
            .unwrap();
        };
        for second in 0..3 {
            draw(&mut drawing, second, "base", vec![state("desk", 2 * second, None, &[("sampled", 8)])], Vec::new());
            let delay_ns = (second > 0).then_some(90 * MS);
            draw(&mut drawing, second, "desk", Vec::new(), vec![state("base", 2 * second, delay_ns, &[])]);
        }
        let rows = drawing.rows();
        let name = r"camera.0\/image\ base\ \u{2192}\ desk";
        let of = |above: &str| rows.get(&format!("/network/{above}{name}")).copied().unwrap_or(0);
        assert_eq!([of("records/"), of("delay/"), of(r"records\ lost/sampled\,\ ")], [2, 2, 3], "{rows:?}");
        assert_eq!(delay_of("camera.0/image", ["base", "desk"]).to_string(), format!("/network/delay/{name}"));
    }

    #[test]
    fn a_rate_needs_two_reports_of_one_router() {
        let mut view = Replicas::default();
        for (records, at_ms, per_s, why) in [
            (10, 1000, None, "the first"),
            (15, 1500, Some(10.0), "half a second later"),
            (16, 1510, None, "too soon"),
            (25, 2000, Some(20.0), "since the last that counted"),
            (3, 2500, None, "the router began anew"),
            (4, 3000, Some(2.0), "and goes on"),
            (5, 1000, None, "time went back"),
            (6, 1500, Some(2.0), "and goes on"),
        ] {
            assert_eq!(view.per_s("a", records, at_ms * MS), per_s, "{why}");
        }
    }
}
