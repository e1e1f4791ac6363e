//! A module that plays ping-pong with another one by data: each subscribes to what the other publishes. The same in
//! Python is `benches/languages/player.py`. It is this program again, with the arguments of a
//! [`crate::foreign::ForeignProgram`].

use crate::foreign::ForeignProgram;
use nix::sys::signal::{Signal, raise};
use rohrpost_bench_local::harness::{
    Cell, Failure, OrFail, Pause, Placement, SAMPLES_MIN, Scheduling, check_echo, fill,
};
use rohrpost_mailbox::monotonic_ns;
use rohrpost_modules::runtime::{Context, Rate, Received, Start, Subscription, run_started};
use rohrpost_modules::{Module, ModuleError, NoSettings};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

/// Set for the hidden program that is the module.
const ROLE: &str = "ROHRPOST_BENCH_PLAYER";
/// The number that ends a turn, and the one before it begins: subscriptions take a moment.
const STOP: u64 = u64::MAX;
const HANDSHAKE: u64 = STOP - 1;
const HANDSHAKE_EACH: Duration = Duration::from_millis(20);

static TURN: OnceLock<PlayerTurn> = OnceLock::new();

/// What it is told.
struct PlayerTurn {
    is_ping: bool,
    cell: Cell,
    samples: PathBuf,
}

/// The module as a program; nodes lie in `folder`.
///
/// # Errors
/// When this program does not know where it is.
pub fn player(folder: &Path, config: &Path) -> Result<ForeignProgram, Failure> {
    let program = std::env::current_exe().or_fail("this program")?;
    let environment = vec![(ROLE, "".into()), ("ROHRPOST_DIR", folder.into())];
    Ok(ForeignProgram { program, first: Vec::new(), last: vec![config.into()], environment })
}

/// If this process was started as the module: runs it until the turn is over.
pub(crate) fn run_hidden_module() -> Option<Result<(), Failure>> {
    std::env::var_os(ROLE)?;
    Some(run(&std::env::args().skip(1).collect::<Vec<_>>()))
}

fn run(arguments: &[String]) -> Result<(), Failure> {
    let [end, bytes, messages, warm_up, pause_ns, cap_ms, samples, config] = arguments else {
        return Err(Failure::Failed(format!("eight arguments, not {}", arguments.len())));
    };
    let number = |text: &String| text.parse::<usize>().or_fail(text);
    let is_ping = end == "ping";
    let cell = Cell {
        bytes: number(bytes)?,
        messages: number(messages)?,
        warm_up: number(warm_up)?,
        placement: Placement::TwoCores,
        scheduling: Scheduling::Fifo,
        pause: Pause::Awake(Duration::from_nanos(number(pause_ns)? as u64)),
        cap: Duration::from_millis(number(cap_ms)? as u64),
    };
    TURN.get_or_init(|| PlayerTurn { is_ping, cell, samples: samples.into() });
    let name = if is_ping { "player.0" } else { "player.1" };
    let arguments = ["--config", config, "--name", name].map(String::from);
    let ended = Start::from_arguments(arguments.into_iter()).and_then(run_started::<BallPlayer>);
    ended.or_fail("the module")
}

/// Plays.
#[rohrpost_modules::interface(class = "player", crate = rohrpost_modules::macro_support)]
trait Player {
    /// What is thrown.
    #[data(1)]
    fn ball() -> Vec<u8>;
}

struct BallPlayer {
    turn: &'static PlayerTurn,
    balls: Subscription<Vec<u8>>,
    /// The next, or the one that is on its way.
    number: u64,
    message: Vec<u8>,
    sent_ns: u64,
    began_ns: Option<u64>,
    is_warm: bool,
    round_trips: Vec<u64>,
}

impl Module for BallPlayer {
    type Settings = NoSettings;
    type Interfaces = PlayerInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        let turn = TURN.get().ok_or_else(|| Failure::Failed("it is not told what to play".into()))?;
        let other = if turn.is_ping { "player.1" } else { "player.0" };
        let balls = context.subscribe(PlayerInterface::BALL, other, Rate::Each)?;
        if turn.is_ping {
            context.set_period(HANDSHAKE_EACH);
        }
        let (number, message) = (0, vec![0; turn.cell.bytes]);
        let round_trips = Vec::with_capacity(turn.cell.messages);
        let is_warm = turn.cell.warm_up == 0;
        Ok(Self { turn, balls, number, message, sent_ns: 0, began_ns: None, is_warm, round_trips })
    }

    /// Throws one that does not count, until it comes back.
    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        if self.began_ns.is_none() {
            self.throw(context, HANDSHAKE)?;
        }
        Ok(())
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let Some(ball) = data.read(&self.balls)? else { return Ok(()) };
        let played = if self.turn.is_ping { self.back(context, &ball) } else { self.echo(context, &ball) };
        // A module in error goes on, and the bench would wait for it.
        if let Err(error) = &played {
            let _ = writeln!(std::io::stderr(), "{error}");
            std::process::exit(1);
        }
        played
    }
}

impl Player for BallPlayer {}

impl BallPlayer {
    fn throw(&mut self, context: &mut Context, number: u64) -> Result<(), ModuleError> {
        fill(&mut self.message, number);
        self.turn.cell.pause.take();
        self.sent_ns = monotonic_ns();
        Ok(context.publish_now(PlayerInterface::BALL, &self.message)?)
    }

    fn back(&mut self, context: &mut Context, ball: &[u8]) -> Result<(), ModuleError> {
        let (back_ns, cell) = (monotonic_ns(), &self.turn.cell);
        let Some(began_ns) = self.began_ns else {
            self.began_ns = Some(back_ns);
            return self.throw(context, 0);
        };
        if number_of(ball) == Some(HANDSHAKE) {
            return Ok(());
        }
        check_echo(&self.message, ball)?;
        if self.is_warm {
            self.round_trips.push(back_ns.saturating_sub(self.sent_ns));
        }
        self.number += 1;
        let spent = Duration::from_nanos(back_ns.saturating_sub(began_ns));
        self.is_warm |= self.number >= cell.warm_up as u64 || spent > cell.cap / 4;
        let is_late = spent > cell.cap && self.round_trips.len() >= SAMPLES_MIN.min(cell.messages);
        if self.number < (cell.warm_up + cell.messages) as u64 && !is_late {
            return self.throw(context, self.number);
        }
        self.throw(context, STOP)?;
        let bytes: Vec<u8> = self.round_trips.iter().flat_map(|ns| ns.to_le_bytes()).collect();
        std::fs::write(&self.turn.samples, bytes)?;
        Ok(raise(Signal::SIGTERM)?)
    }

    fn echo(&mut self, context: &mut Context, ball: &Vec<u8>) -> Result<(), ModuleError> {
        match number_of(ball) {
            Some(STOP) => return Ok(raise(Signal::SIGTERM)?),
            Some(HANDSHAKE) => {}
            Some(number) if number == self.number => self.number += 1,
            number => return Err(Failure::Failed(format!("ball {number:?} came when {} was due", self.number)).into()),
        }
        Ok(context.publish_now(PlayerInterface::BALL, ball)?)
    }
}

fn number_of(ball: &[u8]) -> Option<u64> {
    ball.first_chunk().map(|head| u64::from_le_bytes(*head))
}
