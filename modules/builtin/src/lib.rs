//! Modules that the command contains: a configuration names them by `builtin = "sim"`. Each is a thin shell; what the
//! demo's modules compute is in [`rohrpost_robot`].
//!
//! The command also asks here what a built-in module would refuse of a configuration, what it offers, and how the lines
//! that the collector keeps are written.

#![forbid(unsafe_code)]

mod arena;
mod body;
mod carmen;
mod check;
pub mod format;
mod map;
mod mapper;
mod mischief;
mod output;
mod payload;
mod pilot;
mod settings;
mod sim;
mod station;
mod team;
mod world;
mod wormhole;

pub use arena::{ArenaError, OpenArena};
pub use check::{check, check_saved, notes};
pub use rohrpost_robot::arena::Report;
pub use rohrpost_robot::simulator::Touch;
pub use wormhole::holder_text;

use rohrpost_config::{
    Document, Module as Configured, Problem, RECORDER, REPLAY, ROUTER, SettingsError, TCP_CLIENT, TCP_ROUTER,
    TEAM_ROUTER,
};
use rohrpost_modules::Module;
use rohrpost_modules::interface::{Interface, Interfaces};
use rohrpost_modules::interfaces::{
    RecorderInterface, ReplayInterface, RouterInterface, TcpInterface, TeamRouterInterface,
};
use rohrpost_modules::runtime::{Start, StartError, run_started};
use rohrpost_modules::schema::Description;

/// What can be done with a built-in module.
struct Builtin {
    run: fn(Start) -> Result<(), StartError>,
    check: fn(&Document<'_>, &Configured) -> Vec<Problem>,
    check_saved: fn(&Document<'_>, &Configured) -> Option<SettingsError>,
    /// One for each class that it can answer to.
    descriptions: fn() -> Vec<Description>,
}

impl Builtin {
    fn of<M: Module<Settings: settings::Settings>>() -> Self {
        let descriptions = || M::Interfaces::table().into_iter().map(|served| served.description).collect();
        Self { run: run_started::<M>, check: settings::module::<M>, check_saved: settings::saved::<M>, descriptions }
    }

    fn find(name: &str) -> Option<Self> {
        Some(match name {
            sim::NAME => Self::of::<sim::Sim>(),
            world::NAME => Self::of::<world::ArenaModule>(),
            "body" => Self::of::<body::BodyModule>(),
            "carmen" => Self::of::<carmen::Carmen>(),
            "mapper" => Self::of::<mapper::MapModule>(),
            "mischief" => Self::of::<mischief::MischiefModule>(),
            payload::NAME => Self::of::<payload::PayloadModule>(),
            "pilot" => Self::of::<pilot::PilotModule>(),
            station::NAME => Self::of::<station::StationModule>(),
            "team" => Self::of::<team::TeamModule>(),
            "wormhole" => Self::of::<wormhole::WormholeModule>(),
            "output" => Self::of::<output::OutputModule>(),
            _ => return None,
        })
    }
}

/// Runs a built-in module by its name in the configuration (`builtin = "sim"`).
///
/// # Errors
/// None for a name that has no program here; else what starting it brought.
pub fn run(name: &str, start: Start) -> Option<Result<(), StartError>> {
    Some((Builtin::find(name)?.run)(start))
}

/// The built-in module that is called so or offers the interface of a class; none if nothing is built in for it.
pub fn of_class(class: &str) -> Option<&'static str> {
    let all = [
        sim::NAME,
        world::NAME,
        "carmen",
        "mapper",
        "pilot",
        "mischief",
        "team",
        payload::NAME,
        station::NAME,
        "wormhole",
        "output",
        RECORDER,
        REPLAY,
        ROUTER,
        TCP_CLIENT,
        TCP_ROUTER,
        TEAM_ROUTER,
    ];
    all.into_iter().find(|builtin| *builtin == class || description(builtin, class).is_some())
}

/// What a built-in module offers under the name of a class, its own or an alias's; none if it knows no such class.
pub fn description(builtin: &str, class: &str) -> Option<Description> {
    // The programs of these are not here: this crate knows no network and no file of a recording.
    let beyond_here = match builtin {
        ROUTER => Some(RouterInterface::description()),
        TCP_CLIENT | TCP_ROUTER => Some(TcpInterface::description()),
        TEAM_ROUTER => Some(TeamRouterInterface::description()),
        RECORDER => Some(RecorderInterface::description()),
        REPLAY => Some(ReplayInterface::description()),
        _ => None,
    };
    if beyond_here.is_some() {
        return beyond_here.filter(|description| description.class == class);
    }
    let all = (Builtin::find(builtin)?.descriptions)();
    all.into_iter().find(|description| description.class == class)
}
