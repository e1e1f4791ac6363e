//! `rohrpost replay`: a node of its own in which a recording is played in the place of the modules that were recorded.
//!
//! ```text
//! files ─▶ recorded: modules, configuration ─▶ configuration: of one node ─▶ launch
//!                                                                              ├─ replay.0 (player), stands in for all
//!                                                                              └─ modules that run: --run
//! ```

#[cfg(test)]
mod asking_tests;
mod configuration;
mod others;
mod permitted;
mod recorded;
mod session;
mod settings;
mod sizes;
mod tables;

use crate::begin::check;
use crate::begin::demo::{Folder, drawing, drawn, is_built_in, write_map};
use crate::exact::{self, ExactArguments, ExactProgram};
use crate::launch::end;
use crate::quota::check_shared;
use crate::record::PartArguments;
use crate::terminal::speech::Speech;
use crate::terminal::{Failure, complain, say};
use configuration::{NODE, PlayedModules, ReplayWish, saved_of};
use others::IntoStream;
use permitted::ReplayDrawing;
use recorded::RecordedFiles;
use rohrpost::output::plain;
use rohrpost::schema::Description;
use rohrpost::wire::append;
use rohrpost_config::{Installation, StreamSpec, resolved_text};
use rohrpost_launch::{Launch, events};
use rohrpost_recorder::player::RATE_MAX;
use session::ReplaySession;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::SystemTime;

/// The name of the configuration that is made.
const CONFIG: &str = "replay.toml";
/// The file with answers.
const ANSWERS: &str = "answers";
/// The file that the GUI writes.
const DRAWING: &str = "rohrpost-replay.rrd";
/// The largest rate: that of a node's time.
const RATES: std::ops::RangeInclusive<f64> = 0.001..=RATE_MAX;

#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("runs").args(["exact", "run"]))]
#[command(after_help = "Examples:
  rohrpost replay recordings/main-*.mcap                  all that was recorded, at its speed
  rohrpost replay main-0001.mcap --run mapper.0 --rate 5  a fresh mapper draws the map anew
  rohrpost replay main-0001.mcap --from +10s --until +20s --loop
  rohrpost replay main-0001.mcap --names laser.0 odometry.0/odometry --paused
  rohrpost replay rosbag2_0.mcap --into /scan=laser.0/scan /imu=imu.0/raw
  rohrpost replay --exact main-0001.mcap                  says which programs that would run, and runs none
  rohrpost replay --exact main-0001.mcap pilot.0 --program target/debug/pilot -- --verbose
  rohrpost replay --exact main-0001.mcap --run-recorded   all modules that have a journal there, as recorded
In another terminal, as with any node:
  rohrpost call replay.0 pause          also resume, step, step_by 0.5, seek 12.5
  rohrpost echo replay.0 state
  rohrpost stream read laser.0 scan --next 10
It is a node of its own, called `replay`; a command to a module that is played gets the answer that its journal has,
or a fault. With --exact no node runs.")]
pub(crate) struct Arguments {
    /// Recordings, played one after the other. Those of several recorders are to be merged first. With --exact one
    /// recording, and modules; all that have a journal, if none is named.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Another configuration than the recorded one. With --exact it is compared with what would run.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// A module that runs as it was configured, and is not played; can be given several times. If the configuration is
    /// the recorded one, programs and the recorder need --run-recorded, too.
    #[arg(long, value_name = "NAME")]
    run: Vec<String>,
    /// Run the commands that are recorded, as you: with --run and with --exact. Anybody may have written them.
    #[arg(long, requires = "runs", conflicts_with_all = ["config", "program", "list"])]
    run_recorded: bool,
    /// Names (laser.0) or topics (laser.0/scan) to play; all, if none is named.
    #[arg(long, num_args = 1.., value_name = "NAME")]
    names: Vec<String>,
    /// Of a recording of another program, such as rosbag2: play the messages of TOPIC as bytes, into a stream of a
    /// module; can be given several times.
    #[arg(long, num_args = 1.., value_name = "TOPIC=MODULE/STREAM", conflicts_with = "names")]
    into: Vec<IntoStream>,
    #[command(flatten)]
    part: PartArguments,
    /// Times the speed at which it was recorded.
    #[arg(long, default_value_t = 1.0, value_name = "X", value_parser = parse_rate)]
    rate: f64,
    /// Begin anew at the end.
    #[arg(long = "loop")]
    repeats: bool,
    /// Begin paused.
    #[arg(long)]
    paused: bool,
    /// Show it live in the Rerun viewer, if one is installed, instead of writing a file.
    #[arg(long)]
    viewer: bool,
    /// Leave the GUI out.
    #[arg(long, conflicts_with = "viewer")]
    no_gui: bool,
    /// No live table, only events.
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    repeated: RepeatArguments,
}

/// What belongs to exact replay alone.
#[derive(clap::Args)]
struct RepeatArguments {
    /// Run the programs of modules again with what they were called with and told, and compare all that they do.
    #[arg(long, conflicts_with_all = [
        "run", "names", "into", "from", "until", "rate", "repeats", "paused", "viewer", "no_gui", "quiet",
    ])]
    exact: bool,
    /// With --exact: this program runs, with the arguments behind `--`, and no word of the recorded command. It is
    /// given the settings that were recorded: which files and devices they name, `record info --json` shows; what of
    /// them is otherwise in --config is told before it runs.
    #[arg(long, value_name = "PATH", requires = "exact", conflicts_with = "list")]
    program: Option<PathBuf>,
    /// The arguments of --program.
    #[arg(last = true, value_name = "ARGUMENT", requires = "program")]
    arguments: Vec<OsString>,
    /// With --exact: folder that stands for that of the configuration; files that its settings name are there.
    #[arg(long, value_name = "FOLDER", requires = "exact")]
    folder: Option<PathBuf>,
    /// With --exact: print what is in the journals instead, entry by entry.
    #[arg(long, requires = "exact", conflicts_with_all = ["json", "config"])]
    list: bool,
    /// With --exact: one JSON object a run of a module.
    #[arg(long, requires = "exact")]
    json: bool,
}

fn parse_rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| RATES.contains(rate));
    rate.ok_or_else(|| format!("write {} to {}", RATES.start(), RATES.end()))
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    if arguments.repeated.exact {
        return repeat(arguments);
    }
    let recorded = RecordedFiles::read(&arguments.files)?;
    others::check(&recorded, &arguments.into)?;
    let folder = Folder::new()?;
    let made = installation(arguments, &recorded, folder.path())?;
    for topic in &made.played.left_out {
        let topic = plain::line(topic);
        say(format_args!("{topic} is not played: its module is not described, or with another type"));
    }
    let installation = Arc::new(made.installation);
    let (drawing, begun) = (drawing(&installation), SystemTime::now());
    let speech = Speech::begin()?;
    let resolved = crate::look::resolved::of_node(&installation, NODE);
    let mut launch = Launch::begin(installation, NODE, std::env::current_exe()?, events()?, &resolved)?;
    let summary = ReplaySession::new(&launch, &made.player, &made.played).and_then(|mut session| {
        session.watch(&mut launch, &speech, arguments.quiet, arguments.paused)?;
        session.summary(&mut launch)
    });
    let code = end(launch, &speech);
    speech.settle();
    say(summary?.trim_end());
    drawn(drawing, begun);
    Ok(code)
}

/// Exact replay.
fn repeat(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let RepeatArguments { program, arguments: words, folder, list, json, .. } = &arguments.repeated;
    let (file, modules) = arguments.files.split_first().ok_or("name a recording")?;
    exact::run(&ExactArguments {
        file: file.clone(),
        modules: modules.iter().map(|module| module.display().to_string()).collect(),
        program: match program {
            Some(program) => Some(ExactProgram::Given { program: program.clone(), arguments: words.clone() }),
            None => arguments.run_recorded.then_some(ExactProgram::Recorded),
        },
        config: arguments.config.clone(),
        folder: folder.clone(),
        list: *list,
        json: *json,
    })
}

/// What is launched.
struct MadeReplay {
    installation: Installation,
    /// The player's name.
    player: String,
    played: PlayedModules,
}

/// Writes the configuration and what belongs to it into a folder.
fn installation(arguments: &Arguments, recorded: &RecordedFiles, folder: &Path) -> Result<MadeReplay, Failure> {
    let here = std::env::current_dir()?;
    let (source, base) = source(arguments, recorded, &here, folder)?;
    if let Some(odd) = [&here, &base].into_iter().find(|folder| folder.to_str().is_none()) {
        let shown = odd.display();
        return Err(
            format!("{shown}: its name is no UTF-8 text, as configurations are; replay in another folder").into()
        );
    }
    let saved = folder.join("parameters.toml");
    let saved_text = match (&source.parameters, &arguments.config) {
        (None, _) => None,
        (Some(path), Some(_)) => std::fs::read_to_string(path).ok(),
        (Some(path), None) => {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            recorded.text(&name).map(str::to_owned)
        }
    };
    let drawing = match (arguments.no_gui, arguments.viewer) {
        (true, _) => ReplayDrawing::Nothing,
        (false, true) => ReplayDrawing::Window,
        (false, false) => ReplayDrawing::File(here.join(DRAWING)),
    };
    let wish = ReplayWish {
        installation: &source,
        folder: &base,
        recorded,
        runs: &arguments.run,
        is_own: arguments.config.is_some() || arguments.run_recorded,
        names: &arguments.names,
        drawing,
        saved: saved_text.is_some().then_some(&*saved),
    };
    let played = match recorded.are_others {
        true => others::played(recorded, &arguments.into, &source, &wish.running_names()?)?,
        false => wish.played()?,
    };
    if let Some(text) = saved_text {
        let runs = |name: &str| arguments.run.iter().any(|run| run == name);
        std::fs::write(&saved, saved_of(&text, runs)?)?;
    }
    let course = (&arguments.part, arguments.rate, arguments.repeats);
    let mut settings = settings::made(course, recorded, &played, folder)?;
    match noted_answers(recorded, &source, &played, folder) {
        Ok(None) => {}
        Ok(Some(answers)) => {
            std::fs::write(folder.join(ANSWERS), answers)?;
            settings.answers = Some(ANSWERS.into());
        }
        Err(error) => complain(format_args!("commands are not answered, as the journals cannot be read: {error}")),
    }
    let (text, player) = wish.text(&played, toml::Table::try_from(settings)?)?;
    let path = folder.join(CONFIG);
    std::fs::write(&path, text)?;
    let named =
        |errors| format!("the recorded configuration does not fit a replay with these modules:\n{}", told(&errors));
    let mut installation = check::load(&path).map_err(named)?;
    installation.shown = CONFIG.into();
    // One that the user names is the user's own word, and so are the streams that are named with --into.
    if arguments.config.is_none() && !recorded.are_others {
        let meant = |error| format!("{error}; if that is meant, name a configuration of your own: --config FILE");
        check_shared(installation.memory_on(NODE).saturating_add(streams_memory(&installation, &played)))
            .map_err(meant)?;
    }
    Ok(MadeReplay { installation, player, played })
}

/// Bytes of the streams that the player makes besides those in its configuration: one for each that a played module
/// describes, of the size that the player has for streams of that name.
fn streams_memory(installation: &Installation, played: &PlayedModules) -> u64 {
    let players = || installation.modules.iter().filter(|module| module.node == NODE);
    let sizes = |name: &str| players().filter_map(|module| module.streams.get(name)).map(StreamSpec::memory).max();
    let names = played.described.values().flat_map(Description::streams).map(|item| &item.field.name);
    let (mut counted, mut bytes) = (BTreeSet::new(), 0_u64);
    for name in names {
        let known = sizes(name);
        if known.is_none() || !counted.insert(name) {
            bytes = bytes.saturating_add(known.unwrap_or_else(|| StreamSpec::default().memory()));
        }
    }
    bytes
}

/// The configuration that was recorded, or the one that is named; and where its paths begin. What the demo's
/// configuration names, comes to `own`.
fn source(
    arguments: &Arguments,
    recorded: &RecordedFiles,
    here: &Path,
    own: &Path,
) -> Result<(Installation, PathBuf), Failure> {
    if let Some(path) = &arguments.config {
        let base = path.canonicalize().map_err(|error| format!("{}: {error}", path.display()))?;
        let text = resolved_text(path)?;
        return Ok((Installation::parse(&text, path)?, base.parent().unwrap_or(here).to_owned()));
    }
    if recorded.are_others {
        if let Some(run) = arguments.run.first() {
            return Err(format!("--run {run}: the files have no configuration; name one: --config FILE").into());
        }
        return Ok((others::source(&arguments.into)?, here.to_owned()));
    }
    let recorded = recorded.configuration()?;
    let named =
        |errors| format!("{}\nthis is the configuration in the recording; name another: --config FILE", told(&errors));
    let installation = Installation::parse(&recorded.text, Path::new(&recorded.name)).map_err(named)?;
    if is_built_in(&recorded.text) {
        write_map(own)?;
        return Ok((installation, own.to_owned()));
    }
    Ok((installation, here.to_owned()))
}

/// Mistakes in a configuration that may be of others: a line each.
fn told(errors: &rohrpost_config::Errors) -> String {
    let problem = |(file, line, message): (PathBuf, Option<usize>, String)| {
        let file = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let line = line.map_or(String::new(), |line| format!(":{line}"));
        format!("{}{line}: {}", plain::line(&file), plain::line(&message))
    };
    errors.placed().map(problem).collect::<Vec<_>>().join("\n")
}

/// What modules that are played have answered to commands, as bytes; none if the files have no journal of them.
fn noted_answers(
    recorded: &RecordedFiles,
    source: &Installation,
    played: &PlayedModules,
    folder: &Path,
) -> Result<Option<Vec<u8>>, Failure> {
    let is_played = |host: &String| {
        let module = source.classes.parse_module(host).ok().and_then(|name| source.module(name));
        let mut names = module.into_iter().flat_map(|module| module.names());
        played.described.contains_key(host)
            || names.any(|name| played.described.contains_key(&source.classes.format(name)))
    };
    let modules: Vec<String> = recorded.with_journal().into_iter().filter(is_played).collect();
    if modules.is_empty() {
        return Ok(None);
    }
    let mut bytes = Vec::new();
    append(&mut bytes, &exact::read_answers(&recorded.infos, (source, &modules), folder)?)?;
    Ok(Some(bytes))
}
