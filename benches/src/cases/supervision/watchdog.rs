//! What a watchdog costs a module, and how soon launch ends one that hangs. Launch is `rohrpost launch`; its module is
//! this program again.

use crate::cases::errors::{Done, as_failure};
use crate::motor::{CommandedEvent, ROLE, await_answer, configuration, find_motor, reach_motor};
use nix::sys::prctl::set_pdeathsig;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{
    Child, End, Failure, OrFail, Placement, Samples, Scheduling, Scratch, sample_in_child, settle,
};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use std::fs;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Hangs of a turn: each takes the limit, and a start.
const HANGS: usize = 120;
const QUICK_HANGS: usize = 5;
const LIMIT_US: f64 = 100_000.0;
/// Ended at once, started again at once, as often as it takes.
const WATCHED: &str = r#"
watchdog = "100 ms"
restart = { backoff = "1 ms", within = "10 ms", at-most = 1000 }
"#;
const LOOK_EACH: Duration = Duration::from_micros(100);
/// A module that hangs is ended within this time, however busy the computer is.
const ENDED_WITHIN: Duration = Duration::from_secs(20);
const PATIENCE: Duration = Duration::from_secs(120);

/// The cases of this file.
pub(super) fn cases() -> [Case; 2] {
    let hand_over = Case::new("hand-over with watchdog", None, "us", |settings, subject| {
        let contenders = [
            Contender::sampled("rohrpost", || hand_overs(settings, WATCHED)),
            Contender::sampled("without watchdog", || hand_overs(settings, "")).beside(at_most(1.02), None),
        ];
        Ok(compare(settings, subject, &contenders))
    });
    let hang = Case::new("hang to its end", None, "us", |settings, subject| {
        let limit = Summary { p99: Some(LIMIT_US), ..Summary::single(LIMIT_US) };
        let contenders = [
            Contender::sampled("rohrpost", || hangs(settings)),
            Contender::fixed("100 ms", limit).beside(None, at_most(1.2)),
        ];
        Ok(compare(settings, subject, &contenders))
    });
    [hand_over, hang]
}

/// A launch with a motor, in order ended when this is dropped.
struct Launched {
    launch: Child,
    scratch: Scratch,
}

impl Launched {
    /// The motor has these keys, and is where the far end is.
    fn start(settings: &Settings, placement: Placement, keys: &str) -> Result<Self, Failure> {
        let (rohrpost, scratch) = (settings.command()?, Scratch::new()?);
        let own = std::env::current_exe().or_fail("this program")?;
        let config = scratch.directory().join(CONFIG);
        fs::write(&config, configuration(&own.to_string_lossy(), keys)).or_fail("its configuration")?;
        let launch = Child::start(|| {
            settle(End::Pong, placement, Scheduling::Normal)?;
            // Killed, it would leave its module behind.
            set_pdeathsig(Signal::SIGTERM).or_fail("rohrpost launch")?;
            let mut command = Command::new(&rohrpost);
            command.args(["launch", "--quiet"]).arg(&config).env(ROLE, "").env("ROHRPOST_DIR", scratch.directory());
            let error = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).exec();
            Err(Failure::of("rohrpost launch", error))
        })?;
        Ok(Self { launch, scratch })
    }

    fn config(&self) -> PathBuf {
        self.scratch.directory().join(CONFIG)
    }

    /// Figures of what a process of its own does with the motor.
    fn sample(&self, body: impl FnOnce(&Samples) -> Done<()>) -> Result<Vec<f64>, Failure> {
        sample_in_child(PATIENCE, |samples| body(samples).map_err(as_failure("commanding a module")))
    }
}

const CONFIG: &str = "bench.toml";

impl Drop for Launched {
    fn drop(&mut self) {
        let _ = kill(Pid::from_raw(self.launch.pid()), Signal::SIGTERM);
        let deadline = Instant::now() + ENDED_WITHIN;
        while self.launch.has_ended() == Ok(false) && Instant::now() < deadline {
            std::thread::sleep(LOOK_EACH);
        }
    }
}

/// Of commands to a motor with these keys.
fn hand_overs(settings: &Settings, keys: &str) -> Result<Vec<f64>, Failure> {
    let event = CommandedEvent::OneProcessor;
    let launched = Launched::start(settings, event.placement(), keys)?;
    let folder = launched.scratch.directory();
    launched.sample(|samples| event.time(settings, &folder, &launched.config(), samples).map(drop))
}

/// From the command at which the motor hangs until its process has ended.
fn hangs(settings: &Settings) -> Result<Vec<f64>, Failure> {
    let launched = Launched::start(settings, Placement::TwoCores, WATCHED)?;
    launched.sample(|samples| {
        settle(End::Ping, Placement::TwoCores, Scheduling::Fifo)?;
        let (node, motor) = reach_motor(&launched.scratch.directory(), &launched.config())?;
        for _ in 0..if settings.quick { QUICK_HANGS } else { HANGS } {
            let process = node.process_of(&find_motor(&node)?)?.ok_or("the motor has ended")?;
            let began = Instant::now();
            drop(motor.begin_drive(f64::NAN, 0.0)?);
            while !process.has_ended() {
                if began.elapsed() > ENDED_WITHIN {
                    return Err("launch does not end a module that hangs".into());
                }
                std::thread::sleep(LOOK_EACH);
            }
            samples.push(began.elapsed().as_secs_f64() * 1e6);
            await_answer(&motor)?;
        }
        Ok(())
    })
}
