//! zenoh between two processes through its router, for `rohrpost-bench tcp` to stand beside: scouting is off, every
//! message leaves at once.
//!
//! ```text
//!  rohrpost-bench-zenoh router tcp/127.0.0.1:7447
//!  rohrpost-bench-zenoh pong tcp/127.0.0.1:7447
//!  rohrpost-bench-zenoh ping tcp/127.0.0.1:7447 BYTES MESSAGES WARM_UP CAP_MS     one way of each round trip, us
//! ```
//! The pong answers from its callback, the ping reads from the default channel, as in zenoh's own examples.

use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Cell, End, Link, Placement, Scheduling, ping, settle};
use std::process::ExitCode;
use std::time::{Duration, Instant};
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::CongestionControl;
use zenoh::sample::Sample;
use zenoh::{Config, Session, Wait};

const THERE: &str = "bench/there";
const BACK: &str = "bench/back";
/// The other end is there within this.
const MATCHES_WITHIN: Duration = Duration::from_secs(10);

type Done<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match arguments.as_slice() {
        ["router", at] => router(at),
        ["pong", at] => pong(at),
        ["ping", at, numbers @ ..] => measure(at, numbers),
        _ => Err("router LOCATOR, pong LOCATOR or ping LOCATOR BYTES MESSAGES WARM_UP CAP_MS".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Until it is killed. It has the processor that the TCP router has in its turn.
fn router(at: &str) -> Done<()> {
    settle(End::Pong, Placement::TwoCores, Scheduling::Fifo)?;
    let _session = open("router", &format!("listen: {{ endpoints: [\"{at}\"] }}"))?;
    loop {
        std::thread::park();
    }
}

/// Answers until it is killed.
fn pong(at: &str) -> Done<()> {
    settle(End::Pong, Placement::TwoCores, Scheduling::Fifo)?;
    let session = open("client", &format!("connect: {{ endpoints: [\"{at}\"] }}"))?;
    let back = publisher(&session, BACK)?;
    let answer = move |message: Sample| {
        if let Err(error) = back.put(message.payload().clone()).wait() {
            eprintln!("{error}");
        }
    };
    let _subscriber = session.declare_subscriber(THERE).callback(answer).wait()?;
    loop {
        std::thread::park();
    }
}

fn measure(at: &str, numbers: &[&str]) -> Done<()> {
    let numbers = numbers.iter().map(|number| number.parse()).collect::<Result<Vec<usize>, _>>()?;
    let [bytes, messages, warm_up, cap_ms] = numbers[..] else { return Err("four numbers are needed".into()) };
    let (placement, scheduling) = (Placement::TwoCores, Scheduling::Fifo);
    let cap = Duration::from_millis(cap_ms as u64);
    settle(End::Ping, placement, scheduling)?;
    let session = open("client", &format!("connect: {{ endpoints: [\"{at}\"] }}"))?;
    let subscriber = session.declare_subscriber(BACK).wait()?;
    let mut link = Through { there: publisher(&session, THERE)?, subscriber };
    let give_up = Instant::now() + MATCHES_WITHIN;
    while !link.there.matching_status().wait()?.matching() {
        if Instant::now() > give_up {
            return Err("nobody answers".into());
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    let cell = Cell { bytes, messages, warm_up, placement, scheduling, pace: None, cap };
    for round_trip_ns in ping(&mut link, &cell)? {
        println!("{}", round_trip_ns as f64 / 2000.0);
    }
    println!("end");
    Ok(())
}

struct Through {
    there: Publisher<'static>,
    subscriber: Subscriber<FifoChannelHandler<Sample>>,
}

impl Link for Through {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.there.put(message).wait().map_err(|error| Failure::of("put", error))
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let came = self.subscriber.recv().map_err(|error| Failure::of("receive", error))?;
        let bytes = came.payload().to_bytes();
        if bytes.len() != message.len() {
            return Err(Failure::Failed(format!("{} bytes came, not {}", bytes.len(), message.len())));
        }
        message.copy_from_slice(&bytes);
        Ok(())
    }
}

/// Its threads inherit where and how this one runs.
fn open(mode: &str, endpoints: &str) -> Done<Session> {
    let scouting = "scouting: { multicast: { enabled: false }, gossip: { enabled: false } }";
    Ok(zenoh::open(Config::from_json5(&format!("{{ mode: \"{mode}\", {scouting}, {endpoints} }}"))?).wait()?)
}

fn publisher(session: &Session, key: &'static str) -> Done<Publisher<'static>> {
    Ok(session.declare_publisher(key).congestion_control(CongestionControl::Block).express(true).wait()?)
}
