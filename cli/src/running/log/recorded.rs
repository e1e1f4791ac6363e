//! Lines of output from recordings: always the one that arrived first of those that are next in their files.

use super::arguments::{Arguments, Filter};
use super::show::{Show, keep_last};
use crate::look::{parse_name, unknown_module};
use crate::terminal::{Failure, complain};
use rohrpost::Name;
use rohrpost::output::{OutputLine, plain};
use rohrpost::schema::Schema;
use rohrpost::wire::from_bytes;
use rohrpost_builtin::format::Format;
use rohrpost_config::Installation;
use rohrpost_recording::{ChannelInfo, Damage, Info, ReadError, Reader, Selection, info};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Name of the type of lines, in all versions.
const TYPE: &str = "OutputLine";

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let infos = arguments.file.iter().map(|file| info(file)).collect::<Result<Vec<_>, _>>()?;
    let installation = match arguments.target.config() {
        Some(config) => Installation::load(config)?,
        None => recorded_installation(&infos)?,
    };
    let (settings, mut filter) = Filter::read(arguments, &installation, &|text| find(text, &installation))?;
    if let Some((name, level)) = settings.first() {
        let why = "--level NAME=LEVEL sets the level of a module that runs, and a recording has none";
        return Err(format!("{why}; write --level {level} --module {name}").into());
    }
    let since = arguments.since.as_deref().map(rohrpost_config::parse_duration).transpose()?;
    let last_ns = infos.iter().filter_map(|info| info.last_ns).max();
    filter.since_ns = last_ns
        .zip(since)
        .map(|(last_ns, since)| last_ns.saturating_sub(u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)));
    let show = Show { filter, format: Format::new(&installation), arguments };
    if !infos.iter().flat_map(flaws).all(|flaw| show.note(&flaw)) {
        return Ok(ExitCode::SUCCESS);
    }
    let mut lines = RecordedLines::new(&infos);
    let mut chosen = std::iter::from_fn(|| lines.next()).filter(|line| show.filter.passes(line));
    match arguments.last {
        None => drop(chosen.all(|line| show.line(&line))),
        Some(count) => {
            let mut last = VecDeque::new();
            chosen.for_each(|line| keep_last(&mut last, line, count));
            last.iter().all(|line| show.line(line));
        }
    }
    Ok(if lines.is_well() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The configuration that was recorded with the first of these files that has one.
fn recorded_installation(infos: &[Info]) -> Result<Installation, Failure> {
    let texts = infos.iter().flat_map(|info| info.configuration.iter().map(move |text| (info, text)));
    let mut why = String::new();
    for (info, (name, text)) in texts {
        match Installation::parse(text, Path::new(name)) {
            Ok(installation) => return Ok(installation),
            // Saved parameters are no installation. Names and texts are those of others.
            Err(error) => why += &format!("\n{}", plain::line(&format!("{}: {error}", info.path.display()))),
        }
    }
    Err(format!("no recording has a configuration that is read here; name one with --config{why}").into())
}

fn find(text: &str, installation: &Installation) -> Result<Name, Failure> {
    let name = parse_name(installation, text, Vec::new)?.module();
    let is_known = installation.module(name).is_some() || name.class() == installation.classes.tool();
    if is_known { Ok(name) } else { Err(unknown_module(installation, text)) }
}

fn has_lines(channel: &ChannelInfo) -> bool {
    channel.ty.as_ref().is_some_and(|ty| ty.hash() == OutputLine::schema().hash())
}

/// Why lines of a file may be missing.
fn flaws(info: &Info) -> Vec<String> {
    let path = info.path.display();
    let mut flaws = Vec::new();
    if !info.is_closed {
        flaws.push(format!("{path} was not closed: what its recorder had not written yet is missing"));
    }
    let lines = || info.channels.iter().filter(|channel| has_lines(channel));
    flaws.extend(lines().filter(|channel| channel.lost > 0).map(|channel| {
        format!("{path} lacks {} lines: they found no room, or never came to the recorder", channel.lost)
    }));
    if lines().next().is_none() {
        let is_other = |channel: &&ChannelInfo| channel.type_name == TYPE;
        flaws.push(match info.channels.iter().find(is_other) {
            Some(other) => format!(
                "{path}: {} has lines of another version; `rohrpost record export --format json` shows them",
                other.topic
            ),
            None => format!("{path} has no lines of output; `output = true` of [record] records them"),
        });
    }
    flaws
}

struct RecordedLines {
    sources: Vec<LineSource>,
}

/// The lines of one file. It is opened when its time comes, since the files of one recording follow each other.
struct LineSource {
    path: PathBuf,
    /// What has lines in it.
    topics: Vec<String>,
    is_closed: bool,
    reader: Option<Reader>,
    /// The next one, unless the file is still to be opened.
    line: Option<OutputLine>,
    /// When that arrived, or anything at the earliest; none at the end.
    next_ns: Option<u64>,
    is_well: bool,
}

impl RecordedLines {
    fn new(infos: &[Info]) -> Self {
        Self { sources: infos.iter().map(LineSource::new).collect() }
    }

    fn next(&mut self) -> Option<OutputLine> {
        loop {
            let waiting = self.sources.iter_mut().filter(|source| source.next_ns.is_some());
            let first = waiting.min_by_key(|source| source.next_ns)?;
            let line = first.line.take();
            first.advance();
            if line.is_some() {
                return line;
            }
        }
    }

    /// Whether all was readable so far.
    fn is_well(&self) -> bool {
        self.sources.iter().all(|source| source.is_well)
    }
}

impl LineSource {
    fn new(info: &Info) -> Self {
        let lines: Vec<&ChannelInfo> = info.channels.iter().filter(|channel| has_lines(channel)).collect();
        Self {
            path: info.path.clone(),
            topics: lines.iter().map(|channel| channel.topic.as_str().to_owned()).collect(),
            is_closed: info.is_closed,
            reader: None,
            line: None,
            next_ns: lines.iter().filter_map(|channel| channel.first_ns).min(),
            is_well: true,
        }
    }

    /// Goes to the next line. What cannot be read is told, and left out.
    fn advance(&mut self) {
        self.next_ns = None;
        let mut reader = match self.reader.take().map_or_else(|| self.open(), Ok) {
            Ok(reader) => reader,
            Err(error) => return self.complain(&error.to_string()),
        };
        loop {
            let (arrival_ns, line) = match reader.next() {
                Ok(Some((channel, message))) if self.topics.iter().any(|topic| channel.topic == *topic) => {
                    (message.arrival_ns, from_bytes::<OutputLine>(message.data))
                }
                Ok(Some(_)) => continue,
                Ok(None) => return,
                // That was told.
                Err(ReadError::Damaged { what: Damage::Cut, .. }) if !self.is_closed => continue,
                // It goes on behind that.
                Err(error @ ReadError::Damaged { .. }) => {
                    self.complain(&error.to_string());
                    continue;
                }
                Err(error) => return self.complain(&error.to_string()),
            };
            match line {
                Ok(line) => {
                    (self.reader, self.line, self.next_ns) = (Some(reader), Some(line), Some(arrival_ns));
                    return;
                }
                Err(error) => self.complain(&format!("{}: not a line of output: {error}", self.path.display())),
            }
        }
    }

    /// Of a closed file, reads only the chunks with lines.
    fn open(&self) -> Result<Reader, Failure> {
        if self.is_closed {
            let selection = Selection { names: self.topics.clone(), ..Selection::default() };
            return Ok(Reader::select(&self.path, &selection)?);
        }
        Ok(Reader::open(&self.path)?)
    }

    fn complain(&mut self, error: &str) {
        complain(error);
        self.is_well = false;
    }
}
