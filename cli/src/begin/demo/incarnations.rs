//! The incarnations of routers: which one died, when, and when the next was ready.

use rohrpost::Name;
use rohrpost::common::State;
use rohrpost_config::Installation;
use rohrpost_mailbox::{Node, NodeError, ParticipantProcess, ProcessError, monotonic_ns, node_directory};
use std::sync::Arc;

/// What a router carries packages to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum RouterKind {
    /// Other nodes of the LAN.
    Lan,
    /// Everything beyond it.
    Tcp,
}

/// A router that died.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Death {
    pub(super) kind: RouterKind,
    /// Its node, by its place in the configuration.
    pub(super) node: usize,
    /// The process.
    pub(super) pid: u32,
    /// When it was found dead, monotonic ns.
    pub(super) at_ns: u64,
    /// The next process, and when it was found ready; none until then.
    pub(super) again: Option<(u32, u64)>,
}

struct WatchedNode {
    kind: RouterKind,
    /// By its place in the configuration.
    index: usize,
    node: Arc<Node>,
    router: Name,
    /// The process that is ready; none until there is one.
    process: Option<ParticipantProcess>,
    /// Why it is not watched, or was not killed.
    refused: Option<String>,
}

/// Watches routers, at most one of a kind on each node, in the tables of the nodes' shared memory: it sends nothing.
pub(super) struct Incarnations {
    nodes: Vec<WatchedNode>,
    pub(super) deaths: Vec<Death>,
}

impl Incarnations {
    pub(super) fn of(installation: &Installation) -> Result<Self, NodeError> {
        let mut nodes = Vec::new();
        for (index, config) in installation.nodes.iter().enumerate() {
            let is_here = |router: &Name| installation.node_of(*router) == Some(&config.name);
            let tcp = installation.tcp_router().filter(is_here);
            let routers = [(RouterKind::Lan, installation.router_of(&config.name)), (RouterKind::Tcp, tcp)];
            for (kind, router) in routers.into_iter().filter_map(|(kind, router)| Some((kind, router?))) {
                let node = Node::open(&node_directory(&installation.name, &config.name))?;
                nodes.push(WatchedNode { kind, index, node, router, process: None, refused: None });
            }
        }
        let mut incarnations = Self { nodes, deaths: Vec::new() };
        incarnations.look();
        Ok(incarnations)
    }

    /// Checks which routers died, and which came back.
    pub(super) fn look(&mut self) {
        for watched in &mut self.nodes {
            let (kind, node) = (watched.kind, watched.index);
            match &watched.process {
                Some(process) if process.has_ended() => {
                    let pid = process.pid();
                    watched.process = None;
                    self.deaths.push(Death { kind, node, pid, at_ns: monotonic_ns(), again: None });
                }
                Some(_) => {}
                None => {
                    watched.found(watched.ready());
                    let last = self.deaths.iter_mut().rev().find(|death| (death.kind, death.node) == (kind, node));
                    if let (Some(process), Some(death)) = (&watched.process, last) {
                        death.again = Some((process.pid(), monotonic_ns()));
                    }
                }
            }
        }
    }

    /// Kills a router, as a crash would: that of this node, or the first one that is known.
    pub(super) fn kill(&mut self, kind: RouterKind, node: Option<usize>) -> Option<u32> {
        let is_meant =
            |watched: &&mut WatchedNode| watched.kind == kind && node.is_none_or(|node| watched.index == node);
        let watched = self.nodes.iter_mut().find(is_meant)?;
        let process = watched.process.as_ref()?;
        match process.kill() {
            Ok(()) => Some(process.pid()),
            Err(error) => {
                watched.refused = Some(format!("no signal reaches process {}: {error}", process.pid()));
                None
            }
        }
    }

    /// The nodes with a router that is not watched or was not killed, by their places in the configuration, and why.
    pub(super) fn refused(&self) -> impl Iterator<Item = (usize, &str)> {
        self.nodes.iter().filter_map(|watched| Some((watched.index, watched.refused.as_deref()?)))
    }
}

impl WatchedNode {
    /// Notes what was found of the present router.
    fn found(&mut self, ready: Result<Option<ParticipantProcess>, ProcessError>) {
        (self.process, self.refused) = match ready {
            Ok(process) => (process.filter(|process| !process.has_ended()), None),
            Err(error) => (None, Some(error.to_string())),
        };
    }

    /// The process of the present router; none until it is ready.
    fn ready(&self) -> Result<Option<ParticipantProcess>, ProcessError> {
        let all = self.node.participants();
        let is_ready = |state: State| !matches!(state, State::Starting | State::Stopping);
        let mut routers = all.into_iter().filter(|participant| participant.module == self.router);
        let router = routers.find(|router| router.state.is_some_and(|state| is_ready(state.into())));
        router.map_or(Ok(None), |router| self.node.process_of(&router))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_router_that_is_not_watched_has_a_reason_until_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        let (kind, router) = (RouterKind::Lan, Name::new(1, 32, 0, 0));
        let watched = WatchedNode { kind, index: 3, node, router, process: None, refused: None };
        let mut incarnations = Incarnations { nodes: vec![watched], deaths: Vec::new() };
        incarnations.nodes[0].found(Err(ProcessError::Elsewhere));
        let told: Vec<(usize, &str)> = incarnations.refused().collect();
        assert!(matches!(told[..], [(3, why)] if why.contains("no process of this pid namespace")), "{told:?}");
        incarnations.look();
        assert_eq!(incarnations.refused().count(), 0, "there is no router, so there is nothing to be refused");
        assert_eq!(incarnations.kill(RouterKind::Lan, Some(3)), None);
    }
}
