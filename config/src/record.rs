//! What is recorded, and how its files are written: the section `[record]`.

use crate::classes::ClassTable;
use crate::directory::Directory;
use crate::exact::{self, ExactModule};
use crate::log_control;
use crate::module::{Lines, Module, RECORDER};
use crate::output::Level;
use crate::reader::{Item, Section};
use rohrpost_mailbox::Name;
use std::fmt;
use std::net::SocketAddr;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Name of the class of the module that collects lines of output.
const OUTPUT: &str = "output";
/// A smaller file would hold little but what each begins with.
const ROTATE_SIZE: RangeInclusive<u64> = 1 << 20..=1 << 40;
/// Of everything, one in so many at the least.
const EVERY_MAX: u32 = 1_000_000;
const RATE_HZ: RangeInclusive<f64> = 0.001..=1000.0;
/// How much is drawn of each item, unless the file says it.
const DRAWN_HZ: f64 = 10.0;

/// The section `[record]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Where files are, from the configuration file's folder.
    pub directory: PathBuf,
    /// Streams, which are read in place.
    pub streams: Vec<RecordedItems>,
    /// Data, which are subscribed to.
    pub data: Vec<RecordedItems>,
    /// Lines of output from this level on; none: no line.
    pub output: Option<Level>,
    /// At most so many values a second of each item are in the files once more, as other programs draw them; none: not
    /// one.
    pub drawn: Option<f64>,
    /// Modules of which a journal is recorded, so that they can be replayed exactly.
    pub exact: Vec<ExactModule>,
    /// A file gets no longer.
    pub rotate_size: u64,
    /// Nor older.
    pub rotate_after: Duration,
    /// What stays free on the disk.
    pub leave_free: u64,
    /// A message waits no longer in memory: so much is lost if the recorder is killed.
    pub flush: Duration,
    /// How often the disk is told to keep what it has: so much more is lost with the power.
    pub sync: Duration,
    /// Where log control listens for connections; none: nowhere.
    pub control: Option<SocketAddr>,
    /// Line of the section.
    pub line: usize,
}

/// One entry of `streams` or `data`: one item of a module, all of a module, or all of all modules.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedItems {
    /// Module or alias; none: each.
    pub from: Option<Name>,
    /// Name of the item in its interface; none: each.
    pub item: Option<String>,
    /// Which of its values.
    pub sampling: Sampling,
    /// Line in the file.
    pub line: usize,
}

/// Which values of an item are recorded.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Sampling {
    /// Each.
    #[default]
    Each,
    /// One in so many.
    Every(u32),
    /// At most so many a second.
    Rate(f64),
}

impl fmt::Display for Sampling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Each => f.write_str("each"),
            Self::Every(every) => write!(f, "one in {every}"),
            Self::Rate(rate_hz) => write!(f, "at most {rate_hz} a second"),
        }
    }
}

impl Recording {
    /// None without the section, or without a place for the files, which is reported then.
    pub(crate) fn read(section: Option<Section<'_>>, directory: &Directory<'_>, folder: &Path) -> Option<Self> {
        let section = section?;
        let place = section.required("directory", "directory = \"recordings\"");
        let place = place.and_then(|item| item.text("recordings"));
        let streams = RecordedItems::read_all(&section, "streams", "[\"camera.0/image\"]", directory);
        let data = RecordedItems::read_all(&section, "data", "[\"mapper.0/pose\"]", directory);
        for stream in streams.iter().filter(|stream| stream.item.is_some()) {
            if let Some(twice) = data.iter().find(|data| (data.from, &data.item) == (stream.from, &stream.item)) {
                let text = twice.text(directory.classes);
                section.reader.report(
                    twice.line,
                    format!(
                        "[record]: `{text}` is in `streams`, line {}, already; it is recorded once, drop one",
                        stream.line
                    ),
                );
            }
        }
        let output = section.or("output", None, output);
        let drawn = section.or("drawn", None, drawn);
        let exact = exact::read(&section, directory);
        let rotate_size = section.or("rotate-size", 1 << 30, |item| item.size(ROTATE_SIZE, "1 GiB"));
        let (second, hour) = (Duration::from_secs(1), Duration::from_secs(3600));
        let rotate_after = section.or("rotate-after", hour, |item| item.duration_of_at_least(second, "1 h"));
        let leave_free = section.or("leave-free", 256 << 20, |item| item.size(0..=1 << 50, "256 MiB"));
        let flush = section.or("flush", Duration::from_millis(500), |item| item.duration_above_zero("500 ms"));
        let sync = section.or("sync", Duration::from_secs(2), |item| item.duration_above_zero("2 s"));
        let control = log_control::read(&section);
        let line = section.line;
        section.finish();
        Some(Self {
            directory: folder.join(place?),
            streams,
            data,
            output,
            drawn,
            exact,
            rotate_size,
            rotate_after,
            leave_free,
            flush,
            sync,
            control,
            line,
        })
    }

    /// Note of `check`, and of each start of the recorder, if log control takes commands from other computers.
    pub fn control_note(&self) -> Option<String> {
        log_control::note(self.control?)
    }

    /// Whether this module has a journal, which is recorded.
    pub fn is_exact(&self, module: Name) -> bool {
        self.exact.iter().any(|exact| exact.name == module)
    }

    /// The entry of `streams` that counts for a stream; none: it is not recorded.
    pub fn stream(&self, from: Name, item: &str) -> Option<&RecordedItems> {
        nearest_entry(&self.streams, from, item)
    }

    /// The entry of `streams` by which a stream is read in place; none also if one of `data` names it more exactly.
    pub fn in_place(&self, from: Name, stream: &str) -> Option<&RecordedItems> {
        let entry = self.stream(from, stream)?;
        // `*` of `data` is not meant for streams.
        let data = self.datum(from, stream).filter(|data| data.item.is_some());
        data.is_none_or(|data| data.exactness() <= entry.exactness()).then_some(entry)
    }

    /// The entry of `data` that counts for data; none: they are not recorded.
    pub fn datum(&self, from: Name, item: &str) -> Option<&RecordedItems> {
        nearest_entry(&self.data, from, item)
    }
}

/// What names an item itself goes before what names its module, and that before all.
fn nearest_entry<'e>(entries: &'e [RecordedItems], from: Name, item: &str) -> Option<&'e RecordedItems> {
    let has = |entry: &&RecordedItems| {
        entry.from.is_none_or(|name| name == from) && entry.item.as_ref().is_none_or(|name| name == item)
    };
    entries.iter().filter(has).max_by_key(|entry| entry.exactness())
}

fn output(item: &Item<'_>) -> Option<Option<Level>> {
    let value = item.value.get_ref();
    match (value.as_bool(), value.as_str().and_then(Level::from_word)) {
        (Some(true), _) => Some(Some(Level::Trace)),
        (Some(false), _) => Some(None),
        (None, Some(level)) => Some(Some(level)),
        (None, None) => {
            item.wrong("true, false, or the least important level: \"error\", \"warn\", \"info\", \"debug\", \"trace\"")
        }
    }
}

fn drawn(item: &Item<'_>) -> Option<Option<f64>> {
    match item.value.get_ref().as_bool() {
        Some(is_drawn) => Some(is_drawn.then_some(DRAWN_HZ)),
        None => item.number(RATE_HZ, "10.0").map(Some),
    }
}

impl RecordedItems {
    /// How exactly it names an item: the item itself goes before its module, and that before all. The greater one
    /// counts.
    pub fn exactness(&self) -> (bool, bool) {
        (self.item.is_some(), self.from.is_some())
    }

    /// As the file writes it.
    pub fn text(&self, classes: &ClassTable) -> String {
        let item = self.item.as_deref().unwrap_or("*");
        self.from.map_or_else(|| item.to_owned(), |from| format!("{}/{item}", classes.format(from)))
    }

    fn read_all(section: &Section<'_>, key: &'static str, example: &str, directory: &Directory<'_>) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for item in &section.or(key, Vec::new(), |item| item.list(example)) {
            let Some(read) = Self::read(item, "[record]", directory) else { continue };
            if let Some(first) = all.iter().find(|first| (first.from, &first.item) == (read.from, &read.item)) {
                let text = read.text(directory.classes);
                item.report(format!("`{text}` is in line {} of `{key}` already; drop one", first.line));
            }
            all.push(read);
        }
        all
    }

    /// `section`: where it stands.
    pub(crate) fn read(item: &Item<'_>, section: &str, directory: &Directory<'_>) -> Option<Self> {
        let (text, sampling) = match item.is_table() {
            true => sampled(item, section)?,
            false => (item.text_of_list("laser.0/scan")?, Sampling::Each),
        };
        let line = item.line;
        if text == "*" {
            return Some(Self { from: None, item: None, sampling, line });
        }
        let Some((module, name)) = text.split_once('/') else {
            item.report(format!(
                "`{text}` names no item; write `laser.0/scan` for one, `laser.0/*` for all of a module, or `*` for all"
            ));
            return None;
        };
        let from = directory.module(item, module);
        let is_name = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if name != "*" && (name.is_empty() || !is_name) {
            item.report(format!(
                "`{text}`: `{name}` is no name of an item; write the name that follows `fn` in the interface, or `*`"
            ));
            return None;
        }
        Some(Self { from: Some(from?), item: (name != "*").then(|| name.into()), sampling, line })
    }
}

/// A table of a name, and which of its values.
fn sampled<'d>(item: &Item<'d>, section: &str) -> Option<(&'d str, Sampling)> {
    let section = item.section(section)?;
    let name = section.required("name", "name = \"laser.0/scan\"").and_then(|item| item.text("laser.0/scan"));
    let every = section.get("every");
    let rate = section.get("rate");
    let sampling = match (&every, &rate) {
        (Some(every), None) => every.whole(1..=EVERY_MAX, 10).map(Sampling::Every),
        (None, Some(rate)) => rate.number(RATE_HZ, "2.0").map(Sampling::Rate),
        (None, None) => {
            item.report("write which values: `every = 10`, or `rate = 2.0`; for each of them, write the name alone");
            None
        }
        (Some(_), Some(rate)) => {
            rate.report("`every` and `rate` are both given; values are chosen by one of them, drop the other");
            None
        }
    };
    section.finish();
    // A wrong choice has its own message, and is no reason to doubt the name.
    Some((name?, sampling.unwrap_or_default()))
}

/// Finds the module that records, and adds to its `calls` what it subscribes to.
pub(crate) fn connect(
    (recording, has_replica): (Option<&Recording>, HasReplica<'_>),
    file: &Section<'_>,
    classes: &ClassTable,
    modules: &mut [Module],
    lines: &mut [Lines],
) {
    let mut all = (0..modules.len()).filter(|at| modules[*at].is_recorder());
    let (first, second) = (all.next(), all.next());
    if let (Some(first), Some(second)) = (first, second) {
        let (name, line) = (classes.format(modules[second].name), modules[first].line);
        file.reader.report(
            modules[second].line,
            format!("module `{name}`: a module in line {line} records already, and there is one [record]; drop one"),
        );
    }
    match (first, recording) {
        (Some(at), Some(recording)) => {
            let (calls, mut wrong) = connections((recording, has_replica), classes, modules, &modules[at]);
            wrong.extend(exact::mistakes(&recording.exact, classes, modules, &modules[at]));
            wrong.into_iter().for_each(|(line, message)| file.reader.report(line, format!("[record]: {message}")));
            for (name, line) in calls {
                if !modules[at].calls.contains(&name) {
                    modules[at].calls.push(name);
                    lines[at].calls.push(line);
                }
            }
        }
        (Some(at), None) if file.get("record").is_none() => file.reader.report(
            modules[at].line,
            format!(
                "module `{}` records nothing, as there is no [record]; add one, with `directory = \"recordings\"` and \
                 `data = [\"*\"]`",
                classes.format(modules[at].name)
            ),
        ),
        (None, Some(recording)) => file.reader.report(
            recording.line,
            format!(
                "[record]: no module records; add `[[module]]` with `name = \"{RECORDER}.0\"` and \
                 `builtin = \"{RECORDER}\"`"
            ),
        ),
        _ => {}
    }
}

/// Whether a node has a replica of the streams of an entry.
type HasReplica<'f> = &'f dyn Fn(&RecordedItems, &str) -> bool;

/// Names that the recorder subscribes to, and mistakes, each with its line.
type Connections = (Vec<(Name, usize)>, Vec<(usize, String)>);

fn connections(
    (recording, has_replica): (&Recording, HasReplica<'_>),
    classes: &ClassTable,
    modules: &[Module],
    own: &Module,
) -> Connections {
    let (mut calls, mut wrong) = (Vec::new(), Vec::new());
    let host = |name: Name| modules.iter().find(|module| module.names().any(|known| known == name));
    let collector = modules.iter().flat_map(Module::names).find(|name| classes.name(name.class()) == Some(OUTPUT));
    for stream in &recording.streams {
        let Some(module) = stream.from.and_then(host).filter(|module| module.node != own.node) else { continue };
        if has_replica(stream, &own.node) {
            continue;
        }
        let (text, node) = (stream.text(classes), &module.node);
        wrong.push((
            stream.line,
            format!(
                "`{text}` is a stream on node {node}, and `{}` records on node {}: streams are read on their own node; \
                 name it in `data` if its records fit a package, give node {} a [[replica]] of it, or record on node \
                 {node}",
                classes.format(own.name),
                own.node,
                own.node
            ),
        ));
    }
    for entry in recording.streams.iter().chain(&recording.data) {
        if entry.from.is_some_and(|from| own.names().any(|name| name == from)) {
            wrong.push((entry.line, format!("`{}` would record itself; drop the entry", entry.text(classes))));
        }
        if entry.from.is_some() && entry.from == collector && entry.item.as_deref() == Some("line") {
            wrong.push((
                entry.line,
                format!("`{}` are the lines of output; write `output = true` instead", entry.text(classes)),
            ));
        }
    }
    for data in &recording.data {
        match data.from {
            Some(from) => calls.push((from, data.line)),
            None => {
                let others = modules.iter().filter(|module| module.is_in_file() && module.name != own.name);
                calls.extend(others.flat_map(Module::names).map(|name| (name, data.line)));
            }
        }
    }
    match (recording.output, collector) {
        (Some(_), Some(collector)) => calls.push((collector, recording.line)),
        (Some(_), None) => wrong.push((
            recording.line,
            "`output` wants lines, and no module collects them; add `[[module]]` with `name = \"output.0\"` and \
             `builtin = \"output\"`, or drop `output`"
                .into(),
        )),
        (None, _) => {}
    }
    (calls, wrong)
}
