//! Programs of a team that start from its two files alone: `wormhole ID MAP HOSTS` and `station ID MAP HOSTS` (seed
//! 000, A.4). Both are the command `rohrpost`, also under these names.
//!
//! ```text
//!  mobile.toml or station.toml ─┐
//!  map, hosts file, keys ───────┼─▶ a configuration in a folder of its own, or beside FILE ──▶ launch
//!  --config FILE: drivers ──────┘
//! ```

mod merge;

use crate::begin::demo::folder::Folder;
use crate::launch::run_made;
use crate::terminal::{Failure, complain};
use merge::merge;
use rohrpost_config::{TeamHost, roster};
use rohrpost_team::grid::Map;
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use toml::{Table, Value};

/// Longest map or hosts file, bytes.
const FILE_BYTES_MAX: u64 = 16 << 20;
/// Folder of the keys, beside the hosts file.
const KEYS: &str = "team-keys";
/// The module that takes part in the team.
const TEAM: &str = "team.0";

#[derive(clap::Args)]
#[command(
    after_help = "Example: rohrpost wormhole 3 lab.map hosts --config drivers.toml\nHOSTS has a line `ID IP PORT` \
    for each robot and station, the same file everywhere; ids begin at 0, and the system of a host is its id plus 1. \
    Keys are taken from the folder `team-keys` beside HOSTS. A link of the name `wormhole` or `station` to this \
    command starts it by that name alone."
)]
pub(crate) struct Arguments {
    /// Number of this host in HOSTS.
    id: u8,
    /// The team's map, of any format.
    map: PathBuf,
    /// The team's hosts.
    hosts: PathBuf,
    /// Adds to what is made: drivers, keys, settings; sections and modules as in any configuration.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Side of a cell, of a map that does not say it.
    #[arg(long, value_name = "METRES", default_value_t = 1.0)]
    cell_m: f64,
    /// Start without keys: anyone on the network may take part, and no station is obeyed.
    #[arg(long)]
    insecure: bool,
    /// No live table, only events.
    #[arg(long)]
    quiet: bool,
}

/// What is started.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum TeamProgram {
    Mobile,
    Station,
}

/// The words of a command line: a link to the command may have the name of one of these programs.
pub(crate) fn by_name(words: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let mut words: Vec<OsString> = words.into_iter().collect();
    let name = words.first().and_then(|word| Path::new(word).file_name()).and_then(OsStr::to_str);
    let begins_with_id = words.get(1).and_then(|word| word.to_str()).is_some_and(|word| word.parse::<i64>().is_ok());
    let inserted: &[&str] = match name {
        Some("wormhole") => &["wormhole"],
        Some("station") if begins_with_id => &["station", "start"],
        Some("station") => &["station"],
        _ => &[],
    };
    let values = words.split_off(words.len().min(1));
    words.into_iter().chain(inserted.iter().map(OsString::from)).chain(values).collect()
}

/// Starts it, and runs until it is told to end: by a signal, or a mobile by its station.
pub(crate) fn start(arguments: &Arguments, host: TeamProgram) -> Result<ExitCode, Failure> {
    let made = Made::new(arguments, host)?;
    let folder = Folder::new()?;
    // Paths of FILE are relative to its folder.
    let beside = arguments.config.as_ref().map(|file| file.with_extension(format!("made-{}.toml", arguments.id)));
    let file = beside.unwrap_or_else(|| folder.path().join("team.toml"));
    std::fs::write(&file, made.text).map_err(|error| format!("{}: cannot be written: {error}", file.display()))?;
    made.notes.iter().for_each(complain);
    run_made(file, arguments.quiet, TEAM)
}

/// A configuration, and what a person should know of it.
struct Made {
    text: String,
    notes: Vec<&'static str>,
}

impl Made {
    fn new(arguments: &Arguments, host: TeamProgram) -> Result<Self, Failure> {
        let map = Map::read(&read(&arguments.map)?).map_err(|error| at(&arguments.map, &error))?;
        let cells = arguments.cell_m;
        if !(cells.is_finite() && cells > 0.0) {
            return Err(format!("--cell-m {cells} is no length; write metres, such as 1.0").into());
        }
        let hosts = roster(&read(&arguments.hosts)?, arguments.id).map_err(|mistakes| {
            let lines: Vec<String> = mistakes.iter().map(|mistake| at(&arguments.hosts, mistake)).collect();
            lines.join("\n")
        })?;
        let template = match host {
            TeamProgram::Mobile => include_str!("mobile.toml"),
            TeamProgram::Station => include_str!("station.toml"),
        };
        let mut made: Table = include_str!("classes.toml").parse()?;
        merge(&mut made, template.parse()?);
        let is_sealed = arguments.secure(&mut made, &hosts)?;
        arguments.take_part(&mut made, map.cell_m.is_none(), host == TeamProgram::Mobile && is_sealed, &hosts)?;
        let mut notes = Vec::new();
        match &arguments.config {
            Some(file) => {
                let text = String::from_utf8(read(file)?).map_err(|error| at(file, &error))?;
                merge(&mut made, text.parse::<Table>().map_err(|error| at(file, &error))?);
            }
            None if host == TeamProgram::Mobile => {
                notes.push("no --config with drivers: a simulated body drives, in a world of its own");
                arguments.simulate(&mut made, &map)?;
            }
            None => {}
        }
        // Whatever was added: the hosts file says which system this is.
        let system = table(&mut made, "system");
        system.insert("id".into(), Value::Integer(i64::from(arguments.id) + 1));
        Ok(Self { text: toml::to_string(&made)?, notes })
    }
}

impl Arguments {
    /// Keys or none, as people have decided; whether there are keys.
    fn secure(&self, made: &mut Table, hosts: &[TeamHost]) -> Result<bool, Failure> {
        let beside = std::path::absolute(&self.hosts)?.with_file_name(KEYS);
        let team = table(made, "team");
        let is_sealed = beside.is_dir();
        match (is_sealed, self.insecure) {
            (true, false) => {
                team.insert("keys".into(), text(&beside)?);
                team.insert("security".into(), "keys".into());
            }
            (false, true) => {
                team.insert("security".into(), "none".into());
            }
            (true, true) => {
                return Err(format!("--insecure, and {} has keys; drop one of both", beside.display()).into());
            }
            (false, false) => {
                return Err(format!(
                    "no keys: {0} is not there; `rohrpost keys new {0}` makes them, for all hosts to copy. With \
                     --insecure anyone on the network may take part",
                    beside.display()
                )
                .into());
            }
        }
        let own = hosts.iter().find(|host| host.id == self.id).ok_or("the hosts file has no such host")?;
        team.insert("address".into(), own.address.ip().to_string().into());
        team.insert("port".into(), i64::from(own.address.port()).into());
        let others = hosts.iter().filter(|host| host.id != self.id);
        let peers = others.map(|host| (host.system().to_string(), Value::from(host.address.to_string())));
        team.insert("peers".into(), Value::Table(peers.collect()));
        Ok(is_sealed)
    }

    /// Names, map and stations of the module that takes part.
    fn take_part(&self, made: &mut Table, needs_size: bool, obeys: bool, hosts: &[TeamHost]) -> Result<(), Failure> {
        let name = format!("host{}", self.id);
        made.insert("installation".into(), format!("team-{name}").into());
        table(made, "system").insert("name".into(), name.clone().into());
        table(table(made, "nodes"), &name);
        let mut settings = Table::new();
        settings.insert("map".into(), text(&std::path::absolute(&self.map)?)?);
        if needs_size {
            settings.insert("cell-m".into(), self.cell_m.into());
        }
        if obeys {
            // All that have the keys may be stations.
            let others = hosts.iter().filter(|host| host.id != self.id).map(|host| i64::from(host.system()).into());
            settings.insert("stations".into(), Value::Array(others.collect()));
        }
        let mut module = Table::new();
        module.insert("name".into(), TEAM.into());
        module.insert("settings".into(), settings.into());
        let added = Table::from_iter([("module".into(), Value::Array(vec![module.into()]))]);
        merge(made, added);
        Ok(())
    }

    /// A world with this robot alone, and its body there.
    fn simulate(&self, made: &mut Table, map: &Map) -> Result<(), Failure> {
        let drawn = map.robots.get(usize::from(self.id)).map(|(cell, _)| *cell);
        let first = || map.grid.cells().map(|(cell, _)| cell).find(|cell| map.grid.is_path(*cell));
        let cell = drawn.or_else(first).ok_or_else(|| at(&self.map, &"no path to drive on; mark paths"))?;
        let mut body: Table = include_str!("body.toml").parse()?;
        let robot = Table::from_iter([
            ("id".into(), Value::from(i64::from(self.id) + 1)),
            ("cell".into(), cell.to_string().into()),
        ]);
        let mut settings = Table::from_iter([
            ("map".into(), text(&std::path::absolute(&self.map)?)?),
            ("robots".into(), Value::Array(vec![robot.into()])),
        ]);
        if map.cell_m.is_none() {
            settings.insert("cell-m".into(), self.cell_m.into());
        }
        let arena = Table::from_iter([("name".into(), "arena.0".into()), ("settings".into(), settings.into())]);
        merge(&mut body, Table::from_iter([("module".into(), Value::Array(vec![arena.into()]))]));
        merge(made, body);
        Ok(())
    }
}

/// A table in a table, made if it is not there.
fn table<'a>(of: &'a mut Table, key: &str) -> &'a mut Table {
    let entry = of.entry(key).or_insert_with(|| Value::Table(Table::new()));
    if !entry.is_table() {
        *entry = Value::Table(Table::new());
    }
    entry.as_table_mut().expect("it was made one")
}

fn text(path: &Path) -> Result<Value, Failure> {
    let text = path.to_str().ok_or_else(|| format!("{}: not in UTF-8; give it another name", path.display()))?;
    Ok(text.into())
}

fn at(file: &Path, what: &impl std::fmt::Display) -> String {
    format!("{}: {what}", file.display())
}

/// A file that may be anything: a pipe that never ends, say.
fn read(file: &Path) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    let read = File::open(file).and_then(|opened| opened.take(FILE_BYTES_MAX + 1).read_to_end(&mut bytes));
    read.map_err(|error| at(file, &error))?;
    if bytes.len() as u64 > FILE_BYTES_MAX {
        return Err(at(file, &format_args!("longer than {FILE_BYTES_MAX} bytes; is it the right file?")).into());
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_of_the_name_of_a_program_starts_it() {
        for (typed, read) in [
            ("/usr/bin/wormhole 3 lab.map hosts", "/usr/bin/wormhole wormhole 3 lab.map hosts"),
            ("station 5 lab.map hosts", "station station start 5 lab.map hosts"),
            ("station quit --all", "station station quit --all"),
            ("rohrpost station info", "rohrpost station info"),
            ("wormhole", "wormhole wormhole"),
        ] {
            let words = by_name(typed.split(' ').map(OsString::from));
            assert_eq!(words.join(OsStr::new(" ")).to_str(), Some(read));
        }
    }
}
