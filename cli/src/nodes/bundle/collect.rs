//! Which files go into a bundle, and under which paths: as the configuration names them, from the deepest folder on
//! that has all of them. So each relative path leads to the same file on every node.

use crate::terminal::Failure;
use rohrpost_bundle::{FilePath, Ingredient, lexical};
use rohrpost_config::{Installation, Module, Program};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Bytes of the first line of a key.
const PEM_LINE_BYTES: u64 = 64;

/// What a configuration needs on a node.
pub(super) struct Collected {
    pub(super) configuration: FilePath,
    pub(super) files: Vec<Ingredient>,
    /// What is not in the bundle, though the configuration names it.
    pub(super) notes: Vec<String>,
}

struct Collector<'i> {
    installation: &'i Installation,
    /// The configuration's folder, without links.
    folder: PathBuf,
    files: BTreeSet<PathBuf>,
    notes: Vec<String>,
}

/// Collects the configuration with what it includes, the parameters saved beside it, its programs, the files that its
/// settings name, the hosts of its team, and `with`: files, and folders with all in them.
///
/// # Errors
/// A file that is not there or is secret, and paths of the configuration that a bundle cannot have.
pub(super) fn collect(installation: &Installation, with: &[PathBuf]) -> Result<Collected, Failure> {
    let text: toml::Table = installation.text.parse()?;
    refuse_paths(installation, &text)?;
    let folder = lexical(&std::path::absolute(&installation.folder)?);
    let mut collector = Collector { installation, folder, files: BTreeSet::new(), notes: Vec::new() };
    let configuration = lexical(&std::path::absolute(&installation.path)?);
    collector.files.insert(configuration.clone());
    installation.included().try_for_each(|file| collector.included(&file))?;
    let saved = installation.parameters.as_ref();
    let saved = saved.filter(|saved| saved.starts_with(&installation.folder) && saved.is_file());
    saved.into_iter().try_for_each(|saved| collector.add(saved))?;
    installation.modules.iter().filter(|module| module.is_in_file()).try_for_each(|module| collector.module(module))?;
    let hosts = text.get("team").and_then(|team| team.get("peers")?.as_str());
    hosts.into_iter().try_for_each(|hosts| collector.named(hosts, "[team]"))?;
    with.iter().try_for_each(|path| collector.add(path))?;
    let root = common(&collector.files);
    let path = |file: &Path| {
        let path = file.strip_prefix(&root).unwrap_or(file);
        let text = path.to_str().ok_or_else(|| format!("{}: its name is no text in UTF-8", path.display()))?;
        FilePath::parse(text).map_err(Failure::from)
    };
    let configuration = path(&configuration)?;
    let ingredient = |source: &PathBuf| Ok(Ingredient { path: path(source)?, source: source.clone() });
    let files = collector.files.iter().map(ingredient).collect::<Result<_, Failure>>()?;
    Ok(Collected { configuration, files, notes: collector.notes })
}

/// What a node writes, and its keys, must not lie in a folder that comes and goes with the bundle.
fn refuse_paths(installation: &Installation, text: &toml::Table) -> Result<(), Failure> {
    let is_sealed_team = team_keys(installation).is_some();
    for (section, key, default, right) in [
        ("network", "keys", installation.keys.is_some().then_some("keys"), "/etc/rohrpost/keys"),
        ("team", "keys", is_sealed_team.then_some("team-keys"), "/etc/rohrpost/team-keys"),
        ("tcp", "certificates", None, "/etc/rohrpost/certificates"),
        ("output", "file", None, "/var/log/rohrpost/output.log"),
        ("record", "directory", None, "/var/lib/recordings"),
    ] {
        let named = text.get(section).and_then(|section| section.get(key)?.as_str());
        if let Some(path) = named.or(default).filter(|path| Path::new(path).is_relative()) {
            return Err(format!(
                "{}: {key} of [{section}]: `{path}` would lie in the bundle, which holds no secrets, and goes when \
                 newer ones come; write an absolute path, such as `{key} = \"{right}\"`",
                installation.path.display()
            )
            .into());
        }
    }
    Ok(())
}

/// The folder with the keys of the team.
fn team_keys(installation: &Installation) -> Option<&PathBuf> {
    installation.team.as_ref()?.keys.as_ref()
}

impl Collector<'_> {
    /// A file that the configuration includes.
    fn included(&mut self, file: &Path) -> Result<(), Failure> {
        if file.starts_with(&self.installation.folder) {
            return self.add(file);
        }
        let file = file.display();
        self.notes.push(format!("`{file}` is included by an absolute path, so each node must have it itself"));
        Ok(())
    }

    /// The program of a module, and files that its arguments and settings name.
    fn module(&mut self, module: &Module) -> Result<(), Failure> {
        let name = self.installation.classes.format(module.name);
        if let Program::Command(words) = &module.program {
            let (program, arguments) = words.split_first().map_or(("", &[][..]), |(first, rest)| (first, rest));
            let path = self.folder.join(program);
            if !program.contains('/') || Path::new(program).is_absolute() {
                self.notes.push(format!(
                    "{name} runs `{program}`, which each node must have itself; a path from the configuration's folder \
                     on, such as `./{}`, would be in the bundle",
                    Path::new(program).file_name().unwrap_or_default().display()
                ));
            } else if path.is_file() || !module.optional {
                self.add(&path)?;
            } else {
                self.notes.push(format!("{name} is left out: its program `{program}` is not there"));
            }
            arguments.iter().try_for_each(|argument| self.named(argument, &name))?;
        }
        self.settings(&toml::Value::Table(module.settings.clone()), &name)
    }

    fn settings(&mut self, value: &toml::Value, module: &str) -> Result<(), Failure> {
        match value {
            toml::Value::String(text) => self.named(text, module),
            toml::Value::Array(values) => values.iter().try_for_each(|value| self.settings(value, module)),
            toml::Value::Table(table) => table.values().try_for_each(|value| self.settings(value, module)),
            _ => Ok(()),
        }
    }

    /// A text that may name a file.
    fn named(&mut self, text: &str, module: &str) -> Result<(), Failure> {
        let path = self.folder.join(text);
        if !path.is_file() {
            return Ok(());
        }
        if Path::new(text).is_absolute() {
            self.notes.push(format!("{module} names `{text}`, which each node must have itself: its path is absolute"));
            return Ok(());
        }
        self.add(&path)
    }

    /// A file, or all in a folder. Links to files are followed: the bundle has what they lead to.
    fn add(&mut self, path: &Path) -> Result<(), Failure> {
        let told = |error: io::Error| format!("{}: cannot be read ({error})", path.display());
        let there = fs::metadata(path).map_err(told)?;
        let path = lexical(&std::path::absolute(path)?);
        let tcp = self.installation.tcp.as_ref();
        let certificates = tcp.and_then(|tcp| tcp.certificates.as_ref());
        let mut secret = self.installation.keys.iter().chain(team_keys(self.installation)).chain(certificates);
        let is_key = path.extension().is_some_and(|end| end == "key" || end == "keys");
        if is_key
            || there.is_file() && begins_as_key(&path).map_err(told)?
            || secret.any(|folder| path.starts_with(lexical(&self.folder.join(folder))))
        {
            return Err(format!("{}: this is a key; a bundle holds no secrets", path.display()).into());
        }
        if there.is_file() {
            self.files.insert(path);
        } else if there.is_dir() {
            let mut entries =
                fs::read_dir(&path)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
            entries.sort();
            if let Some(link) = entries.iter().find(|entry| entry.is_symlink() && entry.is_dir()) {
                return Err(
                    format!("{}: a link to a folder; name that folder itself with --with", link.display()).into()
                );
            }
            entries.iter().try_for_each(|entry| self.add(entry))?;
        } else {
            return Err(format!("{}: neither a file nor a folder", path.display()).into());
        }
        Ok(())
    }
}

/// Whether a file is a private key in the form of PEM, which OpenSSH and TLS use.
fn begins_as_key(path: &Path) -> io::Result<bool> {
    let mut begin = Vec::new();
    File::open(path)?.take(PEM_LINE_BYTES).read_to_end(&mut begin)?;
    let line = String::from_utf8_lossy(&begin);
    Ok(line.starts_with("-----BEGIN ") && line.lines().next().is_some_and(|line| line.contains("PRIVATE KEY-----")))
}

/// The deepest folder that has all of these files in it.
fn common(files: &BTreeSet<PathBuf>) -> PathBuf {
    let mut folders = files.iter().filter_map(|file| file.parent());
    let Some(first) = folders.next() else { return PathBuf::new() };
    let has_all = |folder: &&Path| files.iter().all(|file| file.starts_with(folder));
    first.ancestors().find(has_all).unwrap_or(first).to_owned()
}
