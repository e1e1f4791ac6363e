//! Programs in Python at a robot: on a laptop in a network namespace of its own, with Python and `clients/python`
//! alone. The robot is on `base`; its file knows the laptop as a node that the TCP router reaches, and nothing is
//! launched there.

use crate::harness::{
    Place, assert_has, halt, head, json_lines, lab, program, python, repository, signal, until, wait,
};
use crate::network::Network;
use crate::process::{Running, Said};
use nix::sys::signal::Signal;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

const NODES: [(&str, &str); 2] = [("base", "10.80.0.1"), ("laptop", "10.80.0.2")];
const OPEN: &str = "security = \"none\"";
const SEALED: &str = "security = \"tls\"\ncertificates = \"certificates\"";
const SERVER: &str = "10.80.0.1:21119";
const PAGE: &str = include_str!("../../docs/src/python.md");

struct Scene {
    network: Network,
}

impl Scene {
    /// None, with a report, where namespaces are not permitted.
    fn launched(security: &str) -> Option<Self> {
        Self::with(security, "")
    }

    /// The same with more modules.
    fn with(security: &str, modules: &str) -> Option<Self> {
        let lab = lab(NODES, "Python on a laptop")?;
        let place = Place::new();
        let config = place.write("robot.toml", configured(security) + modules);
        if security == SEALED {
            place.say(&["keys", "new", config.to_str().unwrap()]).ok();
        }
        let network = Network::new(place, config, Some(lab)).launched(&["base"]);
        until("the robot's modules are at the TCP router", || network.net("base")["beyond"]["state"] == "up");
        Some(Self { network })
    }

    /// Python on the laptop.
    fn python(&self, arguments: &[&str]) -> Running {
        let mut command = python(&self.network.place, arguments);
        command.env("PYTHONPATH", repository("clients/python/src")).env("ROHRPOST_CONFORMING", &self.network.config);
        self.network.inside("laptop", || Running::start(command))
    }

    /// A program of the book, with the arguments that the book gives it.
    fn book(&self, name: &str) -> Running {
        let fence = format!("```python {name}\n");
        let code = PAGE.split(&fence).nth(1).unwrap_or_else(|| panic!("no {name}")).split("```").next().unwrap();
        self.network.place.write(name, code);
        self.python(&[name, SERVER, &self.digests(), "certificates"])
    }

    fn digests(&self) -> String {
        self.network.robot("base").installation.digest().to_string()
    }

    /// A person's command on the robot.
    fn says(&self, arguments: &[&str]) -> Said {
        self.network.says("base", arguments)
    }

    /// `python -m rohrpost` on the laptop, unsealed.
    fn prints(&self, words: &[&str]) -> Said {
        self.printing(words).said()
    }

    fn printing(&self, words: &[&str]) -> Running {
        let (digests, label) = (self.digests(), "node laptop of robot");
        let classes = ["motor=200", "odometry=160", "camera=112", "tcp=64", "tool=16"];
        let mut arguments = [&["-m", "rohrpost"], words].concat();
        arguments.extend(["--server", SERVER, "--digests", &digests, "--as", "tool.70", "--timeout", "20"]);
        arguments.extend(["--label", label]);
        arguments.extend(classes.iter().flat_map(|class| ["--class", class]));
        self.python(&arguments)
    }

    /// The newest picture of the camera, which takes no more of them: its number, and postcard.
    fn newest_picture(&self) -> (String, Vec<u8>) {
        let raw = self.network.place.path("newest.postcard");
        let said = self.on_node(&["stream", "read", "camera.0", "image", "--raw", raw.to_str().unwrap()]).ok();
        (said.split_whitespace().next().unwrap().into(), std::fs::read(raw).unwrap())
    }

    /// A person's command on the robot that has subcommands.
    fn on_node(&self, arguments: &[&str]) -> Said {
        let at = ["--config", self.network.config.to_str().unwrap(), "--node", "base"];
        self.network.place.say(&[arguments, &at].concat())
    }

    fn stop(self) {
        self.network.stop();
    }
}

fn configured(security: &str) -> String {
    let map = repository("config/building.map");
    format!(
        "{}[nodes.base]\ntools = [0, 15]\n[nodes.laptop]\nnetwork = \"tcp\"\ntools = [64, 127]\n\
         [tcp]\n{security}\naddress = \"{}\"\nserver = \"base\"\n\
         [[module]]\nname = \"motor.0\"\nnode = \"base\"\naliases = [\"odometry.0\", \"laser.0\", \"camera.0\"]\n\
         builtin = \"sim\"\n\
         settings = {{ map = {map:?}, seed = 1, laser-rate-hz = 10, odometry-rate-hz = 20, camera-rate-hz = 2 }}\n\
         [module.stream.image]\nrecord = \"1 MiB\"\nkeep = 4\n\
         [[replica]]\nstream = \"camera.0/image\"\nto = [\"laptop\"]\n\
         [[module]]\nname = \"gripper.0\"\nnode = \"laptop\"\nprogram = \"gripper.py\"\n\
         calls = [\"motor.0\", \"odometry.0\"]\n",
        head("motor 200, odometry 160, laser 150, camera 112, gripper 110, probe 96, tcp 64, output 32, tool 16"),
        NODES[0].1
    )
}

#[test]
fn a_laptop_with_python_alone_drives_the_robot_and_is_called_from_there() {
    let Some(scene) = Scene::launched(SEALED) else { return };
    let mut gripper = scene.book("hosted.py");
    gripper.wait_for("hosted");
    let drove = scene.book("drive.py").said().ok();
    let lines: Vec<&str> = drove.lines().collect();
    assert!(
        matches!(lines[..], [at, "refused: NotFinite", time] if at.starts_with("drives at 0.")
        && time.starts_with("robot's time is known to ")),
        "{drove}"
    );
    let watched = scene.book("watch.py").said().ok();
    // The newest value is the first one, but on a computer that was too busy to read that before the next.
    let number =
        watched.strip_prefix("motor.0 is On, odometry.0 is On\nnumber ").map(|number| number.trim().parse::<u32>());
    assert!(matches!(number, Some(Ok(_))), "{watched}");
    a_picture_comes_as_the_camera_took_it(&scene, || scene.book("look.py"), "picture.png");
    let closes = || scene.says(&["call", "gripper.0", "close", "4"]);
    let wait_closed = |when: &str| {
        let closed = wait(when, || Some(closes()).filter(|said| said.code == Some(0)));
        assert_eq!(closed.ok(), "{width_m: 0.02, force_n: 4}\n", "{when}");
    };
    wait_closed("the robot stops, and it closes");
    // What it calls does not answer in time: that is no error of its own, and passes.
    let motor = scene.network.robot("base").pid("motor.0");
    halt(motor);
    let late = closes();
    assert!(
        late.code == Some(1) && late.out.contains("answers with an error: \"the robot does not stop: no answer from "),
        "{late:?}"
    );
    signal(motor, Signal::SIGCONT);
    wait_closed("the robot stops again, and it closes");
    let refused = scene.says(&["call", "gripper.0", "close", "40"]);
    assert_eq!(
        (refused.code, refused.out.trim()),
        (Some(1), "gripper.0 answers with an error: \"more than 20 N break it\"")
    );
    let said = scene.says(&["call", "gripper.0"]).ok();
    assert_has(
        &said,
        ["Holds things, and stops the robot while it takes them.", "close <force_n: f64>", "How it holds now."],
    );
    let held = scene.says(&["echo", "gripper.0", "grip", "--count", "1"]).ok();
    assert!(held.ends_with("{width_m: 0.02, force_n: 4}\n"), "{held}");
    let set = |value: &str| scene.on_node(&["param", "set", "gripper.0", "speed-m-s", value]);
    assert_eq!(set("0.1").ok(), "gripper.0 speed-m-s: 0.05 -> 0.1 m/s\n");
    assert!(set("0.3").fails().contains("out of range: 0..=0.2"));
    let file =
        scene.network.place.write("gripper.json", scene.on_node(&["interface", "export", "gripper.0", "--json"]).ok());
    let code = scene.network.place.say(&["interface", "generate", "--lang", "rust", file.to_str().unwrap()]).ok();
    assert!(code.contains("fn close(&mut self, force_n: f64) -> Result<Grip, String>;"), "{code}");
    // The TCP router is killed; the program in Python comes back by itself, the same one.
    signal(scene.network.robot("base").pid("tcp.255"), Signal::SIGKILL);
    wait_closed("it is called again");
    gripper.assert_runs();
    gripper.signal(Signal::SIGINT);
    gripper.end();
    until("it has gone", || scene.says(&["call", "--timeout", "1", "gripper.0", "close", "4"]).code != Some(0));
    scene.stop();
}

/// A program on the laptop writes the newest picture: its pixels are those of the camera.
fn a_picture_comes_as_the_camera_took_it(scene: &Scene, program: impl FnOnce() -> Running, file: &str) {
    scene.says(&["call", "motor.0", "off"]).ok();
    let (number, taken) = scene.newest_picture();
    program().said().ok_with([&number, "640"]);
    let (size, pixels) = read_png(&scene.network.place.path(file));
    assert_eq!((size, pixels.len()), ((640, 480), 640 * 480 * 3));
    // Before the pixels stand sizes and format alone.
    assert!(taken.ends_with(&pixels) && taken.len() < pixels.len() + 16, "not as the camera took it");
    scene.says(&["call", "motor.0", "on"]).ok();
}

/// Width, height and bytes of a file of red, green and blue.
fn read_png(file: &Path) -> ((u32, u32), Vec<u8>) {
    let mut reader = png::Decoder::new(BufReader::new(File::open(file).unwrap())).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
    ((info.width, info.height), pixels)
}

#[test]
fn what_the_tools_print_python_prints_on_the_laptop() {
    let Some(scene) = Scene::launched(OPEN) else { return };
    until("all are in the list, which the TCP router makes anew now and then", || {
        let hosts = scene.prints(&["list"]).ok();
        let has = |module| hosts.lines().any(|line| line.starts_with(module) && line.ends_with("node base of robot"));
        ["motor.0", "odometry.0", "tcp.255"].into_iter().all(has)
    });
    assert!(scene.prints(&["status", "motor.0"]).ok().starts_with("motor.0 is on\n"));
    assert_eq!(scene.prints(&["call", "motor.0.drive", "0.3", "-0.1"]).ok(), "ok\n");
    let refused = scene.prints(&["call", "motor.0.drive", "nan", "0"]);
    assert_eq!((refused.code, refused.err.trim()), (Some(1), "motor.0.drive answers with an error: NotFinite"));
    for (words, why) in [
        (["call", "motor.0.drive", "fast", "0"], "speed_m_s: expected a number (f64), got `fast`"),
        (["call", "motor.0.fly", "1", "0"], "1.200.0.0 has no function `fly`; it has: drive, halt"),
        (["call", "pilot.0.drive", "1", "0"], "no class `pilot` is known here"),
    ] {
        let said = scene.prints(&words);
        assert!(said.code == Some(2) && said.err.contains(why), "{said:?}");
    }
    let got = scene.prints(&["call", "odometry.0.get.odometry"]).ok();
    assert!(got.starts_with("{pose: {x_m: "), "{got}");
    let data = scene.prints(&["echo", "odometry.0.odometry", "--count", "2", "--json"]).ok();
    let data = json_lines(&data);
    let numbers = data.iter().map(|data| data["sequence"].as_u64());
    assert_eq!(numbers.collect::<Vec<_>>(), [Some(0), Some(1)], "{data:?}");
    scene.prints(&["time"]).ok_with([" s since 1970, off by at most "]);
    let picture = || scene.printing(&["picture", "camera.0", "it.png"]);
    a_picture_comes_as_the_camera_took_it(&scene, picture, "it.png");
    let records = scene.prints(&["stream", "read", "camera.0", "image", "--next", "2", "--json", "--bytes", "3"]).ok();
    let records = json_lines(&records);
    let values: Vec<_> = records.iter().map(|record| &record["value"]).filter(|value| !value.is_null()).collect();
    assert_eq!(values.len(), 2, "{records:?}");
    let pixels = &values[0]["pixels"];
    assert_eq!((values[0]["width_px"].as_u64(), pixels["len_bytes"].as_u64()), (Some(640), Some(640 * 480 * 3)));
    let none = scene.prints(&["stream", "read", "odometry.0", "odometry"]);
    assert!(none.code == Some(2) && none.err.contains("sends node laptop no stream odometry.0/odometry"), "{none:?}");
    scene.stop();
}

#[test]
fn a_client_in_python_conforms_at_a_tcp_router() {
    let Some(scene) = Scene::launched(OPEN) else { return };
    let [run, client] = ["run", "client"].map(|name| repository(&format!("tests/conformance/{name}.py")));
    let digests = scene.digests();
    let live = ["--live", SERVER, &digests, "--", "python3", "-B", &client];
    let in_loop = [&[&*run, "--only-live"], &live[..], &["--asyncio"]].concat();
    for suite in [[&[&*run], &live[..]].concat(), in_loop] {
        let said = scene.python(&suite).said().ok();
        assert!(said.starts_with("conforms: "), "{said}");
    }
    scene.stop();
}

#[test]
fn rust_conforms_at_a_tcp_router_too() {
    let module =
        format!("[[module]]\nname = \"probe.0\"\nnode = \"base\"\nprogram = {}\n", program("conforming::module"));
    let Some(scene) = Scene::with(OPEN, &module) else { return };
    let (run, me) = (repository("tests/conformance/run.py"), std::env::current_exe().unwrap());
    let client = [me.to_str().unwrap(), "--exact", "conforming::client", "--nocapture"];
    let digests = scene.digests();
    let suite = [&*run, "--only-live", "--live", SERVER, &digests, "--"];
    let said = scene.python(&[&suite[..], &client].concat()).said().ok();
    assert!(said.starts_with("conforms: "), "{said}");
    scene.stop();
}
