//! Code that the modules of the TCP router and of its clients share.

use crate::router::replicas::{of, stream_number};
use rohrpost_config::{Installation, Tcp};
use rohrpost_mailbox::{Latency, Name, Priority};
use rohrpost_modules::ModuleError;
use rohrpost_modules::interfaces::{BeyondNode, BeyondStream, BeyondStreams, CarriedLoss, ClassPassed, ReplicaStates};
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::replication::{LineSettings, ReplicaSettings};
use rohrpost_routers::tcp::{Class, LineCounts, LineParts};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// How often they publish their state.
pub(crate) const PERIOD: Duration = Duration::from_millis(500);
/// Longest name in a session, bytes.
pub(super) const NAME_BYTES_MAX: usize = rohrpost_routers::session::frame::NAME_BYTES_MAX;

/// The section `[tcp]`.
pub(super) fn configured(installation: &Installation) -> Result<&Tcp, ModuleError> {
    installation.tcp.as_ref().ok_or_else(|| ModuleError::new("the configuration has no [tcp]"))
}

/// The folder of the certificates; without one nothing is sealed, and a warning says so.
pub(super) fn certificates(installation: &Installation, tcp: &Tcp) -> Option<PathBuf> {
    if tcp.certificates.is_none() {
        tracing::warn!("{}", Tcp::UNPROTECTED);
    }
    tcp.certificates.as_ref().map(|folder| installation.resolve(folder))
}

/// The replicas of a node that go by the TCP router, if there are any.
pub(super) fn line_parts(installation: &Installation, node: &str) -> Option<LineParts> {
    let settings = LineSettings::new(installation, node)?;
    Some(LineParts { settings, describe: Arc::new(stream_number) })
}

/// What the TCP router sends to which node, as the file says.
pub(super) fn streams(installation: &Installation, node: &str) -> BeyondStreams {
    let Some(settings) = LineSettings::new(installation, node) else { return BeyondStreams::default() };
    let beyond = |(index, client): &(NodeIndex, Name)| {
        let name = installation.nodes.get(usize::from(*index)).map(|node| node.name.clone()).unwrap_or_default();
        BeyondNode { name, client: client.raw() }
    };
    let places = |to: u64| (0..).zip(&settings.nodes).filter(move |(_, (index, _))| to & 1 << index != 0);
    let stream = |(place, sent): (u16, &ReplicaSettings)| BeyondStream {
        place,
        source: sent.from.raw(),
        item: sent.item.clone(),
        record_bytes: sent.shape.record_bytes,
        to: places(sent.to).map(|(place, _)| place).collect(),
    };
    let sent = (0..).zip(&settings.sent).filter(|(_, sent)| sent.to != 0);
    BeyondStreams { nodes: settings.nodes.iter().map(beyond).collect(), streams: sent.map(stream).collect() }
}

/// What a module publishes of the replicas that go by the TCP router.
pub(super) struct ReplicaReport {
    node: String,
    settings: Option<LineSettings>,
    /// Those of the last report.
    delays: Vec<Latency>,
}

impl ReplicaReport {
    /// Of a node.
    pub(super) fn new(installation: &Installation, node: &str) -> Self {
        Self { node: node.into(), settings: LineSettings::new(installation, node), delays: Vec::new() }
    }

    /// How they stand; none: there are none.
    pub(super) fn states(&mut self, installation: &Installation, counts: &LineCounts) -> Option<ReplicaStates> {
        let settings = self.settings.as_ref()?;
        of(&self.node, &counts.replicas, installation, &settings.received, &mut self.delays)
    }
}

/// The level of each priority.
pub(super) fn levels(tcp: &Tcp) -> [u8; 256] {
    std::array::from_fn(|priority| tcp.level(Priority(priority as u8)))
}

/// The name of a node's client at the TCP router.
pub(super) fn called(node: &str, installation: &Installation) -> String {
    short(&format!("node {node} of {}", installation.system.name))
}

/// A display name, cut to the limit of sessions.
pub(super) fn short(name: &str) -> String {
    let printable = || name.chars().filter(|c| !c.is_control());
    let ends = printable().scan(0, |end, c| {
        *end += c.len_utf8();
        Some(*end)
    });
    printable().take(ends.take_while(|end| *end <= NAME_BYTES_MAX).count()).collect()
}

/// Each class's counters, in the published form.
pub(crate) fn classes(all: &[Class]) -> Vec<ClassPassed> {
    let class = |class: &Class| ClassPassed {
        class: class.priority.0,
        packages: class.packages,
        passed: class.passed,
        replaced: class.replaced,
        lost: class
            .lost
            .iter()
            .map(|(cause, packages)| CarriedLoss { cause: cause.word().into(), packages: *packages })
            .collect(),
    };
    all.iter().map(class).collect()
}
