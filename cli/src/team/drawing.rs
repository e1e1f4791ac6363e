//! The GUI of a team: a module of the arena's system that draws all robots in space.

use crate::terminal::Failure;
use rohrpost_config::GUI;
use std::collections::BTreeSet;
use toml_edit::{Array, DocumentMut, InlineTable, Item, Table, TableLike, Value, value};

/// Priority of the class `gui` where the file has none: the first that is free from here on.
const GUI_ID: i64 = 40;
/// Classes that tell what is drawn of a robot.
const SHOWN: [&str; 3] = ["team", "payload", "wormhole"];
/// Incidents and lines that wait while the bridge is busy.
const DATA_SLOTS: i64 = 128;

/// Where a team is drawn.
pub(crate) struct TeamDrawing(InlineTable);

impl TeamDrawing {
    /// From a word of the command line: a file of the present folder, or a viewer's `rerun+http://…`.
    ///
    /// # Errors
    /// The present folder is gone.
    pub(crate) fn new(word: &str) -> Result<Self, Failure> {
        let mut settings = InlineTable::new();
        if word.starts_with("rerun+") {
            settings.insert("viewer", word.into());
        } else {
            settings.insert("file", std::path::absolute(word)?.display().to_string().into());
        }
        Ok(Self(settings))
    }

    /// Adds the GUI to an arena's document, which has its class: it draws the arena with these `settings`, and by
    /// `way`, the arena's section `[team]`, this number of robots with the file `robot`.
    ///
    /// # Errors
    /// The documents are no configurations.
    pub(super) fn add(
        &self,
        arena: &mut DocumentMut,
        settings: &Table,
        way: Table,
        robot: &DocumentMut,
        robots: u8,
    ) -> Result<(), Failure> {
        arena["team"] = Item::Table(way);
        let map = ["map", "cell-m"].into_iter().filter_map(|key| Some((key, settings.get(key)?.as_value()?.clone())));
        let mut module = Table::new();
        module.insert("name", value(format!("{GUI}.0")));
        module.insert("program", value("rohrpost-gui-bridge"));
        module.insert("optional", value(true));
        module.insert("stop-within", value("10 s"));
        module.insert(
            "settings",
            value(self.0.iter().map(|(key, it)| (key, it.clone())).chain(map).collect::<InlineTable>()),
        );
        let data: InlineTable = [("slots", Value::from(DATA_SLOTS)), ("size", "20 KiB".into())].into_iter().collect();
        module.insert("mailbox", value(InlineTable::from_iter([("data", Value::from(data))])));
        arena["module"].as_array_of_tables_mut().ok_or("no [[module]]")?.push(module);
        let told = told(robot);
        let of_robots = (1..=robots).flat_map(|id| told.iter().map(move |name| format!("{id}.{name}.0")));
        let show = |from: String| InlineTable::from_iter([("from", from)]);
        let shows: Array = std::iter::once("arena.0".into()).chain(of_robots).map(show).collect();
        let mut gui = Table::new();
        gui.insert("show", value(shows));
        arena["gui"] = Item::Table(gui);
        Ok(())
    }
}

/// The class of the GUI, which robots have to know that tell it something.
pub(super) fn add_class(classes: &mut dyn TableLike) {
    if classes.contains_key(GUI) {
        return;
    }
    let id = |(_, class): (&str, &Item)| class.as_table_like()?.get("id")?.as_integer();
    let taken: BTreeSet<i64> = classes.iter().filter_map(id).collect();
    let free = (GUI_ID..=255).find(|id| !taken.contains(id)).unwrap_or(GUI_ID);
    let class = [("id", Value::from(free)), ("text", "Shows people what happens".into())];
    classes.insert(GUI, value(InlineTable::from_iter(class)));
}

/// Modules and aliases of a robot that tell what is drawn.
fn told(robot: &DocumentMut) -> Vec<String> {
    let modules = robot.get("module").and_then(Item::as_array_of_tables).into_iter().flatten();
    let names = modules.flat_map(|module| {
        let aliases = module.get("aliases").and_then(Item::as_array).into_iter().flatten();
        module.get("name").and_then(Item::as_str).into_iter().chain(aliases.filter_map(Value::as_str))
    });
    let is_shown = |name: &&str| name.split_once('.').is_some_and(|(class, _)| SHOWN.contains(&class));
    names.filter(is_shown).map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use crate::team::squad::{SquadFile, SquadNetwork};
    use std::path::Path;

    #[test]
    fn the_gui_of_an_arena_shows_all_robots_which_know_its_class() {
        let team = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/team.toml");
        let mut file = SquadFile::read(Path::new(team)).unwrap();
        file.draw("team.rrd").unwrap();
        let folder = tempfile::tempdir().unwrap();
        let squad = file.write(Some(2), SquadNetwork::Loopback, folder.path()).unwrap();
        let classes = &squad.arena.classes;
        let shown: Vec<String> = squad.arena.gui.show.iter().map(|show| classes.format(show.from)).collect();
        let of = |id| ["wormhole", "team", "payload"].map(|class| format!("{id}.{class}.0.0"));
        let expected: Vec<String> = ["arena.0".into()].into_iter().chain(of(1)).chain(of(2)).collect();
        assert_eq!(shown, expected);
        let gui = squad.arena.modules.iter().find(|module| classes.format(module.name) == "gui.0").unwrap();
        assert!(gui.settings.contains_key("map") && gui.settings.contains_key("file"), "{:?}", gui.settings);
        assert!(squad.robots.iter().all(|robot| robot.classes.id("gui").is_some()));
    }
}
