//! What a module says, on its way to a collector that is played by the test. One test, since a process has one output.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, Node, Participant, Receiver, Shape};
use rohrpost_modules::common::{DataHead, OutputLevel};
use rohrpost_modules::output::{
    LINES, OutputLine, TEXT_MAX, drain, flush, install, level, lost, retry_at, set_level, suppressed,
};
use std::path::Path;
use std::time::{Duration, Instant};

const CONFIG: &str = r#"
installation = "said"
[system]
name = "robot"
id = 1
[classes]
motor = { id = 200, text = "Drives" }
output = { id = 32, text = "Collects" }
tool = { id = 16, text = "By hand" }
[nodes.main]
[output]
burst = 100000
[[module]]
name = "motor.0"
program = "motor"
optional = true
[[module]]
name = "output.0"
builtin = "output"
"#;
const ME: Name = Name::new(1, 200, 0, 0);
const COLLECTOR: Name = Name::new(1, 32, 0, LINES);
const PATIENCE: Duration = Duration::from_secs(30);
/// The shortest time for which lines that wait let the module sleep.
const PAUSE: Duration = Duration::from_millis(20);
/// Of the queue in each process.
const WAITING: u32 = 256;

/// The next line; sends what waits until there is one.
fn next(collector: &mut Receiver) -> OutputLine {
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        drain();
        if let Some(package) = collector.receive_timeout(Duration::from_millis(5)) {
            let (_, value) = DataHead::split(package.body()).unwrap();
            return postcard::from_bytes(value).unwrap();
        }
    }
    panic!("no line came");
}

fn nothing_more(collector: &mut Receiver) {
    drain();
    assert!(collector.try_receive().is_none() && retry_at().is_none());
}

#[test]
fn lines_arrive_whole_or_are_counted() {
    let directory = tempfile::tempdir().unwrap();
    let installation = Installation::parse(CONFIG, Path::new("said.toml")).unwrap();
    let node = Node::create(&directory.path().join("node"), 0o700).unwrap();
    let participant = Participant::join(&node, ME).unwrap();
    install(&participant, &installation, ME, true);

    // No collector: what does not fit in the queue is counted, nobody waits.
    for n in 0..WAITING + 44 {
        tracing::info!("line {n}");
    }
    assert_eq!(lost(), 44);
    let before = Instant::now();
    assert!(retry_at().is_some_and(|at| at >= before + PAUSE), "a time that has passed would keep the module awake");

    // Errors and panics have queues of their own: what waits already takes no room from them.
    tracing::error!("an error behind the flood");
    assert!(std::thread::spawn(|| panic!("a panic before there is a collector")).join().is_err());
    assert_eq!(lost(), 44);

    // A collector comes, too small for all at once.
    let shape = Shape { slots: 8, ..Shape::default() };
    let mut collector = Participant::join(&node, Name::NONE).unwrap().receiver(COLLECTOR, shape).unwrap();
    // What was tried first, when nobody was there, goes first; then what matters most.
    let panic = next(&mut collector);
    assert!(panic.text.ends_with("a panic before there is a collector") && panic.level == OutputLevel::Error);
    assert_eq!((panic.lost, next(&mut collector).text.as_str()), (44, "an error behind the flood"));
    let lines: Vec<OutputLine> = (0..WAITING).map(|_| next(&mut collector)).collect();
    assert_eq!(lines.iter().map(|line| line.lost).sum::<u32>(), 0, "it is said what was lost, once");
    assert!(lines.iter().enumerate().all(|(n, line)| line.text == format!("line {n}") && line.module() == ME));
    nothing_more(&mut collector);

    // The level is changed while it runs.
    for (level, heard) in [(OutputLevel::Warn, "w"), (OutputLevel::Error, ""), (OutputLevel::Trace, "dw")] {
        let before = self::level();
        assert_eq!((set_level(level), self::level()), (before, Some(level)));
        tracing::debug!("d");
        tracing::warn!("w");
        for text in heard.chars() {
            assert_eq!(next(&mut collector).text, text.to_string(), "at {level:?}");
        }
        nothing_more(&mut collector);
    }

    // Long lines are cut, never inside a character.
    for shift in 0..4 {
        tracing::info!("{}{}", "x".repeat(shift), "€".repeat(TEXT_MAX));
        let text = next(&mut collector).text;
        assert!(text.len() <= TEXT_MAX && text.len() > TEXT_MAX - 6, "{} bytes", text.len());
        assert!(text.ends_with("€…"));
    }
    tracing::info!(number = 7, "with fields");
    assert_eq!(next(&mut collector).text, "with fields number=7");

    // The number of an error has a place of its own.
    let full = std::io::Error::from_raw_os_error(28);
    tracing::warn!(errno = full.raw_os_error(), "is full");
    let line = next(&mut collector);
    assert_eq!((line.errno, line.text.as_str()), (Some(28), "is full"));
    assert_eq!(line.full_text(), "is full (errno 28: No space left on device)");
    tracing::warn!(error = &full as &(dyn std::error::Error + 'static), "cannot write");
    let line = next(&mut collector);
    let text = "cannot write error=No space left on device (os error 28)";
    assert_eq!((line.errno, line.text.as_str(), &*line.full_text()), (Some(28), text, text));
    tracing::warn!(errno = None::<i32>, "is well");
    tracing::warn!(errno = 70_000, "is odd");
    let lines = [0, 1].map(|_| next(&mut collector));
    assert_eq!(
        lines.each_ref().map(|line| (line.errno, line.text.as_str())),
        [(None, "is well"), (None, "is odd errno=70000")]
    );

    // A panic is reported with its reason, in any thread.
    assert!(std::thread::spawn(|| panic!("the wheels came off")).join().is_err());
    let line = next(&mut collector);
    assert_eq!(line.level, OutputLevel::Error);
    assert!(line.text.contains("the wheels came off") && line.text.contains("output.rs"), "{}", line.text);

    // The collector dies and another one comes, for shorter lines only: those that never fit do not block the rest.
    collector.close();
    let shape = Shape { body_bytes_max: 128, ..Shape::default() };
    let mut collector = Participant::join(&node, Name::NONE).unwrap().receiver(COLLECTOR, shape).unwrap();
    let before = lost();
    tracing::info!("{}", "long".repeat(100));
    tracing::info!("short");
    let line = next(&mut collector);
    assert_eq!((line.text.as_str(), line.lost, lost() - before), ("short", 1, 1));

    // Last words find a collector that comes a little later. A computer may be too busy for that, but not each time.
    let there = (0..100).any(|_| {
        std::mem::replace(&mut collector, elsewhere(&node)).close();
        tracing::error!("last words");
        let ending = std::thread::spawn(flush);
        collector = Participant::join(&node, Name::NONE).unwrap().receiver(COLLECTOR, Shape::default()).unwrap();
        ending.join().unwrap();
        collector.try_receive().is_some_and(|package| String::from_utf8_lossy(package.body()).ends_with("last words"))
    });
    assert!(there, "it ended without its last words");
    while collector.try_receive().is_some() {}

    // At the end of its patience, what is left is lost, and counted.
    std::mem::replace(&mut collector, elsewhere(&node)).close();
    let before = lost();
    for _ in 0..3 {
        tracing::info!("too late");
    }
    flush();
    assert_eq!((lost() - before, retry_at()), (3, None));
    collector = Participant::join(&node, Name::NONE).unwrap().receiver(COLLECTOR, Shape::default()).unwrap();
    tracing::info!("in time");
    let line = next(&mut collector);
    assert_eq!((line.text.as_str(), line.lost), ("in time", 3));

    // Panics that a thread survives, one after the other: none of them waits for a collector, as its last one would.
    collector.close();
    for _ in 0..10 {
        assert!(std::panic::catch_unwind(|| panic!("caught")).is_err());
        drain();
    }
    assert_eq!(lost() - before, 3, "none was given up");
    let mut collector = Participant::join(&node, Name::NONE).unwrap().receiver(COLLECTOR, Shape::default()).unwrap();
    for _ in 0..10 {
        assert!(next(&mut collector).text.ends_with("caught"));
    }

    // A flood beyond the allowance, and no collector: a queue full of lines, many lost, the rest suppressed.
    collector.close();
    let (lost_before, flood) = (lost(), 200_000);
    for n in 0..flood {
        tracing::info!("{n}");
    }
    let flooded = Instant::now();
    while flooded.elapsed() < Duration::from_secs(1) {
        drain();
        std::thread::sleep(Duration::from_millis(20));
    }
    // It is time to tell of it, but there is no room: that must not keep the module awake.
    let before = Instant::now();
    assert!(retry_at().is_some_and(|at| at >= before + PAUSE));
    let mut collector = Participant::join(&node, Name::NONE).unwrap().receiver(COLLECTOR, Shape::default()).unwrap();
    let (mut said, mut told) = (0, 0);
    while told == 0 {
        let line = next(&mut collector);
        said += u64::from(line.suppressed == 0);
        told += u64::from(line.suppressed);
    }
    assert_eq!((said, told), (u64::from(WAITING) + 1, suppressed()), "one was held by the way");
    assert_eq!(said + told + (lost() - lost_before), flood, "all are accounted for");
}

/// A mailbox that nobody sends to.
fn elsewhere(node: &std::sync::Arc<Node>) -> Receiver {
    let name = Name::new(1, 32, 9, LINES);
    Participant::join(node, Name::NONE).unwrap().receiver(name, Shape::default()).unwrap()
}
