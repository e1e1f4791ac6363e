//! The real routers of three nodes that send in slots.

use super::capture::{Capture, FrameKind};
use super::counts::Counts;
use super::plan::{INSTALLATION, Plan};
use super::rights::Rights;
use super::stage::{NODES, Place, Stage};
use crate::lan::router::{Router, RouterSpec, end_all, router_of};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Machine, OrFail, Scratch, look_for};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::{Node, SystemClock};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A joining node listens to some cycles and measures; ordinary processes on busy processors take longer.
const SENDS_WITHIN: Duration = Duration::from_secs(60);
/// After so many datagrams with packages the node has found its slots.
const FRAMES: usize = 10;
/// Name of a router's thread that sends in its slots.
const SLOTS_THREAD: &str = "slots";
const LOOK_EACH: Duration = Duration::from_millis(10);

/// Three routers, until this is dropped.
pub struct Routers<'a> {
    stage: &'a Stage,
    scratch: Scratch,
    command: PathBuf,
    config: PathBuf,
    rights: Rights,
    routers: Vec<Router>,
}

impl<'a> Routers<'a> {
    /// Starts them and waits until they take packages.
    ///
    /// # Errors
    /// What a router failed with; [`Failure::Skipped`] when the command is not there.
    pub fn start(stage: &'a Stage, plan: &Plan, rights: Rights, settings: &Settings) -> Result<Self, Failure> {
        let (command, scratch) = (settings.command()?, Scratch::new()?);
        // Without it, three routers report the same.
        plan.installation()?;
        let config = scratch.directory().join("bench-tdma.toml");
        fs::write(&config, plan.text()).or_fail("configuration")?;
        let mut all = Self { stage, scratch, command, config, rights, routers: Vec::new() };
        for node in 0..NODES {
            let router = all.launch(node)?;
            all.routers.push(router);
        }
        all.routers.iter_mut().try_for_each(Router::await_ready)?;
        Ok(all)
    }

    fn launch(&self, node: u8) -> Result<Router, Failure> {
        let scratch = self.scratch.directory();
        Router::start(&spec(node, &self.command, &self.config, &scratch), || {
            self.stage.enter(Place::Node(node))?;
            self.rights.take()
        })
    }

    /// Kills one with SIGKILL, so that it tells nobody.
    pub fn kill(&mut self, node: u8) {
        // Dropped, its process is killed.
        self.routers.retain(|router| router.index() != node);
    }

    /// Starts one again that was killed.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn start_again(&mut self, node: u8) -> Result<(), Failure> {
        let mut router = self.launch(node)?;
        router.await_ready()?;
        self.routers.push(router);
        Ok(())
    }

    /// The directory of a node.
    pub fn directory(&self, node: u8) -> PathBuf {
        spec(node, &self.command, &self.config, &self.scratch.directory()).directory()
    }

    /// System time of a node.
    ///
    /// # Errors
    /// When it has none.
    pub fn clock(&self, node: u8) -> Result<SystemClock, Failure> {
        let node = Node::open(&self.directory(node)).or_fail("node")?;
        Ok(SystemClock::open(&node))
    }

    /// What they report of their slots.
    ///
    /// # Errors
    /// When one does not answer.
    pub fn counts(&self) -> Result<Vec<Counts>, Failure> {
        Counts::ask(&self.command, &self.config, &self.scratch.directory())
    }

    /// What the computer did for them.
    pub fn machine(&self) -> Machine {
        Machine::look(&self.routers.iter().map(Router::pid).collect::<Vec<_>>(), SLOTS_THREAD)
    }

    /// Waits until each node has sent some more packages.
    ///
    /// # Errors
    /// What the others report, if one does not.
    pub fn await_packages(&self, capture: &mut Capture) -> Result<(), Failure> {
        let from = capture.len();
        let all = look_for(SENDS_WITHIN, LOOK_EACH, || {
            capture.check()?;
            let frames = capture.since(from);
            let sends = |node| {
                let its = frames.iter().filter(|frame| frame.from == node && frame.what == FrameKind::Packages);
                its.take(FRAMES).count() == FRAMES
            };
            Ok((0..NODES).all(sends).then_some(()))
        })?;
        let said = || self.routers.iter().map(Router::said).collect::<String>();
        all.ok_or_else(|| Failure::Failed(format!("a node does not send in its slots: {}", said())))
    }
}

impl Drop for Routers<'_> {
    fn drop(&mut self) {
        end_all(&mut self.routers);
    }
}

fn spec<'a>(node: u8, command: &'a Path, config: &'a Path, scratch: &'a Path) -> RouterSpec<'a> {
    RouterSpec {
        command,
        config,
        installation: INSTALLATION,
        node: Place::Node(node).name(),
        program: "router",
        module: router_of(node),
        scratch,
    }
}
