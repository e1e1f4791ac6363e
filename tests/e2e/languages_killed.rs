//! One stream and its readers in three languages, killed again and again: a camera in C writes, modules in C, Rust and
//! Python read in place. Those that are not killed go on, pictures are whole, and accounts balance as in Rust.

use crate::c_modules::{CLASSES, compiled, entry, example, said, seen};
use crate::harness::{OUTPUT, Place, Robot, classes, program, repository, signal, times, until};
use crate::python_node::package;
use nix::sys::signal::Signal;
use rohrpost::Name;
use rohrpost::interfaces::CameraInterface;
use rohrpost_mailbox::{ClassTraffic, Loss, Next, Participant, StreamId, StreamReader};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Reads the camera's pictures in Python.
const SEER: &str = include_str!("python/seer.py");
/// Reads them in C.
const WATCHER: &str = "tests/e2e/c/watcher.c";
const READERS: [&str; 3] = ["viewer.0", "looker.0", "seer.0"];
const ALL: [&str; 4] = ["camera.0", "viewer.0", "looker.0", "seer.0"];
/// Of the camera's pictures.
const WIDTH: usize = 320;
const HEIGHT: usize = 240;
const RESTART: &str = "restart = { backoff = \"50 ms\", at-most = 1000, within = \"50 ms\" }";

/// The module in Python, which finds the package where it was built.
fn seer(place: &Place) -> PathBuf {
    place.program("seer.py", SEER.replace("PACKAGE", package(place).to_str().unwrap()))
}

fn modules(place: &Place) -> Vec<String> {
    let quoted = |path: &Path| format!("{path:?}");
    let looker = program("c_modules::module");
    let stream = "[module.stream.image]\nrecord = \"256 KiB\"\nkeep = 4\n";
    let reads = format!("calls = [\"camera.0\"]\n{RESTART}");
    vec![
        CLASSES.clone(),
        classes("seer 107"),
        OUTPUT.into(),
        entry("camera.0", &quoted(&example(place, "camera")), &format!("{RESTART}\n{stream}")),
        entry("viewer.0", &quoted(&compiled(place, Path::new(&repository(WATCHER)))), &reads),
        entry("looker.0", &looker, &reads),
        entry("seer.0", &quoted(&seer(place)), &reads),
    ]
}

/// The stream as the test reads it itself.
struct Own {
    reader: StreamReader,
    /// By how much numbers of pictures are ahead of those of records, modulo 256, in each incarnation of the camera.
    ahead: BTreeMap<u32, u8>,
}

/// Reads all that there is. Each picture is whole, of one number, and the one of its record: the camera counts them as
/// the stream does its records, so that a picture which was not written shows, as what an older one has left.
fn read_rest(own: &mut Own) {
    loop {
        match own.reader.try_next().unwrap() {
            Next::Nothing => return,
            Next::Lost(_) => {}
            Next::Record(record) => {
                let pixels = record.body().last_chunk::<{ HEIGHT * WIDTH * 3 }>().unwrap();
                for (index, pixel) in pixels.chunks(3).enumerate() {
                    let expected = [pixels[0], (index / WIDTH) as u8, (index % WIDTH) as u8];
                    assert_eq!(pixel, expected, "pixel {index} of {:?}", record.info());
                }
                let info = record.info();
                let ahead = pixels[0].wrapping_sub(info.sequence as u8);
                assert_eq!(*own.ahead.entry(info.incarnation).or_insert(ahead), ahead, "not written: {info:?}");
            }
        }
    }
}

/// What was accepted was received, is lost for a cause, or waits; each death may have interrupted one.
fn check_mailboxes(robot: &Robot, deaths: u64) {
    for name in robot.node.mailboxes().unwrap() {
        let Some(found) = robot.node.look_at(name) else { continue };
        let accepted = || Loss::ALL.into_iter().filter(|cause| cause.was_accepted());
        let passed = |class: &ClassTraffic| class.received + accepted().map(|cause| class.lost(cause)).sum::<u64>();
        let accounted = found.classes.iter().map(passed).sum::<u64>() + u64::from(found.depth);
        assert!(found.sent.abs_diff(accounted) <= deaths, "{deaths} deaths, {accounted} accounted for: {found:?}");
    }
}

/// Each reader sees pictures that it had not seen.
fn go_on(place: &Place, own: &mut Own, before: [u64; 3]) {
    for (module, before) in READERS.into_iter().zip(before) {
        until(format!("{module} sees on"), || {
            read_rest(own);
            seen(place, module) > before
        });
    }
}

/// Each restart of the camera shows once at each reader, and nothing else does.
fn check_jumps(place: &Place, before: [u64; 3], restarts: usize) -> [u64; 3] {
    let jumps = [0, 1, 2].map(|reader| before[reader] + said(place, READERS[reader], "jumps"));
    assert!(jumps.iter().all(|jumps| *jumps <= restarts as u64), "{READERS:?}: {jumps:?}, {restarts} restarts");
    jumps
}

/// Kills one of them, and only that one is started again.
fn kill(place: &Place, robot: &Robot, own: &mut Own, victim: &str) {
    let pids = || ALL.map(|module| (module, robot.pid(module)));
    let others = |pids: [(&'static str, u32); 4]| pids.into_iter().filter(|(module, _)| *module != victim);
    let (before, pid) = (pids(), robot.pid(victim));
    signal(pid, Signal::SIGKILL);
    robot.wait_restarted(victim, pid);
    go_on(place, own, READERS.map(|module| if module == victim { 0 } else { seen(place, module) }));
    assert!(others(pids()).eq(others(before)), "{:?} were {before:?}", pids());
}

#[test]
fn modules_in_c_rust_and_python_are_killed_and_the_others_go_on() {
    let place = Place::new();
    let modules = modules(&place);
    let (mut launch, robot) = place.launched(&modules.iter().map(String::as_str).collect::<Vec<_>>());
    let participant = Participant::join(&robot.node, Name::NONE).unwrap();
    let id = StreamId { name: robot.name("camera.0"), number: CameraInterface::IMAGE.number };
    let mut own = Own { reader: participant.stream_reader(id).unwrap(), ahead: BTreeMap::new() };
    let began = own.reader.position();
    go_on(&place, &mut own, [0; 3]);
    // One after the other, in another order each time round, and at other moments of their periods.
    // For a long run: `ROHRPOST_KILLS=200 cargo test -p rohrpost-cli --test e2e languages_killed`.
    let kills = times("ROHRPOST_KILLS", 8);
    let victims: Vec<&str> = (0..kills).map(|kill| ALL[(kill * 3 + kill / ALL.len()) % ALL.len()]).collect();
    // What the killed ones had counted.
    let (mut counted, mut restarts) = ([0; 3], 0);
    for (at, victim) in victims.iter().enumerate() {
        std::thread::sleep(Duration::from_millis(at as u64 * 7 % 50));
        let jumps = check_jumps(&place, counted, restarts);
        if let Some(reader) = READERS.iter().position(|reader| reader == victim) {
            counted[reader] = jumps[reader];
        }
        kill(&place, &robot, &mut own, victim);
        restarts += usize::from(*victim == "camera.0");
    }
    check_jumps(&place, counted, restarts);
    place.say(&["stop", "camera.0"]).ok();
    read_rest(&mut own);
    let told = robot.node.inspect_stream(id).unwrap().unwrap();
    let (read, lost) = own.reader.accounts();
    assert_eq!(read + lost, told.written - began, "{read} read, {lost} lost");
    assert_eq!((told.adoptions as usize, told.refused), (restarts, 0));
    check_mailboxes(&robot, victims.len() as u64);
    drop((own, participant, robot));
    place.end(&mut launch);
}
