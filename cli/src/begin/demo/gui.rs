//! The GUI of a demo: the drawing that it writes, and how far its build is that `cargo demo` runs beside the demo.

use super::copy::is_gui;
use crate::terminal::say;
use rohrpost::output::plain;
use rohrpost_config::{GUI, Installation};
use rohrpost_launch::Launch;
use rohrpost_launch::launcher::Phase;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
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

/// So much of the file's end is read; its last line is far shorter.
const END_BYTES: u64 = 4096;

/// What to say of the build: the last line of its file. None when the GUI has joined the robot, or no build runs.
pub(super) fn build_progress(file: Option<&Path>, launch: &Launch) -> Option<String> {
    let file = file.filter(|_| launch.phases().any(|(name, phase)| is_gui(name) && phase == Phase::LeftOut))?;
    let last = last_line(file).unwrap_or_else(|error| format!("nobody knows how far it is: {error}"));
    Some(format!("GUI bridge: {} ({})", plain::line(&last), file.display()))
}

/// The last whole line: the build may be writing the next one.
fn last_line(path: &Path) -> io::Result<String> {
    let mut file = File::open(path)?;
    let long = file.metadata()?.len();
    file.seek(SeekFrom::Start(long.saturating_sub(END_BYTES)))?;
    let mut end = Vec::new();
    file.take(END_BYTES).read_to_end(&mut end)?;
    let text = String::from_utf8_lossy(&end);
    let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
    Ok(whole.lines().next_back().unwrap_or("it begins").to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_whole_line_is_shown() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("build.log");
        let long = format!("{}\n3 of 4 crates\n", "x".repeat(10_000));
        for (text, line, why) in [
            ("", "it begins", "nothing is written yet"),
            ("1 of 4 cr", "it begins", "nor a whole line"),
            ("1 of 4 crates\n2 of", "1 of 4 crates", "the next one is being written"),
            (&long, "3 of 4 crates", "whatever came before"),
        ] {
            std::fs::write(&path, text).unwrap();
            assert_eq!(last_line(&path).unwrap(), line, "{why}");
        }
        assert!(last_line(folder.path().join("nowhere").as_path()).is_err());
    }
}
