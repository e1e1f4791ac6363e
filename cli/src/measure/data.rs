//! `rohrpost data`: every item that modules publish, with its rate, its size and its subscribers, read from counters.

use crate::look::observer::Silence;
use crate::look::target::{Running, Target};
use crate::measure::watch::{FlowFigures, Tracks};
use crate::terminal::table::table_of;
use crate::terminal::units::{Stop, bytes, per_second, seconds, short};
use crate::terminal::{Failure, say};
use rohrpost::Name;
use rohrpost::output::plain;
use rohrpost::schema::{DataKind, Description, Type, describe_type};
use rohrpost_launch::survey::{Scope, StreamSurvey, Survey, is_hop};
use rohrpost_mailbox::{FlowInfo, Kind};
use serde::Serialize;
use std::collections::BTreeSet;
use std::process::ExitCode;
use std::time::Duration;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost data                    every item: package or stream, rate, size, age
  rohrpost data laser.0 --types    the items of one module, with their whole types
  rohrpost data --seconds 10       rates of items that come seldom
Rates are those of the observed time; `-`: nothing came. `rohrpost echo` prints the values of an item. The tool reads \
    counters in shared memory, on other nodes through their launches: it subscribes to nothing.")]
pub(crate) struct Arguments {
    /// Module; without it, all that run.
    module: Option<String>,
    #[command(flatten)]
    target: Target,
    /// Watch for this time.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    seconds: f64,
    /// Print types with all their members.
    #[arg(long)]
    types: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// What modules publish.
#[derive(Serialize)]
struct Listing {
    installation: String,
    /// The node that the tool runs on.
    node: String,
    /// The shown nodes that do not answer.
    silent: Vec<Silence>,
    items: Vec<ItemLine>,
    /// Modules with no known items, and why.
    unknown: Vec<UnknownModule>,
}

#[derive(Serialize)]
struct UnknownModule {
    module: String,
    why: String,
}

#[derive(Serialize)]
struct ItemLine {
    node: String,
    module: String,
    item: String,
    number: u16,
    /// How it travels: `package` or `stream`.
    #[serde(rename = "as")]
    carrier: &'static str,
    /// The name of its type, or the whole type if it has no name.
    #[serde(rename = "type")]
    type_name: String,
    /// The whole type; none without a description.
    members: Option<String>,
    /// In the observed time; none if nothing was published in it.
    rate_hz: Option<f64>,
    /// Mean size of a value; none before the first.
    bytes: Option<f64>,
    /// Time since the newest value.
    age_s: Option<f64>,
    subscribers: BTreeSet<String>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let only = arguments.module.as_deref().map(|text| running.module(text)).transpose()?;
    let listing = Observed::new(&running, seconds(arguments.seconds)?)?.listing(only);
    if arguments.json {
        say(serde_json::to_string(&listing)?);
    } else {
        say(in_text(&listing, arguments.types).trim_end());
    }
    Ok(ExitCode::SUCCESS)
}

/// All nodes at the end of the observed time.
struct Observed<'a> {
    running: &'a Running,
    /// What each node sent and published, in the order of the shown nodes.
    tracks: Vec<(String, Tracks)>,
    survey: Survey,
    silent: Vec<Silence>,
}

impl<'a> Observed<'a> {
    fn new(running: &'a Running, long: Duration) -> Result<Self, Failure> {
        let nodes = running.shown();
        let mut tracks: Vec<_> = nodes.iter().map(|node| ((*node).to_owned(), Tracks::new(Duration::MAX))).collect();
        let mut look = || -> Result<_, Failure> {
            let seen = running.look_at(&nodes, Scope::All)?;
            for (seen, (_, tracks)) in seen.iter().zip(&mut tracks) {
                if let Ok(survey) = seen {
                    tracks.look(survey.at_ns, survey.flows.iter().cloned());
                }
            }
            Ok(seen)
        };
        let stop = Stop::new()?;
        look()?;
        // Ctrl-C ends it early: the observation is then shorter.
        stop.within(long);
        let (survey, silent) = running.joined(look()?);
        Ok(Self { running, tracks, survey, silent })
    }

    fn listing(self, only: Option<Name>) -> Listing {
        let (mut items, mut unknown) = (Vec::new(), Vec::new());
        for module in &self.survey.modules {
            let names = [module.name].into_iter().chain(module.aliases.iter().copied());
            for name in names.filter(|name| only.is_none_or(|only| only == *name)) {
                match self.items_of(name, &module.node) {
                    Ok(found) => items.extend(found),
                    // One that need not run, or stands by, has nothing to say here.
                    Err(_) if module.process.is_none() && only.is_none() => {}
                    Err(why) => {
                        unknown.push(UnknownModule { module: self.running.text(name), why: why.to_string() });
                    }
                }
            }
        }
        self.add_beyond(only, &mut items, &mut unknown);
        let Self { running, silent, .. } = self;
        let (installation, node) = (running.installation.name.clone(), running.node_name.clone());
        Listing { installation, node, silent, items, unknown }
    }

    /// Items of modules that the configuration does not have: those at the TCP router, by their own descriptions.
    fn add_beyond(&self, only: Option<Name>, items: &mut Vec<ItemLine>, unknown: &mut Vec<UnknownModule>) {
        let is_shown = |name: &Name| match only {
            Some(only) => only == *name && self.survey.module(only).is_none(),
            None => true,
        };
        for name in self.running.modules_beyond().into_iter().filter(is_shown) {
            match self.running.describe(name) {
                Ok(described) => items.extend(described.data.iter().map(|item| {
                    let line = self.line(name, "beyond", item.number, Some(&described));
                    ItemLine { subscribers: BTreeSet::new(), ..line }
                })),
                Err(why) => unknown.push(UnknownModule { module: self.running.text(name), why: why.to_string() }),
            }
        }
    }

    /// All described items of a module, then those that only its counters or its streams show.
    fn items_of(&self, name: Name, node: &str) -> Result<Vec<ItemLine>, Failure> {
        let described = self.running.describe(name);
        let mut numbers: Vec<u16> = described.iter().flat_map(|it| &it.data).map(|item| item.number).collect();
        let published = self.flows(node).filter(|(flow, _)| flow.is_publication() && flow.from.module() == name);
        let streams = self.survey.streams.iter().filter(|stream| stream.info.id.name == name);
        let others: BTreeSet<u16> = published
            .filter_map(|(flow, _)| data_number(flow))
            .chain(streams.map(|stream| stream.info.id.number))
            .filter(|number| !numbers.contains(number))
            .collect();
        numbers.extend(others);
        match described {
            Err(why) if numbers.is_empty() => Err(why),
            described => {
                let described = described.ok();
                Ok(numbers.into_iter().map(|number| self.line(name, node, number, described.as_ref())).collect())
            }
        }
    }

    fn flows(&self, node: &str) -> impl Iterator<Item = (&FlowInfo, FlowFigures)> {
        self.tracks.iter().filter(move |(name, _)| name == node).flat_map(|(_, tracks)| tracks.figures())
    }

    fn line(&self, name: Name, node: &str, number: u16, described: Option<&Description>) -> ItemLine {
        let item = described.and_then(|it| it.data.iter().find(|item| item.number == number));
        let is_it = |stream: &&StreamSurvey| (stream.info.id.name, stream.info.id.number) == (name, number);
        let streams: Vec<&StreamSurvey> = self.survey.streams.iter().filter(is_it).collect();
        let stream = streams.iter().find(|stream| stream.node == node);
        let is_published =
            |flow: &FlowInfo| flow.is_publication() && flow.from.module() == name && data_number(flow) == Some(number);
        let flow = self.flows(node).find(|(flow, _)| is_published(flow));
        let newest = stream.and_then(|stream| Some((stream, stream.info.newest?)));
        let is_stream = item.map_or(stream.is_some(), |item| item.kind == DataKind::Stream);
        ItemLine {
            node: node.into(),
            module: self.running.text(name),
            item: item.map_or_else(|| format!("number {number}"), |item| item.field.name.clone()),
            number,
            carrier: if is_stream { "stream" } else { "package" },
            type_name: item.map_or_else(|| "-".into(), |item| type_name(&item.field.ty)),
            members: item.map(|item| describe_type(&item.field.ty)),
            rate_hz: flow.as_ref().and_then(|(_, figures)| figures.rate_hz.filter(|_| figures.packages > 0)),
            bytes: match &flow {
                Some((flow, _)) if flow.packages > 0 => Some(flow.bytes as f64 / flow.packages as f64),
                _ => newest.map(|(_, newest)| newest.len_bytes as f64),
            },
            age_s: match &flow {
                Some((flow, figures)) if flow.packages > 0 => Some(figures.since_last_s),
                _ => newest.map(|(stream, newest)| stream.at_ns.saturating_sub(newest.written_ns) as f64 / 1e9),
            },
            subscribers: self.subscribers(name, number, flow.map_or(0, |(flow, _)| flow.last_ns), &streams),
        }
    }

    /// Modules that values of an item went to in the observed time, or went to last, and those that read its stream.
    fn subscribers(&self, name: Name, number: u16, last_ns: u64, streams: &[&StreamSurvey]) -> BTreeSet<String> {
        let process = |to: Name| self.running.text(self.survey.module(to).map_or(to.module(), |module| module.name));
        let is_fed = |(flow, figures): &(&FlowInfo, FlowFigures)| {
            let is_data = flow.to != Name::NONE
                && !self.running.is_collector(flow.to)
                && flow.from.module() == name
                && data_number(flow) == Some(number);
            is_data && (figures.packages > 0 || flow.last_ns >= last_ns)
        };
        let installation = &self.running.installation;
        let of_nodes = self
            .tracks
            .iter()
            .flat_map(|(node, tracks)| tracks.figures().filter(move |(flow, _)| !is_hop(installation, node, flow)));
        let fed = of_nodes.filter(is_fed).map(|(flow, _)| process(flow.to));
        let readers = streams.iter().flat_map(|stream| &stream.info.reader_modules).map(|reader| process(*reader));
        fed.chain(readers).collect()
    }
}

fn data_number(flow: &FlowInfo) -> Option<u16> {
    match flow.kind.kind() {
        Kind::Data(number) => Some(number),
        _ => None,
    }
}

/// A type's name; a type without one, in short.
fn type_name(ty: &Type) -> String {
    match ty {
        Type::Struct(named) => named.name.clone(),
        Type::Enum { name, .. } => name.clone(),
        Type::List(element) => format!("[{}]", type_name(element)),
        Type::Option(some) => format!("{}?", type_name(some)),
        other => describe_type(other),
    }
}

fn in_text(listing: &Listing, has_types: bool) -> String {
    let several = listing.items.iter().any(|item| item.node != listing.items[0].node);
    let heads = ["node", "module", "item", "as", ">rate", ">size", ">age", "subscribers", "type"];
    let first = usize::from(!several);
    let or_none = |text: Option<String>| text.unwrap_or_else(|| "-".into());
    let rows = listing.items.iter().map(|item| {
        let whole = item.members.as_ref().filter(|_| has_types).unwrap_or(&item.type_name);
        let row = [
            item.node.clone(),
            item.module.clone(),
            item.item.clone(),
            item.carrier.into(),
            or_none(item.rate_hz.map(per_second)),
            or_none(item.bytes.map(bytes)),
            or_none(item.age_s.map(short)),
            or_none(item.subscribers.iter().cloned().reduce(|all, one| format!("{all}, {one}"))),
            whole.clone(),
        ];
        row[first..].to_vec()
    });
    let mut text =
        if listing.items.is_empty() { "nothing is published\n".into() } else { table_of(&heads[first..], rows) };
    let unknown = listing.unknown.iter().map(|it| format!("{}: {}", it.module, plain::line(&it.why)));
    for line in unknown.chain(listing.silent.iter().map(Silence::text)) {
        text += &format!("\n{line}");
    }
    text
}
