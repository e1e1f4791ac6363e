//! Launch with real processes: this test binary once more, as modules that behave well, panic, hang or never get ready.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, base_directory};
use rohrpost_modules::call::CallError;
use rohrpost_modules::launch::{Event, Launch, LaunchError, Phase};
use rohrpost_modules::runtime::Context;
use rohrpost_modules::{Module, ModuleError, run};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(60);

/// How a module behaves.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Settings {
    manner: String,
    /// Written to when it is switched off.
    traces: PathBuf,
}

struct Actor {
    settings: Settings,
}

impl Module for Actor {
    type Settings = Settings;
    type Interfaces = ();

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        match settings.manner.as_str() {
            "refuses" => return Err(ModuleError::new("no wheels")),
            "never-ready" => loop {
                std::thread::park();
            },
            "panics" => context.set_period(Duration::from_millis(1)),
            _ => {}
        }
        Ok(Self { settings })
    }

    fn on(&mut self, _: &mut Context) -> Result<(), ModuleError> {
        match self.settings.manner.as_str() {
            "hangs" => loop {
                std::thread::park();
            },
            _ => Ok(()),
        }
    }

    fn off(&mut self, context: &mut Context) {
        let path = self.settings.traces.join(format!("off-{}", context.me().class().0));
        let _ = std::fs::write(path, "");
    }

    fn tick(&mut self, _: &mut Context) -> Result<(), ModuleError> {
        panic!("the wheels came off");
    }
}

/// Not a test: what launch starts.
#[test]
fn role() {
    if std::env::var_os("ROHRPOST_MODULE").is_some() {
        let code = run::<Actor>();
        std::process::exit(i32::from(code != std::process::ExitCode::SUCCESS));
    }
}

const CLASSES: [(&str, u8); 3] = [("first", 60), ("second", 50), ("third", 40)];

struct Ground {
    installation: Arc<Installation>,
    traces: PathBuf,
    tell: Sender<Event>,
    events: Option<Receiver<Event>>,
    _directory: tempfile::TempDir,
}

/// A node of its own, with a module for each manner.
fn ground(name: &str, manners: &[&str], more: &str) -> Ground {
    let directory = tempfile::tempdir().unwrap();
    let traces = directory.path().to_owned();
    let mut text = format!("installation = \"{name}-{}\"\n[system]\nname = \"robot\"\nid = 1\n", std::process::id());
    text.push_str("[classes]\ntool = { id = 16, text = \"By hand\" }\n");
    for (class, id) in CLASSES {
        writeln!(text, "{class} = {{ id = {id}, text = \"An actor\" }}").unwrap();
    }
    text.push_str("[nodes.main]\n");
    let program = std::env::current_exe().unwrap();
    for (manner, (class, _)) in manners.iter().zip(CLASSES) {
        let command = format!("['{}', '--exact', 'role', '--nocapture']", program.display());
        writeln!(text, "[[module]]\nname = \"{class}.0\"\nprogram = {command}\nstop-within = \"500 ms\"\n{more}")
            .unwrap();
        writeln!(text, "settings = {{ manner = '{manner}', traces = '{}' }}", traces.display()).unwrap();
    }
    let file = traces.join("ground.toml");
    std::fs::write(&file, text).unwrap();
    let installation = Arc::new(Installation::load(&file).unwrap());
    let (tell, events) = channel();
    Ground { installation, traces, tell, events: Some(events), _directory: directory }
}

impl Ground {
    fn begin(&mut self) -> Result<Launch, LaunchError> {
        let program = std::env::current_exe().unwrap();
        Launch::begin(self.installation.clone(), "main", program, self.events.take().unwrap())
    }

    fn name(index: usize) -> Name {
        Name::new(1, CLASSES[index].1, 0, 0)
    }

    fn was_off(&self, index: usize) -> bool {
        self.traces.join(format!("off-{}", CLASSES[index].1)).exists()
    }
}

/// Watches until it is so; what was said meanwhile.
fn watch_until(launch: &mut Launch, mut so: impl FnMut(&mut Launch) -> bool) -> String {
    let (began, mut notes) = (Instant::now(), String::new());
    while !so(launch) {
        assert!(began.elapsed() < PATIENCE, "in vain; said so far: {notes}");
        assert!(launch.watch(Duration::from_millis(5)));
        notes.extend(launch.take_notes());
    }
    notes.extend(launch.take_notes());
    notes
}

#[test]
fn modules_run_and_stop_in_their_safe_state() {
    let mut ground = ground("well", &["well", "well", "well"], "");
    let mut launch = ground.begin().unwrap();
    assert_eq!(launch.phase(Ground::name(2)), Some(Phase::Running));
    assert!(launch.tool().status(Ground::name(0)).is_ok());
    ground.tell.send(Event::Stop).unwrap();
    ground.tell.send(Event::Stop).unwrap();
    assert!(!launch.watch(PATIENCE), "told to stop");
    assert_eq!(launch.stop(), [] as [String; 0]);
    assert!((0..3).all(|index| ground.was_off(index)));
    let gone = base_directory().join(format!("{}.main", ground.installation.name));
    assert!(!Path::new(&gone).exists(), "nothing is left");
}

#[test]
fn a_panic_makes_a_module_safe_and_starts_it_again_until_it_is_given_up() {
    let restart = "restart = { policy = \"on-failure\", at-most = 2, within = \"1 min\", backoff = \"1 ms\" }";
    let mut ground = ground("panics", &["panics"], restart);
    let mut launch = ground.begin().unwrap();
    let failed = |launch: &mut Launch| launch.phase(Ground::name(0)) == Some(Phase::Failed);
    let notes = watch_until(&mut launch, failed);
    assert_eq!(notes.matches("the wheels came off").count(), 3, "each time it is told why: {notes}");
    assert!(notes.contains("given up after 2 restarts"), "{notes}");
    assert!(ground.was_off(0), "made safe before the end");
    let call = launch.tool().status(Ground::name(0));
    assert!(matches!(call, Err(CallError::NotSent(_))), "its mailboxes are gone: {call:?}");
    launch.stop();
}

#[test]
fn one_that_hangs_keeps_nobody_from_being_watched_and_is_killed_at_the_end() {
    let restart = "restart = { policy = \"on-failure\", at-most = 100, within = \"1 min\", backoff = \"1 ms\" }";
    let mut ground = ground("hangs", &["hangs", "well"], restart);
    let mut launch = ground.begin().unwrap();
    let pid = |launch: &mut Launch, index| {
        let survey = launch.survey().unwrap();
        survey.module(Ground::name(index)).and_then(|module| module.process.as_ref()).map(|process| process.pid as i32)
    };
    let kill = |pid| nix::sys::signal::kill(nix::unistd::Pid::from_raw(pid), nix::sys::signal::Signal::SIGKILL);
    // The one that hangs is started again, and is being switched on in vain; then the other one dies, three times.
    let hanging = pid(&mut launch, 0).unwrap();
    kill(hanging).unwrap();
    watch_until(&mut launch, |launch| launch.phase(Ground::name(0)) == Some(Phase::Ready));
    let began = Instant::now();
    for restarts in 1..=3 {
        let well = pid(&mut launch, 1).unwrap();
        kill(well).unwrap();
        watch_until(&mut launch, |launch| {
            launch.restarts(Ground::name(1)) == restarts && launch.phase(Ground::name(1)) == Some(Phase::Running)
        });
    }
    let hangs = launch.phase(Ground::name(0)) == Some(Phase::Ready);
    assert!(hangs || began.elapsed() > Duration::from_secs(1), "all that while it was still being switched on");
    let notes = launch.stop().join("\n");
    assert!(!notes.contains("second.0"), "{notes}");
    assert!(ground.was_off(1));
}

#[test]
fn what_does_not_start_is_told_and_leaves_nothing_running() {
    let never = "restart = { policy = \"never\" }\nready-within = \"300 ms\"";
    for (manner, why) in [("refuses", "no wheels"), ("never-ready", "killed by signal 9")] {
        let mut ground = ground(manner, &["well", manner], never);
        let error = ground.begin().err().unwrap().to_string();
        assert!(error.contains("second.0 did not become ready") && error.contains(why), "{error}");
        assert!(!base_directory().join(format!("{}.main", ground.installation.name)).exists());
    }
}

#[test]
fn told_to_stop_while_it_starts_it_stops() {
    let mut ground = ground("early", &["well", "never-ready"], "");
    ground.tell.send(Event::Child).unwrap();
    ground.tell.send(Event::Stop).unwrap();
    let error = ground.begin().err().unwrap();
    assert!(error.to_string().contains("told to stop"), "{error}");
}
