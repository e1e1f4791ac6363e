//! Launch with real processes: this test binary once more, as modules that behave well, panic, hang or never get ready.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_config::Installation;
use rohrpost_launch::launcher::{AskLaunch, LauncherInterface, Phase};
use rohrpost_launch::{Event, Launch, LaunchError};
use rohrpost_mailbox::{ModuleState, Name, Node, base_directory, node_directory};
use rohrpost_modules::call::CallError;
use rohrpost_modules::call::append;
use rohrpost_modules::runtime::Context;
use rohrpost_modules::runtime::ToolLink;
use rohrpost_modules::{Module, ModuleError, run};
use std::fmt::Write;
use std::os::unix::fs::PermissionsExt;
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
            // It holds the pipe that its parent prints to.
            "leaves-child" => drop(std::process::Command::new("sleep").arg("1").spawn()?),
            "waits" => {
                while !settings.traces.join("go").exists() {
                    std::thread::sleep(Duration::from_millis(5));
                }
            }
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
        let command = match *manner {
            "cannot-run" => format!("['{}']", script(&traces).display()),
            _ => format!("['{}', '--exact', 'role', '--nocapture', '--test-threads', '2']", program.display()),
        };
        writeln!(text, "[[module]]\nname = \"{class}.0\"\nprogram = {command}\n{more}").unwrap();
        // Others end and become ready by themselves, however long a busy computer takes.
        match *manner {
            "hangs" => writeln!(text, "stop-within = \"500 ms\"").unwrap(),
            "never-ready" if !more.contains("ready-within") => writeln!(text, "ready-within = \"300 ms\"").unwrap(),
            _ => {}
        }
        writeln!(text, "settings = {{ manner = '{manner}', traces = '{}' }}", traces.display()).unwrap();
    }
    let file = traces.join("ground.toml");
    std::fs::write(&file, text).unwrap();
    let installation = Arc::new(Installation::load(&file).unwrap());
    let (tell, events) = channel();
    Ground { installation, traces, tell, events: Some(events), _directory: directory }
}

/// A program with a missing interpreter: the kernel refuses to run it.
fn script(folder: &Path) -> PathBuf {
    let path = folder.join("script");
    std::fs::write(&path, "#!/nowhere\n").unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path
}

impl Ground {
    fn begin(&mut self) -> Result<Launch, LaunchError> {
        let program = std::env::current_exe().unwrap();
        Launch::begin(self.installation.clone(), "main", program, self.events.take().unwrap(), b"{}")
    }

    fn node(&self) -> PathBuf {
        node_directory(&self.installation.name, "main")
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

fn pid(launch: &mut Launch, index: usize) -> Option<u32> {
    let survey = launch.survey().unwrap();
    survey.module(Ground::name(index)).and_then(|module| module.process.as_ref()).map(|process| process.pid)
}

/// Kills a process, and waits until its parent can see it.
fn kill(pid: u32) {
    nix::sys::signal::kill(nix::unistd::Pid::from_raw(pid as i32), nix::sys::signal::Signal::SIGKILL).unwrap();
    let began = Instant::now();
    while !std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap().contains(") Z ") {
        assert!(began.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(1));
    }
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
    let words = ["the wheels came off", "; as before", "given up after 2 restarts"];
    assert_eq!(words.map(|it| notes.matches(it).count()), [2, 1, 1], "told why at first and at last: {notes}");
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
    // The one that hangs is started again, and is being switched on in vain; then the other one dies, three times.
    let hanging = pid(&mut launch, 0).unwrap();
    kill(hanging);
    watch_until(&mut launch, |launch| launch.phase(Ground::name(0)) == Some(Phase::Ready));
    let began = Instant::now();
    for restarts in 1..=3 {
        let well = pid(&mut launch, 1).unwrap();
        kill(well);
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
    let never = "restart = { policy = \"never\" }\nrequired = true";
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

/// Of a start that would never end: it is told to, so that the test fails instead.
fn end_in_the_end(ground: &Ground) {
    let tell = ground.tell.clone();
    std::thread::spawn(move || {
        std::thread::sleep(PATIENCE);
        let _ = tell.send(Event::Stop);
    });
}

#[test]
fn one_that_is_stopped_before_its_turn_does_not_keep_the_start() {
    let mut ground = ground("turn", &["waits", "well", "well"], "ready-within = \"10 min\"");
    end_in_the_end(&ground);
    let (installation, path, go) = (ground.installation.clone(), ground.node(), ground.traces.join("go"));
    let person = std::thread::spawn(move || {
        let began = Instant::now();
        let node = loop {
            match Node::open(&path).ok().filter(|node| node.launcher().is_some()) {
                Some(node) => break node,
                None => assert!(began.elapsed() < PATIENCE),
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        let mut tool = ToolLink::join(&installation, &node, "main", PATIENCE).unwrap();
        // The last: nothing comes after it that would wake launch. Launch has its node before it has its mailbox.
        let launcher = tool.launcher();
        while let Err(error) = tool.stop(launcher, "third.0") {
            assert!(began.elapsed() < PATIENCE, "{error}");
            std::thread::sleep(Duration::from_millis(5));
        }
        tool.close();
        std::fs::write(go, "").unwrap();
    });
    let mut launch = ground.begin().unwrap();
    person.join().unwrap();
    assert_eq!(launch.phase(Ground::name(1)), Some(Phase::Running));
    assert_eq!(launch.phase(Ground::name(2)), Some(Phase::Stopped));
    assert!(launch.watch(Duration::ZERO));
    launch.stop();
    assert!(!ground.was_off(2), "it never ran");
}

#[test]
fn a_program_that_cannot_be_run_ends_the_start_as_its_policy_has_it() {
    let again = "restart = { policy = \"on-failure\", at-most = 2, within = \"1 min\", backoff = \"1 ms\" }";
    for (policy, tries) in [("restart = \"never\"", 1), (again, 3)] {
        let mut ground = ground("cannot", &["well", "cannot-run"], &format!("{policy}\nrequired = true"));
        end_in_the_end(&ground);
        let error = ground.begin().err().unwrap().to_string();
        assert!(error.contains("second.0 did not become ready: could not be started: "), "{error}");
        assert_eq!(error.matches("could not be started: ").count(), tries, "each try is told, once: {error}");
        assert_eq!(error.contains("given up after 2 restarts"), tries == 3, "{error}");
        assert!(!ground.node().exists());
    }
}

const SOON: &str = "restart = { policy = \"always\", at-most = 100, within = \"1 min\", backoff = \"1 ms\" }\n";
const LATER: &str = "restart = { policy = \"always\", at-most = 100, within = \"1 min\", backoff = \"10 min\" }\n";

#[test]
fn what_is_off_comes_back_off_however_it_ended() {
    let name = Ground::name(0);
    for (start, asked) in [("off", false), ("off", true), ("on", false), ("on", true)] {
        let mut ground = ground("off", &["leaves-child"], &format!("start = \"{start}\"\n{SOON}"));
        let mut launch = ground.begin().unwrap();
        let node = Node::open(&ground.node()).unwrap();
        let mut person = ToolLink::join(&ground.installation, &node, "main", PATIENCE).unwrap();
        person.switch(name, false).unwrap();
        let before = pid(&mut launch, 0).unwrap();
        kill(before);
        if asked {
            // Launch finds this as soon as it has seen the end; what was printed last is still waited for then.
            person.begin_restart(person.launcher(), "first.0").unwrap();
        }
        watch_until(&mut launch, |launch| {
            launch.phase(name) == Some(Phase::Running) && pid(launch, 0).is_some_and(|pid| pid != before)
        });
        let state = node.last_word_of(name, pid(&mut launch, 0).unwrap()).unwrap().state;
        assert_eq!(state, Some(ModuleState::Off), "start = {start}, restart was asked for: {asked}");
        person.close();
        launch.stop();
    }
}

/// Functions of launch, by their numbers.
const STOP: u16 = 18;
const START: u16 = 19;

/// Has a person's order for the first module carried out.
fn order(person: &mut ToolLink, launch: &mut Launch, function: u16) {
    let words = |body: &mut Vec<u8>| append(body, &("first.0",));
    let call = person.begin(person.launcher(), function, LauncherInterface::hash(), words).unwrap();
    watch_until(launch, |_| {
        person.link.collect();
        person.link.poll(call).is_some_and(|answer| answer.is_ok())
    });
}

fn has_mailboxes(node: &Node, index: usize) -> bool {
    node.mailboxes().unwrap().iter().any(|name| name.module() == Ground::name(index))
}

#[test]
fn one_that_is_stopped_while_it_waits_leaves_no_mailboxes_to_its_next_run() {
    let mut ground = ground("stale", &["well", "well"], LATER);
    let mut launch = ground.begin().unwrap();
    let (name, node) = (Ground::name(0), Node::open(&ground.node()).unwrap());
    let mut person = ToolLink::join(&ground.installation, &node, "main", PATIENCE).unwrap();
    kill(pid(&mut launch, 0).unwrap());
    watch_until(&mut launch, |launch| launch.phase(name) == Some(Phase::Waiting));
    assert!(has_mailboxes(&node, 0), "kept for the next start");
    order(&mut person, &mut launch, STOP);
    assert_eq!(launch.phase(name), Some(Phase::Stopped));
    watch_until(&mut launch, |_| !has_mailboxes(&node, 0));
    assert!(has_mailboxes(&node, 1));
    order(&mut person, &mut launch, START);
    watch_until(&mut launch, |launch| launch.phase(name) == Some(Phase::Running));
    person.close();
    launch.stop();
}

#[test]
fn a_registry_that_somebody_holds_keeps_launch_from_nothing_but_removing() {
    let mut ground = ground("held", &["well", "well"], LATER);
    let mut launch = ground.begin().unwrap();
    let (name, node) = (Ground::name(0), Node::open(&ground.node()).unwrap());
    kill(pid(&mut launch, 0).unwrap());
    watch_until(&mut launch, |launch| launch.phase(name) == Some(Phase::Waiting));
    let mut person = ToolLink::join(&ground.installation, &node, "main", PATIENCE).unwrap();
    // As a process that is halted while it makes a mailbox.
    let file = std::fs::File::options().read(true).write(true).open(ground.node().join("node")).unwrap();
    lock_registry(&file, nix::libc::F_WRLCK);
    order(&mut person, &mut launch, STOP);
    assert!(launch.watch(Duration::ZERO) && has_mailboxes(&node, 0), "not now");
    order(&mut person, &mut launch, START);
    assert!(launch.watch(Duration::ZERO));
    assert_eq!(launch.phase(name), Some(Phase::Waiting), "not with what was left");
    lock_registry(&file, nix::libc::F_UNLCK);
    watch_until(&mut launch, |launch| launch.phase(name) == Some(Phase::Running));
    person.close();
    launch.stop();
}

/// Locks the byte of a node's file that stands for its registry (see shared-memory.md), or gives it back.
fn lock_registry(file: &std::fs::File, kind: i32) {
    let region = nix::libc::flock { l_type: kind as _, l_whence: 0, l_start: (1 << 20) + 1, l_len: 1, l_pid: 0 };
    nix::fcntl::fcntl(file, nix::fcntl::FcntlArg::F_OFD_SETLK(&region)).unwrap();
}
