//! Modules that do what a test gives them, and their interfaces.

use super::support::{PATIENCE, Place};
use rohrpost_mailbox::Name;
use rohrpost_modules::interface;
use rohrpost_modules::runtime::{Context, Received, StartError, StreamSubscription, run_started};
use rohrpost_modules::schema::{Bytes, Schema, View};
use rohrpost_modules::types::Pose;
use rohrpost_modules::{Module, ModuleError};
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// System time in these tests, ns: that of a million seconds.
pub(crate) const T: u64 = 1_000_000_000_000_000;
pub(crate) const CAMERA: Name = Name::new(1, 150, 0, 0);
pub(crate) const VIEWER: Name = Name::new(1, 140, 0, 0);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub(crate) struct Picture {
    pub(crate) width_px: u32,
    pub(crate) pixels: Bytes,
}

#[derive(Debug, PartialEq, Deserialize)]
pub(crate) struct PictureView<'a> {
    pub(crate) width_px: u32,
    pub(crate) pixels: &'a [u8],
}

impl View for Picture {
    type View<'a> = PictureView<'a>;
}

/// Sees.
#[interface(class = "camera", crate = rohrpost_modules::macro_support)]
pub(crate) trait Camera {
    /// What it sees.
    #[stream(1)]
    fn image() -> Picture;

    /// Where it is.
    #[stream(2)]
    fn place() -> Pose;

    /// What is no stream.
    #[data(3)]
    fn level() -> u32;
}

/// The same name, another interface.
#[interface(class = "camera", crate = rohrpost_modules::macro_support)]
pub(crate) trait OtherCamera {
    /// What it sees.
    #[stream(1)]
    fn image() -> u32;

    /// Where it is.
    #[stream(2)]
    fn place() -> u32;
}

pub(crate) fn picture(width_px: u32, pixels: usize) -> Picture {
    Picture { width_px, pixels: vec![width_px as u8; pixels].into() }
}

/// A camera at work.
#[derive(Default)]
pub(crate) struct Eye;
impl Camera for Eye {}

/// One of another make.
#[derive(Default)]
pub(crate) struct OtherEye;
impl OtherCamera for OtherEye {}

/// Looks at what a camera sees.
#[derive(Default)]
pub(crate) struct Watcher {
    /// What it does with data.
    pub(crate) handler: Option<Handler>,
    /// What it rewinds behind the next data.
    pub(crate) rewinds: Option<StreamSubscription<Picture>>,
}
type Handler = Box<dyn FnMut(&Received<'_>) -> Result<(), ModuleError>>;

/// What a test gives a module to do.
type Order = Box<dyn FnOnce(&mut dyn Any, &mut Context) + Send>;

/// Where modules find their orders, by the installation and the module.
static ORDERS: Mutex<BTreeMap<(String, u32), Receiver<Order>>> = Mutex::new(BTreeMap::new());

pub(crate) struct Puppet<P> {
    part: P,
    orders: Receiver<Order>,
}

/// What differs between them.
pub(crate) trait Part: Default + 'static {
    type Interfaces;

    fn received(&mut self, _: &mut Context, _: &Received<'_>) -> Result<(), ModuleError> {
        Ok(())
    }
}

impl Part for Watcher {
    type Interfaces = ();

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        if let Some(subscription) = self.rewinds.take() {
            context.rewind(&subscription);
        }
        self.handler.as_mut().map_or(Ok(()), |handler| handler(data))
    }
}

macro_rules! puppets {
    ($($part:ident: $interfaces:ty),*) => {$(
        impl Module for Puppet<$part> {
            type Settings = toml::Table;
            type Interfaces = $interfaces;

            fn new(_: toml::Table, context: &mut Context) -> Result<Self, ModuleError> {
                context.set_period(Duration::from_millis(1));
                let key = (context.installation().name.clone(), context.me().raw());
                let orders = ORDERS.lock().unwrap().remove(&key).unwrap();
                Ok(Self { part: $part::default(), orders })
            }

            fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
                while let Ok(order) = self.orders.try_recv() {
                    order(&mut self.part, context);
                }
                Ok(())
            }

            fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
                self.part.received(context, data)
            }
        }
    )*};
}
puppets! { Eye: CameraInterface, OtherEye: OtherCameraInterface, Watcher: () }

impl Part for Eye {
    type Interfaces = CameraInterface;
}
impl Part for OtherEye {
    type Interfaces = OtherCameraInterface;
}
impl Camera for Puppet<Eye> {}
impl OtherCamera for Puppet<OtherEye> {}

const CONFIG: &str = r#"
installation = "streams-NUMBER"
[system]
name = "robot"
id = 1
[classes]
router = { id = 250, text = "Carries" }
camera = { id = 150, text = "Sees" }
viewer = { id = 140, text = "Looks" }
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
node = "main"
program = "eye"
optional = true
STREAMS
[[module]]
name = "viewer.0"
node = "main"
program = "watcher"
optional = true
calls = ["camera.0"]
[[module]]
name = "camera.1"
node = "far"
program = "eye"
optional = true
"#;

impl Place {
    /// With these sections of streams of the camera.
    pub(crate) fn with(streams: &str) -> Self {
        Self::new(&CONFIG.replace("STREAMS", streams), &[])
    }

    /// Begins a module, and hands it out when it is on.
    pub(crate) fn start<P: Part>(&self, name: Name) -> Puppeteer<P>
    where
        Puppet<P>: Module,
    {
        let mut puppet = self.begin(name);
        self.wait_until_on(name, || {
            if puppet.thread.as_ref().is_some_and(JoinHandle::is_finished) {
                panic!("it ended: {:?}", puppet.ended());
            }
        });
        puppet
    }

    /// Begins a module.
    pub(crate) fn begin<P: Part>(&self, name: Name) -> Puppeteer<P>
    where
        Puppet<P>: Module,
    {
        let (orders, receiver) = channel();
        ORDERS.lock().unwrap().insert((self.installation.name.clone(), name.raw()), receiver);
        let start = self.start_of(name);
        let thread = Some(std::thread::spawn(move || run_started::<Puppet<P>>(start)));
        Puppeteer { orders, thread, part: std::marker::PhantomData }
    }

    /// Values that the camera has published under this number, as tools count them.
    pub(crate) fn published(&self, number: u16) -> u64 {
        let kind = rohrpost_mailbox::Type::data(number);
        let rows = self.node.traffic();
        rows.iter().filter(|row| row.is_publication() && row.kind == kind).map(|row| row.packages).sum()
    }
}

/// A module at work.
pub(crate) struct Puppeteer<P> {
    orders: Sender<Order>,
    thread: Option<JoinHandle<Result<(), StartError>>>,
    part: std::marker::PhantomData<fn(P)>,
}

impl<P: Part> Puppeteer<P> {
    /// Has the module do something, and returns what came of it.
    pub(crate) fn does<R: Send + 'static>(&self, order: impl FnOnce(&mut P, &mut Context) -> R + Send + 'static) -> R {
        let (answer, answers) = channel();
        self.send(move |part, context| answer.send(order(part, context)).unwrap());
        match answers.recv_timeout(PATIENCE) {
            Ok(answer) => answer,
            Err(RecvTimeoutError::Timeout) => panic!("the module does not do it"),
            Err(RecvTimeoutError::Disconnected) => panic!("the module ended over it"),
        }
    }

    /// Has the module do something, and does not wait for it.
    pub(crate) fn send(&self, order: impl FnOnce(&mut P, &mut Context) + Send + 'static) {
        let order = move |part: &mut dyn Any, context: &mut Context| order(part.downcast_mut().unwrap(), context);
        self.orders.send(Box::new(order)).unwrap();
    }

    /// What the module that ended had to say.
    pub(crate) fn ended(&mut self) -> Result<(), StartError> {
        self.thread.take().unwrap().join().unwrap()
    }

    /// Ends it as a fault in its own code does: nothing is cleaned up.
    pub(crate) fn crashes(mut self) {
        self.send(|_, _| panic!("as the test wants it"));
        assert!(self.thread.take().unwrap().join().is_err());
    }
}
