//! Systems of one node each, with a real router of the team, as launch would start it.

use crate::lan::ends::await_way;
use crate::lan::router::{Router, RouterSpec, end_all};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{OrFail, Scratch};
use rohrpost_mailbox::{Class, Name, local};
use std::fs;
use std::net::IpAddr;
use std::path::{Path, PathBuf};

const INSTALLATION: &str = "bench-team";
/// Class of what is timed: that of the LAN's cases.
const BENCH: Class = Class(200);
/// Class of routers of the team; never in real time.
const TEAM_ROUTER: Class = Class(65);
/// Where what systems send goes; a place of the test has it for itself.
pub const GROUP: &str = "239.81.0.1:21121";
/// The turn before the first one.
const INTRODUCING: u8 = u8::MAX;

/// The systems 1, 2 and so on, until this is dropped.
pub struct TeamSystems {
    scratch: Scratch,
    routers: Vec<Router>,
}

impl TeamSystems {
    /// Starts a router for each address, and waits until packages of each system come to the first one, and back.
    /// `enter` runs in the process of a router before, to move it to its place.
    ///
    /// # Errors
    /// What a router failed with; [`Failure::Skipped`] when the command is not there.
    pub fn start(
        command: Result<PathBuf, Failure>,
        addresses: &[IpAddr],
        enter: impl Fn(u8) -> Result<(), Failure>,
    ) -> Result<Self, Failure> {
        let command = command?;
        let mut all = Self { scratch: Scratch::new()?, routers: Vec::new() };
        let scratch = all.scratch.directory();
        for (system, address) in (1..).zip(addresses) {
            let config = scratch.join(format!("{}.toml", node(system)));
            fs::write(&config, configuration(system, *address)).or_fail("configuration")?;
            all.routers.push(Router::start(&spec(system, &command, &config, &scratch), || enter(system))?);
        }
        all.routers.iter_mut().try_for_each(Router::await_ready)?;
        for other in (2..).take(addresses.len().saturating_sub(1)) {
            for (from, to) in [(1, other), (other, 1)] {
                let directories = [from, to].map(|system| all.directory(system));
                let names = [from, to].map(|system| bench(system, INTRODUCING));
                await_way(directories.each_ref().map(PathBuf::as_path), names)?;
            }
        }
        Ok(all)
    }

    /// The directory of a system's node.
    pub fn directory(&self, system: u8) -> PathBuf {
        spec(system, Path::new(""), Path::new(""), &self.scratch.directory()).directory()
    }

    /// Processes of the routers.
    pub fn pids(&self) -> Vec<i32> {
        self.routers.iter().map(Router::pid).collect()
    }
}

impl Drop for TeamSystems {
    fn drop(&mut self) {
        end_all(&mut self.routers);
    }
}

/// The mailbox of what is timed in a system, or in all; each turn has one of its own.
pub fn bench(system: u8, turn: u8) -> Name {
    Name::new(system, BENCH.0, 0, turn)
}

fn node(system: u8) -> String {
    format!("robot-{system}")
}

fn spec<'a>(system: u8, command: &'a Path, config: &'a Path, scratch: &'a Path) -> RouterSpec<'a> {
    RouterSpec {
        command,
        config,
        installation: INSTALLATION,
        node: node(system),
        program: "team-router",
        module: Name::new(system, TEAM_ROUTER.0, 0, local::COMMANDS),
        scratch,
    }
}

fn configuration(system: u8, address: IpAddr) -> String {
    format!(
        r#"installation = "{INSTALLATION}"
[system]
name = "{node}"
id = {system}
[classes]
bench = {{ id = {bench}, text = "Is timed" }}
team-router = {{ id = {router}, text = "Carries packages between systems" }}
tool = {{ id = 16, text = "Tools" }}
[nodes.{node}]
[team]
security = "none"
address = "{address}"
group = "{GROUP}"
[[module]]
name = "bench.0"
program = "bench"
optional = true
"#,
        node = node(system),
        bench = BENCH.0,
        router = TEAM_ROUTER.0,
    )
}
