//! A node of a system, as one thread takes part in it; names, and system time.

use crate::code::Code;
use crate::edge::{bytes_to, edge, failed, needed_text, place, say, text};
use crate::objects::NodeObject;
use crate::table;
use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, Node, Participant, SystemClock, SystemTime, node_directory};
use std::ffi::{c_char, c_uint};
use std::mem::MaybeUninit;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Which module launch has started this process as, and by which configuration.
const LAUNCHED: [&str; 2] = ["ROHRPOST_CONFIG", "ROHRPOST_MODULE"];

/// A node that this thread takes part in.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NodeHandle {
    /// Which; 0 is none.
    pub id: u64,
}

/// System time as this computer knows it.
#[repr(C)]
pub struct TimeNow {
    /// Nanoseconds since 1970.
    pub ns: u64,
    /// Times of different epochs cannot be subtracted.
    pub epoch: u64,
    /// How far off it is at most, ns.
    pub error_ns: u64,
    /// How long ago its source was last heard, ns.
    pub age_ns: u64,
}

impl TimeNow {
    pub(crate) fn of(now: SystemTime) -> Self {
        let ns = |duration: Duration| u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        Self { ns: now.ns, epoch: now.epoch, error_ns: ns(now.error), age_ns: ns(now.age) }
    }
}

impl NodeObject {
    fn join(node: &Arc<Node>, module: Name, installation: Option<Arc<Installation>>) -> Result<Self, Code> {
        let participant = Participant::join(node, module).map_err(failed)?;
        Ok(Self { clock: SystemClock::open(node), participant, watches: None, installation })
    }

    /// By a configuration: its node of this name, or that of this module, under the module's name or none.
    fn configured(file: &Path, node: Option<&str>, module: Option<&str>, is_module: bool) -> Result<Self, Code> {
        let installation = Arc::new(Installation::load(file).map_err(failed)?);
        let module = module.map(|text| installation.classes.parse_module(text)).transpose().map_err(failed)?;
        let lacks = |what: &str| say(Code::Configuration, format_args!("{}: {what}", file.display()));
        let of_module = || installation.node_of(module?);
        let name = node.or_else(of_module).ok_or_else(|| lacks("name a node, or a module that it has"))?;
        let found = installation.node(name).ok_or_else(|| lacks(&format!("there is no node `{name}`")))?;
        let opened = Node::open(&node_directory(&installation.name, &found.name)).map_err(failed)?;
        let own = module.filter(|_| is_module).unwrap_or(Name::NONE);
        Self::join(&opened, own, Some(installation.clone()))
    }

    /// A name by its text.
    fn named(&self, text: &str) -> Result<Name, Code> {
        match &self.installation {
            Some(installation) => installation.classes.parse_name(text).map_err(failed),
            None => text.parse().map_err(|error| say(Code::Value, format_args!("{error}"))),
        }
    }

    fn text_of(&self, name: Name) -> String {
        match &self.installation {
            Some(installation) => installation.classes.format(name),
            None => name.to_string(),
        }
    }
}

fn open(
    out: Option<&mut MaybeUninit<NodeHandle>>,
    make: impl FnOnce() -> Result<NodeObject, Code>,
) -> Result<(), Code> {
    let out = place(out, "node")?.write(NodeHandle { id: 0 });
    out.id = table::open(make)?;
    Ok(())
}

/// Takes part in the node that launch has started this process on; the environment says which. The module itself takes
/// part by `rohrpost_module_run`, so this is for what it does besides: without a name, as launch asks for one process
/// of a name.
///
/// The caller owns the node, and closes it by `rohrpost_node_close`. A node belongs to the thread that opens it; each
/// thread opens its own, and takes one of the node's 256 places.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_node_open(node: Option<&mut MaybeUninit<NodeHandle>>) -> Code {
    edge(|| {
        open(node, || {
            let [config, module] = LAUNCHED.map(std::env::var_os);
            let (Some(config), Some(module)) = (config, module.and_then(|module| module.into_string().ok())) else {
                let [config, module] = LAUNCHED;
                let words = format_args!("{config} and {module} are not set: launch did not start this process");
                return Err(say(Code::Configuration, words));
            };
            NodeObject::configured(Path::new(&config), None, Some(&module), false)
        })
    })
}

/// Takes part in a node of a configuration, by the file's path. `node_name` may be null if the configuration has the
/// module. `module` is the name that this process takes part as, such as "tool.70"; null: without a name.
///
/// Owner and thread: as for `rohrpost_node_open`.
///
/// # Safety
/// Texts are null or end with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_node_open_configured(
    config: *const c_char,
    node_name: *const c_char,
    module: *const c_char,
    node: Option<&mut MaybeUninit<NodeHandle>>,
) -> Code {
    edge(|| {
        // SAFETY: the caller's promise of all three.
        let (config, name, module) =
            unsafe { (needed_text(config, "config")?, text(node_name, "node_name")?, text(module, "module")?) };
        open(node, || NodeObject::configured(Path::new(config), name, module, true))
    })
}

/// Takes part in the node with this directory, as the module of this name (0: without a name). Names are numbers then,
/// such as "1.200.0.0". With `create`, makes the directory if there is none.
///
/// Owner and thread: as for `rohrpost_node_open`.
///
/// # Safety
/// The text is null or ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_node_open_directory(
    directory: *const c_char,
    create: bool,
    module: u32,
    node: Option<&mut MaybeUninit<NodeHandle>>,
) -> Code {
    edge(|| {
        // SAFETY: the caller's promise.
        let directory = Path::new(unsafe { needed_text(directory, "directory") }?);
        open(node, || {
            let made = if create { Node::create(directory, 0o700) } else { Node::open(directory) };
            NodeObject::join(&made.map_err(failed)?, Name::from_raw(module), None)
        })
    })
}

/// Closes a node. What was opened by it stays open. Thread: that of the node.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_node_close(node: NodeHandle) -> Code {
    edge(|| table::close::<NodeObject>(node.id).map(drop))
}

/// The name that a text means: "motor.0", "motor.0.2", "1.200.0.2". Thread: that of the node.
///
/// # Safety
/// The text is null or ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_name_parse(
    node: NodeHandle,
    name_text: *const c_char,
    name: Option<&mut MaybeUninit<u32>>,
) -> Code {
    edge(|| {
        // SAFETY: the caller's promise.
        let (text, out) = (unsafe { needed_text(name_text, "name_text") }?, place(name, "name")?);
        let name = table::with(node.id, |node: &mut NodeObject| node.named(text))?;
        out.write(name.raw());
        Ok(())
    })
}

/// Writes a name as text into a buffer, with a zero behind it. If the buffer is too small, the last error says how many
/// bytes are needed. Thread: that of the node.
///
/// # Safety
/// `buffer` is null, or has room for `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_name_text(node: NodeHandle, name: u32, buffer: *mut c_char, size: usize) -> Code {
    edge(|| {
        let text = table::with(node.id, |node: &mut NodeObject| Ok(node.text_of(Name::from_raw(name))))?;
        // SAFETY: the caller's promise.
        unsafe { bytes_to(text.as_bytes(), buffer, size) }
    })
}

/// System time now. No system call. Thread: that of the node.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_time_now(node: NodeHandle, now: Option<&mut MaybeUninit<TimeNow>>) -> Code {
    edge(|| {
        let out = place(now, "now")?;
        let now = table::with(node.id, |node: &mut NodeObject| Ok(node.clock.now()))?;
        out.write(TimeNow::of(now));
        Ok(())
    })
}

/// Version of the layout of shared memory that this library reads: both sides of a mailbox have the same. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_layout_version() -> c_uint {
    rohrpost_mailbox::LAYOUT_VERSION
}
