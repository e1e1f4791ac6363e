//! A memory that is soon full: a file system of its own for one process. Tests of other crates take this file, too.

use std::ffi::CString;
use std::io;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

/// Has a process mount a memory of `pages` here that it alone sees.
pub(crate) fn with_small_memory(command: &mut Command, place: &Path, pages: usize) {
    let place = CString::new(place.as_os_str().as_bytes()).unwrap();
    let options = CString::new(format!("size={}", pages * 4096)).unwrap();
    // As a user without rights: in a user namespace, where one has all of them.
    // SAFETY: takes nothing.
    let spaces = libc::CLONE_NEWNS | if unsafe { libc::geteuid() } == 0 { 0 } else { libc::CLONE_NEWUSER };
    let mount = move || {
        let check = |result: i32| if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) };
        // SAFETY: strings that live as long as the calls, or null where that is allowed; nothing is allocated.
        unsafe {
            check(libc::unshare(spaces))?;
            let all = libc::MS_REC | libc::MS_PRIVATE;
            check(libc::mount(std::ptr::null(), c"/".as_ptr(), std::ptr::null(), all, std::ptr::null()))?;
            let tmpfs = c"tmpfs".as_ptr();
            check(libc::mount(tmpfs, place.as_ptr(), tmpfs, 0, options.as_ptr().cast()))
        }
    };
    // SAFETY: system calls alone, which may be made between fork and exec.
    unsafe { command.pre_exec(mount) };
}

/// Whether a process may mount here at all: some containers forbid it.
pub(crate) fn may_mount() -> bool {
    let place = tempfile::tempdir().unwrap();
    let mut command = Command::new("true");
    with_small_memory(&mut command, place.path(), 16);
    command.status().is_ok_and(|status| status.success())
}
