//! `rohrpost team kill`, `stop` and `resume`: what a person does to robots that run on this computer.

use crate::look::target::Target;
use crate::running::halt::halt_or_resume;
use crate::terminal::{Failure, say};
use rohrpost::interface::Interface;
use rohrpost::interfaces::SupervisorInterface;
use rohrpost_config::Installation;
use rohrpost_launch::launcher::launcher_of;
use rohrpost_mailbox::Node;
use rohrpost_modules::runtime::NotedNode;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost team kill 4")]
pub(super) struct Arguments {
    /// System number of the robot.
    robot: u8,
}

/// A node that runs here.
struct RunningNode {
    memory: Arc<Node>,
    installation: Installation,
    config: PathBuf,
    name: String,
}

fn all_here() -> Result<Vec<RunningNode>, Failure> {
    let read = |path: PathBuf| {
        let memory = Node::open(&path)?;
        let NotedNode { config, node: name } = NotedNode::of(&memory)?;
        Ok(RunningNode { installation: Installation::load(&config)?, memory, config, name })
    };
    rohrpost::find_running().into_iter().map(read).collect()
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let nodes = all_here()?;
    let meant: Vec<&RunningNode> = nodes.iter().filter(|node| node.installation.system.id == arguments.robot).collect();
    if meant.is_empty() {
        let there: Vec<String> = nodes.iter().map(|node| node.installation.system.id.to_string()).collect();
        return Err(format!("robot {} does not run here; these do: {}", arguments.robot, there.join(", ")).into());
    }
    for node in meant {
        // Its launch first, which would start the others again.
        let launcher = launcher_of(&node.installation, &node.name);
        let mut participants = node.memory.participants();
        participants.sort_by_key(|participant| Some(participant.module) != launcher);
        let processes = participants.iter().filter_map(|it| node.memory.process_of(it).ok().flatten());
        let killed = processes.filter(|process| process.kill().is_ok()).count();
        say(format_args!("killed {killed} processes of {}", node.name));
    }
    Ok(ExitCode::SUCCESS)
}

/// Halts all robots with a wormhole, or lets them go on. Each is asked, whatever becomes of the others.
pub(super) fn halt_all(is_halt: bool) -> Result<ExitCode, Failure> {
    let mut code = ExitCode::SUCCESS;
    let is_supervised = |node: &RunningNode| {
        let class = node.installation.classes.id(SupervisorInterface::CLASS);
        node.installation.modules.iter().any(|module| Some(module.name.class()) == class)
    };
    let robots: Vec<RunningNode> = all_here()?.into_iter().filter(is_supervised).collect();
    if robots.is_empty() {
        return Err("no robot with a wormhole runs here; `rohrpost team launch FILE` launches some".into());
    }
    for robot in robots {
        say(format_args!("{}:", robot.name));
        let asked = halt_or_resume(Target::new(Some(robot.config), None, Some(robot.name)), is_halt)?;
        if asked != ExitCode::SUCCESS {
            code = asked;
        }
    }
    Ok(code)
}
