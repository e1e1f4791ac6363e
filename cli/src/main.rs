//! The `rohrpost` command. A folder for each kind of command, and in it one file or folder for each subcommand:
//! `begin`, `running`, `measure`, `record` and `replay`, `nodes`, `team`, `computer`.
//!
//! Commands share `look`, which reads a node, near or far, and `terminal`: output, tables, units. `launch` opens the
//! routers' sockets, `manager` talks to systemd. Golden files hold what `top` and `doctor` show.

#![forbid(unsafe_code)]
// All output goes through `say` and `complain`, which escape what a terminal would obey.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod begin;
mod bench;
mod command_line;
mod computer;
mod daemons;
mod exact;
mod launch;
mod look;
mod manager;
mod measure;
mod nodes;
mod quota;
mod record;
mod replay;
mod routers;
mod running;
mod team;
mod terminal;

use begin::{arena, check, demo, interface, new};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use computer::{clean, completions, doctor, man, run, version};
use measure::{bw, data, delay, graph, hz, mailbox, ping, send, stream};
use nodes::{bundle, keys, net, time};
use running::{call, control, echo, halt, list, log, param, status, top};
use std::process::ExitCode;
use team::{entrances, members, path, station, two_files};
use terminal::{complain, habits, parser};

/// Prioritised mailboxes for robots: configure, launch, inspect, call.
#[derive(Parser)]
#[command(name = "rohrpost", version = version::text(), after_help = "Try `rohrpost demo`, then in another terminal \
    `rohrpost top`.\nEach command explains itself: `rohrpost log --help`.")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Explain what a configuration will run, or its mistakes.
    Check(check::Arguments),
    /// Start the modules of a node and supervise them.
    Launch(launch::Arguments),
    /// Run a simulated robot that drives and maps, or play a robot's log.
    Demo(demo::Arguments),
    /// Move a simulated robot, and count what it touches.
    Arena(arena::Arguments),
    /// End a module and start it again.
    Restart(control::Arguments),
    /// End a module; it stays ended until it is started.
    Stop(control::Arguments),
    /// Start a module that was stopped, has ended, or failed.
    Start(control::Arguments),
    /// Stop a supervised robot; it stands until it is let go.
    Halt(halt::HaltArguments),
    /// Let a robot go on that was halted.
    Resume(halt::ResumeArguments),
    /// List the modules and mailboxes of a running node.
    List(list::Arguments),
    /// Show one mailbox: its slots, losses and waits; disturbs nobody.
    Mailbox(mailbox::Arguments),
    /// List, show, read and write streams of records.
    Stream(stream::Arguments),
    /// Watch modules, and switch them on and off.
    Top(top::Arguments),
    /// Ask modules how they are.
    Status(status::Arguments),
    /// Call a function of a module.
    Call(call::Arguments),
    /// List all that modules publish: rates, sizes, subscribers.
    Data(data::Arguments),
    /// Print the data that a module publishes.
    Echo(echo::Arguments),
    /// Print what modules say.
    Log(log::Arguments),
    /// Measure how often a module publishes; disturbs nobody.
    Hz(hz::Arguments),
    /// Measure the bytes that go in and out of a module; disturbs nobody.
    Bw(bw::Arguments),
    /// Measure how long packages wait; disturbs nobody.
    Delay(delay::Arguments),
    /// Show or draw which module sends what to which; disturbs nobody.
    Graph(graph::Arguments),
    /// Measure how long a module takes to answer.
    Ping(ping::Arguments),
    /// Show how the nodes hear each other, what waits and what is lost.
    Net(net::Arguments),
    /// Send a command over and over.
    Send(send::Arguments),
    /// Show, set, save and load the parameters of modules.
    Param(param::Arguments),
    /// Describe, recover, cut and merge files of recordings.
    Record(record::Arguments),
    /// Play recordings, or repeat what modules did.
    Replay(replay::Arguments),
    /// Show how well each node knows the common time.
    Time(time::Arguments),
    /// Show the robot's team: members, leader, views, clocks, intruders.
    Team(members::Arguments),
    /// Start a robot of a team from the team's two files.
    Wormhole(two_files::Arguments),
    /// See a team, make up intruders, ask robots, tell them to end.
    Station(station::Arguments),
    /// Find the shortest path on a map, around robots.
    Path(path::Arguments),
    /// List the cells from which to block an intruder, nearest first.
    Entrances(entrances::Arguments),
    /// Remove what a crash left in shared memory, and nothing that lives.
    Clean(clean::Arguments),
    /// Check whether this computer lets a robot run in time.
    Doctor(doctor::Arguments),
    /// Measure how this computer hands packages over.
    Bench(bench::Arguments),
    /// Make, change and show keys and certificates of nodes.
    Keys(keys::Arguments),
    /// Bring the files that nodes run to them, signed, and back.
    Bundle(bundle::Arguments),
    /// Begin a module of your own: a project that builds and runs.
    New(new::Arguments),
    /// Write interfaces to files, and typed code of them.
    Interface(interface::Arguments),
    /// Print a script by which a shell completes what you type.
    Completions(completions::Arguments),
    /// Write manual pages of all commands.
    Man(man::Arguments),
    /// Print versions, of this program and of what nodes share.
    Version(version::Arguments),
    /// Run a built-in module by hand.
    Run(run::Arguments),
    /// Carry packages between this node and the others.
    Router(routers::LanArguments),
    /// Carry packages beyond the LAN: the server.
    TcpRouter(routers::Arguments),
    /// Carry packages between this node and the TCP router.
    TcpClient(routers::Arguments),
    /// Carry packages to and from other systems without a server.
    TeamRouter(routers::TeamArguments),
}

fn main() -> ExitCode {
    completions::answer(Arguments::command);
    let command = parser::grouped(Arguments::command());
    let words = parser::options_first(&command, two_files::by_name(std::env::args_os()));
    if let Some(ours) = habits::answer(&words) {
        complain(ours);
        return ExitCode::from(2);
    }
    let matches = command.get_matches_from(words);
    let arguments = Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let result = match arguments.command {
        Command::Check(arguments) => check::run(&arguments),
        Command::Launch(arguments) => launch::run(&arguments),
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Arena(arguments) => arena::run(&arguments),
        Command::Restart(arguments) => control::run(&arguments, control::Order::Restart),
        Command::Stop(arguments) => control::run(&arguments, control::Order::Stop),
        Command::Start(arguments) => control::run(&arguments, control::Order::Start),
        Command::Halt(arguments) => halt::halt(&arguments),
        Command::Resume(arguments) => halt::resume(&arguments),
        Command::List(arguments) => list::run(&arguments),
        Command::Mailbox(arguments) => mailbox::run(&arguments),
        Command::Stream(arguments) => stream::run(&arguments),
        Command::Top(arguments) => top::run(&arguments),
        Command::Status(arguments) => status::run(&arguments),
        Command::Call(arguments) => call::run(&arguments),
        Command::Data(arguments) => data::run(&arguments),
        Command::Echo(arguments) => echo::run(&arguments),
        Command::Log(arguments) => log::run(&arguments),
        Command::Hz(arguments) => hz::run(&arguments),
        Command::Bw(arguments) => bw::run(&arguments),
        Command::Delay(arguments) => delay::run(&arguments),
        Command::Graph(arguments) => graph::run(&arguments),
        Command::Ping(arguments) => ping::run(&arguments),
        Command::Net(arguments) => net::run(&arguments),
        Command::Send(arguments) => send::run(&arguments),
        Command::Param(arguments) => param::run(&arguments),
        Command::Record(arguments) => record::run(&arguments),
        Command::Replay(arguments) => replay::run(&arguments),
        Command::Time(arguments) => time::run(&arguments),
        Command::Team(arguments) => members::run(&arguments),
        Command::Wormhole(arguments) => two_files::start(&arguments, two_files::TeamProgram::Mobile),
        Command::Station(arguments) => station::run(&arguments),
        Command::Path(arguments) => path::run(&arguments),
        Command::Entrances(arguments) => entrances::run(&arguments),
        Command::Clean(arguments) => clean::run(&arguments),
        Command::Doctor(arguments) => doctor::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
        Command::Keys(arguments) => keys::run(&arguments),
        Command::Bundle(arguments) => bundle::run(&arguments),
        Command::New(arguments) => new::run(&arguments),
        Command::Interface(arguments) => interface::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments),
        Command::Man(arguments) => man::run(&arguments, parser::grouped(Arguments::command())),
        Command::Version(arguments) => version::run(&arguments),
        Command::Run(arguments) => run::run(arguments),
        Command::Router(arguments) => routers::connect(arguments),
        Command::TcpRouter(arguments) => routers::serve(arguments),
        Command::TcpClient(arguments) => routers::join(arguments),
        Command::TeamRouter(arguments) => routers::team(arguments),
    };
    result.unwrap_or_else(|error| {
        complain(error);
        ExitCode::FAILURE
    })
}
