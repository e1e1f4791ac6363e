//! The drawing that the GUI of a demo writes.

use crate::terminal::say;
use rohrpost_config::{GUI, Installation};
use std::path::PathBuf;
use std::time::SystemTime;

/// The file that the GUI will write, if it writes one.
pub(crate) fn drawing(installation: &Installation) -> Option<PathBuf> {
    let class = installation.classes.id(GUI)?;
    let gui = installation.modules.iter().find(|module| module.name.class() == class)?;
    let file = gui.settings.get("file").filter(|_| !gui.settings.contains_key("viewer"))?;
    Some(installation.resolve(file.as_str()?))
}

/// Prints where the drawing is, if it was written since.
pub(crate) fn drawn(drawing: Option<PathBuf>, begun: SystemTime) {
    let is_new = |path: &PathBuf| path.metadata().and_then(|file| file.modified()).is_ok_and(|at| at >= begun);
    if let Some(path) = drawing.filter(is_new) {
        let path = path.canonicalize().unwrap_or(path);
        let here = std::env::current_dir().unwrap_or_default();
        let path = path.strip_prefix(here).unwrap_or(&path).display();
        say(format_args!("drawing: {path} (to open it: rerun {path})"));
    }
}
