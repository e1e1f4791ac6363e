//! The program that is supervised: which node runs it, and the launch that restarts it there.

use rohrpost_config::{HOLDERS_FILE, Installation};
use rohrpost_launch::launcher::LauncherProxy;
use rohrpost_mailbox::{Name, Node};
use rohrpost_modules::ModuleError;
use rohrpost_modules::call::{CallError, TRANSIT_MAX, VALIDITY_MAX};
use rohrpost_modules::interface::Proxy;
use rohrpost_modules::runtime::Context;
use std::io;
use std::sync::Arc;
use std::time::Duration;

pub(super) struct Program {
    pub(super) name: Name,
    /// The launch of the node that runs it; none if it is in no configuration.
    launch: Option<LauncherProxy>,
    /// With several nodes.
    moving: Option<Moving>,
    /// When it promised last, ns; 0: its numbers are forgotten.
    pub(super) heard_ns: u64,
}

/// What is known of a program that may be on several nodes.
struct Moving {
    node: Arc<Node>,
    /// What this node's launch wrote last of the nodes that run such modules.
    told: Vec<u8>,
    /// The node that runs it, once one is known.
    holder: Option<String>,
}

impl Program {
    pub(super) fn open(program: &str, context: &Context) -> Result<Self, ModuleError> {
        let installation = context.installation();
        let name = installation.classes.parse_module(program)?;
        let module = installation.module(name);
        let moving = module.filter(|module| module.has_standby()).map(|_| Moving {
            node: context.link().borrow().participant().node().clone(),
            told: Vec::new(),
            holder: None,
        });
        let launch = module.and_then(|module| launch_of(&module.node, installation, context));
        Ok(Self { name, launch, moving, heard_ns: 0 })
    }

    /// Whether what comes now is of a program with other numbers: another node runs it, or nothing that it sent before
    /// can come any more, and its computer may have lost its clock. To be asked at each tick.
    pub(super) fn is_another(&mut self, now_ns: u64, context: &Context) -> bool {
        let has_moved = self.has_moved(context);
        let silent = Duration::from_nanos(now_ns.saturating_sub(self.heard_ns));
        let is_forgotten = self.heard_ns != 0 && silent > VALIDITY_MAX + TRANSIT_MAX;
        if has_moved || is_forgotten {
            self.heard_ns = 0;
        }
        has_moved || is_forgotten
    }

    /// Whether another node runs it than before, by what this node's launch knows.
    fn has_moved(&mut self, context: &Context) -> bool {
        let Some(Moving { node, told, holder }) = &mut self.moving else { return false };
        let read = || node.read_file(HOLDERS_FILE).map(Option::unwrap_or_default).map_err(io::Error::other);
        // One that cannot be read now is read at the next tick.
        let Ok(now) = context.take_in(read) else { return false };
        if *told == now {
            return false;
        }
        *told = now;
        let installation = context.installation();
        let places = rohrpost_config::holders(str::from_utf8(told).unwrap_or_default());
        let place = places.filter(|(name, _)| *name == self.name).map(|(_, place)| usize::from(place)).last();
        let Some(at) = place.and_then(|place| installation.lan_nodes().get(place)) else { return false };
        let before = holder.replace(at.name.clone());
        self.launch = launch_of(&at.name, installation, context);
        before.is_some_and(|before| before != at.name)
    }

    /// Asks launch to end the run that failed; `None`: no launch here knows the program.
    pub(super) fn end_failing(&self, program: &str, cause: String, run: u32) -> Option<Result<(), CallError>> {
        let launch = self.launch.as_ref()?;
        Some(launch.begin_end_failing(program.into(), cause, run).map(drop))
    }
}

/// The launch of a node.
pub(crate) fn launch_of(node: &str, installation: &Installation, context: &Context) -> Option<LauncherProxy> {
    let launcher = installation.launch_of(installation.node(node)?);
    Some(LauncherProxy::new(context.link(), launcher))
}
