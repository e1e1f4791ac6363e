use super::*;
use rohrpost::schema::{Field, Schema};
use rohrpost::types::Image;

const CONFIG: &str = r#"
installation = "ways"
[system]
name = "robot"
id = 1
[classes]
router = { id = 250, text = "Carries" }
camera = { id = 112, text = "Sees" }
tool = { id = 16, text = "By hand" }
[time]
source = "master"
[network]
security = "none"
[nodes.main]
address = "10.77.0.1"
tools = [0, 15]
[nodes.far]
address = "10.77.0.2"
tools = [16, 31]
[[module]]
name = "camera.0"
node = "far"
program = "eye"
[module.stream.large]
record = "1 MiB"
[module.stream.middle]
record = "32 KiB"
[[replica]]
stream = "camera.0/copied"
to = ["main"]
"#;
const CAMERA: Name = Name::new(1, 112, 0, 0);
const INTAKE: Intake = Intake { body_bytes_max: 20 * 1024, period: Duration::from_millis(50) };

fn installation() -> Installation {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("robot.toml");
    std::fs::write(&file, CONFIG).unwrap();
    Installation::load(&file).unwrap()
}

#[test]
fn a_stream_is_read_in_place_where_no_package_of_the_bridge_takes_it() {
    let installation = installation();
    let way = |kind, name: &str, own, wish| {
        let item = DataItem { number: 1, kind, field: Field::new(name, <Image>::schema()) };
        way(&installation, own, CAMERA, &item, wish, INTAKE)
    };
    let (stream, newest) = (DataKind::Stream, Wish::newest());
    let replica = || Way::Replica { delay: replicas::delay_of("camera.0/copied", ["far", "main"]) };
    for (kind, name, own, wish, right, why) in [
        (DataKind::Data, "large", "far", newest, Way::Data, "no stream"),
        (stream, "small", "far", newest, Way::Data, "4 KiB, as streams have without a section"),
        (stream, "middle", "far", newest, Way::Ring, "more than the mailbox takes"),
        (stream, "large", "far", newest, Way::Ring, "more than a package takes"),
        (stream, "large", "far", Wish::each(), Way::Data, "each is asked for once more when it is lost"),
        (stream, "middle", "main", newest, Way::Data, "it comes from afar, if the mailbox takes it"),
        (stream, "copied", "main", newest, replica(), "it is here already, though a package would take it"),
        (stream, "copied", "main", Wish::each(), Way::Data, "each is asked for once more when it is lost"),
        (DataKind::Data, "copied", "main", newest, Way::Data, "no stream"),
        (stream, "copied", "far", newest, Way::Data, "here it is written"),
    ] {
        assert_eq!(way(kind, name, own, wish), right, "{name}: {why}");
    }
    let Way::Unseen { why } = way(stream, "large", "main", newest) else { panic!("no package takes it") };
    assert_eq!(
        why,
        "stream `large` of camera.0 is not shown: it is on node `far`, and its records of up to 1048576 bytes fit no \
         package; add a [[replica]] with `stream = \"camera.0/large\"` and `to = [\"main\"]`, or lower `record` in \
         [module.stream.large] of camera.0 to 65499 if its values have no more"
    );
}

#[test]
fn a_stream_is_looked_at_no_more_often_than_it_is_drawn() {
    for (rate, ms) in [(Rate::Each, 50), (Rate::Every(Duration::from_millis(20)), 50), (Rate::hz(2.0).unwrap(), 500)] {
        assert_eq!(INTAKE.period_of(rate), Duration::from_millis(ms), "{rate:?}");
    }
}
