//! A writer in a process of its own that is killed again and again, and ends in the end.

use super::puppets::{CAMERA, Camera, CameraInterface, Picture, VIEWER, Watcher, picture};
use super::support::{PATIENCE, Place, play, process, wait};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_mailbox::{Next, StreamId};
use rohrpost_modules::runtime::{Context, Stream};
use rohrpost_modules::{Module, ModuleError};
use std::process::Child;
use std::time::Duration;

const KILLS: usize = 10;

/// Writes pictures as long as it lives.
struct Shooter;

impl Camera for Shooter {}

impl Module for Shooter {
    type Settings = toml::Table;
    type Interfaces = CameraInterface;

    fn new(_: toml::Table, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_micros(200));
        Ok(Self)
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        context.write_now(CameraInterface::IMAGE, &picture(7, 3000))?;
        Ok(())
    }
}

/// Not a test of its own: the writer's process comes here.
#[test]
fn role() {
    play::<Shooter>("camera.0");
}

fn shooter(place: &Place) -> Child {
    process("killed::role", &place.installation.path)
}

#[test]
fn a_writer_that_is_killed_again_and_again_loses_no_reader_and_each_record_is_accounted_for() {
    let place = Place::with("[module.stream.image]\nkeep = 10000\n");
    let viewer = place.start::<Watcher>(VIEWER);
    let mut images = viewer.does(|_, context| context.stream(CameraInterface::IMAGE, "camera.0").unwrap());
    let mut incarnations = Vec::new();
    // Until so many records of the next writer were read.
    let mut read = |images: &mut Stream<Picture>, wanted: usize| {
        let (before, mut came) = (incarnations.last().copied(), 0);
        wait("it reads on", || {
            if let Next::Record(record) = images.try_next().unwrap() {
                assert_eq!(record.read().unwrap(), picture(7, 3000), "whole");
                incarnations.push(record.info().incarnation);
                came += usize::from(incarnations.last().copied() != before);
            }
            (came >= wanted).then_some(())
        });
    };
    for _ in 0..KILLS {
        let mut writer = shooter(&place);
        read(&mut images, 30);
        writer.kill().unwrap();
        writer.wait().unwrap();
    }
    let mut writer = shooter(&place);
    read(&mut images, 30);
    kill(Pid::from_raw(writer.id() as i32), Signal::SIGTERM).unwrap();
    let ended = wait("it ends", || writer.try_wait().unwrap());
    assert!(ended.success(), "{ended} within {PATIENCE:?}");
    // Started by hand, it removes what is its own; a reader keeps what it has open.
    assert!(place.node.streams().unwrap().iter().all(|id| *id != StreamId { name: CAMERA, number: 1 }));
    while let Next::Record(record) = images.try_next().unwrap() {
        assert_eq!(record.read().unwrap(), picture(7, 3000));
    }
    let (read, lost) = images.accounts();
    assert_eq!(read + lost, images.position(), "each that was ever written was read or counted as lost");
    incarnations.dedup();
    assert_eq!(incarnations.len(), KILLS + 1, "of all lives");
}
