//! A module that keeps the rules of exact replay, or breaks one of them, as its settings say.
//!
//! It is this test program itself, as `probe` is.

use crate::harness::{program, run_if_launched};
use rohrpost::schema::Bytes;
use rohrpost::serde::Deserialize;
use rohrpost::{Context, Interest, Module, ModuleClock, ModuleError, Ready, Received, Stream, StreamSubscription};
use rohrpost_mailbox::Shape;
use std::collections::HashMap;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;

/// It is another build if it finds this in its environment.
pub(crate) const OTHER_BUILD: &str = "ROHRPOST_E2E_SEER_BIAS";

/// It asks for something else if it finds here for what: `tick`, `mailbox`, `rewind` or `rewind-to`.
pub(crate) const OTHER_QUESTIONS: &str = "ROHRPOST_E2E_SEER_ASKS";

/// Bytes of a picture.
pub(crate) const PICTURE_BYTES: usize = 100_000;

/// What its map says if it is not to be made: it fails, or it panics if its number is odd.
pub(crate) const NOTHING: &[u8] = b"nothing";

/// Its lines in a configuration.
pub(crate) fn entry(number: usize, source: &str) -> String {
    let program = program("seer::module");
    let room = format!("[module.stream.picture]\nrecord = \"{} B\"\nkeep = 256\n", PICTURE_BYTES + 8);
    let room = if source == "pictures" { &*room } else { "" };
    format!(
        "[[module]]\nname = \"seer.{number}\"\nprogram = {program}\n\
         settings = {{ source = \"{source}\" }}\nstop-within = \"60 s\"\n{room}"
    )
}

/// Not a test: a module that launch starts, or an exact replay. Run as a test it ends at once.
#[test]
fn module() {
    run_if_launched::<Seer>();
}

/// Says what it sees.
#[rohrpost::interface(class = "seer")]
trait Seeing {
    /// Adds to all that it says from now on.
    #[command(16)]
    fn add(&mut self, more: u64) -> u64;

    /// Fails at the next tick.
    #[command(17)]
    fn fail(&mut self);

    /// Panics at once.
    #[command(18)]
    fn panic(&mut self);

    /// What it saw.
    #[data(1)]
    fn vision() -> u64;

    /// A picture of it.
    #[stream(2)]
    fn picture() -> Bytes;
}

/// Where a seer has its visions from.
#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(crate = "rohrpost::serde", rename_all = "kebab-case")]
enum Sight {
    /// The clock.
    Clock,
    /// The order of a hash map.
    HashOrder,
    /// A file that the runtime sees it read.
    TakenIn,
    /// A file that is part of its settings.
    Map,
    /// A descriptor that no journal knows.
    Descriptor,
    /// A socket, as the rules have it.
    Port,
    /// A socket, read past the journal.
    Beside,
    /// The clock, in another thread.
    Thread,
    /// Its link.
    Link,
    /// Pictures that it writes itself, once something was added.
    Pictures,
    /// The clock; and it asks for a mailbox, and to go back in streams.
    Asking,
}

#[derive(Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields)]
struct SeerSettings {
    source: Sight,
}

struct Seer {
    source: Sight,
    clock: ModuleClock,
    more: u64,
    fails: bool,
    map: Option<Vec<u8>>,
    port: Option<UnixStream>,
    pictures: Option<(Stream<Bytes>, StreamSubscription<Bytes>)>,
}

impl Module for Seer {
    type Settings = SeerSettings;
    type Interfaces = SeeingInterface;

    fn new(settings: SeerSettings, context: &mut Context) -> Result<Self, ModuleError> {
        let otherwise = std::env::var(OTHER_QUESTIONS).unwrap_or_default();
        context.set_period(Duration::from_millis(if otherwise == "tick" { 6 } else { 5 }));
        let source = settings.source;
        let map = (source == Sight::Map).then(|| std::fs::read(context.path("vision.map"))).transpose()?;
        if map.as_ref().is_some_and(|map| map == NOTHING) {
            assert_eq!(context.me().instance() % 2, 0, "there is nothing to see");
            return Err(ModuleError::new("it sees nothing in its map"));
        }
        match source {
            Sight::Descriptor => drop(context.watch(&std::io::stdin(), Interest::Read)?),
            Sight::Thread => {
                let clock = context.clock().clone();
                drop(std::thread::spawn(move || clock.now()).join());
            }
            Sight::Asking => ask(context, &otherwise)?,
            _ => {}
        }
        let port = matches!(source, Sight::Port | Sight::Beside).then(|| open(context)).transpose()?;
        let pictures = (source == Sight::Pictures).then(|| own_pictures(context)).transpose()?;
        let bias = std::env::var(OTHER_BUILD).ok().and_then(|bias| bias.parse().ok()).unwrap_or(0);
        Ok(Self { source, clock: context.clock().clone(), more: bias, fails: false, map, port, pictures })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        if self.fails {
            return Err(ModuleError::new(format!("it sees nothing at {}", self.clock.now().ns)));
        }
        let seen = match self.source {
            Sight::HashOrder => {
                let map: HashMap<u64, ()> = (0..64).map(|number| (number, ())).collect();
                map.keys().fold(0, |sum: u64, number| sum.wrapping_mul(31).wrapping_add(*number))
            }
            Sight::TakenIn => {
                let bytes = context.take_in(|| std::fs::read("/proc/sys/kernel/random/uuid"))?;
                let missing = context.take_in(|| std::fs::read("/nowhere")).unwrap_err();
                assert_eq!(missing.kind(), std::io::ErrorKind::NotFound);
                sum(&bytes)
            }
            Sight::Pictures if self.more == 0 => return Ok(()),
            Sight::Pictures => self.take_picture(context)?,
            Sight::Link => context.link().borrow().incarnation().into(),
            _ => self.clock.now().ns ^ context.now().ns ^ self.map.as_ref().map_or(0, |map| map.len() as u64),
        };
        Ok(context.publish_now(SeeingInterface::VISION, &seen.wrapping_add(self.more))?)
    }

    /// Says what its pictures show, once more.
    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let Some((_, each)) = &self.pictures else { return Ok(()) };
        let shown = data.read(each)?.map_or(0, |picture| sum(&picture));
        Ok(context.publish_now(SeeingInterface::VISION, &shown)?)
    }

    /// Says what its port brings, and sends it back there.
    fn ready(&mut self, context: &mut Context, ready: Ready) -> Result<(), ModuleError> {
        let Some(port) = &mut self.port else {
            context.unwatch(ready.watch);
            return Ok(());
        };
        let mut room = [0; 16];
        let came = match self.source {
            Sight::Beside => port.read(&mut room),
            _ => context.take_in_to(&mut room, |room| port.read(room)),
        };
        let bytes = match came {
            Ok(0) => {
                context.unwatch(ready.watch);
                return Ok(());
            }
            Ok(count) => &room[..count],
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
            Err(error) => return Err(error.into()),
        };
        let gone = match self.source {
            Sight::Beside => port.write(bytes),
            _ => context.give_out(bytes, |bytes| port.write(bytes)),
        };
        assert_eq!(gone?, bytes.len());
        let seen = sum(bytes).wrapping_add(self.more);
        Ok(context.publish_now(SeeingInterface::VISION, &seen)?)
    }
}

impl Seer {
    /// Writes a picture of the clock, and looks at it.
    fn take_picture(&mut self, context: &mut Context) -> Result<u64, ModuleError> {
        let now_ns = context.now().ns;
        let picture = now_ns.to_le_bytes().repeat(PICTURE_BYTES / 8);
        context.write(SeeingInterface::PICTURE, now_ns, &picture.into())?;
        let Some((newest, _)) = &mut self.pictures else { return Ok(0) };
        let newest = newest.newest()?.map(|record| record.read()).transpose()?;
        Ok(newest.map_or(0, |picture| sum(&picture)))
    }
}

fn sum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0, |sum: u64, byte| sum.wrapping_mul(31).wrapping_add((*byte).into()))
}

/// Opens a seer's own pictures, and slows it down.
fn own_pictures(context: &mut Context) -> Result<(Stream<Bytes>, StreamSubscription<Bytes>), ModuleError> {
    context.set_period(Duration::from_millis(20));
    let own = context.installation().classes.format(context.me());
    let newest = context.stream(SeeingInterface::PICTURE, &own)?;
    Ok((newest, context.subscribe_stream(SeeingInterface::PICTURE, &own)?))
}

/// Makes a mailbox, follows a seer's own pictures twice, and goes back in both; one of these `otherwise`.
fn ask(context: &mut Context, otherwise: &str) -> Result<(), ModuleError> {
    let slots = if otherwise == "mailbox" { 5 } else { 4 };
    context.open_mailbox(3, Shape { slots, body_bytes_max: 100, ..Shape::default() })?;
    let own = context.installation().classes.format(context.me());
    let mut follow = || context.subscribe_stream(SeeingInterface::PICTURE, &own);
    let (first, second) = (follow()?, follow()?);
    context.rewind(if otherwise == "rewind" { &second } else { &first });
    context.rewind_to(&second, if otherwise == "rewind-to" { 8 } else { 7 });
    Ok(())
}

/// Opens a seer's port.
fn open(context: &mut Context) -> Result<UnixStream, ModuleError> {
    let path = context.path("port");
    let port = context.open_outside(|| {
        let port = UnixStream::connect(&path)?;
        port.set_nonblocking(true)?;
        Ok(port)
    })?;
    context.watch(&port, Interest::Read)?;
    Ok(port)
}

impl Seeing for Seer {
    fn add(&mut self, more: u64) -> u64 {
        self.more += more;
        self.more
    }

    fn fail(&mut self) {
        self.fails = true;
    }

    fn panic(&mut self) {
        panic!("it has seen too much: {}", self.more);
    }
}
