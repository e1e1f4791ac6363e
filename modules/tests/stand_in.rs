//! A module that stands in for others by their descriptions alone, as a player of recordings does: programs with the
//! compiled types take it for them.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_config::Installation;
use rohrpost_mailbox::Name;
use rohrpost_modules::call::{CallError, Fault};
use rohrpost_modules::interface::{Interface, StandIn, StandInCommand};
use rohrpost_modules::interfaces::{LaserInterface, LaserProxy, MotorInterface, MotorProxy};
use rohrpost_modules::runtime::{Context, ContextError, StartError, run_started};
use rohrpost_modules::schema::Description;
use rohrpost_modules::types::{LaserScan, Twist};
use rohrpost_modules::{Module, ModuleError, description, wire};
use support::Place;

pub mod support;

const DRIVE: u16 = 16;
const TWIST: Twist = Twist { speed_m_s: 0.5, turn_rate_rad_s: -0.25 };

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    /// Names, and files with their descriptions.
    described: Vec<(String, String)>,
}

/// Knows no type of what it plays: bytes of descriptions and of values come from files.
struct Player;

impl Module for Player {
    type Settings = Settings;
    type Interfaces = ();

    fn stand_ins(settings: &Settings, installation: &Installation) -> Result<Vec<StandIn>, ModuleError> {
        let stand_in = |(name, file): &(String, String)| {
            let name = installation.classes.parse_module(name)?;
            let description = Description::from_bytes(&std::fs::read(installation.resolve(file))?)?;
            Ok(StandIn { name, description })
        };
        settings.described.iter().map(stand_in).collect()
    }

    fn new(_: Settings, _: &mut Context) -> Result<Self, ModuleError> {
        Ok(Self)
    }

    fn on(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let name = |text: &str| context.installation().classes.parse_module(text);
        let (player, motor, lasers) = (name("player.0")?, name("motor.0")?, [name("laser.0")?, name("laser.1")?]);
        context.publish_as(motor, MotorInterface::MOTION.number, 5, &std::fs::read(context.path("motion"))?)?;
        for (number, laser) in (1..).zip(lasers) {
            let scan = std::fs::read(context.path("scan"))?;
            context.publish_as(laser, LaserInterface::SCAN.number, number, &scan)?;
        }
        for (from, number) in [(motor, 99), (player, MotorInterface::MOTION.number), (Name::new(1, 9, 9, 0), 1)] {
            let refused = context.publish_as(from, number, 5, &[]);
            assert!(matches!(refused, Err(ContextError::NotStoodIn { number: told, .. }) if told == number));
        }
        let too_large = context.publish_as(lasers[0], LaserInterface::SCAN.number, 9, &[0; 100_000]);
        assert!(matches!(too_large, Err(ContextError::Record(_))), "{too_large:?}");
        Ok(())
    }

    fn stand_in_command(
        &mut self,
        context: &mut Context,
        command: &StandInCommand<'_>,
        reply: &mut Vec<u8>,
    ) -> Result<(), Fault> {
        let class = context.installation().classes.name(command.to.class());
        let (speed_m_s, _): (f64, f64) = wire::from_bytes(command.arguments).map_err(|_| Fault::Unknown(0))?;
        match (class, command.number) {
            (Some("motor"), DRIVE) if speed_m_s > 0.0 => {
                // `Ok(())`, as it was recorded.
                reply.push(0);
                Ok(())
            }
            _ => Err(Fault::ModuleError("no answer was recorded".into())),
        }
    }
}

const CONFIG: &str = r#"
installation = "stand-in-NUMBER"
[system]
name = "robot"
id = 1
[classes]
motor = { id = 200, text = "Drives" }
player = { id = 170, text = "Plays" }
laser = { id = 150, text = "Sees" }
tool = { id = 16, text = "By hand" }
[nodes.main]
[[module]]
name = "player.0"
aliases = ["motor.0", "laser.0", "laser.1"]
program = "player"
optional = true
settings = { described = [DESCRIBED] }
[module.stream.scan]
record = "64 KiB"
"#;

/// A node for a player that stands in for these names by these descriptions.
fn described(described: &str) -> Place {
    Place::new(
        &CONFIG.replace("DESCRIBED", described),
        &[
            ("motor.bin", &MotorInterface::description().to_bytes()),
            ("laser.bin", &LaserInterface::description().to_bytes()),
            ("motion", &encoded(&TWIST)),
            ("scan", &encoded(&scan())),
        ],
    )
}

fn encoded<T: serde::Serialize>(value: &T) -> Vec<u8> {
    let mut bytes = Vec::new();
    wire::append(&mut bytes, value).unwrap();
    bytes
}

fn scan() -> LaserScan {
    LaserScan { start_rad: -1.0, step_rad: 0.5, range_max_m: 8.0, ranges_m: vec![1.0, 2.5, 8.0], pose: None }
}

#[test]
fn programs_with_the_types_take_a_stand_in_for_the_module() {
    let place = described(r#"["motor.0", "motor.bin"], ["laser.0", "laser.bin"], ["laser.1", "laser.bin"]"#);
    let player = place.name("player.0");
    let start = place.start_of(player);
    std::thread::spawn(move || run_started::<Player>(start).unwrap());
    place.wait_until_on(player, || ());
    let mut tool = place.tool();
    let noted = description::noted(&place.node, place.name("motor.0")).unwrap();
    assert_eq!((noted.hash(), noted), (MotorInterface::hash(), MotorInterface::description()));
    let motor: MotorProxy = place.proxy("motor.0");
    assert_eq!(motor.motion().unwrap(), (5, TWIST));
    for (stamp_ns, laser) in [(1, "laser.0"), (2, "laser.1")] {
        assert_eq!(place.proxy::<LaserProxy>(laser).scan().unwrap(), (stamp_ns, scan()), "{laser}: as data");
        let mut stream = tool.stream(&place.installation, LaserInterface::SCAN, place.name(laser)).unwrap();
        let record = stream.newest().unwrap().unwrap();
        assert_eq!((record.stamp_ns(), record.read().unwrap()), (stamp_ns, scan()), "{laser}: as a record");
    }
    assert!(motor.drive(0.5, 0.0).is_ok());
    let refused = motor.drive(-0.5, 0.0).unwrap_err().to_string();
    assert!(refused.contains("no answer was recorded"), "{refused}");
    let unknown = tool.call(place.name("motor.0"), 99, MotorInterface::hash(), |_| Ok(()), |_| Ok(()));
    assert!(matches!(unknown, Err(CallError::Fault(_, Fault::Unknown(99)))), "{unknown:?}");
}

#[test]
fn a_module_stands_in_for_its_own_names_by_descriptions_of_their_class() {
    let motors = r#"["motor.0", "motor.bin"], ["laser.0", "laser.bin"]"#;
    for (described, expected) in [
        (
            format!("{motors}, [\"laser.2\", \"laser.bin\"]"),
            "`laser.2`, a module of class `laser`, but it does not have",
        ),
        (
            format!("{motors}, [\"laser.1\", \"motor.bin\"]"),
            "`laser.1`, a module of class `motor`, but that name is of",
        ),
        (
            format!("{motors}, [\"motor.0\", \"motor.bin\"]"),
            "`motor.0`, a module of class `motor`, but it does so twice",
        ),
        (motors.into(), "`laser.1` is an alias of `player.0`, but that program has no interface of class `laser`"),
    ] {
        let place = self::described(&described);
        let refused = run_started::<Player>(place.start_of(place.name("player.0"))).unwrap_err();
        assert!(refused.to_string().contains(expected), "{refused}");
        assert_eq!(refused.exit_code(), StartError::CONFIGURATION, "{refused}");
    }
}
