//! What the kernel is asked for a process: its scheduling, its memory, its kin, a device for IP packets. A refusal is
//! told, not fatal.

pub(crate) mod family;

pub use family::{Ancestor, descends_from, ended_child};

use nix::fcntl::{FcntlArg, FdFlag, fcntl};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::sys::resource::{Resource, getrlimit, setrlimit};
use nix::sys::statvfs::statvfs;
use std::fs::File;
use std::io;
use std::os::fd::{AsRawFd, BorrowedFd, FromRawFd, OwnedFd, RawFd};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

/// How a process is scheduled.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scheduling {
    /// SCHED_FIFO with this priority, 1 (least) to 99.
    Fifo(u8),
    /// The normal scheduler with this niceness, -20 (most) to 19.
    Normal(i8),
}

/// Time of a processor that a thread needs again and again, for SCHED_DEADLINE.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Reservation {
    /// So much of it in each period, ns. A thread that uses it up stands still until the next period, unless nobody has
    /// reserved the rest. From 1024 on.
    pub runtime_ns: u64,
    /// It has got it so long after it has become ready to run, at the latest, ns; at least the runtime, at most the
    /// period.
    pub deadline_ns: u64,
    /// The period, ns; at most four seconds.
    pub period_ns: u64,
}

/// Why the system grants no reservation.
#[derive(Debug, thiserror::Error)]
pub enum ReservationError {
    /// The user has no right to.
    #[error(
        "SCHED_DEADLINE needs CAP_SYS_NICE, which no limit of users brings: `setcap cap_sys_nice+ep` on the program, \
         `AmbientCapabilities=CAP_SYS_NICE` in its unit, or `--cap-add=SYS_NICE` for its container; nor is it given \
         to a thread that is bound to some of the processors"
    )]
    NotAllowed,
    /// Others have reserved too much.
    #[error("processors have too little time left that is not reserved; let others reserve less")]
    TooMuch,
    /// It is no reservation, or the kernel cannot.
    #[error("the kernel does not take {0:?}: {1}")]
    NotTaken(Reservation, io::Error),
}

/// A FIFO process that runs for so long without sleeping is ended by the kernel (RLIMIT_RTTIME), µs.
const RUNAWAY_US: u64 = 2_000_000;

/// Schedules the calling thread, and the threads that it starts from now on.
///
/// # Errors
/// Mostly EPERM: no right to real-time scheduling (`ulimit -r`, CAP_SYS_NICE).
pub fn schedule(how: Scheduling) -> io::Result<()> {
    match how {
        Scheduling::Fifo(priority) => {
            // A runaway must not take the computer with it. Only ever lowered, so it cannot be refused.
            let (soft, hard) = getrlimit(Resource::RLIMIT_RTTIME)?;
            setrlimit(Resource::RLIMIT_RTTIME, RUNAWAY_US.min(soft), hard)?;
            let parameters = libc::sched_param { sched_priority: i32::from(priority.clamp(1, 99)) };
            // SAFETY: reads the parameters, which live here; 0 is the calling thread.
            check(unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) })
        }
        Scheduling::Normal(nice) => {
            // It may have inherited real time. To give that up needs no right.
            let parameters = libc::sched_param { sched_priority: 0 };
            // SAFETY: reads the parameters, which live here; 0 is the calling thread.
            check(unsafe { libc::sched_setscheduler(0, libc::SCHED_OTHER, &raw const parameters) })?;
            // SAFETY: takes numbers only; 0 is the calling process.
            check(unsafe { libc::setpriority(libc::PRIO_PROCESS, 0, i32::from(nice)) })
        }
    }
}

/// What `sched_setattr` reads, as the kernel has known it from the first on (SCHED_ATTR_SIZE_VER0).
const _: () = {
    assert!(size_of::<libc::sched_attr>() == 48);
    assert!(std::mem::offset_of!(libc::sched_attr, sched_flags) == 8);
    assert!(std::mem::offset_of!(libc::sched_attr, sched_runtime) == 24);
    assert!(std::mem::offset_of!(libc::sched_attr, sched_period) == 40);
};

/// Reserves time of a processor for the calling thread: it goes before all others, and on whichever processor is free.
/// The threads that it starts run as ordinary ones.
///
/// # Errors
/// [`ReservationError`]
pub fn reserve(reservation: Reservation) -> Result<(), ReservationError> {
    // Interrupts and the hypervisor take the processor from a thread that runs, and the kernel counts that as the
    // thread's. A thread that exceeds its reservation by that stands still for as many periods as make up for it,
    // unless it counts what nobody has reserved as well.
    let flags = libc::SCHED_FLAG_RESET_ON_FORK | libc::SCHED_FLAG_RECLAIM;
    let attributes = libc::sched_attr {
        size: size_of::<libc::sched_attr>() as u32,
        sched_policy: libc::SCHED_DEADLINE as u32,
        sched_flags: flags as u64,
        sched_nice: 0,
        sched_priority: 0,
        sched_runtime: reservation.runtime_ns,
        sched_deadline: reservation.deadline_ns,
        sched_period: reservation.period_ns,
    };
    // SAFETY: reads as many bytes of the attributes, which live here, as these say of themselves; 0 is the calling
    // thread, and there are no flags.
    let result = unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const attributes, 0) };
    if result == 0 {
        return Ok(());
    }
    let error = io::Error::last_os_error();
    Err(match error.raw_os_error() {
        Some(libc::EPERM) => ReservationError::NotAllowed,
        Some(libc::EBUSY) => ReservationError::TooMuch,
        _ => ReservationError::NotTaken(reservation, error),
    })
}

/// How the calling thread is scheduled.
///
/// # Errors
/// When the kernel does not say.
pub fn scheduling() -> io::Result<Scheduling> {
    scheduling_of(0)
}

/// How the main thread of a process is scheduled; 0 is the caller.
///
/// # Errors
/// When there is no such process.
pub fn scheduling_of(pid: u32) -> io::Result<Scheduling> {
    let pid = libc::pid_t::try_from(pid).map_err(|_| io::ErrorKind::InvalidInput)?;
    let mut parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: takes a number only.
    let policy = unsafe { libc::sched_getscheduler(pid) };
    check(policy.min(0))?;
    // SAFETY: writes the parameters, which live here.
    check(unsafe { libc::sched_getparam(pid, &raw mut parameters) })?;
    if policy & !libc::SCHED_RESET_ON_FORK == libc::SCHED_FIFO {
        return Ok(Scheduling::Fifo(parameters.sched_priority.clamp(0, 99) as u8));
    }
    // SAFETY: takes numbers only. -1 may be a niceness; an unknown process was refused above.
    Ok(Scheduling::Normal(unsafe { libc::getpriority(libc::PRIO_PROCESS, pid as libc::id_t) } as i8))
}

/// Keeps the process's memory from being paged out, now and later, if the memlock limit has room for all it may need.
/// False when it has not: with a small limit, later allocations would fail instead of being paged.
///
/// # Errors
/// When the kernel refuses all the same.
pub fn lock_memory() -> io::Result<bool> {
    let (soft, _) = getrlimit(Resource::RLIMIT_MEMLOCK)?;
    if soft != nix::libc::RLIM_INFINITY {
        return Ok(false);
    }
    mlockall(MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE)?;
    Ok(true)
}

/// Whether this process ignores a signal: it was started so, as by `nohup`, or has chosen to.
pub fn ignores(signal: i32) -> bool {
    // SAFETY: numbers and addresses, for which zero is a value.
    let mut now: libc::sigaction = unsafe { std::mem::zeroed() };
    // SAFETY: changes nothing, and writes to `now`, which lives here.
    let told = check(unsafe { libc::sigaction(signal, std::ptr::null(), &raw mut now) });
    told.is_ok() && now.sa_sigaction == libc::SIG_IGN
}

/// Room of a file system, bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Room {
    /// All in all.
    pub bytes: u64,
    /// What this user may still take.
    pub free: u64,
}

/// Room of the file system that a path is on.
///
/// # Errors
/// When there is no such path.
pub fn room(path: &Path) -> io::Result<Room> {
    let told = statvfs(path)?;
    Ok(Room { bytes: told.blocks() * told.fragment_size(), free: told.blocks_available() * told.fragment_size() })
}

/// Makes a TUN device in the network of the calling thread; `%d` in its name becomes a number that is free. Each read
/// brings one IP packet that the kernel sends by it, each write hands the kernel one that has come. It vanishes with
/// the last descriptor.
///
/// # Errors
/// Mostly EPERM: it needs CAP_NET_ADMIN; ENOENT: the kernel has no `tun`, or a container no `/dev/net/tun`.
pub fn tun(name: &str) -> io::Result<(OwnedFd, String)> {
    let device = File::options().read(true).write(true).open("/dev/net/tun")?;
    // SAFETY: numbers and bytes, for which zero is a value.
    let mut request: libc::ifreq = unsafe { std::mem::zeroed() };
    // The last byte stays 0.
    let room = request.ifr_name.len() - 1;
    for (to, from) in request.ifr_name[..room].iter_mut().zip(name.bytes()) {
        *to = from as libc::c_char;
    }
    request.ifr_ifru.ifru_flags = (libc::IFF_TUN | libc::IFF_NO_PI) as libc::c_short;
    // SAFETY: reads and writes the request, which lives here, and is what TUNSETIFF takes.
    check(unsafe { libc::ioctl(device.as_raw_fd(), libc::TUNSETIFF, &raw mut request) })?;
    let name = request.ifr_name.iter().map(|byte| *byte as u8).take_while(|byte| *byte != 0);
    Ok((device.into(), String::from_utf8_lossy(&name.collect::<Vec<_>>()).into_owned()))
}

fn check(result: i32) -> io::Result<()> {
    if result < 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
}

/// Numbers of the descriptors that were handed on to this process, with commas.
const HANDED_ON: &str = "ROHRPOST_HANDED_ON";

/// Has a process that is to be started keep copies of these descriptors: see [`handed_on`]. In this process they stay
/// close-on-exec, so no other one that is started meanwhile has them; the mark is cleared in that process alone.
///
/// # Errors
/// When there can be no further descriptors.
pub fn hand_on(command: &mut Command, descriptors: &[OwnedFd]) -> io::Result<()> {
    let copies = descriptors.iter().map(OwnedFd::try_clone).collect::<io::Result<Vec<_>>>()?;
    let numbers: Vec<String> = copies.iter().map(|copy| copy.as_raw_fd().to_string()).collect();
    command.env(HANDED_ON, numbers.join(","));
    let keep = move || {
        for copy in &copies {
            fcntl(copy, FcntlArg::F_SETFD(FdFlag::empty()))?;
        }
        Ok(())
    };
    // SAFETY: between fork and exec the closure makes system calls that are safe there (signal-safety(7)), and takes no
    // lock and no memory.
    unsafe { command.pre_exec(keep) };
    Ok(())
}

/// Has a process that is to be started know of no descriptors: those of this process are not its.
pub fn hand_nothing_on(command: &mut Command) {
    command.env_remove(HANDED_ON);
}

/// Takes over the descriptors that the process which started this one has [handed on](hand_on), in their order; up to
/// the first that is not there. Once: asked again, there are none.
pub fn handed_on() -> Vec<OwnedFd> {
    static WERE_TAKEN: AtomicBool = AtomicBool::new(false);
    if WERE_TAKEN.swap(true, Ordering::Relaxed) {
        return Vec::new();
    }
    let numbers = std::env::var(HANDED_ON).unwrap_or_default();
    numbers.split(',').map_while(|number| adopt(number.parse().ok()?).ok()).collect()
}

/// Takes over a descriptor under this number. From then on it is closed in processes that this one starts, as all that
/// this one has opened itself.
fn adopt(number: RawFd) -> io::Result<OwnedFd> {
    if number < 0 {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    // SAFETY: the descriptor is only looked at by `fcntl`; one that is not open is an error.
    let descriptor = unsafe { BorrowedFd::borrow_raw(number) };
    let flags = FdFlag::from_bits_retain(fcntl(descriptor, FcntlArg::F_GETFD)?);
    if flags.contains(FdFlag::FD_CLOEXEC) || number <= 2 {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, format!("descriptor {number} was not handed on")));
    }
    fcntl(descriptor, FcntlArg::F_SETFD(FdFlag::FD_CLOEXEC))?;
    // SAFETY: it is open, the process that started this one says that it is ours, and nobody else in this process has
    // taken it: each number is asked for once, and what this process has opened itself is marked to be closed in
    // further ones, which this one was not.
    Ok(unsafe { OwnedFd::from_raw_fd(number) })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// What the kernel says of a thread that has reserved so much.
    fn reserved(runtime_ns: u64, period_ns: u64) -> Result<libc::sched_attr, ReservationError> {
        let reserve = move || {
            reserve(Reservation { runtime_ns, deadline_ns: period_ns, period_ns })?;
            // SAFETY: numbers only, for which 0 is a value.
            let mut said: libc::sched_attr = unsafe { std::mem::zeroed() };
            let bytes = size_of::<libc::sched_attr>();
            // SAFETY: writes as many bytes as it is told, to attributes that live here; 0 is the calling thread, and
            // there are no flags.
            assert_eq!(unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &raw mut said, bytes, 0) }, 0);
            Ok(said)
        };
        // Of a thread of its own, with which it ends.
        std::thread::spawn(reserve).join().unwrap()
    }

    #[test]
    fn a_reservation_is_granted_or_refused_with_a_reason() {
        match reserved(MS / 10, 10 * MS) {
            Ok(said) => {
                assert_eq!((said.sched_policy, said.sched_runtime), (libc::SCHED_DEADLINE as u32, MS / 10));
                assert!(
                    said.sched_flags & libc::SCHED_FLAG_RECLAIM as u64 != 0,
                    "what the hypervisor takes is made up for"
                );
            }
            Err(ReservationError::NotAllowed | ReservationError::TooMuch) => {}
            Err(error) => panic!("{error}"),
        }
        // More than there is, and nothing: both are refused, with and without the capability.
        let error = reserved(2 * MS, MS).unwrap_err();
        assert!(matches!(error, ReservationError::NotTaken(..) | ReservationError::NotAllowed), "{error}");
    }

    #[test]
    fn what_is_handed_on_is_open_in_that_process_alone_and_taken_over_once() {
        let (reader, mut writer) = std::io::pipe().unwrap();
        std::io::Write::write_all(&mut writer, b"handed on").unwrap();
        drop(writer);
        let kept = [OwnedFd::from(reader)];
        let number = kept[0].as_raw_fd();
        let cat = || {
            let mut command = Command::new("sh");
            command.args(["-c", "cat /proc/self/fd/${ROHRPOST_HANDED_ON:-$0}", &number.to_string()]);
            command.stderr(std::process::Stdio::null());
            command
        };
        assert!(!cat().status().unwrap().success(), "it is not open in others");
        assert!(adopt(number).is_err(), "it is of this process, which has opened it");
        let mut command = cat();
        hand_on(&mut command, &kept).unwrap();
        assert_eq!(command.output().unwrap().stdout, b"handed on");

        // As in a process that it was handed on to.
        fcntl(&kept[0], FcntlArg::F_SETFD(FdFlag::empty())).unwrap();
        let [first] = kept;
        let number = std::os::fd::IntoRawFd::into_raw_fd(first);
        let taken = adopt(number).unwrap();
        assert!(adopt(number).is_err(), "it has an owner");
        drop(taken);
        assert!([number, 0, -1].into_iter().all(|number| adopt(number).is_err()));
    }

    #[test]
    fn what_a_thread_with_a_reservation_starts_is_ordinary() {
        let of_child = std::thread::spawn(|| {
            // Without the right to it, the child is as ordinary as this one.
            let _ = reserve(Reservation { runtime_ns: MS / 10, deadline_ns: 10 * MS, period_ns: 10 * MS });
            std::thread::spawn(scheduling).join().unwrap().unwrap()
        });
        assert!(matches!(of_child.join().unwrap(), Scheduling::Normal(_)));
    }
}
