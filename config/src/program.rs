//! Location of a module's program on this computer. Only the node that runs a module looks it up.

use crate::installation::Installation;
use crate::module::{Module, Program};
use rohrpost_mailbox::Name;
use std::ffi::OsStr;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// A module without its program on this computer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingProgram {
    /// The module.
    pub module: Name,
    /// Whether the module may be left out.
    pub optional: bool,
    /// The program, as the file names it.
    pub program: String,
    /// Where it was looked for: `is neither in /opt/robot nor on PATH`.
    pub place: String,
    /// What to tell the user, with file and line.
    pub message: String,
}

impl std::fmt::Display for MissingProgram {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}

/// Finds a module's program. With a slash it is a path from `folder`, the configuration file's. A bare name is searched
/// in `beside`, the folder of the running executable, and then on PATH.
pub fn find_program(program: &str, folder: &Path, beside: &Path) -> Option<PathBuf> {
    find(program, folder, beside, std::env::var_os("PATH").as_deref())
}

fn find(program: &str, folder: &Path, beside: &Path, search: Option<&OsStr>) -> Option<PathBuf> {
    if program.contains('/') {
        return Some(below(folder, program)).filter(|path| is_program(path));
    }
    let on_path: Vec<PathBuf> = search.map(|search| std::env::split_paths(search).collect()).unwrap_or_default();
    let folders = std::iter::once(beside.to_owned()).chain(on_path);
    folders.map(|folder| folder.join(program)).find(|path| is_program(path))
}

/// Without the `./` that only says "not on PATH".
fn below(folder: &Path, program: &str) -> PathBuf {
    folder.join(program.strip_prefix("./").unwrap_or(program))
}

fn is_program(path: &Path) -> bool {
    path.metadata().is_ok_and(|data| data.is_file() && data.permissions().mode() & 0o111 != 0)
}

impl Installation {
    /// The modules of a node without their programs on this computer, in the order of the file. `beside` is the folder
    /// of the running executable.
    pub fn missing_programs(&self, node: &str, beside: &Path) -> Vec<MissingProgram> {
        self.modules_on(node).filter_map(|module| self.missing_program(module, beside)).collect()
    }

    /// What to tell of a module without its program on this computer; none if the program is there, or built in.
    /// `beside` is the folder of the running executable.
    ///
    /// ```
    /// # use rohrpost_config::{Installation, Module};
    /// fn why(installation: &Installation, module: &Module) -> Option<String> {
    ///     let beside = std::path::Path::new("/opt/robot");
    ///     let missing = installation.missing_program(module, beside)?;
    ///     Some(format!("`{}` {}", missing.program, missing.place)) // `planner` is neither in /opt/robot nor on PATH
    /// }
    /// ```
    pub fn missing_program(&self, module: &Module, beside: &Path) -> Option<MissingProgram> {
        let Program::Command(words) = &module.program else { return None };
        let program = words.first()?;
        if find_program(program, &self.folder, beside).is_some() {
            return None;
        }
        let place = if program.contains('/') {
            format!("is no program at {}", below(&self.folder, program).display())
        } else {
            format!("is neither in {} nor on PATH", beside.display())
        };
        let right = if module.optional {
            "the module is left out, since it is optional"
        } else {
            "build or install it, or correct `program`"
        };
        let (file, name) = (self.shown.display(), self.classes.format(module.name));
        let message = format!("{file}:{}: module `{name}`: `{program}` {place}; {right}", module.line);
        Some(MissingProgram {
            module: module.name,
            optional: module.optional,
            program: program.clone(),
            place,
            message,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn programs_are_found_where_the_file_says() {
        let root = tempfile::tempdir().unwrap();
        let at = |path: &str| root.path().join(path);
        for (path, mode) in
            [("conf/own", 0o755), ("bin/both", 0o755), ("path/both", 0o755), ("path/far", 0o755), ("bin/text", 0o644)]
        {
            fs::create_dir_all(at(path).parent().unwrap()).unwrap();
            fs::write(at(path), "").unwrap();
            fs::set_permissions(at(path), fs::Permissions::from_mode(mode)).unwrap();
        }
        for (program, found, why) in [
            ("./own", Some("conf/own"), "with a slash: from the file's folder"),
            ("../path/far", Some("conf/../path/far"), "and out of it"),
            ("own", None, "a bare name is not looked for in the file's folder"),
            ("both", Some("bin/both"), "beside our executable comes first"),
            ("far", Some("path/far"), "then PATH"),
            ("text", None, "what cannot be executed is no program"),
            ("./", None, "nor is a folder"),
        ] {
            let result = find(program, &at("conf"), &at("bin"), Some(at("path").as_os_str()));
            assert_eq!(result, found.map(at), "{why}");
        }
    }
}
