//! Several nodes of one place, each with a launch of its own; where there is a lab, each in a namespace of it.

use crate::harness::{Place, Robot, lacks_namespaces, python, runs, signal, until};
use crate::process::{Running, Said};
use nix::sys::signal::Signal;
use rohrpost_routers::lab::Lab;
use serde_json::Value;
use std::ffi::OsString;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU16, Ordering};

/// Sections of a configuration with several nodes.
pub(crate) const NETWORK: &str = "[network]\nsecurity = \"none\"\n[time]\nsource = \"master\"\n";

/// Addresses that no other test has: of the loopback's 16 million, by process and count.
pub(crate) fn addresses() -> [String; 2] {
    static COUNT: AtomicU16 = AtomicU16::new(0);
    let (pid, count) = (std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    assert!(count <= 50, "a process has so many");
    [1, 2].map(|node| format!("127.{}.{}.{}", 1 + pid / 250 % 250, pid % 250, 5 * count + node))
}

/// Tables of nodes with their addresses, each with sixteen tools.
pub(crate) fn nodes<A: Display>(nodes: impl IntoIterator<Item = (&'static str, A)>) -> String {
    let table = |(node, (name, address)): (usize, (&str, A))| {
        format!("[nodes.{name}]\naddress = \"{address}\"\ntools = [{}, {}]\n", 16 * node, 16 * node + 15)
    };
    nodes.into_iter().enumerate().map(table).collect()
}

/// A module's table on a node.
pub(crate) fn at(node: &str, module: &str) -> String {
    module.replacen("[[module]]\n", &format!("[[module]]\nnode = \"{node}\"\n"), 1)
}

/// All nodes of a file in namespaces, by one launch with these further words, once they run. None, with a report, where
/// namespaces are not permitted.
#[track_caller]
pub(crate) fn launched_all(place: &Place, config: &Path, nodes: &[&str], words: &[&str]) -> Option<Running> {
    let mut launch = place.start(&[&["launch", config.to_str().unwrap(), "--all"], words].concat());
    until("all nodes run", || {
        let out = launch.out();
        // Whole lines: what is read of one may end anywhere.
        let lines = || out.split_inclusive('\n').filter(|line| line.ends_with('\n'));
        let runs = |node: &&str| lines().any(|line| line.contains(&format!("│ node {node} of test runs: ")));
        launch.ended().is_some() || nodes.iter().all(runs)
    });
    if launch.ended().is_some() {
        let said = launch.said();
        assert!(lacks_namespaces(&said.err), "{said:#?}");
        return None;
    }
    Some(launch)
}

/// Nodes that run.
pub(crate) struct Network {
    // Dropped in this order: processes, what they left, their network.
    pub(crate) nodes: Vec<(&'static str, Running, Robot)>,
    pub(crate) place: Place,
    pub(crate) config: PathBuf,
    /// How the network is made worse for what is launched from now on.
    pub(crate) impair: &'static str,
    /// Further environment of what is launched from now on.
    pub(crate) environment: Vec<(&'static str, OsString)>,
    lab: Option<Lab>,
}

impl Network {
    /// None is launched yet.
    pub(crate) fn new(place: Place, config: PathBuf, lab: Option<Lab>) -> Self {
        Self { nodes: Vec::new(), place, config, impair: "", environment: Vec::new(), lab }
    }

    pub(crate) fn impaired(self, impair: &'static str) -> Self {
        Self { impair, ..self }
    }

    /// These nodes, launched one after the other.
    pub(crate) fn launched(mut self, nodes: &[&'static str]) -> Self {
        nodes.iter().for_each(|node| self.launch(node));
        self
    }

    /// Launches a node and waits until its modules are on.
    pub(crate) fn launch(&mut self, node: &'static str) {
        self.launch_from(&self.config.clone(), &[node]);
    }

    /// Launches nodes of a file, all at once.
    pub(crate) fn launch_from(&mut self, config: &Path, nodes: &[&'static str]) {
        let begin = |node: &&'static str| {
            let mut command = self.place.command(&["launch", config.to_str().unwrap(), "--node", node]);
            command.envs(self.environment.iter().cloned());
            if !self.impair.is_empty() {
                command.env("ROHRPOST_IMPAIR", self.impair);
            }
            (*node, self.inside(node, || Running::start(command)))
        };
        let begun: Vec<_> = nodes.iter().map(begin).collect();
        for (node, mut launch) in begun {
            let robot = self.place.robot(config, node, &mut launch);
            robot.wait_on(&mut launch);
            self.nodes.push((node, launch, robot));
        }
    }

    pub(crate) fn lab(&self) -> &Lab {
        self.lab.as_ref().unwrap()
    }

    /// Does this where the node's sockets are.
    pub(crate) fn inside<T>(&self, node: &str, work: impl FnOnce() -> T) -> T {
        let _inside = self.lab.as_ref().map(|lab| lab.enter(node).unwrap());
        work()
    }

    pub(crate) fn robot(&self, node: &str) -> &Robot {
        &self.nodes.iter().find(|(name, ..)| *name == node).unwrap().2
    }

    pub(crate) fn launcher(&self, node: &str) -> &Running {
        &self.nodes.iter().find(|(name, ..)| *name == node).unwrap().1
    }

    /// A person's command at a node.
    pub(crate) fn says(&self, node: &str, arguments: &[&str]) -> Said {
        self.place.say_at(&self.config, node, arguments)
    }

    /// What `net` tells of a node.
    pub(crate) fn net(&self, node: &str) -> Value {
        let told: Value = serde_json::from_str(self.says(node, &["net", "--json"]).out.trim()).unwrap_or_default();
        told.as_array().and_then(|all| all.iter().find(|told| told["node"] == node)).cloned().unwrap_or_default()
    }

    /// Python at a node's computer.
    pub(crate) fn python(&self, node: &str, arguments: &[&str]) -> Running {
        self.inside(node, || Running::start(python(&self.place, arguments)))
    }

    /// Kills all processes of a node, as a cut of its power does, or its launch alone: then its modules end themselves.
    pub(crate) fn kill(&mut self, node: &str, with_modules: bool) {
        let at = self.nodes.iter().position(|(name, ..)| *name == node).unwrap();
        let (_, mut launch, robot) = self.nodes.remove(at);
        let pids = robot.pids();
        if with_modules {
            pids.iter().for_each(|pid| signal(*pid, Signal::SIGKILL));
        }
        launch.kill();
        until("its processes have ended", || !pids.iter().any(|pid| runs(*pid)));
    }

    /// Ends a node in order.
    pub(crate) fn halt(&mut self, node: &str) {
        let at = self.nodes.iter().position(|(name, ..)| *name == node).unwrap();
        self.nodes.remove(at).1.stop();
    }

    /// Ends all, the last one first, which leaves nothing of any node; files that they wrote are there.
    pub(crate) fn stop(mut self) -> Place {
        while let Some((_, mut launch, _)) = self.nodes.pop() {
            launch.stop();
        }
        self.place.assert_empty();
        self.place
    }
}
