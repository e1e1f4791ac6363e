//! Modules in C, the examples of `clients/c`, beside modules in Rust: compiled as the book says, launched, listed,
//! called, killed, and with one stream that both read in place.

use crate::harness::{NoSettings, OUTPUT, PATIENCE, Place, classes, program, run_if_launched, runs, until, wait};
use crate::process::Running;
use crate::terminal::open_pair;
use rohrpost::interfaces::CameraInterface;
use rohrpost::types::Image;
use rohrpost::{Context, Module, ModuleError, Received, StreamSubscription};
use rohrpost_mailbox::{Label, Participant, Priority, Shape, Type};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::LazyLock;

const PAGE: &str = include_str!("../../docs/src/c.md");

pub(crate) static CLASSES: LazyLock<String> = LazyLock::new(|| {
    let drivers =
        "thermometer 120, counter 118, motor 200, odometry 160, laser 150, camera 112, looker 110, viewer 108";
    classes(&format!("{drivers}, asker 106, mapper 95"))
});

/// Not a test: a module that launch starts. Run as a test it ends at once.
#[test]
fn module() {
    run_if_launched::<Looker>();
}

/// Looks at a camera's pictures in Rust.
#[rohrpost::interface(class = "looker")]
trait Looking {
    /// How many whole pictures it has seen.
    #[command(16)]
    fn seen(&mut self) -> u64;
    /// How often pictures and records were not counted alike; once for each restart of the camera.
    #[command(17)]
    fn jumps(&mut self) -> u64;
}

struct Looker {
    pictures: StreamSubscription<Image>,
    seen: u64,
    /// By how much the number of the last picture was ahead of its record's.
    ahead: Option<u8>,
    jumps: u64,
}

impl Module for Looker {
    type Settings = NoSettings;
    type Interfaces = LookingInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        Ok(Self {
            pictures: context.subscribe_stream(CameraInterface::IMAGE, "camera.0")?,
            seen: 0,
            ahead: None,
            jumps: 0,
        })
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let Some(picture) = data.view(&self.pictures)? else { return Ok(()) };
        for (row, pixels) in picture.rows()?.enumerate() {
            let first = pixels[0];
            let is_whole =
                pixels.chunks(3).enumerate().all(|(column, pixel)| *pixel == [first, row as u8, column as u8]);
            if !is_whole {
                return Err(ModuleError::new(format!("row {row} is of two pictures")));
            }
        }
        let number = picture.rows()?.next().map_or(0, |pixels| pixels[0]);
        let ahead = number.wrapping_sub(data.head.sequence as u8);
        self.jumps += u64::from(self.ahead.is_some_and(|before| before != ahead));
        self.ahead = Some(ahead);
        self.seen += 1;
        Ok(())
    }
}

impl Looking for Looker {
    fn seen(&mut self) -> u64 {
        self.seen
    }

    fn jumps(&mut self) -> u64 {
        self.jumps
    }
}

fn client() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("clients/c")
}

/// Compiles an example.
pub(crate) fn example(place: &Place, name: &str) -> PathBuf {
    compiled(place, &client().join(format!("examples/{name}.c")))
}

/// Compiles a program of the book.
fn book(place: &Place, name: &str) -> PathBuf {
    let fence = format!("```{} {name}\n", name.rsplit_once('.').unwrap().1);
    let code = PAGE.split(&fence).nth(1).unwrap_or_else(|| panic!("no {name}")).split("```").next().unwrap();
    place.write(name, code);
    compiled(place, &place.path(name))
}

/// Compiles a program with the library that Cargo has put beside this one. Wherever it reads or writes what is not its
/// own, it ends, and its test fails.
pub(crate) fn compiled(place: &Place, source: &Path) -> PathBuf {
    let library = std::env::current_exe().unwrap().parent().unwrap().to_owned();
    let program = place.path(source.file_stem().unwrap().to_str().unwrap());
    let is_c = source.extension().unwrap() == "c";
    let (compiler, standard) = if is_c { ("cc", "-std=c11") } else { ("c++", "-std=c++17") };
    let output = Command::new(compiler)
        .args([standard, "-Wall", "-Wextra", "-Wshadow", "-Werror", "-D_GNU_SOURCE"])
        .args(["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", "-o"])
        .arg(&program)
        .arg(source)
        .arg(format!("-I{}", client().join("include").display()))
        .arg(format!("-L{0}", library.display()))
        // Not by the new tags, before which LD_LIBRARY_PATH counts: Cargo's leads to the library of an earlier build.
        .arg(format!("-Wl,--disable-new-dtags,-rpath,{}", library.display()))
        .args(["-lrohrpost_c", "-lm"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    program
}

/// A module's lines in a configuration.
pub(crate) fn entry(name: &str, program: &str, more: &str) -> String {
    format!("[[module]]\nname = \"{name}\"\nprogram = {program}\n{more}\n")
}

/// What a module says that it has seen.
pub(crate) fn seen(place: &Place, module: &str) -> u64 {
    said(place, module, "seen")
}

/// What a module says that it has counted.
pub(crate) fn said(place: &Place, module: &str, function: &str) -> u64 {
    place.say(&["call", module, function]).ok().trim().parse().unwrap()
}

#[test]
fn modules_in_rust_and_in_c_read_one_stream_in_place_that_a_camera_in_c_writes() {
    let place = Place::new();
    let [camera, viewer] = ["camera", "viewer"].map(|name| format!("{:?}", example(&place, name)));
    let looker = program("c_modules::module");
    let (mut launch, robot) = place.launched(&[
        &CLASSES,
        &entry("camera.0", &camera, "[module.stream.image]\nrecord = \"256 KiB\"\nkeep = 4"),
        &entry("viewer.0", &viewer, "calls = [\"camera.0\"]"),
        &entry("looker.0", &looker, "calls = [\"camera.0\"]"),
    ]);
    let listed = place.say(&["list"]).ok();
    assert!(["camera.0", "viewer.0", "looker.0"].iter().all(|name| listed.contains(name)), "{listed}");
    for module in ["viewer.0", "looker.0"] {
        until(format!("{module} sees"), || seen(&place, module) > 0);
    }
    let described = place.say(&["call", "viewer.0"]).ok();
    assert!(described.contains("seen -> u64\n      How many pictures it has seen."), "{described}");
    assert!(described.contains("brightness: f64\n      Of the whole picture, 0 to 255."), "{described}");
    let echoed = place.say(&["echo", "viewer.0", "--count", "1"]).ok();
    let brightness: f64 = echoed.trim().rsplit_once(' ').unwrap().1.parse().unwrap();
    assert!((60.0..=200.0).contains(&brightness), "{brightness}");
    let streams = place.say(&["stream", "list", "--json"]).json();
    let image = streams["streams"].as_array().unwrap().iter().find(|stream| stream["stream"] == "camera.0").unwrap();
    assert_eq!((&image["readers"], &image["record_bytes"]), (&2.into(), &262_144.into()), "{streams:#}");
    place.say(&["send", "viewer.0", "look"]).fails_with(["look"]);
    // Killed, it is started again, and goes on with its stream; so do its readers.
    robot.kill("camera.0");
    let before = [seen(&place, "viewer.0"), seen(&place, "looker.0")];
    for (module, before) in ["viewer.0", "looker.0"].into_iter().zip(before) {
        until(format!("{module} sees on"), || seen(&place, module) > before);
    }
    place.end(&mut launch);
}

/// The microcontroller at the other end of a serial line.
struct Wheels {
    line: File,
    count: i64,
}

impl Wheels {
    fn turn(&mut self) {
        self.count += 10;
        writeln!(self.line, "{} {}", self.count, self.count).unwrap();
    }
}

#[test]
fn a_module_in_c_asks_for_all_that_there_is_rightly_and_wrongly() {
    let place = Place::new();
    let thermometer = format!("{:?}", book(&place, "thermometer.c"));
    let asker = format!("{:?}", compiled(&place, &client().join("tests/asker.c")));
    let (mut launch, robot) = place.launched(&[
        &CLASSES,
        &entry("thermometer.0", &thermometer, "settings = { volts-per-degree = 0.02 }"),
        &entry(
            "asker.0",
            &asker,
            "calls = [\"thermometer.0\"]\nsettings = { share = 60, name = \"it\", list = [1, 2] }\n\
             [module.stream.small]\nreaders = 1",
        ),
    ]);
    let checked = wait("it has heard of the temperature", || {
        let said = place.say(&["call", "asker.0", "check"]);
        let is_early = said.err.contains("came[");
        if is_early {
            // A failed function puts its module in error, until it is switched off and on.
            for word in ["off", "on"] {
                place.say(&["call", "asker.0", word]).ok();
            }
        }
        (!is_early).then_some(said)
    });
    assert!(checked.ok().contains(r#"{\"list\":[1,2],\"name\":\"it\"}"#), "settings, without parameters");
    assert_eq!(robot.state("asker.0"), "on", "what it opens besides is not taken for it");
    let records = place.say(&["stream", "read", "asker.0", "1", "--from", "0"]).ok();
    let bodies: Vec<&str> = records.lines().map(|line| line.rsplit_once("  ").unwrap().1).collect();
    let expected = ["{number: 7, bytes: [97, 98, 99]}", "{number: 8, bytes: [120, 121]}", "{number: 7, bytes: [122]}"];
    assert_eq!(bodies, expected, "{records}");
    place.say(&["call", "asker.0", "fork"]).ok();
    place.say(&["call", "asker.0", "fork"]).ok();
    assert_eq!(robot.state("asker.0"), "on", "its children have given up nothing of it");
    // Codes of calls in the function are its module's failures, and nothing that its caller did.
    for (function, why) in [("typo", "there is no parameter `typo`"), ("bad_reply", "the bytes are not of this type")] {
        let failed = place.say(&["call", "asker.0", function]).fails();
        assert!(failed.contains(why) && !failed.contains("argument"), "{failed}");
        assert_eq!(robot.state("asker.0"), "error");
        for word in ["off", "on"] {
            place.say(&["call", "asker.0", word]).ok();
        }
    }
    place.say(&["call", "asker.0", "fail"]).fails_with(["it does not say why"]);
    assert_eq!(robot.state("asker.0"), "error");
    // So launch ends with an error, once it knows.
    let why = "asker.0 is in error: it does not say why";
    until("launch tells it", || (launch.out() + &launch.err()).contains(why));
    launch.stop_failed();
    place.assert_empty();
}

#[test]
fn a_driver_in_c_gives_the_mapper_the_odometry_that_it_makes_of_a_serial_line() {
    let place = Place::new();
    let driver = format!("{:?}", example(&place, "driver"));
    let (line, slave, port) = open_pair();
    let map = client().join("../../config/building.map");
    let (mut launch, robot) = place.launched(&[
        &CLASSES,
        OUTPUT,
        "[[module]]\nname = \"motor.0\"\naliases = [\"odometry.1\", \"laser.0\"]\nbuiltin = \"sim\"\n",
        &format!("settings = {{ map = {map:?}, seed = 1, laser-rate-hz = 20 }}\n"),
        &entry("odometry.0", &driver, &format!("settings = {{ port = {port:?}, count-m = 0.002 }}")),
        "[[module]]\nname = \"mapper.0\"\nbuiltin = \"mapper\"\ncalls = [\"laser.0\", \"odometry.0\"]\n",
        "settings = { laser = \"laser.0\", odometry = \"odometry.0\" }\n",
    ]);
    let mut wheels = Wheels { line, count: 0 };
    until("the mapper maps scans by the odometry of C", || {
        wheels.turn();
        let counts = place.say(&["call", "mapper.0", "counts"]).ok();
        let mapped = counts.split_once("mapped: ").unwrap().1.split([',', '}']).next().unwrap();
        mapped != "0"
    });
    place.say(&["call", "odometry.0", "get", "odometry"]).ok_with(["pose: {x_m: ", "heading_rad: 0}"]);
    // A parameter with a range of its own, and one that the module itself refuses.
    place.say(&["param", "set", "odometry.0", "count-m", "0.004"]).ok();
    let said = place.say(&["param", "set", "odometry.0", "track-m", "20"]);
    said.fails_with(["`track-m` is 20 m, out of range: 0.01..=10 m"]);
    let said = place.say(&["param", "set", "odometry.0", "port", "/dev/null"]);
    said.fails_with(["the port is opened when the module starts: restart it"]);
    // Whatever the line says: more than a number has room for, and differences of more.
    for counts in ["99999999999999999999 1", "9223372036854775807 0", "-9223372036854775808 0"] {
        writeln!(wheels.line, "{counts}").unwrap();
    }
    writeln!(wheels.line, "no counts").unwrap();
    until("a line that cannot be read is told", || {
        place.say(&["log"]).ok().contains("something that is not two counts")
    });
    assert_eq!(robot.state("odometry.0"), "on");
    drop(slave);
    place.end(&mut launch);
}

#[test]
fn the_programs_of_the_book_do_what_it_says() {
    let place = Place::new();
    let [thermometer, counter, echo] =
        ["thermometer.c", "counter.cpp", "echo.c"].map(|name| book(&place, name).display().to_string());
    let (mut launch, robot) = place.launched(&[
        &CLASSES,
        &entry("thermometer.0", &format!("{thermometer:?}"), "settings = { volts-per-degree = 0.02 }"),
        &entry("counter.0", &format!("{counter:?}"), ""),
    ]);
    assert_eq!(place.say(&["call", "thermometer.0", "calibrate", "21.5"]).ok(), "1.5\n");
    until("it says what it was told", || {
        place.say(&["echo", "thermometer.0", "--count", "1"]).ok().ends_with(" 21.5\n")
    });
    place.say(&["call", "thermometer.0", "calibrate", "warm"]).fails_with(["true_c"]);
    until("it counts", || place.say(&["echo", "counter.0", "--count", "1"]).ok().ends_with(" 2\n"));
    let mut command = Command::new(&echo);
    command.arg(&robot.installation.path).arg("main").env("ROHRPOST_DIR", place.memory());
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut echo = Running::start(command);
    let [me, there] = ["tool.41", "tool.40"].map(|name| robot.name(name));
    let participant = Participant::join(&robot.node, me).unwrap();
    let mut receiver = participant.receiver(me, Shape::default()).unwrap();
    let mut sender = wait("it receives", || {
        echo.assert_runs();
        participant.sender(there).ok()
    });
    let label = Label { from: me, kind: Type::command(16), id: 7, priority: Priority(16), ..Label::default() };
    sender.send(&label, &[b"there and back"]).unwrap();
    let package = receiver.receive_timeout(PATIENCE).unwrap();
    assert_eq!((package.head().id, package.body()), (7, &b"there and back"[..]));
    drop(package);
    sender.send(&label, &[]).unwrap();
    assert!(echo.end().success());
    receiver.close();
    drop((sender, participant));
    // When launch dies, whatever killed it, they end as modules in Rust do.
    let all = ["thermometer.0", "counter.0"].map(|name| (robot.name(name), robot.pid(name)));
    launch.kill();
    until("no module is left", || all.iter().all(|(_, pid)| !runs(*pid)));
    assert!(all.iter().all(|(name, pid)| robot.node.last_word_of(*name, *pid).is_none()), "they left in order");
    place.say(&["clean"]).ok();
    place.assert_empty();
}
