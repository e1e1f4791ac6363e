//! What a module asks of its runtime, in its functions.

use super::current::with_context;
use crate::code::Code;
use crate::decode::{self, Decoder, decoder};
use crate::edge::{bytes, bytes_to, edge, failed, needed_text, place, say};
use crate::node::TimeNow;
use crate::waiting::{interest_of, open_descriptor};
use rohrpost_mailbox::Watch;
use rohrpost_native::{CallError, Fault, Moment, NativeContext, Peer, SayLevel, say as say_line};
use std::cell::RefCell;
use std::ffi::{c_char, c_int, c_void};
use std::mem::MaybeUninit;
use std::rc::Rc;
use std::time::Duration;

/// How important a line of output is.
#[repr(u8)]
#[derive(Clone, Copy)]
pub enum LineLevel {
    /// The module cannot do its work.
    Error = 0,
    /// Something is not as it should be.
    Warn = 1,
    /// What a user wants to know.
    Info = 2,
    /// What an author wants to know.
    Debug = 3,
    /// Everything.
    Trace = 4,
}

/// Says a line, at a `rohrpost_level`. Any thread; before the module runs, nobody hears it.
///
/// # Safety
/// The text is null or ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_say(level: u8, line: *const c_char) -> Code {
    edge(|| {
        // SAFETY: the caller's promise.
        let line = unsafe { needed_text(line, "line") }?;
        let levels = [SayLevel::Error, SayLevel::Warn, SayLevel::Info, SayLevel::Debug, SayLevel::Trace];
        let words = format_args!("`level` is {level}; it is one of rohrpost_level, 0 to 4");
        let level = levels.get(usize::from(level)).ok_or_else(|| say(Code::Value, words))?;
        say_line(*level, line, None);
        Ok(())
    })
}

/// The module's own name. Only a function of the module may call this, and all `rohrpost_module_...` below.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_module_name(name: Option<&mut MaybeUninit<u32>>) -> Code {
    edge(|| {
        let out = place(name, "name")?;
        out.write(with_context(|context| Ok(context.me().raw()))?);
        Ok(())
    })
}

/// System time now.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_module_now(now: Option<&mut MaybeUninit<TimeNow>>) -> Code {
    edge(|| {
        let out = place(now, "now")?;
        out.write(with_context(|context| Ok(TimeNow::of(context.now())))?);
        Ok(())
    })
}

/// Has `tick` called once in this time, ns, from now on.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_module_period(period_ns: u64) -> Code {
    edge(|| {
        with_context(|context| {
            context.set_period(Duration::from_nanos(period_ns));
            Ok(())
        })
    })
}

/// The settings that are no parameters, as an object in JSON, with a zero behind it. If the buffer is too small, the
/// last error says how many bytes are needed.
///
/// # Safety
/// `buffer` is null, or has room for `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_module_settings(buffer: *mut c_char, size: usize) -> Code {
    // SAFETY: the caller's promise.
    edge(|| with_context(|context| unsafe { bytes_to(context.settings().as_bytes(), buffer, size) }))
}

/// The present value of a parameter, to be read at once: it is there until the function ends, or sets one.
///
/// # Safety
/// The text is null or ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_module_parameter(
    name: *const c_char,
    value: Option<&mut MaybeUninit<Decoder>>,
) -> Code {
    edge(|| {
        let out = place(value, "value")?.write(decode::none());
        // SAFETY: the caller's promise.
        let name = unsafe { needed_text(name, "name") }?;
        with_context(|context| {
            let none = || say(Code::NoItem, format_args!("there is no parameter `{name}`"));
            *out = decoder(context.parameter(name).ok_or_else(none)?);
            Ok(())
        })
    })
}

/// The module sets a parameter of its own.
///
/// # Safety
/// The text is null or ends with a zero; `value` is null, or points to `len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_module_set_parameter(name: *const c_char, value: *const c_void, len: usize) -> Code {
    edge(|| {
        // SAFETY: the caller's promise.
        let (name, value) = unsafe { (needed_text(name, "name")?, bytes(value, len, "value")?) };
        with_context(|context| context.set_parameter(name, value).map_err(failed))
    })
}

/// Publishes a value of the module's data or of a stream, that was true at `stamp_ns`, system time; 0: now. The bytes
/// are copied.
///
/// # Safety
/// `value` is null, or points to `len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_module_publish(number: u16, stamp_ns: u64, value: *const c_void, len: usize) -> Code {
    edge(|| {
        // SAFETY: the caller's promise.
        let value = unsafe { bytes(value, len, "value") }?;
        with_context(|context| context.publish(number, moment(stamp_ns), value).map_err(failed))
    })
}

/// When a value was true; none: now.
pub(super) fn moment(stamp_ns: u64) -> Option<Moment> {
    Some(stamp_ns).filter(|ns| *ns > 0).map(Moment::Ns)
}

thread_local! {
    /// The last answer of another module.
    static REPLY: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Runs a function of another module, `motor.0`, by its number: arguments are values one behind the other, and so is
/// the result, to be read from `reply`; it is there until the next such call, and empty when this fails. Waits for it
/// at most `timeout_ns`, and all else of the module with it. The first call asks the other one what it offers.
///
/// `interface` is the hash of the interface that the caller goes by: `MOTOR_HASH` of the header that
/// `rohrpost interface generate --lang c` writes, or what `rohrpost_interface_hash` gives. Nothing is run by another
/// one: `ROHRPOST_FAULT`, and the last error says that they differ.
///
/// # Safety
/// The text is null or ends with a zero; `arguments` is null, or points to `len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_module_call(
    module: *const c_char,
    interface: u32,
    function: u16,
    arguments: *const c_void,
    len: usize,
    timeout_ns: u64,
    reply: Option<&mut MaybeUninit<Decoder>>,
) -> Code {
    edge(|| {
        let reply = place(reply, "reply")?.write(decode::none());
        // SAFETY: the caller's promise.
        let (module, arguments) = unsafe { (needed_text(module, "module")?, bytes(arguments, len, "arguments")?) };
        let timeout = Duration::from_nanos(timeout_ns);
        asked(module, interface, timeout, reply, |context, peer| context.call(peer, function, arguments, timeout))
    })
}

/// Asks another module for the newest value of its data of this number: `reply` is its time (ns since 1970, a u64),
/// then the value. For the rest as `rohrpost_module_call`.
///
/// # Safety
/// The text is null or ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_module_get(
    module: *const c_char,
    interface: u32,
    number: u16,
    timeout_ns: u64,
    reply: Option<&mut MaybeUninit<Decoder>>,
) -> Code {
    edge(|| {
        let reply = place(reply, "reply")?.write(decode::none());
        // SAFETY: the caller's promise.
        let module = unsafe { needed_text(module, "module") }?;
        let timeout = Duration::from_nanos(timeout_ns);
        asked(module, interface, timeout, reply, |context, peer| context.get(peer, number, timeout))
    })
}

/// Asks another module, if it has this interface; one that has another is asked anew what it offers the next time.
fn asked(
    module: &str,
    interface: u32,
    timeout: Duration,
    reply: &mut Decoder,
    ask: impl FnOnce(&mut NativeContext<'_>, &Rc<Peer>) -> Result<Vec<u8>, CallError>,
) -> Result<(), Code> {
    let result = with_context(|context| {
        let peer = context.peer(module, timeout).map_err(failed)?;
        let result = if peer.hash == interface {
            ask(context, &peer)
        } else {
            Err(CallError::Fault(peer.name, Fault::InterfaceDiffers { server: peer.hash }))
        };
        if let Err(CallError::Fault(_, Fault::InterfaceDiffers { .. })) = &result {
            context.forget(module);
        }
        result.map_err(failed)
    })?;
    REPLY.with_borrow_mut(|kept| {
        *kept = result;
        *reply = decoder(kept);
    });
    Ok(())
}

/// Has `ready` called when a descriptor is ready for `interest`, bits `ROHRPOST_READ` and `ROHRPOST_WRITE`; `watch` is
/// its number there. The library keeps a duplicate, the caller its own.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_module_watch(descriptor: c_int, interest: u8, watch: Option<&mut MaybeUninit<u32>>) -> Code {
    edge(|| {
        let (out, interest) = (place(watch, "watch")?, interest_of(interest)?);
        let descriptor = open_descriptor(descriptor)?;
        out.write(with_context(|context| context.watch(&descriptor, interest).map_err(failed))?.number());
        Ok(())
    })
}

/// Watches it no longer.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_module_unwatch(watch: u32) -> Code {
    edge(|| {
        let was_watched = with_context(|context| Ok(context.unwatch(Watch::from_number(watch))))?;
        let none = || say(Code::Value, format_args!("watch {watch}: there is none (any more)"));
        was_watched.then_some(()).ok_or_else(none)
    })
}
