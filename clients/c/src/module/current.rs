//! The context of the module of which a function runs now, in its thread. So no function of C carries it about, keeps
//! it for longer than it is there, or hands it to another thread.

use crate::code::Code;
use crate::edge::{say, tell};
use crate::fork::forks;
use rohrpost_native::NativeContext;
use std::cell::Cell;
use std::ptr::NonNull;

/// How a child of a module's process ends that returns from the function in which it was forked.
const FORKED_EXIT: libc::c_int = 70;

/// The context, and how often the process was forked when the function began.
type Current = Option<(NonNull<NativeContext<'static>>, u32)>;

thread_local! {
    static CURRENT: Cell<Current> = const { Cell::new(None) };
}

/// Puts back what was there before, whatever happens.
struct Restore(Current);

impl Drop for Restore {
    fn drop(&mut self) {
        CURRENT.set(self.0);
    }
}

/// Runs a function of the module, during which it has this context.
pub(super) fn entered<T>(context: &mut NativeContext<'_>, function: impl FnOnce() -> T) -> T {
    let (context, began) = (NonNull::from(context).cast::<NativeContext<'static>>(), forks());
    let _restore = Restore(CURRENT.replace(Some((context, began))));
    let result = function();
    if forks() != began {
        tell("a forked process came back to the loop of its parent's module, and ends; let it end by exec or _exit");
        // SAFETY: it ends the process, without a word of the parent's: no destructor and no `atexit` runs.
        unsafe { libc::_exit(FORKED_EXIT) };
    }
    result
}

/// Uses the context of the function that runs now.
pub(super) fn with_context<T>(use_it: impl FnOnce(&mut NativeContext<'_>) -> Result<T, Code>) -> Result<T, Code> {
    // Not there meanwhile: a second use would be a second reference.
    let Some((mut context, began)) = CURRENT.take() else {
        let words = format_args!("only a function of a module that runs may call this, in its thread");
        return Err(say(Code::Outside, words));
    };
    let _restore = Restore(Some((context, began)));
    if forks() != began {
        let words = format_args!("this process was forked from a module's, and has no part in it: call exec or _exit");
        return Err(say(Code::Forked, words));
    }
    // SAFETY: `entered` has borrowed it for as long as the function runs, which calls this, and nothing else has a
    // reference to it until `_restore` puts it back. Its lifetime is not used beyond this call.
    use_it(unsafe { context.as_mut() })
}
