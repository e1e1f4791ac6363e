//! `rohrpost graph`: senders, receivers, content and rates of packages, read from the senders' counters; and readers of
//! streams.

mod parts;
mod svg;

use crate::look::observer::Silence;
use crate::look::target::{Running, Target};
use crate::measure::watch::Tracks;
use crate::nodes::vocabulary::{Vocabulary, answered};
use crate::terminal::table::table;
use crate::terminal::units::{Stop, bytes, seconds};
use crate::terminal::whole_file::write_whole;
use crate::terminal::{Failure, say};
use parts::{Carries, Edge, Graph, Module, to_dot};
use rohrpost::Name;
use rohrpost_launch::survey::{Scope, StreamSurvey, Survey, is_hop};
use rohrpost_mailbox::{FlowInfo, Kind, StreamId};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost graph                             a table: sender, receiver, content, rate
  rohrpost graph --svg -o graph.svg          a drawing
  rohrpost graph --dot | dot -Tpdf > graph.pdf
Rates are those of the observed time. All nodes are shown; --node shows one. A drawing leaves out replies and the \
    calls that every module has (such as the renewal of subscriptions); --all draws them, too. The tool reads \
    counters in shared memory, on other nodes through their launches: it sends nothing to modules.")]
pub(crate) struct Arguments {
    #[command(flatten)]
    target: Target,
    /// Watch for this time.
    #[arg(long, default_value_t = 2.0, value_name = "SECONDS")]
    seconds: f64,
    /// Print the graph for Graphviz.
    #[arg(long, conflicts_with_all = ["svg", "json"])]
    dot: bool,
    /// Draw the graph as SVG.
    #[arg(long, conflicts_with = "json")]
    svg: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Draw replies and calls that every module has, too; table and JSON always have them.
    #[arg(long)]
    all: bool,
    /// Show also flows that were silent meanwhile.
    #[arg(long)]
    silent: bool,
    /// Write the output into this file.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let long = seconds(arguments.seconds)?;
    if long.is_zero() {
        return Err("in 0 s nothing is sent; try --seconds 2".into());
    }
    let graph = Graph::new(&running, long, arguments.silent)?;
    let text = if arguments.json {
        serde_json::to_string(&graph)?
    } else if arguments.dot {
        to_dot(&graph, arguments.all)
    } else if arguments.svg {
        svg::write(&graph, arguments.all)
    } else {
        graph.silent.iter().fold(in_text(&graph), |text, silence| format!("{text}\n{}", silence.text()))
    };
    match &arguments.output {
        Some(file) => write_whole(file, &(text + "\n"))?,
        None => {
            say(text);
        }
    }
    Ok(ExitCode::SUCCESS)
}

impl Graph {
    fn new(running: &Running, long: Duration, silent: bool) -> Result<Self, Failure> {
        // Each node has its own clock. The window is as long as the observation.
        let nodes = running.shown();
        let mut tracks: Vec<Tracks> = nodes.iter().map(|_| Tracks::new(Duration::MAX)).collect();
        let stop = Stop::new()?;
        let before = look(running, &nodes, &mut tracks)?;
        let began = Instant::now();
        // Ctrl-C ends it early: the observation is then shorter.
        stop.within(long);
        let seen = look(running, &nodes, &mut tracks)?;
        let interval_s = began.elapsed().as_secs_f64();
        let (survey, away) = running.joined(seen);
        let mut names = Names { running, survey: &survey, vocabulary: Vocabulary::default() };
        let mut edges: Vec<Edge> = Vec::new();
        // Packages that a router delivers for an observed node are counted there.
        let is_seen = |node: &str| nodes.contains(&node) && away.iter().all(|silence| silence.node != node);
        let counts = |node: &str, flow: &FlowInfo| {
            !is_hop(&running.installation, node, flow) || !is_seen(running.node_of(flow.from))
        };
        let all =
            nodes.iter().zip(&tracks).flat_map(|(node, tracks)| tracks.figures().map(move |found| (*node, found)));
        for (_, (flow, figures)) in all.filter(|(node, (flow, _))| counts(node, flow)) {
            if !silent && figures.packages == 0 && figures.refused == 0 {
                continue;
            }
            let (carries, what) = names.what(flow);
            let edge = Edge {
                from: names.process(flow.from),
                to: names.process(flow.to),
                carries,
                what,
                packages: figures.packages,
                packages_per_s: figures.rate_hz.unwrap_or(figures.packages as f64 / interval_s),
                bytes_per_s: figures.bytes_per_s().unwrap_or(figures.bytes as f64 / interval_s),
                refused: figures.refused,
            };
            let same = |known: &&mut Edge| {
                (&known.from, &known.to, known.carries, &known.what) == (&edge.from, &edge.to, edge.carries, &edge.what)
            };
            match edges.iter_mut().find(same) {
                Some(known) => known.add(&edge),
                None => edges.push(edge),
            }
        }
        edges.extend(stream_edges(&mut names, &before, silent, interval_s));
        edges.sort_by(|a, b| (&a.from, &a.to, a.carries, &a.what).cmp(&(&b.from, &b.to, b.carries, &b.what)));
        let classes = &running.installation.classes;
        let mut modules: Vec<Module> = survey
            .modules
            .iter()
            .map(|module| Module {
                module: classes.format(module.name),
                node: module.node.clone(),
                aliases: module.aliases.iter().map(|alias| classes.format(*alias)).collect(),
                state: module.standing().word().into(),
                priority: module.name.class().0,
                is_left_out: module.is_left_out(&running.installation),
            })
            .collect();
        // Tools send, too, and are in no configuration.
        for name in edges.iter().flat_map(|edge| [&edge.from, &edge.to]) {
            if modules.iter().all(|module| module.module != *name) {
                let found = running.module(name).ok();
                let priority = found.map_or(0, |module| module.class().0);
                let node = found.map_or(&*running.node_name, |module| running.node_of(module)).into();
                let (aliases, state, is_left_out) = (Vec::new(), "tool".into(), false);
                modules.push(Module { module: name.clone(), node, aliases, state, priority, is_left_out });
            }
        }
        let installation = running.installation.name.clone();
        let nodes = nodes.into_iter().map(Into::into).collect();
        Ok(Self { installation, node: running.node_name.clone(), nodes, silent: away, interval_s, modules, edges })
    }
}

/// From writers of streams to their readers. Nobody sends a record: a reader looks at it where it was written.
fn stream_edges(names: &mut Names<'_>, before: &NodeReports, silent: bool, interval_s: f64) -> Vec<Edge> {
    let mut edges = Vec::new();
    let survey = names.survey;
    for StreamSurvey { node, info, .. } in &survey.streams {
        let earlier = before.iter().flatten().flat_map(|survey| &survey.streams);
        let earlier = earlier.filter(|known| (&known.node, known.info.id) == (node, info.id)).map(|known| &known.info);
        // Of a ring that was made anew, all.
        let records =
            info.written - earlier.map(|known| known.written).next().filter(|n| *n <= info.written).unwrap_or(0);
        if records == 0 && !silent {
            continue;
        }
        let per_s = records as f64 / interval_s;
        let newest_bytes = info.newest.map_or(0, |newest| newest.len_bytes);
        let what = names.stream(info.id);
        edges.extend(info.reader_modules.iter().map(|reader| Edge {
            from: names.process(info.id.name),
            to: names.process(*reader),
            carries: Carries::Stream,
            what: what.clone(),
            packages: records,
            packages_per_s: per_s,
            bytes_per_s: per_s * newest_bytes as f64,
            refused: info.refused,
        }));
    }
    edges
}

/// What nodes report, or why they do not.
type NodeReports = Vec<Result<Survey, Silence>>;

/// Observes all nodes, and records what each module sends.
fn look(running: &Running, nodes: &[&str], tracks: &mut [Tracks]) -> Result<NodeReports, Failure> {
    let seen = running.look_at(nodes, Scope::All)?;
    for (seen, tracks) in seen.iter().zip(tracks) {
        if let Ok(survey) = seen {
            tracks.look(survey.at_ns, survey.flows.iter().filter(|flow| flow.to != Name::NONE).cloned());
        }
    }
    Ok(seen)
}

/// Resolves names and numbers.
struct Names<'a> {
    running: &'a Running,
    survey: &'a Survey,
    vocabulary: Vocabulary,
}

impl Names<'_> {
    /// The module that has this name or alias.
    fn process(&self, name: Name) -> String {
        let name = self.survey.module(name).map_or(name.module(), |module| module.name);
        self.running.text(name)
    }

    /// A stream by its name, or by its number.
    fn stream(&mut self, id: StreamId) -> String {
        let ask = |module| self.running.describe(module).ok();
        let named = self.vocabulary.word(Kind::Data(id.number), id.name, id.name, ask);
        named.unwrap_or_else(|| format!("stream {}", id.number))
    }

    fn what(&mut self, flow: &FlowInfo) -> (Carries, String) {
        let kind = flow.kind.kind();
        if matches!(kind, Kind::Data(_)) && self.running.is_collector(flow.to) {
            return (Carries::Output, "lines".into());
        }
        let ask = |module| self.running.describe(module).ok();
        let word = self.vocabulary.word(kind, flow.from, flow.to, ask);
        let unknown = |number| format!("number {number}");
        let (carries, unnamed) = match kind {
            Kind::Command(number) if number < rohrpost::common::FIRST_OWN => (Carries::Common, unknown(number)),
            Kind::Command(number) => (Carries::Command, unknown(number)),
            Kind::Reply(number) => (Carries::Reply, answered(&unknown(number))),
            Kind::Data(number) => (Carries::Data, unknown(number)),
            Kind::None => (Carries::Common, "refused before it had a type".into()),
        };
        (carries, word.unwrap_or(unnamed))
    }
}

fn in_text(graph: &Graph) -> String {
    if graph.edges.is_empty() {
        return format!("no package was sent within {:.1} s; --silent shows earlier senders", graph.interval_s);
    }
    let rows = graph.edges.iter().map(|edge| {
        let kind = match edge.carries {
            Carries::Data => "data",
            Carries::Stream => "stream",
            Carries::Command | Carries::Common => "command",
            Carries::Reply => "reply",
            Carries::Output => "output",
        };
        [
            edge.from.clone(),
            edge.to.clone(),
            kind.into(),
            edge.what.clone(),
            edge.packages.to_string(),
            edge.rate(),
            format!("{}/s", bytes(edge.bytes_per_s)),
            edge.refused.to_string(),
        ]
    });
    table(["from", "to", "kind", "what", ">packages", ">rate", ">bytes", ">refused"], rows).trim_end().to_owned()
}
