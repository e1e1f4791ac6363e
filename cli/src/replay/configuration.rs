//! The configuration of a replay's node, made from the one that was recorded.
//!
//! ```text
//! recorded: base    motor.0, laser.0 ─┐                 replay.0: stands in for motor.0, laser.0, pilot.0
//!           brain   mapper.0, pilot.0 ┼─▶ node replay:  mapper.0, as it was configured (--run)
//!           network, slots, access    ─┘                time: that of the recording
//! ```

use super::permitted::{ReplayDrawing, is_bridge, permit, without_arguments};
use super::recorded::RecordedFiles;
use super::sizes::ItemSizes;
use super::tables::{entries, stream, table, table_of, text_of};
use crate::terminal::Failure;
use rohrpost::Name;
use rohrpost::output::plain::line;
use rohrpost::schema::Description;
use rohrpost_config::{GUI, Installation, Module, Program, RECORDER, REPLAY, StreamSpec};
use rohrpost_modules::journal::JOURNAL_NAME;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use toml::{Table, Value};

/// The replay's one node.
pub(super) const NODE: &str = "replay";
/// Built-in modules that tell the node's time themselves.
const TELLERS: [&str; 2] = ["carmen", REPLAY];
/// Mailbox sizes that any module has.
const COMMANDS_MIN: (u16, u32) = (32, 1024);

/// What is wanted.
pub(super) struct ReplayWish<'a> {
    /// The configuration that was recorded, or another one that is meant.
    pub(super) installation: &'a Installation,
    /// Where its relative paths begin.
    pub(super) folder: &'a Path,
    pub(super) recorded: &'a RecordedFiles,
    /// Modules that run.
    pub(super) runs: &'a [String],
    /// Whether that configuration decides what runs, and where that writes and listens: it is the user's own, or the
    /// user said so.
    pub(super) is_own: bool,
    /// Names and topics that are played; none: all.
    pub(super) names: &'a [String],
    pub(super) drawing: ReplayDrawing,
    /// The file with saved parameters.
    pub(super) saved: Option<&'a Path>,
}

/// What is played.
#[derive(Default)]
pub(super) struct PlayedModules {
    /// Names that the player stands in for.
    pub(super) described: BTreeMap<String, Description>,
    pub(super) topics: BTreeSet<String>,
    /// Topics that were recorded and cannot be played.
    pub(super) left_out: BTreeSet<String>,
    /// Topics of another program, and those in which their messages are played as bytes.
    pub(super) into: BTreeMap<String, String>,
    /// By topic: streams that have another size than usual, unless the configuration says theirs.
    pub(super) streams: BTreeMap<String, StreamSpec>,
}

impl ReplayWish<'_> {
    /// Modules that run: those that are named, and the one that draws.
    fn running(&self) -> Result<Vec<&Module>, Failure> {
        let installation = self.installation;
        let mut running: Vec<&Module> = Vec::new();
        for name in self.runs {
            let module = installation.classes.parse_module(name).ok().and_then(|name| installation.module(name));
            let module = module.filter(|module| module.is_in_file()).ok_or_else(|| {
                let own = installation.modules.iter().filter(|module| module.is_in_file());
                let own: Vec<String> = own.map(|module| self.format(module.name)).collect();
                format!("--run {name}: the configuration has no such module; it has {}", own.join(", "))
            })?;
            if matches!(&module.program, Program::Builtin(builtin) if TELLERS.contains(&builtin.as_str())) {
                return Err(format!("--run {name}: it tells its node the time, as the replay does; play it").into());
            }
            if !self.is_own {
                permit(name, module, installation, self.folder)?;
            }
            running.push(module);
        }
        let gui = installation.classes.id(GUI).filter(|_| self.drawing != ReplayDrawing::Nothing);
        // Others than the own one have to be asked for by `--run`: a recording could name any program.
        let guis = installation.modules.iter().filter(|module| Some(module.name.class()) == gui);
        running.extend(guis.filter(|module| is_bridge(module)));
        // In the order of their start.
        let is_running = |module: &&Module| running.iter().any(|running| running.name == module.name);
        Ok(installation.modules.iter().filter(is_running).collect())
    }

    /// Names of modules that run, with their aliases.
    pub(super) fn running_names(&self) -> Result<BTreeSet<String>, Failure> {
        let names = self.running()?.into_iter().flat_map(Module::names);
        Ok(names.map(|name| self.format(name)).collect())
    }

    /// What is played: all that is recorded, but for what runs and what is not wanted.
    pub(super) fn played(&self) -> Result<PlayedModules, Failure> {
        let running = self.running_names()?;
        let runs = |name: &str| running.contains(name);
        let (names, topics) = (self.recorded.names(), self.recorded.all_topics());
        if let Some(unknown) = self.names.iter().find(|name| !names.contains(&***name) && !topics.contains(&***name)) {
            let topics: Vec<&str> = topics.iter().copied().collect();
            let known = rohrpost_config::nearest(unknown, topics.iter().copied());
            let known =
                known.map_or_else(|| format!("it has {}", topics.join(", ")), |at| format!("did you mean {at}?"));
            return Err(format!("--names {unknown}: nothing of it is recorded; {}", line(&known)).into());
        }
        let is_chosen = |name: &str| {
            let is_of = |wanted: &String| wanted.split('/').next() == Some(name);
            self.names.is_empty() || self.names.iter().any(is_of)
        };
        // An earlier replay is not a part of the robot.
        let is_replay = |name: &str| name.split('.').next() == Some(REPLAY);
        let described = self.recorded.described(|name| is_chosen(name) && !runs(name) && !is_replay(name))?;
        for (name, description) in &described {
            let class = &description.class;
            let known = self.installation.classes.parse_module(name).ok();
            if known.is_none_or(|name| self.installation.classes.name(name.class()) != Some(class)) {
                let (name, class) = (line(name), line(class));
                return Err(format!(
                    "{name} was recorded as a module of class `{class}`, which the configuration does not have; name \
                     the one that it was recorded with: --config FILE"
                )
                .into());
            }
        }
        let is_wanted = |topic: &String| {
            let is_it = |wanted: &String| topic == wanted || topic.split('/').next() == Some(wanted);
            self.names.is_empty() || self.names.iter().any(is_it)
        };
        let all: BTreeSet<String> = self.recorded.topics(&described).into_iter().filter(is_wanted).collect();
        let meant = topics.iter().map(|topic| (*topic).to_owned()).filter(is_wanted);
        let meant = meant.filter(|topic| topic.split('/').next().is_some_and(|name| !runs(name) && !is_replay(name)));
        let is_journal = |topic: &String| topic.split('/').nth(1) == Some(JOURNAL_NAME);
        let left_out = meant.filter(|topic| !all.contains(topic) && !is_journal(topic)).collect();
        if all.is_empty() {
            return Err("nothing is left to be played; name other modules, or let fewer run".into());
        }
        Ok(PlayedModules { described, topics: all, left_out, ..PlayedModules::default() })
    }

    /// The text of the configuration. `settings` are the player's; the player's name comes with it.
    pub(super) fn text(&self, played: &PlayedModules, settings: Table) -> Result<(String, String), Failure> {
        let source: Table = self.installation.text.parse()?;
        let running = self.running()?;
        let (class, is_new) = self.class(&running)?;
        let player = self.free_name(played);
        let mut classes = table_of(&source, "classes");
        if is_new {
            let texts = [("id", Value::Integer(class.into())), ("text", "Plays a recording".into())];
            classes.insert(REPLAY.into(), Value::Table(table(texts)));
        }
        let mut new = Table::new();
        new.insert("installation".into(), format!("{}-replay", self.installation.name).into());
        for key in ["system", "scheduling"] {
            new.extend(source.get(key).map(|section| (key.to_owned(), section.clone())));
        }
        new.insert("classes".into(), Value::Table(classes));
        new.insert("nodes".into(), Value::Table(table([(NODE, Value::Table(Table::new()))])));
        new.insert("time".into(), Value::Table(table([("source", "log".into())])));
        new.insert("output".into(), Value::Table(table([("level", self.installation.output.level.as_str().into())])));
        if let Some(saved) = self.saved {
            new.insert("parameters".into(), text_of(saved));
        }
        let is_there = |name: &str| {
            let name = self.installation.classes.parse_module(name).ok();
            let runs = |name: Name| running.iter().any(|module| module.names().any(|own| own == name));
            name.is_some_and(|name| runs(name) || played.described.contains_key(&self.format(name)))
        };
        if let Some(gui) = source.get("gui").and_then(Value::as_table) {
            new.insert(
                "gui".into(),
                Value::Table(entries(gui, "show", |entry| {
                    entry.get("from").and_then(Value::as_str).is_some_and(is_there)
                })),
            );
        }
        if running.iter().any(|module| module.program == Program::Builtin(RECORDER.into())) {
            let runs = |name: &str| running.iter().any(|module| self.format(module.name) == name);
            new.insert("record".into(), Value::Table(self.record(&table_of(&source, "record"), is_there, runs)));
        }
        let written = source.get("module").and_then(Value::as_array).ok_or("no [[module]]")?;
        let own = self.installation.modules.iter().filter(|module| module.is_in_file());
        let entries = own.zip(written).filter(|(module, _)| running.iter().any(|one| one.name == module.name));
        let mut modules: Vec<Value> =
            entries.map(|(module, entry)| Value::Table(self.module(module, entry, class, played, is_there))).collect();
        // Right behind a collector: the others find its streams when they start. It waits until it is told to begin.
        let is_collector =
            |module: &&&Module| self.installation.classes.name(module.name.class()) == Some(rohrpost::output::CLASS);
        let collectors = running.iter().take_while(is_collector).count();
        modules.insert(collectors, Value::Table(self.player(&player, played, settings)?));
        new.insert("module".into(), Value::Array(modules));
        Ok((toml::to_string(&new)?, player))
    }

    /// The class of the player, and whether it is to be added: not below those that call what it plays, and real time
    /// only if they are.
    fn class(&self, running: &[&Module]) -> Result<(u8, bool), Failure> {
        let classes = &self.installation.classes;
        if let Some(known) = classes.id(REPLAY) {
            return Ok((known.0, false));
        }
        let least = running.iter().map(|module| module.name.class().0).max().unwrap_or(1);
        let is_taken = |id: u8| classes.iter().any(|entry| entry.class.0 == id);
        let is_ordinary = |id: u8| u16::from(id) < self.installation.real_time_from();
        let free = || (least..=u8::MAX).filter(|id| !is_taken(*id));
        let id = free().filter(|id| is_ordinary(*id)).max().or_else(|| free().min());
        let id = id.ok_or(
            "no number is free for the class of the player; add `replay = { id = … }` to [classes] of a copy of the \
             configuration: --config FILE",
        )?;
        Ok((id, true))
    }

    /// An instance of the player's class that nothing else has.
    fn free_name(&self, played: &PlayedModules) -> String {
        let names: BTreeSet<String> =
            self.installation.modules.iter().flat_map(Module::names).map(|name| self.format(name)).collect();
        let free = (0..=u8::MAX).map(|instance| format!("{REPLAY}.{instance}"));
        // There are more instances than modules of one class that a recording could have.
        free.into_iter()
            .find(|name| !names.contains(name) && !played.described.contains_key(name))
            .unwrap_or_else(|| format!("{REPLAY}.0"))
    }

    /// A module that runs, as it was configured, without what is not here.
    fn module(
        &self,
        module: &Module,
        entry: &Value,
        player: u8,
        played: &PlayedModules,
        is_there: impl Fn(&str) -> bool,
    ) -> Table {
        let mut entry = entry.as_table().cloned().unwrap_or_default();
        entry.remove("node");
        if let Some(calls) = entry.get_mut("calls").and_then(Value::as_array_mut) {
            let name = |call: &Value| {
                call.as_str().or_else(|| call.get("to").and_then(Value::as_str)).unwrap_or_default().to_owned()
            };
            calls.retain(|call| is_there(&name(call)));
            // A reason is for less important ones, and the player is none.
            let is_played = |name: &str| played.described.contains_key(name) && player >= module.name.class().0;
            calls.iter_mut().filter(|call| is_played(&name(call))).for_each(|call| *call = name(call).into());
        }
        let is_gui = is_bridge(module) || self.installation.classes.name(module.name.class()) == Some(GUI);
        if is_bridge(module) && !self.is_own {
            without_arguments(&mut entry);
        }
        if let Some(program) = entry.get_mut("program") {
            let first = match program {
                Value::Array(words) => words.first_mut(),
                word => Some(word),
            };
            let in_folder = |word: &mut Value| {
                if let Some(path) = word.as_str().filter(|path| path.contains('/')) {
                    *word = text_of(&self.folder.join(path));
                }
            };
            first.into_iter().for_each(in_folder);
        }
        if let Some(settings) = entry.get_mut("settings") {
            self.find_paths(settings);
            if let (true, Some(settings)) = (is_gui, settings.as_table_mut()) {
                self.drawing.settle(settings, self.is_own);
            }
        }
        entry
    }

    /// Texts of settings that name something in the configuration's folder are paths: they are to be found from another
    /// folder, too.
    fn find_paths(&self, settings: &mut Value) {
        match settings {
            Value::String(text) if !text.is_empty() => {
                let path = self.folder.join(&*text);
                if path.exists() {
                    *settings = text_of(&path);
                }
            }
            Value::Array(all) => all.iter_mut().for_each(|value| self.find_paths(value)),
            Value::Table(table) => table.iter_mut().for_each(|(_, value)| self.find_paths(value)),
            _ => {}
        }
    }

    /// What a recorder that runs records of this node.
    fn record(&self, section: &Table, is_there: impl Fn(&str) -> bool, runs: impl Fn(&str) -> bool) -> Table {
        let is_kept = |entry: &Value| {
            let name = entry.as_str().or_else(|| entry.get("name").and_then(Value::as_str)).unwrap_or_default();
            name == "*" || name.split('/').next().is_some_and(&is_there)
        };
        let mut record = entries(&entries(section, "streams", is_kept), "data", is_kept);
        // What is played has no journal.
        record = entries(&record, "exact", |entry| entry.as_str().is_some_and(&runs));
        if let Some(place) = record.get("directory").and_then(Value::as_str) {
            let place = self.folder.join(place);
            record.insert("directory".into(), text_of(&place));
        }
        let collector = format!("{}.0", rohrpost::output::CLASS);
        if !is_there(&collector) {
            record.remove("output");
        }
        record
    }

    /// The player, with the streams and mailboxes of all that it plays.
    fn player(&self, name: &str, played: &PlayedModules, settings: Table) -> Result<Table, Failure> {
        let classes = &self.installation.classes;
        let (mut slots, mut size) = COMMANDS_MIN;
        let mut sizes: BTreeMap<&str, ItemSizes> = BTreeMap::new();
        for (name, description) in &played.described {
            let module = classes.parse_module(name).ok().and_then(|name| self.installation.module(name));
            let commands = module.map(|module| module.mailboxes.commands);
            slots = slots.max(commands.map_or(0, |commands| commands.slots));
            size = size.max(commands.map_or(0, |commands| commands.size));
            for item in description.streams() {
                let item = item.field.name.as_str();
                let all = sizes.entry(item).or_default();
                let configured = module.and_then(|module| module.streams.get(item));
                match (configured, played.streams.get(&format!("{name}/{item}"))) {
                    (None, Some(derived)) => all.add_derived(*derived),
                    (configured, _) => all.add_configured(configured.copied().unwrap_or_default()),
                }
            }
        }
        let commands = table([("slots", Value::Integer(slots.into())), ("size", format!("{size} B").into())]);
        let aliases: Vec<Value> = played.described.keys().map(|name| name.as_str().into()).collect();
        let mut entry = table([
            ("name", name.into()),
            ("aliases", Value::Array(aliases)),
            ("builtin", REPLAY.into()),
            ("restart", "never".into()),
            ("settings", Value::Table(settings)),
            ("mailbox", Value::Table(table([("commands", Value::Table(commands))]))),
        ]);
        let mut streams = Table::new();
        for (item, sizes) in sizes {
            streams.insert(item.to_owned(), Value::Table(stream(&sizes.spec(item)?)));
        }
        entry.insert("stream".into(), Value::Table(streams));
        Ok(entry)
    }

    fn format(&self, name: Name) -> String {
        self.installation.classes.format(name)
    }
}

/// Saved parameters of those modules that run.
pub(super) fn saved_of(text: &str, runs: impl Fn(&str) -> bool) -> Result<String, Failure> {
    let mut saved: Table = text.parse()?;
    saved.retain(|name, _| runs(name));
    Ok(toml::to_string(&saved)?)
}

#[cfg(test)]
#[path = "configuration_tests.rs"]
mod tests;
