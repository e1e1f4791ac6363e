//! What a recorded configuration does not decide by itself, since somebody else may have written it: which command
//! runs, where a recorder writes and listens, and where the GUI draws.

use super::tables::text_of;
use crate::command_line::command_line;
use crate::terminal::Failure;
use rohrpost_config::{Installation, Module, Program, RECORDER};
use std::path::{Path, PathBuf};
use toml::Table;

/// The program that shows what a node does.
const BRIDGE: &str = "rohrpost-gui-bridge";

/// What the GUI is to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum ReplayDrawing {
    Nothing,
    /// Write this file.
    File(PathBuf),
    /// Show it in the viewer.
    Window,
}

impl ReplayDrawing {
    /// Puts it into the settings of the GUI, in the place of what is there: a file that would be written, or an address
    /// to connect to. With nothing to draw, a GUI that runs all the same draws where the user's own configuration says.
    pub(super) fn settle(&self, settings: &mut Table, is_own: bool) {
        let place = match self {
            Self::File(file) => Some(("file", text_of(file))),
            Self::Window => Some(("viewer", "window".into())),
            Self::Nothing if is_own => return,
            Self::Nothing => None,
        };
        settings.remove("file");
        settings.remove("viewer");
        settings.extend(place.map(|(key, place)| (key.to_owned(), place)));
    }
}

/// Whether Rohrpost's own GUI runs as this module.
pub(super) fn is_bridge(module: &Module) -> bool {
    matches!(&module.program, Program::Command(words) if words.first().is_some_and(|first| first == BRIDGE))
}

/// An entry of a GUI that runs without being asked for: the program alone, since its arguments could be any.
pub(super) fn without_arguments(entry: &mut Table) {
    entry.insert("program".into(), BRIDGE.into());
}

/// Whether a module of a recorded configuration may run because `--run` names it. `folder` is where relative paths
/// begin.
///
/// # Errors
/// Which command that would run, or where it would write.
pub(super) fn permit(name: &str, module: &Module, installation: &Installation, folder: &Path) -> Result<(), Failure> {
    let what = match (&module.program, &installation.record) {
        (Program::Command(words), _) if !is_bridge(module) => format!("run\n  {}", command_line(words)),
        (Program::Builtin(builtin), Some(record)) if builtin == RECORDER => {
            let directory: PathBuf = folder.join(&record.directory).components().collect();
            let directory = command_line([directory]);
            let listens = record.control.map_or(String::new(), |address| format!(", and listen on {address}"));
            format!("write files into\n  {directory}{listens}")
        }
        _ => return Ok(()),
    };
    Err(format!(
        "--run {name}: by the configuration in the recording, which anybody may have written, it would {what}\nadd \
         --run-recorded to let it, or name a configuration of your own: --config FILE"
    )
    .into())
}
