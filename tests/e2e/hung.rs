//! Modules that hang, and launch, which ends them as their watchdog has it; those that do not hang are let alone.

use crate::harness::{OUTPUT, Place, halt, probe, program, run_if_launched, signal, until, wait};
use crate::output::lines;
use crate::probe::{ProbingProxy, WORK};
use nix::sys::signal::Signal;
use rohrpost::serde::Deserialize;
use rohrpost::{Context, Module, ModuleError};
use rohrpost_config::Installation;
use rohrpost_mailbox::{ModuleState, Node, Participant, Shape, node_directory};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Not a test: what launch starts. Run as a test it ends at once.
#[test]
fn module() {
    run_if_launched::<Spinner>();
}

/// Not a test: what launch starts. It joins as a module between two turns does, and takes nothing of what comes.
#[test]
fn deaf() {
    let Ok(module) = std::env::var("ROHRPOST_MODULE") else { return };
    let installation = Installation::load(Path::new(&std::env::var("ROHRPOST_CONFIG").unwrap())).unwrap();
    let name = installation.classes.parse_module(&module).unwrap();
    let node = Node::create(&node_directory(&installation.name, "main"), 0o700).unwrap();
    let participant = Participant::join(&node, name).unwrap();
    let _commands = participant.clone().receiver(name, Shape::default()).unwrap();
    participant.set_state(ModuleState::Off);
    loop {
        std::thread::park();
    }
}

#[derive(Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields)]
struct Settings {
    /// Works in periods of so long, ms.
    period: u64,
    /// At each tick it has this probe count.
    #[serde(default)]
    asks: Option<String>,
}

/// At a tick it takes the file `spin` away, and keeps a processor busy for as many ms as that says.
struct Spinner {
    spin: PathBuf,
    asked: Option<ProbingProxy>,
}

impl Module for Spinner {
    type Settings = Settings;
    type Interfaces = ();

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(settings.period));
        let asked = settings.asks.map(|module| context.proxy::<ProbingProxy>(&module)).transpose()?;
        Ok(Self { spin: context.path("spin"), asked })
    }

    fn tick(&mut self, _: &mut Context) -> Result<(), ModuleError> {
        if let Some(Err(error)) = self.asked.as_ref().map(|asked| asked.count_again(1)) {
            std::fs::write(self.spin.with_extension("error"), format!("{error:?}"))?;
        }
        let Ok(ms) = std::fs::read_to_string(&self.spin) else { return Ok(()) };
        let (began, time) = (Instant::now(), Duration::from_millis(ms.parse()?));
        std::fs::remove_file(&self.spin)?;
        while began.elapsed() < time {
            std::hint::spin_loop();
        }
        std::fs::write(self.spin.with_extension("done"), "")?;
        Ok(())
    }
}

fn spinner(period_ms: u64, keys: &str) -> String {
    let program = program("hung::module");
    format!("[[module]]\nname = \"probe.0\"\nprogram = {program}\nsettings = {{ period = {period_ms} }}\n{keys}\n")
}

/// Has the module spin, without a moment in which it finds half a number.
fn spin(place: &Place, ms: u64) {
    std::fs::rename(place.write("spin.part", ms.to_string()), place.path("spin")).unwrap();
}

/// Time that the tests let pass: whatever comes within it would be wrong.
fn pass(time: Duration) {
    let began = Instant::now();
    until("time passes", || began.elapsed() >= time);
}

#[test]
fn a_module_that_spins_is_ended_and_works_again() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &spinner(10, "watchdog = \"1 s\"")]);
    let pid = robot.pid("probe.0");
    spin(&place, 600_000);
    assert_eq!(robot.wait_restarted("probe.0", pid).restarts, 1);
    let said = wait("the log has it", || {
        let texts = lines(&place, "probe.0").into_iter().filter(|line| line["level"] == "error");
        let mut texts = texts.filter_map(|line| line["text"].as_str().map(str::to_owned));
        texts.find(|text| text.starts_with("hung in `tick` for "))
    });
    let how = "(its watchdog allows 1s), and was killed by signal 9; starts again in 200ms";
    assert!(said.ends_with(how), "{said}");
    let told = place.say(&["list", "--json"]).json();
    assert!(told["modules"][1]["error"].as_str().unwrap().contains("hung in `tick` for "), "{told}");
    let out = launch.stop();
    assert_eq!(out.matches("probe.0 hung in `tick` for ").count(), 1, "{out}");
    assert!(!place.path("spin.done").exists(), "it did not come back");
}

#[test]
fn within_the_grace_a_module_that_hangs_may_end_by_itself() {
    let keys = "watchdog = \"1 s\"\nwatchdog-grace = \"60 s\"\nstop-within = \"100 ms\"";
    let (_place, mut launch, robot) = Place::running(&[&probe("probe.0", "", keys)]);
    let pid = robot.pid("probe.0");
    let mut tool = robot.tool(Duration::from_secs(60));
    robot.begin(&mut tool, "probe.0", WORK, &(600_000_u64,));
    assert_eq!(robot.wait_restarted("probe.0", pid).restarts, 1);
    tool.close();
    let out = launch.stop();
    let told = out.lines().find(|line| line.starts_with("probe.0 hung in `work` for ")).unwrap();
    assert!(told.contains("(its watchdog allows 1s), and ended with ") && !out.contains("signal 9"), "{out}");
}

#[test]
fn a_module_that_is_stopped_is_ended_and_counts_against_its_policy() {
    let keys = "watchdog = \"500 ms\"\nrestart = { backoff = \"1 ms\", at-most = 1 }";
    let (_place, mut launch, robot) = Place::running(&[&spinner(3_600_000, keys)]);
    let pid = robot.pid("probe.0");
    halt(pid);
    let process = robot.wait_restarted("probe.0", pid);
    assert_eq!(process.restarts, 1);
    halt(process.pid);
    let how = "stopped by a signal (its watchdog allows 500ms), and was killed by signal 9";
    launch.wait_for(&format!("{how}; given up after 1 restarts within 60s"));
    launch.stop_failed();
    assert!(launch.out().contains(&format!("{how}; starts again in 1ms")), "{}", launch.out());
}

#[test]
fn a_module_that_takes_nothing_of_what_waits_is_ended() {
    let program = program("hung::deaf");
    let keys = "watchdog = \"500 ms\"\nrestart = \"never\"";
    let deaf = format!("[[module]]\nname = \"probe.0\"\nprogram = {program}\n{keys}\n");
    let (_place, mut launch, robot) = Place::begun(&[&deaf, &probe("probe.1", "", "")]);
    launch
        .wait_for("took none of the packages that wait for it (its watchdog allows 500ms), and was killed by signal ");
    until("the others go on", || robot.state("probe.1") == "on");
    launch.stop_failed();
    assert!(launch.err().contains("probe.0 failed for good: hung for "), "{}", launch.err());
}

#[test]
fn a_module_that_waits_and_one_with_a_long_but_allowed_turn_are_let_alone() {
    let limit = Duration::from_millis(300);
    let (_place, mut launch, robot) = Place::running(&[&spinner(3_600_000, "watchdog = \"300 ms\"")]);
    let pid = robot.pid("probe.0");
    pass(5 * limit);
    assert_eq!(robot.pid("probe.0"), pid);
    launch.stop();

    let (place, mut launch, robot) = Place::running(&[&spinner(10, "watchdog = \"30 s\"\nbusy-after = \"200 ms\"")]);
    let pid = robot.pid("probe.0");
    spin(&place, 1000);
    until("the turn is over", || place.path("spin.done").exists());
    assert_eq!(robot.pid("probe.0"), pid);
    let out = launch.stop();
    assert!(out.contains("probe.0 is busy: in `tick` for ") && !out.contains("hung"), "{out}");
}

#[test]
fn a_launch_that_was_stopped_itself_blames_no_module() {
    let limit = Duration::from_secs(2);
    let (place, mut launch, robot) = Place::running(&[&spinner(10, "watchdog = \"2 s\"")]);
    let pid = robot.pid("probe.0");
    // A turn that is allowed, and in which both are stopped for longer than that.
    spin(&place, 600);
    until("the turn has begun", || !place.path("spin").exists());
    for process in [launch.pid(), pid] {
        halt(process);
    }
    pass(2 * limit);
    // Launch looks first, and finds the module in a turn of more than four seconds.
    for process in [launch.pid(), pid] {
        signal(process, Signal::SIGCONT);
    }
    until("the turn is over", || place.path("spin.done").exists());
    pass(limit / 2);
    assert_eq!(robot.pid("probe.0"), pid);
    let out = launch.stop();
    assert!(!out.contains("hung"), "{out}");
}

#[test]
fn no_call_lasts_longer_than_the_file_says() {
    let keys = "calls = [{ to = \"probe.1\", within = \"70 ms\" }]";
    let asks = spinner(10, keys).replace("settings = {", "settings = { asks = \"probe.1\",");
    let (place, mut launch, robot) = Place::running(&[&probe("probe.1", "", "stop-within = \"200 ms\""), &asks]);
    halt(robot.pid("probe.1"));
    let error = wait("no answer", || {
        std::fs::read_to_string(place.path("spin.error")).ok().filter(|error| error.ends_with(')'))
    });
    assert!(error.starts_with("Timeout(") && error.ends_with(", 70ms)"), "{error}");
    launch.stop();
}
