//! How far a build is: the crates that are there, of all that it needs. Minutes are told nowhere: they depend on the
//! computer, and on what else it does.

use crate::cargo;
use crate::failure::Failure;
use std::collections::BTreeSet;
use std::fmt;
use std::io::{BufRead, BufReader, IsTerminal};
use std::process::Stdio;

/// What makes Cargo print a line of JSON for each thing that it has built, and all else as usual.
pub(crate) const JSON: &str = "--message-format=json-render-diagnostics";

#[derive(Default)]
pub(crate) struct Crates {
    there: BTreeSet<String>,
    /// All that the build needs; 0 while nobody knows.
    pub(crate) all: usize,
}

/// A crate that is there now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Added {
    /// Cargo found it: an earlier build made it.
    Found,
    Compiled,
}

impl Crates {
    /// Reads a line that Cargo prints with [`JSON`]; none unless it tells of another crate. A build script is a part of
    /// its crate, and comes before it.
    pub(crate) fn read(&mut self, line: &str) -> Option<Added> {
        let is_artifact = line.starts_with("{\"reason\":\"compiler-artifact\"");
        if !is_artifact || line.contains("\"kind\":[\"custom-build\"]") {
            return None;
        }
        let (_, id) = line.split_once("\"package_id\":\"")?;
        let (id, _) = id.split_once('"')?;
        let added = if line.contains("\"fresh\":false") { Added::Compiled } else { Added::Found };
        self.there.insert(id.to_owned()).then_some(added)
    }

    /// Tenths of the whole that are there.
    fn tenths(&self) -> usize {
        (self.there.len() * 10).checked_div(self.all).unwrap_or(0)
    }
}

impl fmt::Display for Crates {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.there.len(), self.all) {
            (1, 0) => write!(f, "1 crate"),
            (there, 0) => write!(f, "{there} crates"),
            // Build dependencies of a crate without a build script are named as needed, and never built.
            (there, all) => write!(f, "{there} of {} crates", all.max(there)),
        }
    }
}

/// Crates that a package needs, itself included; 0 if Cargo does not say, which the build then explains.
pub(crate) fn needed(package: &str) -> usize {
    // What stands below a crate is listed once; listed each time, Rerun's tree would have no end in practice.
    let words = ["tree", "--package", package, "--edges", "normal,build", "--prefix", "none"];
    let output = cargo::cargo(&words).stderr(Stdio::null()).output().map(|output| output.stdout).unwrap_or_default();
    count(&String::from_utf8_lossy(&output))
}

/// Different crates in a list with lines such as `ring v0.17.14 (proc-macro)`.
fn count(tree: &str) -> usize {
    let lines = tree.lines().filter(|line| !line.is_empty());
    lines.map(|line| line.split(' ').take(2).collect::<Vec<_>>()).collect::<BTreeSet<_>>().len()
}

/// Builds a package, and tells how far that is: on a terminal Cargo does, elsewhere a line for each tenth.
pub(crate) fn build(why: &str, package: &str, which: &[&str]) -> Result<(), Failure> {
    let mut command = cargo::cargo(&[&["build", "--package", package], which].concat());
    if std::io::stderr().is_terminal() {
        return cargo::run(why, &mut command);
    }
    let mut crates = Crates { all: needed(package), ..Crates::default() };
    eprintln!("==> {why}\n    {}", cargo::shown(&command));
    let failed = |how: String| format!("{why}: `cargo build --package {package}` {how}");
    let child = command.arg(JSON).stdout(Stdio::piped()).spawn();
    let mut child = child.map_err(|error| failed(format!("cannot be run: {error}")))?;
    let lines = child.stdout.take().into_iter().flat_map(|stdout| BufReader::new(stdout).lines());
    let mut tenths = 0;
    for line in lines.map_while(Result::ok) {
        let added = crates.read(&line);
        let before = std::mem::replace(&mut tenths, crates.tenths());
        if added == Some(Added::Compiled) && tenths > before {
            eprintln!("    {crates}");
        }
    }
    let status = child.wait().map_err(|error| failed(error.to_string()))?;
    if status.success() { Ok(()) } else { Err(failed(format!("ended with {status}"))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crate_counts_once_and_its_build_script_does_not() {
        let line = |id: &str, kind: &str, fresh: bool| {
            format!(
                "{{\"reason\":\"compiler-artifact\",\"package_id\":\"{id}\",\"manifest_path\":\"/a\",\"target\":\
                 {{\"kind\":[\"{kind}\"],\"name\":\"a\"}},\"fresh\":{fresh}}}"
            )
        };
        let mut crates = Crates::default();
        for (line, added, shown, why) in [
            (line("registry+x#ring@0.17", "custom-build", false), None, "0 crates", "its build script"),
            (line("registry+x#ring@0.17", "lib", false), Some(Added::Compiled), "1 crate", "the crate"),
            (line("registry+x#ring@0.17", "lib", false), None, "1 crate", "the same with other features"),
            (line("registry+x#syn@2.0", "lib", true), Some(Added::Found), "2 crates", "an earlier build made it"),
            (line("path+file:///w#0.1.0", "bin", false), Some(Added::Compiled), "3 crates", "a program"),
            ("{\"reason\":\"build-finished\",\"success\":true}".into(), None, "3 crates", "something else"),
            ("warning".into(), None, "3 crates", "no JSON at all"),
        ] {
            assert_eq!(crates.read(&line), added, "{why}");
            assert_eq!(crates.to_string(), shown, "{why}");
        }
        crates.all = 4;
        assert_eq!((crates.to_string().as_str(), crates.tenths()), ("3 of 4 crates", 7));
        crates.all = 2;
        assert_eq!(crates.to_string(), "3 of 3 crates", "never more than all");
    }

    #[test]
    fn crates_of_a_tree_count_once_for_each_version() {
        let tree =
            "bridge v0.1.0 (/w/bridge)\nsyn v2.0.1\nserde_derive v1.0.2 (proc-macro)\nsyn v2.0.1 (*)\nsyn v1.0.9\n\n";
        assert_eq!(count(tree), 4);
        assert_eq!(count(""), 0);
    }

    #[test]
    fn the_crates_of_the_largest_build_are_counted() {
        let all = needed(cargo::BRIDGE);
        assert!((300..1_000).contains(&all), "{all}");
    }
}
