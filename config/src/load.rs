//! Reads and checks an installation's file as a whole.

use crate::access::Access;
use crate::check;
use crate::classes::ClassTable;
use crate::directory::Directory;
use crate::errors::Errors;
use crate::flow::Flow;
use crate::gui::Gui;
use crate::installation::Installation;
use crate::module::{Context, Module};
use crate::network;
use crate::node::{self, Node, System};
use crate::output::Output;
use crate::reader::{Reader, Section};
use crate::record::{self, Recording};
use crate::replica::Replica;
use crate::saved::Saved;
use crate::scheduling::SchedulingRule;
use crate::sources::{Origins, resolved_text};
use crate::tcp::{self, Tcp};
use crate::tdma;
use crate::team::{self, Team};
use crate::time::TimeSource;
use rohrpost_mailbox::Name;
use std::path::{Path, PathBuf};
use toml::de::DeTable;

impl Installation {
    /// Reads and checks a file with all that it includes, the parameters saved beside it, and the hosts of its team.
    pub fn load(path: &Path) -> Result<Self, Errors> {
        let mut installation = Self::parse(&resolved_text(path)?, path)?;
        if let Some(file) = &installation.parameters {
            installation.saved = Some(Saved::load(file, &installation)?);
        }
        if let Some(team) = &mut installation.team {
            team.read_hosts(installation.system.id)?;
        }
        Ok(installation)
    }

    /// Checks the text of one file, or what [`resolved_text`] made of several; `path` is its name in messages and the
    /// place that relative paths start from. Saved parameters and files of hosts are not read.
    pub fn parse(text: &str, path: &Path) -> Result<Self, Errors> {
        let reader = Reader::new(text);
        let (document, syntax) = DeTable::parse_recoverable(text);
        for error in &syntax {
            reader.report_syntax(error);
        }
        // Values that the parser invented in place of unreadable ones are not validated.
        let read = if syntax.is_empty() { read(&reader, document.get_ref(), text, path) } else { None };
        let problems = reader.into_problems();
        match read {
            Some(installation) if problems.is_empty() => Ok(installation),
            _ => Err(Errors::new(path, problems).with_origins(&Origins::of(text))),
        }
    }
}

fn read<'d>(reader: &'d Reader<'d>, table: &'d DeTable<'d>, text: &str, path: &Path) -> Option<Installation> {
    let file = Section::new(reader, "", 1, table);
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    };
    if let Some(item) = file.get("include") {
        item.report("`include` names other files, and this is a text without them; read it from its file");
    }
    let name = file.required("installation", "installation = \"demo\"").and_then(|item| item.word("demo"));
    let parameters = file.get("parameters").and_then(|item| item.text("tuned.toml")).map(|path| folder.join(path));
    let system = System::read(required(&file, "system", "`[system]` with `name = \"robot\"` and `id = 1`"));
    let classes = ClassTable::read(
        required(&file, "classes", "`[classes]` with lines such as `laser = { id = 150, text = \"Tells distances\" }`"),
        system.id,
    );
    let scheduling = SchedulingRule::read(file.section("scheduling", "[scheduling]"));
    let nodes = Node::read_all(required(&file, "nodes", "`[nodes.main]`"));
    let on_lan = node::on_lan(&nodes);
    let (tdma, slot_lines) = tdma::read(&file, sections(&file, "slot"), on_lan).unzip();
    let network = file.section("network", "[network]").map(|section| network::read(section, on_lan, tdma.as_ref()));
    let keys = network.and_then(|network| network::keys_folder(&file, network.security, &folder));
    let cycle = tdma.as_ref().map(|tdma| tdma.cycle);
    let (time, when_set) = TimeSource::read(file.section("time", "[time]"), &file, &nodes, cycle);
    network::validate_count(&file, &nodes);
    network::validate(&file, on_lan, &classes);
    let tcp = file.section("tcp", "[tcp]").map(|section| Tcp::read(section, &nodes, tdma.as_ref()));
    if tcp.is_some() {
        tcp::validate(&file, &classes, scheduling);
    }
    tcp::validate_nodes(&file, tcp.as_ref(), &nodes);
    let team = file.section("team", "[team]").map(|section| Team::read(section, system.id, &nodes, &folder));
    if team.is_some() {
        team::validate(&file, &classes, scheduling);
    }

    let sections = self::sections(&file, "module");
    if sections.is_empty() {
        file.report("no module; add one: `[[module]]` with `name` and `builtin` or `program`");
    }
    let mut routers = network::routers(on_lan, &classes, system.id);
    routers.extend(tcp::modules(tcp.as_ref(), &nodes, &classes, system.id));
    routers.extend(team::modules(team.as_ref(), &nodes, &classes, system.id));
    let router_names: Vec<Name> = routers.iter().map(|(router, _)| router.name).collect();
    let directory = Directory::read(&sections, &classes, &router_names);
    let context = Context { directory: &directory, nodes: &nodes };
    let read = sections.into_iter().enumerate().filter_map(|(index, section)| context.read(section, index));
    let (mut modules, mut lines): (Vec<Module>, Vec<_>) = routers.into_iter().chain(read).unzip();

    let access = Access::read(file.section("access", "[access]"), &directory);
    let output = Output::read(file.section("output", "[output]"), &directory, &folder);
    let gui = Gui::read(file.section("gui", "[gui]"), &directory);
    let record = Recording::read(file.section("record", "[record]"), &directory, &folder);
    let replica_sections = self::sections(&file, "replica").into_iter();
    let replicas = replica_sections.filter_map(|section| Replica::read(section, &directory, &nodes));
    let replicas: Vec<Replica> = replicas.collect();
    let has_replica = |items: &_, node: &_| replicas.iter().any(|replica| replica.is_of(items, node));
    record::connect((record.as_ref(), &has_replica), &file, &classes, &mut modules, &mut lines);
    let access = access.with_alone(&modules, &lines, &gui, &classes, reader);
    let flow_sections = self::sections(&file, "flow").into_iter();
    let flows = flow_sections.filter_map(|section| Flow::read(section, &directory)).collect();
    file.finish();

    let name = name?.into();
    let (path, text) = (path.to_owned(), text.to_owned());
    let installation = Installation {
        name,
        shown: path.clone(),
        path,
        folder,
        origins: Origins::of(&text),
        text,
        system,
        classes,
        nodes,
        modules,
        network,
        keys,
        tdma,
        tcp,
        team,
        time,
        when_set,
        access,
        output,
        gui,
        record,
        flows,
        replicas,
        parameters,
        saved: None,
        scheduling,
    };
    check::across(&installation, &lines, slot_lines.as_ref(), reader);
    Some(installation)
}

fn required<'d>(file: &Section<'d>, key: &'static str, right: &str) -> Option<Section<'d>> {
    let item = file.get(key);
    if item.is_none() {
        file.report(format!("section `[{key}]` is missing; add {right}"));
    }
    item?.section(&format!("[{key}]"))
}

/// The tables of an array: every `[[key]]`.
fn sections<'d>(file: &Section<'d>, key: &'static str) -> Vec<Section<'d>> {
    let Some(item) = file.get(key) else { return Vec::new() };
    let header = format!("[[{key}]]");
    let Some(tables) = item.value.get_ref().as_array() else {
        item.report(format!("write `{header}`, with two brackets: there may be several"));
        return Vec::new();
    };
    let section = |value: &'d toml::Spanned<toml::de::DeValue<'d>>| {
        let line = file.reader.line(value.span());
        let Some(table) = value.get_ref().as_table() else {
            file.reader.report(line, format!("`{key}` holds something that is no table; write `{header}`"));
            return None;
        };
        Some(Section::new(file.reader, &header, line, table))
    };
    tables.iter().filter_map(section).collect()
}
