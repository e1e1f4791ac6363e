//! The incarnations of routers: which one died, when, and when the next was ready.

use rohrpost::Name;
use rohrpost::common::State;
use rohrpost_config::Installation;
use rohrpost_mailbox::{Node, NodeError, ParticipantProcess, ProcessError, monotonic_ns, node_directory};
use std::sync::Arc;

/// A router that died.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Death {
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
    /// By its place in the configuration.
    index: usize,
    node: Arc<Node>,
    router: Name,
    /// The process that is ready; none until there is one.
    process: Option<ParticipantProcess>,
    /// Why it is not watched, or was not killed.
    refused: Option<String>,
}

/// Watches routers, at most one of each node, in the tables of the nodes' shared memory: it sends nothing.
pub(super) struct Incarnations {
    nodes: Vec<WatchedNode>,
    pub(super) deaths: Vec<Death>,
}

impl Incarnations {
    /// The routers of running nodes.
    pub(super) fn of(installation: &Installation, router: impl Fn(&str) -> Option<Name>) -> Result<Self, NodeError> {
        let watched = |(index, config): (usize, &rohrpost_config::Node)| {
            let router = router(&config.name)?;
            let node = Node::open(&node_directory(&installation.name, &config.name));
            Some(node.map(|node| WatchedNode { index, node, router, process: None, refused: None }))
        };
        let nodes: Result<Vec<WatchedNode>, NodeError> =
            installation.nodes.iter().enumerate().filter_map(watched).collect();
        let mut incarnations = Self { nodes: nodes?, deaths: Vec::new() };
        incarnations.look();
        Ok(incarnations)
    }

    /// Checks which routers died, and which came back.
    pub(super) fn look(&mut self) {
        for watched in &mut self.nodes {
            let index = watched.index;
            match &watched.process {
                Some(process) if process.has_ended() => {
                    let pid = process.pid();
                    watched.process = None;
                    self.deaths.push(Death { node: index, pid, at_ns: monotonic_ns(), again: None });
                }
                Some(_) => {}
                None => {
                    watched.found(watched.ready());
                    let last = self.deaths.iter_mut().rev().find(|death| death.node == index);
                    if let (Some(process), Some(death)) = (&watched.process, last) {
                        death.again = Some((process.pid(), monotonic_ns()));
                    }
                }
            }
        }
    }

    /// Kills the router of a node, as a crash would.
    pub(super) fn kill(&mut self, node: usize) -> Option<u32> {
        let watched = self.nodes.iter_mut().find(|watched| watched.index == node)?;
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
        let watched = WatchedNode { index: 3, node, router: Name::new(1, 32, 0, 0), process: None, refused: None };
        let mut incarnations = Incarnations { nodes: vec![watched], deaths: Vec::new() };
        incarnations.nodes[0].found(Err(ProcessError::Elsewhere));
        let told: Vec<(usize, &str)> = incarnations.refused().collect();
        assert!(matches!(told[..], [(3, why)] if why.contains("no process of this pid namespace")), "{told:?}");
        incarnations.look();
        assert_eq!(incarnations.refused().count(), 0, "there is no router, so there is nothing to be refused");
        assert_eq!(incarnations.kill(3), None);
    }
}
