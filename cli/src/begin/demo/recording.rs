//! The recording of a demo: one file, also if its recorder was started again.
//!
//! The recorder writes into a folder beside that file, `NAME.part`. What it leaves there gets the file's name at the
//! end; if the demo is killed, it stays there, to be recovered.

use crate::terminal::Failure;
use crate::terminal::units::size;
use rohrpost::interface::Interface;
use rohrpost::interfaces::CollectorInterface;
use rohrpost_config::{Installation, Module, Program, RECORDER, may_have_journal};
use rohrpost_mailbox::Class;
use rohrpost_recording::{info, is_closed, merge, recover, recovered_path};
use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use toml_edit::value;

/// Why other demos are not recorded.
pub(super) const ONE_NODE: &str = "--record records a demo of one node, since streams are read on the recorder's own \
                                   node; leave --nodes out, or add [record] to a configuration of your own";

/// The usual id of its class.
const CLASS_ID: u8 = 24;
/// Where the configuration has another class so far down, the next free one below.
const LOWEST_ID: u8 = 1;

/// A file in the making.
pub(super) struct DemoRecording {
    /// As the command line says it.
    to: PathBuf,
    folder: PathBuf,
    overwrite: bool,
}

impl DemoRecording {
    /// Makes the folder, so that what is wrong with the place is told before anything runs.
    pub(super) fn begin(to: &Path, overwrite: bool) -> Result<Self, Failure> {
        let (folder, shown) = (folder(to)?, to.display());
        if to.is_dir() {
            return Err(format!("{shown}: is a folder; name a new file in it, such as {shown}/demo.mcap").into());
        }
        if !overwrite {
            refuse_existing(to)?;
        }
        match std::fs::create_dir(&folder) {
            Ok(()) => Ok(Self { to: to.to_owned(), folder, overwrite }),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Err(format!(
                "{}: another demo records there, or was killed and left its recording there, of which `rohrpost record \
                 recover` makes whole files; remove it, or name another file",
                folder.display()
            )
            .into()),
            Err(error) => {
                Err(format!("{}: cannot make this folder, in which is recorded: {error}", folder.display()).into())
            }
        }
    }

    /// After the recorder has ended: gives its file the name. What there is to say of it.
    pub(super) fn end(self) -> Result<String, Failure> {
        let stays = |error: Failure| format!("{error}; what was recorded stays in {}", self.folder.display());
        let parts = self.whole_parts().map_err(stays)?;
        let whole = match &parts[..] {
            [] => return Err("nothing was recorded: the recorder has not begun, or its disk failed (see above)".into()),
            [one] => one.clone(),
            several => {
                let all = self.folder.join("all.mcap");
                merge(several, &all, &mut |_, _| {}).map_err(|error| stays(error.into()))?;
                all
            }
        };
        if !self.overwrite {
            refuse_existing(&self.to).map_err(stays)?;
        }
        std::fs::rename(&whole, &self.to).map_err(|error| stays(format!("{}: {error}", self.to.display()).into()))?;
        // All that is left are parts, which are in the file.
        let _ = std::fs::remove_dir_all(&self.folder);
        self.told(parts.len())
    }

    fn told(&self, parts: usize) -> Result<String, Failure> {
        let info = info(&self.to)?;
        let (shown, messages, bytes) = (self.to.display(), info.messages, size(info.bytes));
        let ns = info.last_ns.unwrap_or_default().saturating_sub(info.first_ns.unwrap_or_default());
        let seconds = ns as f64 / 1e9;
        let lost = if info.lost > 0 { format!(", {} lost", info.lost) } else { String::new() };
        let again = if parts > 1 { ", in which the recorder was started again" } else { "" };
        let see = format!("what is in it: rohrpost record info {shown}");
        Ok(format!("recording: {shown}: {messages} messages{lost}, {bytes}, {seconds:.1} s{again} ({see})"))
    }

    /// Its closed files, in order. Of those that were not closed, whole ones are made.
    fn whole_parts(&self) -> Result<Vec<PathBuf>, Failure> {
        let mut files = Vec::new();
        for entry in std::fs::read_dir(&self.folder)? {
            let path = entry?.path();
            if path.extension() == Some(OsStr::new("mcap")) {
                files.push(path);
            }
        }
        let mut parts = Vec::new();
        let is_made_of = |file: &PathBuf| files.iter().any(|other| recovered_path(other) == *file);
        for file in files.iter().filter(|file| !is_made_of(file)) {
            if is_closed(file)? {
                parts.push(file.clone());
                continue;
            }
            let to = recovered_path(file);
            // The recorder itself may have made one.
            if !to.exists() {
                recover(file, &to, &mut |_, _| {})?;
            }
            parts.push(to);
        }
        parts.sort();
        Ok(parts)
    }
}

impl Drop for DemoRecording {
    /// A demo that did not begin leaves nothing; a folder with something in it stays.
    fn drop(&mut self) {
        let _ = std::fs::remove_dir(&self.folder);
    }
}

fn refuse_existing(to: &Path) -> Result<(), Failure> {
    match to.symlink_metadata() {
        Ok(_) => {
            Err(format!("{}: is there already; --overwrite replaces it, or name another file", to.display()).into())
        }
        Err(_) => Ok(()),
    }
}

/// The folder in which is recorded.
fn folder(to: &Path) -> Result<PathBuf, Failure> {
    let name = to.file_name().ok_or_else(|| format!("`{}` names no file; write out.mcap", to.display()))?;
    let mut name = name.to_owned();
    name.push(".part");
    Ok(std::env::current_dir()?.join(to).with_file_name(name))
}

/// What a configuration lacks to record all into a file: a class, a module and a section. It stands behind all that is
/// there, so that lines keep their numbers.
pub(super) fn recorder(installation: &Installation, to: &Path) -> Result<String, Failure> {
    let shown = installation.shown.display();
    let records = |module: &Module| module.program == Program::Builtin(RECORDER.into());
    if installation.record.is_some() || installation.modules.iter().any(records) {
        return Err(format!("{shown} has a recorder of its own; leave --record out, or its [record]").into());
    }
    if installation.nodes.len() > 1 {
        return Err(ONE_NODE.into());
    }
    let class = match installation.classes.id(RECORDER) {
        Some(_) => String::new(),
        None => format!("\n[classes.{RECORDER}]\nid = {}\ntext = \"Records\"\n", free_id(installation)?),
    };
    let folder = folder(to)?;
    let directory = folder.to_str().ok_or_else(|| format!("{}: its name is no UTF-8 text", folder.display()))?;
    let output = installation.classes.id(CollectorInterface::CLASS);
    let is_repeatable =
        |module: &&Module| matches!(module.program, Program::Builtin(_)) && may_have_journal(&module.program);
    let exact: Vec<String> =
        installation.modules.iter().filter(is_repeatable).map(|its| installation.classes.format(its.name)).collect();
    let collector =
        |class: Class| installation.modules.iter().any(|module| module.names().any(|name| name.class() == class));
    Ok(format!(
        "{class}
[[module]]
name = \"{RECORDER}.0\"
builtin = \"{RECORDER}\"

[module.mailbox.data]
slots = 256
size = \"20 KiB\"

[record]
directory = {directory}
streams = [\"*\"]
data = [\"*\"]
output = {output}
drawn = true
exact = {exact:?}
rotate-size = \"1024 GiB\"
rotate-after = \"24 h\"
",
        directory = value(directory),
        output = output.is_some_and(collector),
    ))
}

/// Below all modules that it records, so that it waits for them.
fn free_id(installation: &Installation) -> Result<u8, Failure> {
    let lowest = installation.modules.iter().flat_map(Module::names).map(|name| name.class().0).min();
    let is_free = |id: &u8| installation.classes.iter().all(|entry| entry.class.0 != *id);
    let mut below = (LOWEST_ID..lowest.unwrap_or(CLASS_ID + 1).min(CLASS_ID + 1)).rev();
    below.find(is_free).ok_or_else(|| "no class id is free below those of its modules, for the recorder".into())
}

/// Starts the recorder behind the collector and before the others, which it is to hear from the beginning to the end.
pub(super) fn start_early(installation: &mut Installation) {
    let class = installation.classes.id(CollectorInterface::CLASS);
    let modules = &mut installation.modules;
    let Some(at) = modules.iter().position(|its| its.program == Program::Builtin(RECORDER.into())) else { return };
    let recorder = modules.remove(at);
    let collector = modules.iter().position(|its| its.names().any(|name| Some(name.class()) == class));
    modules.insert(collector.map_or(0, |at| at + 1), recorder);
}
