//! From where to where replicas go by the LAN and by the TCP router, as the configuration says.

use crate::frame::NodeIndex;
use crate::replication::{LineSettings, ReplicaSettings};
use rohrpost_config::{Installation, Sampling};
use std::path::Path;

const TEXT: &str = r#"
installation = "test"
[system]
name = "robot"
id = 1
[classes]
router = { id = 250 }
camera = { id = 112 }
tcp = { id = 64 }
tool = { id = 16 }
[nodes.base]
address = "10.0.0.1"
tools = [0, 15]
[nodes.brain]
address = "10.0.0.2"
tools = [16, 31]
[nodes.desk]
network = "tcp"
tools = [32, 47]
[nodes.cell]
network = "tcp"
tools = [48, 63]
[network]
security = "none"
[tcp]
address = "10.0.0.1"
server = "base"
security = "none"
[time]
source = "master"
"#;
/// Places of the nodes, and their names.
const NODES: [&str; 4] = ["base", "brain", "desk", "cell"];
const BASE: NodeIndex = 0;
const BRAIN: NodeIndex = 1;
const DESK: NodeIndex = 2;
const CELL: NodeIndex = 3;

/// A camera on a node, and its pictures on others.
fn installation(writer: NodeIndex, to: &[NodeIndex]) -> Installation {
    let to: Vec<&str> = to.iter().map(|node| NODES[usize::from(*node)]).collect();
    let text = format!(
        "{TEXT}[[module]]\nname = \"camera.0\"\nnode = \"{}\"\nbuiltin = \"sim\"\n[[replica]]\nstream = {{ name = \
         \"camera.0/image\", every = 3 }}\nchanged = true\nto = {to:?}\n",
        NODES[usize::from(writer)]
    );
    Installation::parse(&text, Path::new("test.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// From where to where, and whether records are left out there.
fn hop(replica: &ReplicaSettings) -> Option<(NodeIndex, Vec<NodeIndex>, bool)> {
    let to: Vec<NodeIndex> = (0..64).filter(|node| replica.to & 1 << node != 0).collect();
    let leaves_out = replica.sampling != Sampling::Each;
    assert_eq!(replica.changed, leaves_out, "both are where it is written");
    (!to.is_empty()).then_some((replica.node, to, leaves_out))
}

#[test]
fn the_node_of_the_tcp_router_hands_on_what_it_has_and_sampling_is_where_it_is_written() {
    for (writer, to, lan, by_tcp) in [
        (BASE, vec![BRAIN], Some((BASE, vec![BRAIN], true)), vec![]),
        (BASE, vec![DESK, CELL], None, vec![(BASE, vec![DESK, CELL], true)]),
        (BASE, vec![BRAIN, DESK], Some((BASE, vec![BRAIN], true)), vec![(BASE, vec![DESK], true)]),
        (BRAIN, vec![BASE, DESK], Some((BRAIN, vec![BASE], true)), vec![(BASE, vec![DESK], false)]),
        (DESK, vec![BASE], None, vec![(DESK, vec![BASE], true)]),
        (
            DESK,
            vec![BASE, BRAIN, CELL],
            Some((BASE, vec![BRAIN], false)),
            vec![(BASE, vec![CELL], false), (DESK, vec![BASE], true)],
        ),
    ] {
        let installation = installation(writer, &to);
        assert_eq!(hop(&ReplicaSettings::all(&installation)[0]), lan, "{writer} to {to:?} by the LAN");
        let lines = NODES.map(|node| LineSettings::new(&installation, node));
        let sent: Vec<_> = lines.iter().flatten().filter_map(|line| hop(&line.sent[0])).collect();
        assert_eq!(sent, by_tcp, "{writer} to {to:?} by TCP");
        // Each other end has it from there.
        let ends = sent.iter().flat_map(|(from, to, _)| to.iter().map(move |to| (*to, *from)));
        let mut expected: Vec<(NodeIndex, NodeIndex)> = ends.collect();
        expected.sort_unstable();
        let received = lines.iter().flatten().filter_map(|line| Some((line.own, hop(&line.received[0])?.0)));
        assert_eq!(received.collect::<Vec<_>>(), expected, "{writer} to {to:?}");
        let named = lines[0].as_ref().map(|line| line.nodes.iter().map(|(node, _)| *node).collect::<Vec<_>>());
        assert_eq!(named, (!by_tcp.is_empty()).then(|| vec![DESK, CELL]), "{writer} to {to:?}");
    }
}
