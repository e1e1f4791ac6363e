//! The configuration of a replay is right for one node, whatever was recorded.

use super::*;
use rohrpost::interface::Interface;
use rohrpost::interfaces::{
    CartographerInterface, LaserInterface, MotorInterface, RecorderInterface, ReplayInterface, WheelsInterface,
};
use rohrpost_recording::{ChannelSpec, Message, Options, Session, Writer};

const DEMO: &str = include_str!("../../../config/demo.toml");
const NODES: &str = include_str!("../../../config/demo-nodes.toml");
const BEYOND: &str = include_str!("../../../config/demo-tcp.toml");
const LOGD: &str = r#"
[[module]]
name = "logd.0"
builtin = "logd"
[record]
directory = "recordings"
streams = ["*", { name = "camera.0/image", rate = 2.0 }]
data = ["*", "pilot.0/*"]
output = true
"#;

/// A recording of these modules; of each item a message.
fn recorded(folder: &Path, modules: &[(&str, Description)]) -> RecordedFiles {
    let options = Options { leave_bytes: 0, ..Options::new(folder, "base") };
    let mut writer = Writer::start(options, Session::default()).unwrap();
    for (name, description) in modules {
        writer.describe(name, description).unwrap();
        for item in &description.data {
            let spec = ChannelSpec { name, item: &item.field.name, ty: &item.field.ty, texts: BTreeMap::new() };
            let channel = writer.channel(&spec).unwrap();
            let message = Message { arrival_ns: 5, stamp_ns: 5, epoch: 1, sequence: 0, data: &[] };
            writer.write(channel, &message).unwrap();
        }
    }
    writer.finish().1.unwrap();
    RecordedFiles::read(&[folder.join("base-0001.mcap")]).unwrap()
}

fn demo_modules() -> Vec<(&'static str, Description)> {
    vec![
        ("motor.0", MotorInterface::description()),
        ("laser.0", LaserInterface::description()),
        ("odometry.0", WheelsInterface::description()),
        ("mapper.0", CartographerInterface::description()),
    ]
}

/// That these modules run, of the user's own configuration, and that all the others are played.
fn wish<'a>(
    installation: &'a Installation,
    folder: &'a Path,
    recorded: &'a RecordedFiles,
    runs: &'a [String],
) -> ReplayWish<'a> {
    let drawing = ReplayDrawing::Nothing;
    ReplayWish { installation, folder, recorded, runs, is_own: true, names: &[], drawing, saved: None }
}

/// The configuration, and what is played.
fn made(text: &str, modules: &[(&str, Description)], runs: &[&str], names: &[&str]) -> (Installation, PlayedModules) {
    let folder = tempfile::tempdir().unwrap();
    let recorded = recorded(folder.path(), modules);
    let source = Installation::parse(text, Path::new("robot.toml")).unwrap();
    let texts = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let (runs, names) = (texts(runs), texts(names));
    let wish = ReplayWish { names: &names, ..wish(&source, folder.path(), &recorded, &runs) };
    let played = wish.played().unwrap();
    let (text, player) = wish.text(&played, Table::new()).unwrap();
    let installation = Installation::parse(&text, Path::new("replay.toml"));
    let installation = installation.unwrap_or_else(|errors| panic!("{errors}\n{text}"));
    let player = installation.classes.parse_module(&player).unwrap();
    assert_eq!(installation.module(player).unwrap().program, Program::Builtin(REPLAY.into()));
    (crate::begin::check::validate(installation).unwrap(), played)
}

fn names(installation: &Installation) -> Vec<String> {
    let modules = installation.modules.iter().flat_map(Module::names);
    modules.map(|name| installation.classes.format(name)).collect()
}

#[test]
fn one_player_has_the_names_of_all_that_was_recorded() {
    for (text, keep) in [(DEMO, 1024), (NODES, 1024), (BEYOND, 64)] {
        let (installation, played) = made(text, &demo_modules(), &[], &[]);
        assert_eq!(names(&installation), ["replay.0", "laser.0", "mapper.0", "motor.0", "odometry.0"]);
        assert_eq!(installation.time, rohrpost_config::TimeSource::Log);
        assert_eq!((installation.nodes.len(), installation.nodes[0].name.as_str()), (1, NODE));
        let topics: Vec<&str> = played.topics.iter().map(String::as_str).collect();
        let all = ["laser.0/scan", "mapper.0/map", "mapper.0/pose", "motor.0/motion", "odometry.0/odometry"];
        assert_eq!((topics, played.left_out.len()), (all.to_vec(), 0));
        let player = &installation.modules[0];
        assert_eq!(player.streams["odometry"].keep, keep, "as the recorded module had it");
        assert!(u16::from(player.name.class().0) < installation.real_time_from(), "it is not real time by itself");
    }
}

#[test]
fn modules_that_run_keep_their_configuration_but_for_what_is_not_here() {
    let (installation, played) = made(DEMO, &demo_modules(), &["mapper.0"], &["laser.0", "odometry.0/odometry"]);
    assert_eq!(names(&installation), ["replay.0", "laser.0", "odometry.0", "mapper.0"]);
    let [player, mapper] = [&installation.modules[0], &installation.modules[1]];
    assert_eq!(mapper.calls.len(), 2);
    assert!(player.name.class() > mapper.name.class(), "it does not wait for something less important");
    assert_eq!(played.topics.len(), 2);
    // The pilot is more important than the number of any ordinary class.
    let (installation, _) = made(DEMO, &demo_modules(), &["pilot.0"], &[]);
    let [player, pilot] = [&installation.modules[0], &installation.modules[1]];
    assert_eq!(pilot.calls.len(), 2);
    assert!(player.name.class() > pilot.name.class());
    let (installation, _) = made(DEMO, &demo_modules(), &["output.0", "pilot.0"], &[]);
    let names = names(&installation);
    assert_eq!((names[0].as_str(), names[1].as_str()), ("output.0", "replay.0"), "the collector hears all others");
}

#[test]
fn a_recorder_that_runs_records_what_is_here() {
    let text = DEMO.replace("[nodes.main]", "logd = { id = 24 }\n[nodes.main]").replace("[classes]", "[classes]\n");
    let (installation, _) = made(&format!("{text}{LOGD}"), &demo_modules(), &["logd.0"], &[]);
    let record = installation.record.as_ref().unwrap();
    assert_eq!((record.streams.len(), record.data.len(), record.output), (1, 1, None));
    assert!(record.directory.is_absolute(), "{:?}", record.directory);
}

#[test]
fn a_replay_that_was_recorded_is_not_a_part_of_the_robot() {
    let mut modules = demo_modules();
    modules.push(("replay.0", ReplayInterface::description()));
    let replayed = "replay = { id = 127 }\n[nodes.main]";
    let (installation, _) = made(&DEMO.replace("[nodes.main]", replayed), &modules, &[], &[]);
    assert_eq!(names(&installation)[0], "replay.0");
    assert_eq!(installation.modules[0].name.class().0, 127);
}

#[test]
fn what_cannot_be_played_is_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let mut modules = demo_modules();
    modules.push(("logd.0", RecorderInterface::description()));
    let recorded = recorded(folder.path(), &modules);
    let source = Installation::parse(DEMO, Path::new("robot.toml")).unwrap();
    for (runs, names, words) in [
        (vec!["mapper.1"], vec![], "--run mapper.1: the configuration has no such module; it has output.0, motor.0"),
        (vec![], vec!["laser.0/scna"], "--names laser.0/scna: nothing of it is recorded; did you mean laser.0/scan?"),
        (vec![], vec![], "logd.0 was recorded as a module of class `logd`, which the configuration does not have"),
        (vec!["mapper.0"], vec!["mapper.0"], "nothing is left to be played"),
    ] {
        let texts = |names: Vec<&str>| names.into_iter().map(str::to_owned).collect::<Vec<_>>();
        let (runs, names) = (texts(runs), texts(names));
        let wish = ReplayWish { names: &names, ..wish(&source, folder.path(), &recorded, &runs) };
        let told = wish.played().map(|_| ()).unwrap_err().to_string();
        assert!(told.contains(words), "{told}");
    }
}

#[test]
fn paths_in_settings_begin_where_they_did() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("office.map"), "").unwrap();
    let recorded = recorded(folder.path(), &demo_modules());
    let text = DEMO.replace(
        "settings = { laser = \"laser.0\", odometry",
        "settings = { map = \"office.map\", laser = \"laser.0\", odometry",
    );
    let text = text.replace("builtin = \"mapper\"", "program = [\"./bin/mapper\", \"./x\"]");
    let source = Installation::parse(&text, Path::new("robot.toml")).unwrap();
    let runs = ["mapper.0".to_owned()];
    let wish = wish(&source, folder.path(), &recorded, &runs);
    let (text, _) = wish.text(&wish.played().unwrap(), Table::new()).unwrap();
    let installation = Installation::parse(&text, Path::new("replay.toml")).unwrap();
    let mapper = &installation.modules[1];
    assert_eq!(mapper.settings["map"], text_of(&folder.path().join("office.map")));
    assert_eq!(mapper.settings["laser"], "laser.0".into());
    let program = folder.path().join("./bin/mapper").display().to_string();
    assert_eq!(mapper.program, Program::Command(vec![program, "./x".into()]));
}

#[test]
fn saved_parameters_are_those_of_modules_that_run() {
    let saved = "[\"pilot.0\"]\ncruise-m-s = 0.5\n\n[\"motor.0\"]\nlaser-rate-hz = 5.0\n";
    assert_eq!(saved_of(saved, |name| name == "pilot.0").unwrap().trim(), "[\"pilot.0\"]\ncruise-m-s = 0.5");
}

/// A recorded configuration, of which these modules are to run; why they do not, or the configuration that is made.
fn stranger(text: &str, runs: &[&str], is_own: bool, drawing: ReplayDrawing) -> Result<Installation, String> {
    let folder = tempfile::tempdir().unwrap();
    let recorded = recorded(folder.path(), &demo_modules());
    let source = Installation::parse(text, Path::new("robot.toml")).unwrap();
    let runs: Vec<String> = runs.iter().map(|name| (*name).to_owned()).collect();
    let wish = ReplayWish { is_own, drawing, ..wish(&source, Path::new("/work"), &recorded, &runs) };
    let played = wish.played().map_err(|error| error.to_string())?;
    let (text, _) = wish.text(&played, Table::new()).map_err(|error| error.to_string())?;
    Ok(Installation::parse(&text, Path::new("replay.toml")).unwrap())
}

#[test]
fn a_recording_decides_neither_what_runs_nor_where_that_writes_and_listens() {
    let program = "builtin = \"mapper\"";
    let text = DEMO.replace(program, "program = [\"/bin/sh\", \"-c\", \"touch 'a b'\\n\"]");
    let told = stranger(&text, &["mapper.0"], false, ReplayDrawing::Nothing).unwrap_err();
    for words in ["--run mapper.0: ", r"/bin/sh -c $'touch \'a b\'\n'", "add --run-recorded", "--config FILE"] {
        assert!(told.contains(words), "no `{words}` in: {told}");
    }
    assert!(stranger(&text, &["mapper.0"], true, ReplayDrawing::Nothing).is_ok());
    assert!(stranger(DEMO, &["mapper.0", "pilot.0", "output.0"], false, ReplayDrawing::Nothing).is_ok());

    let control = "control = \"127.0.0.1:7000\"\n";
    let text = DEMO.replace("[nodes.main]", "logd = { id = 24 }\n[nodes.main]") + LOGD + control;
    let told = stranger(&text, &["logd.0"], false, ReplayDrawing::Nothing).unwrap_err();
    assert!(told.contains("write files into\n  /work/recordings, and listen on 127.0.0.1:7000\n"), "{told}");
    assert!(stranger(&text, &["logd.0"], true, ReplayDrawing::Nothing).is_ok());
}

#[test]
fn a_gui_draws_where_the_command_line_says_and_nowhere_else() {
    let bridge = "program = \"rohrpost-gui-bridge\"";
    let text = DEMO.replace(bridge, "program = [\"rohrpost-gui-bridge\", \"--more\"]");
    let viewer = "viewer = \"rerun+http://192.0.2.1:9876/proxy\"";
    let text = text.replace("settings = { file = ", &format!("settings = {{ {viewer}, file = "));
    let settings = |drawing: &ReplayDrawing, runs: &[&str], is_own| {
        let installation = stranger(&text, runs, is_own, drawing.clone()).unwrap();
        let name = installation.classes.parse_module("gui.0").unwrap();
        let Module { settings, program, .. } = installation.module(name).unwrap().clone();
        (settings, program)
    };
    let own = Program::Command(vec!["rohrpost-gui-bridge".into()]);
    let file = ReplayDrawing::File("/work/drawn.rrd".into());
    for (drawing, runs, wanted) in [
        (&file, &[][..], table([("file", "/work/drawn.rrd".into())])),
        (&file, &["gui.0"], table([("file", "/work/drawn.rrd".into())])),
        (&ReplayDrawing::Window, &[], table([("viewer", "window".into())])),
        (&ReplayDrawing::Nothing, &["gui.0"], Table::new()),
    ] {
        assert_eq!(settings(drawing, runs, false), (wanted, own.clone()), "{drawing:?}");
    }
    let (settings, program) = settings(&file, &[], true);
    assert_eq!(settings, table([("file", "/work/drawn.rrd".into())]));
    assert_eq!(program, Program::Command(vec!["rohrpost-gui-bridge".into(), "--more".into()]));
}
