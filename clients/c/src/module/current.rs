//! The context of the module of which a function runs now, in its thread. So no function of C carries it about, keeps
//! it for longer than it is there, or hands it to another thread.

use crate::code::Code;
use crate::edge::say;
use rohrpost_native::NativeContext;
use std::cell::Cell;
use std::ptr::NonNull;

type Current = Option<NonNull<NativeContext<'static>>>;

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
    let context = NonNull::from(context).cast::<NativeContext<'static>>();
    let _restore = Restore(CURRENT.replace(Some(context)));
    function()
}

/// Uses the context of the function that runs now.
pub(super) fn with_context<T>(use_it: impl FnOnce(&mut NativeContext<'_>) -> Result<T, Code>) -> Result<T, Code> {
    // Not there meanwhile: a second use would be a second reference.
    let Some(mut context) = CURRENT.take() else {
        let words = format_args!("only a function of a module that runs may call this, in its thread");
        return Err(say(Code::Outside, words));
    };
    let _restore = Restore(Some(context));
    // SAFETY: `entered` has borrowed it for as long as the function runs, which calls this, and nothing else has a
    // reference to it until `_restore` puts it back. Its lifetime is not used beyond this call.
    use_it(unsafe { context.as_mut() })
}
