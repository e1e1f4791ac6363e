//! What `rohrpost team launch` makes of a robot's file: a file for each robot, and one for their arena.
//!
//! Robots differ in number, names, address, place and seed. All paths stay those of the file; the arena's socket is in
//! the folder of the new files.

use super::drawing::{TeamDrawing, add_class};
use crate::begin::check;
use crate::terminal::Failure;
use rohrpost_config::Installation;
use rohrpost_team::grid::{Cell, Map};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::net::Ipv4Addr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, TableLike, value};

/// System number and name of the arena's node: stations and robots have lower numbers.
const ARENA_ID: u8 = 254;
const ARENA: &str = "arena";
/// Robots at most: the arena has the last number.
pub(crate) const ROBOTS_MAX: u8 = 253;

/// The section `[team.launch]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct TeamLaunch {
    /// How many there are, unless the command line says it.
    #[serde(default = "robots")]
    robots: u8,
    /// Settings of the built-in `arena`, but for robots and socket.
    arena: toml::Table,
    /// Robots that differ in more than their number.
    #[serde(default)]
    robot: Vec<Differing>,
}

/// A robot that the file says more of.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Differing {
    id: u8,
    /// Where it begins.
    cell: Option<String>,
    facing: Option<String>,
    /// Settings of its payload.
    #[serde(default)]
    payload: toml::Table,
}

fn robots() -> u8 {
    6
}

#[derive(Deserialize)]
struct WithTeam {
    team: Option<WithLaunch>,
}

#[derive(Deserialize)]
struct WithLaunch {
    launch: Option<TeamLaunch>,
}

/// A robot's file that says how it becomes a team.
pub(crate) struct SquadFile {
    shown: String,
    folder: PathBuf,
    document: DocumentMut,
    launch: TeamLaunch,
    /// Where it is drawn, if at all.
    drawing: Option<TeamDrawing>,
}

/// The systems of a team.
pub(crate) struct Squad {
    /// By number.
    pub(crate) robots: Vec<Arc<Installation>>,
    pub(crate) arena: Arc<Installation>,
}

/// The network by which robots reach each other.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum SquadNetwork {
    /// Each has a network namespace.
    Namespaces,
    /// All are on the loopback device.
    Loopback,
}

impl SquadNetwork {
    pub(crate) fn address(self, id: u8) -> Ipv4Addr {
        match self {
            Self::Namespaces => Ipv4Addr::new(10, 77, 0, id),
            Self::Loopback => Ipv4Addr::new(127, 77, 0, id),
        }
    }
}

/// The only node of a robot.
pub(crate) fn node_name(id: u8) -> String {
    format!("robot{id}")
}

impl SquadFile {
    /// Reads a file.
    ///
    /// # Errors
    /// The file has mistakes, or no section `[team.launch]`.
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        check::load(path)?;
        let folder = path.canonicalize()?.parent().map(Path::to_owned).unwrap_or_default();
        Self::parse(&std::fs::read_to_string(path)?, &path.display().to_string(), folder)
    }

    /// Reads the text of a file that was checked. Its paths are from `folder`.
    ///
    /// # Errors
    /// The section `[team.launch]` is missing, or wrong.
    pub(crate) fn parse(text: &str, shown: &str, folder: PathBuf) -> Result<Self, Failure> {
        let file: WithTeam = toml::from_str(text).map_err(|error| format!("{shown}: {error}"))?;
        let missing = || {
            format!(
                "{shown}: no [team.launch], which says how many robots there are and where; write for example \
                 `[team.launch]` with `robots = 6` and `arena = {{ map = \"hall.map\" }}`"
            )
        };
        let launch = file.team.and_then(|team| team.launch).ok_or_else(missing)?;
        Ok(Self { shown: shown.into(), folder, document: text.parse()?, launch, drawing: None })
    }

    /// All robots are drawn: into a file, or a viewer, see [`TeamDrawing::new`].
    ///
    /// # Errors
    /// The present folder is gone, or the file has no classes.
    pub(crate) fn draw(&mut self, to: &str) -> Result<(), Failure> {
        self.drawing = Some(TeamDrawing::new(to)?);
        add_class(self.document["classes"].as_table_like_mut().ok_or("no [classes]")?);
        Ok(())
    }

    /// Writes the files into `to`, and reads them as a user's.
    ///
    /// # Errors
    /// The map has no room for so many, or a file has mistakes.
    pub(crate) fn write(&self, count: Option<u8>, network: SquadNetwork, to: &Path) -> Result<Squad, Failure> {
        let count = count.unwrap_or(self.launch.robots);
        if !(1..=ROBOTS_MAX).contains(&count) {
            return Err(format!("{}: {count} robots; use 1 to {ROBOTS_MAX}", self.shown).into());
        }
        let load = |name: &str, document: &DocumentMut| {
            let file = to.join(format!("{name}.toml"));
            std::fs::write(&file, document.to_string())?;
            let mut installation = check::load(&file)?;
            installation.shown = format!("{} of {name}", self.shown).into();
            Ok::<_, Failure>(Arc::new(installation))
        };
        let arena = load(ARENA, &self.arena(count, network)?)?;
        let robots =
            (1..=count).map(|id| load(&node_name(id), &self.robot(id, network)?)).collect::<Result<_, Failure>>()?;
        Ok(Squad { robots, arena })
    }

    fn differing(&self, id: u8) -> Option<&Differing> {
        self.launch.robot.iter().find(|robot| robot.id == id)
    }

    fn robot(&self, id: u8, network: SquadNetwork) -> Result<DocumentMut, Failure> {
        let mut document = self.document.clone();
        let node = node_name(id);
        document["system"]["name"] = value(&node);
        document["system"]["id"] = value(i64::from(id));
        document["team"] = Item::Table(self.way(id, network)?);
        rename_node(&mut document, &node)?;
        let modules = document["module"].as_array_of_tables_mut().ok_or("no [[module]]")?;
        for module in modules.iter_mut() {
            let is_payload = module.get("builtin").and_then(Item::as_str) == Some("payload");
            let Some(settings) = module.get_mut("settings").and_then(Item::as_table_like_mut) else { continue };
            self.keep_path(settings, "map");
            if let Some(walls) = settings.get_mut("walls").and_then(Item::as_table_like_mut) {
                self.keep_path(walls, "map");
            }
            if settings.contains_key("seed") {
                settings.insert("seed", value(i64::from(id)));
            }
            for (key, of_robot) in self.differing(id).filter(|_| is_payload).into_iter().flat_map(|it| &it.payload) {
                settings.insert(key, format!("x = {of_robot}").parse::<DocumentMut>()?["x"].clone());
            }
        }
        Ok(document)
    }

    /// The section `[team]` of a system.
    fn way(&self, id: u8, network: SquadNetwork) -> Result<Table, Failure> {
        let mut way = self.document["team"].as_table().ok_or("no [team]")?.clone();
        way.remove("launch");
        way.insert("address", value(network.address(id).to_string()));
        self.keep_path(&mut way, "keys");
        Ok(way)
    }

    /// A path of the file stays one of its folder.
    fn keep_path(&self, table: &mut dyn TableLike, key: &str) {
        if let Some(path) = table.get(key).and_then(Item::as_str).map(|path| self.folder.join(path)) {
            table.insert(key, value(path.display().to_string()));
        }
    }

    fn arena(&self, count: u8, network: SquadNetwork) -> Result<DocumentMut, Failure> {
        let mut settings: Table = toml::to_string(&self.launch.arena)?.parse::<DocumentMut>()?.as_table().clone();
        self.keep_path(&mut settings, "map");
        let map = settings.get("map").and_then(Item::as_str).ok_or("[team.launch]: `arena` has no `map`")?;
        let text = std::fs::read(map).map_err(|error| format!("{map}: {error}"))?;
        let read = Map::read(&text).map_err(|error| format!("{map}: {error}"))?;
        let robots = self.begin(count, &read)?;
        settings.insert("socket", value("arena.sock"));
        settings.insert("robots", value(robots));
        let mut document = DocumentMut::new();
        document["installation"] = self.document["installation"].clone();
        document["classes"] = self.document["classes"].clone();
        document["system"]["name"] = value(ARENA);
        document["system"]["id"] = value(i64::from(ARENA_ID));
        let mut nodes = Table::new();
        nodes.insert(ARENA, toml_edit::table());
        document["nodes"] = Item::Table(nodes);
        let mut modules = ArrayOfTables::new();
        for (name, builtin, settings) in [("output.0", "output", None), ("arena.0", ARENA, Some(settings.clone()))] {
            let mut module = Table::new();
            module.insert("name", value(name));
            module.insert("builtin", value(builtin));
            settings.into_iter().for_each(|settings| drop(module.insert("settings", Item::Table(settings))));
            modules.push(module);
        }
        document["module"] = Item::ArrayOfTables(modules);
        if let Some(drawing) = &self.drawing {
            drawing.add(&mut document, &settings, self.way(ARENA_ID, network)?, &self.document, count)?;
        }
        Ok(document)
    }

    /// Where each robot begins: where the file or the map says it, else somewhere, each time the same.
    fn begin(&self, count: u8, map: &Map) -> Result<toml_edit::Array, Failure> {
        let said = |id| self.differing(id).and_then(|robot| robot.cell.clone());
        let taken = (1..=count).filter_map(said).filter_map(|cell| cell.parse().ok());
        let drawn: Vec<Cell> = map.robots.iter().map(|(cell, _)| *cell).collect();
        let mut taken: BTreeSet<Cell> = taken.chain(drawn.iter().copied()).chain(map.intruders.clone()).collect();
        let free = scattered(map.grid.cells().map(|(cell, _)| cell).filter(|cell| map.grid.is_path(*cell)).collect());
        let mut free = free.into_iter().filter(|cell| taken.insert(*cell));
        let mut drawn = drawn.into_iter();
        let mut robots = toml_edit::Array::new();
        for id in 1..=count {
            let cell = said(id).or_else(|| drawn.next().or_else(|| free.next()).map(|cell| cell.to_string()));
            let cell = cell.ok_or_else(|| format!("{}: the map has no room for {count} robots", self.shown))?;
            let mut robot = InlineTable::new();
            robot.insert("id", i64::from(id).into());
            robot.insert("cell", cell.into());
            if let Some(facing) = self.differing(id).and_then(|robot| robot.facing.clone()) {
                robot.insert("facing", facing.into());
            }
            robots.push(robot);
        }
        Ok(robots)
    }
}

/// All cells, in an order in which neighbours are far from each other.
fn scattered(cells: Vec<Cell>) -> Vec<Cell> {
    // By the golden ratio: each new place lies in one of the widest gaps.
    let mut order: Vec<(u64, Cell)> =
        (0_u64..).zip(cells).map(|(at, cell)| (at.wrapping_mul(0x9E37_79B9_7F4A_7C15), cell)).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, cell)| cell).collect()
}

fn rename_node(document: &mut DocumentMut, node: &str) -> Result<(), Failure> {
    let nodes = document["nodes"].as_table_mut().ok_or("no [nodes]")?;
    let own = nodes.iter().map(|(name, _)| name.to_owned()).next().unwrap_or_default();
    let own = nodes.remove(&own).unwrap_or_default();
    nodes.insert(node, own);
    Ok(())
}
