//! A module in C: what its author writes as a table of functions, launched like any other.

mod asking;
mod current;
mod following;
mod in_place;

pub use asking::*;
pub use following::*;
pub use in_place::*;

use crate::code::Code;
use crate::decode::{Decoder, decoder};
use crate::description::{InterfaceTable, ParameterTable, described, list, parameters};
use crate::edge::{edge, given, last_words, needed_text, said, say, tell, text};
use crate::encode::{Encoder, encoder};
use crate::fork;
use crate::waiting::ReadyDescriptor;
use current::entered;
use rohrpost_mailbox::{BODY_BYTES_MAX, Ready};
use rohrpost_native::{
    CommandFailure, Fault, FollowedData, ModuleError, NativeContext, NativeInterface, NativeModule, Start, run,
    tell_exit,
};
use std::ffi::{CString, c_char, c_int, c_void};

/// How a function of a module ends: a code. Below 0 it has failed, and the last error says why: that of the call that
/// failed, or what `rohrpost_fail` was given.
pub type Outcome = i32;

/// A module. One thread calls all its functions, one at a time, with `user`; any of them may be null. None of them may
/// let an exception of C++ out, or leave by `longjmp`, `pthread_exit` or `pthread_cancel`: Rust has called them.
#[repr(C)]
pub struct ModuleTable {
    /// What it offers.
    pub interface: *const InterfaceTable,
    /// Settings that may change while it runs.
    pub parameters: *const ParameterTable,
    /// How many.
    pub parameter_count: usize,
    /// Names of its other settings, see `rohrpost_module_settings`.
    pub settings: *const *const c_char,
    /// How many.
    pub setting_count: usize,
    /// For the module's own use.
    pub user: *mut c_void,
    /// Once, before all others, switched off: let it follow here what it follows, and set its period. If it fails, the
    /// process ends; with `ROHRPOST_CONFIGURATION` launch does not start it again.
    pub made: Option<unsafe extern "C" fn(user: *mut c_void) -> Outcome>,
    /// Begins to work. If it fails, the module is in error and stays off.
    pub on: Option<unsafe extern "C" fn(user: *mut c_void) -> Outcome>,
    /// Goes to its safe state: also when launch has died, and before the process ends.
    pub off: Option<unsafe extern "C" fn(user: *mut c_void)>,
    /// Once a period while it is on. If it fails, the module is switched off and in error; so it is with those below.
    pub tick: Option<unsafe extern "C" fn(user: *mut c_void) -> Outcome>,
    /// Runs a function: reads its arguments, writes its result. `ROHRPOST_MALFORMED`, when `arguments` cannot be read
    /// or are not read to their end, tells the caller so, and `ROHRPOST_NO_ITEM`, when no call has failed in the
    /// function or the interface does not have it, that there is no such function; the module goes on then. What a
    /// function's own result says is no failure of it.
    pub command: Option<
        unsafe extern "C" fn(user: *mut c_void, number: u16, arguments: *mut Decoder, reply: *mut Encoder) -> Outcome,
    >,
    /// Takes what it follows, while it is on.
    pub received: Option<unsafe extern "C" fn(user: *mut c_void, data: *const DataFollowed) -> Outcome>,
    /// A descriptor that it watches is ready, while it is on. Called again as long as there is something: read once, or
    /// until there is nothing without waiting; at the end of the bytes, `rohrpost_module_unwatch`.
    pub ready: Option<unsafe extern "C" fn(user: *mut c_void, ready: *const ReadyDescriptor) -> Outcome>,
    /// These parameters have new values by now. If it fails, the old values are put back, and the caller gets the
    /// reason.
    pub parameters_changed:
        Option<unsafe extern "C" fn(user: *mut c_void, names: *const *const c_char, count: usize) -> Outcome>,
}

/// Says why a function of a module fails, and returns `ROHRPOST_FAILED` for it to return. Any thread.
///
/// # Safety
/// The text is null or ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_fail(why: *const c_char) -> Code {
    edge(|| {
        // SAFETY: the caller's promise.
        let why = unsafe { text(why, "why") }?;
        // A copy: it may be the last error, which is written here.
        let why = why.unwrap_or("the module failed").to_owned();
        Err(say(Code::Failed, format_args!("{why}")))
    })
}

/// Runs a module, as launch asks for it, until it is told to end; returns the exit code of the process. `main` calls
/// it, with its own arguments, and nothing else of the process may then handle SIGTERM, SIGINT and SIGHUP. SIGPIPE is
/// ignored from then on.
///
/// # Safety
/// All tables are as their texts say, and stay until it returns. `arguments` is null, or points to `count` texts that
/// end with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_module_run(
    module: Option<&ModuleTable>,
    count: c_int,
    arguments: *const *const c_char,
) -> c_int {
    let mut code = 1;
    fork::watch();
    // As in each program of Rust: when launch has died, nobody reads what the module prints, and it still has to go to
    // its safe state.
    // SAFETY: no handler of anybody's is called from now on.
    unsafe { libc::signal(libc::SIGPIPE, libc::SIG_IGN) };
    let ended = edge(|| {
        // SAFETY: the caller's promises.
        let (table, words, interface) = unsafe {
            let table = given(module, "module")?;
            (table, texts(arguments, count.max(0) as usize, "arguments")?, interface(table)?)
        };
        let started = Start::from_arguments(words.into_iter().skip(1));
        let result = started.and_then(|start| run(start, interface, |context| CModule::make(table, context)));
        code = c_int::from(tell_exit(result));
        Ok(())
    });
    if ended != Code::Ok {
        tell(&last_words());
    }
    code
}

/// # Safety
/// As for [`rohrpost_module_run`].
unsafe fn interface(table: &ModuleTable) -> Result<NativeInterface, Code> {
    // SAFETY: the caller's promise.
    unsafe {
        let interface = list(table.interface, 1, "interface")?;
        let settings = texts(table.settings, table.setting_count, "settings")?;
        let parameters = parameters(list(table.parameters, table.parameter_count, "parameters")?)?;
        Ok(NativeInterface { description: described(&interface[0])?, parameters, settings })
    }
}

/// # Safety
/// `first` is null, or points to `count` texts that end with a zero.
unsafe fn texts(first: *const *const c_char, count: usize, what: &str) -> Result<Vec<String>, Code> {
    // SAFETY: the caller's promise.
    unsafe { list(first, count, what)?.iter().map(|text| needed_text(*text, what).map(str::to_owned)).collect() }
}

/// The module as the runtime calls it.
struct CModule<'a> {
    table: &'a ModuleTable,
    /// Room for the result of a function.
    reply: Box<[u8]>,
}

impl CModule<'static> {
    fn make(table: &ModuleTable, context: &mut NativeContext<'_>) -> Result<Box<dyn NativeModule>, ModuleError> {
        // SAFETY: the table stays until `rohrpost_module_run` returns, and the module ends before that.
        let table: &'static ModuleTable = unsafe { &*std::ptr::from_ref(table) };
        let module = Self { table, reply: vec![0; BODY_BYTES_MAX].into() };
        module.call(context, |table| {
            // SAFETY: the author's function, with the author's argument.
            table.made.map(|made| unsafe { made(table.user) })
        })?;
        Ok(Box::new(module))
    }
}

impl CModule<'_> {
    /// Calls a function of the author's, if there is one; while it runs, it may ask for what the context has.
    fn call(
        &self,
        context: &mut NativeContext<'_>,
        function: impl FnOnce(&ModuleTable) -> Option<Outcome>,
    ) -> Result<(), ModuleError> {
        // What earlier calls said is no reason of this one.
        say(Code::Failed, format_args!("it does not say why"));
        match entered(context, || function(self.table)).unwrap_or(0) {
            0.. => Ok(()),
            outcome if outcome == Code::Configuration as i32 => Err(ModuleError::configuration(last_words())),
            _ => Err(ModuleError::new(last_words())),
        }
    }
}

impl NativeModule for CModule<'_> {
    fn on(&mut self, context: &mut NativeContext<'_>) -> Result<(), ModuleError> {
        // SAFETY: the author's function, with the author's argument.
        self.call(context, |table| table.on.map(|on| unsafe { on(table.user) }))
    }

    fn off(&mut self, context: &mut NativeContext<'_>) {
        if let Some(off) = self.table.off {
            // SAFETY: as above.
            entered(context, || unsafe { off(self.table.user) });
        }
    }

    fn tick(&mut self, context: &mut NativeContext<'_>) -> Result<(), ModuleError> {
        // SAFETY: as above.
        self.call(context, |table| table.tick.map(|tick| unsafe { tick(table.user) }))
    }

    fn command(
        &mut self,
        context: &mut NativeContext<'_>,
        number: u16,
        arguments: &[u8],
        reply: &mut Vec<u8>,
    ) -> Result<(), CommandFailure> {
        let unknown = || CommandFailure::Fault(Fault::Unknown(number));
        let command = self.table.command.ok_or_else(unknown)?;
        let (mut read, mut written) = (decoder(arguments), encoder(&mut self.reply));
        say(Code::Failed, format_args!("it does not say why"));
        let said_before = said();
        // SAFETY: the author's function, with the author's argument; both others outlive the call.
        let outcome = entered(context, || unsafe { command(self.table.user, number, &mut read, &mut written) });
        let result = match outcome {
            0.. => written.whole().map_err(|code| code as i32),
            outcome => Err(outcome),
        };
        match result {
            Ok(len) => {
                reply.extend_from_slice(&self.reply[..len.min(BODY_BYTES_MAX)]);
                Ok(())
            }
            // The same codes of another call, which has failed in the function, are failures of the module.
            Err(outcome) if outcome == Code::NoItem as i32 && (!context.offers(number) || said() == said_before) => {
                Err(unknown())
            }
            Err(outcome) if outcome == Code::Malformed as i32 && read.is_malformed() => {
                Err(CommandFailure::Fault(Fault::Arguments(last_words())))
            }
            Err(_) => Err(CommandFailure::Module(ModuleError::new(last_words()))),
        }
    }

    fn received(&mut self, context: &mut NativeContext<'_>, data: &FollowedData<'_>) -> Result<(), ModuleError> {
        let data = followed(data);
        // SAFETY: as above.
        self.call(context, |table| table.received.map(|received| unsafe { received(table.user, &data) }))
    }

    fn ready(&mut self, context: &mut NativeContext<'_>, ready: Ready) -> Result<(), ModuleError> {
        let (watch, readable, writable) = (ready.watch.number(), ready.readable, ready.writable);
        let told = ReadyDescriptor { watch, readable, writable };
        // SAFETY: as above.
        self.call(context, |table| table.ready.map(|ready| unsafe { ready(table.user, &told) }))
    }

    fn parameters_changed(&mut self, context: &mut NativeContext<'_>, changed: &[&str]) -> Result<(), ModuleError> {
        let names: Vec<CString> = changed.iter().filter_map(|name| CString::new(*name).ok()).collect();
        let pointers: Vec<*const c_char> = names.iter().map(|name| name.as_ptr()).collect();
        let call = |table: &ModuleTable| {
            let tell = table.parameters_changed?;
            // SAFETY: as above; the names outlive the call.
            Some(unsafe { tell(table.user, pointers.as_ptr(), pointers.len()) })
        };
        self.call(context, call)
    }
}
