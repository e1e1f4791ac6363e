//! Writing to a stream and reading one ask the kernel for nothing: the thread of a module is followed from one system
//! call to the next, and marks what it does. So it is with a journal, in which each of these is noted.
//!
//! Without a test harness: the module runs on the main thread of a process, which its parent traces.

#![allow(clippy::unwrap_used, reason = "this is a test")]

pub mod support;

#[cfg(target_arch = "x86_64")]
mod traced {
    use crate::support::{Place, play};
    use nix::sys::ptrace;
    use nix::sys::signal::{Signal, raise};
    use nix::sys::wait::{WaitStatus, waitpid};
    use nix::unistd::{Pid, getpgid};
    use rohrpost_mailbox::{Next, monotonic_ns};
    use rohrpost_modules::runtime::{Context, Stream};
    use rohrpost_modules::types::Pose;
    use rohrpost_modules::{Module, ModuleError, interface};
    use std::process::{Command, Stdio};
    use std::time::Duration;

    /// Times that each thing is done, once all is warm.
    const TIMES: usize = 200;
    const WARM: usize = 20;
    /// Marks are system calls too: questions about processes that cannot be.
    const MARK: i32 = 0x4000_0000;
    const STEPS: [&str; 6] = ["read the clock", "write", "newest", "next", "at", "begin and drop"];

    /// Knows where it hangs.
    #[interface(class = "crane", crate = rohrpost_modules::macro_support)]
    trait Crane {
        /// Where its hook hangs.
        #[stream(1)]
        fn hook() -> Pose;
    }

    struct Hook {
        hook: Stream<Pose>,
        ticks: usize,
        before_ns: u64,
    }

    impl Crane for Hook {}

    impl Module for Hook {
        type Settings = toml::Table;
        type Interfaces = CraneInterface;

        fn new(_: toml::Table, context: &mut Context) -> Result<Self, ModuleError> {
            context.set_period(Duration::from_micros(100));
            Ok(Self { hook: context.stream(CraneInterface::HOOK, "crane.0")?, ticks: 0, before_ns: 0 })
        }

        fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
            self.ticks += 1;
            if self.ticks > WARM + TIMES {
                std::process::exit(0);
            }
            let warm = self.ticks > WARM;
            let now_ns = context.now().ns;
            let hook = Pose { x_m: 1.5, ..Pose::default() };
            marked(warm, 0, || assert!(monotonic_ns() > 0));
            marked(warm, 1, || assert!(context.write(CraneInterface::HOOK, now_ns, &hook).is_ok()));
            marked(warm, 2, || assert!(self.hook.newest().is_ok_and(|record| record.is_some())));
            marked(warm, 3, || {
                assert!(matches!(self.hook.try_next(), Ok(Next::Record(record)) if record.read().is_ok()))
            });
            let between = self.before_ns.midpoint(now_ns);
            marked(warm, 4, || assert!(self.hook.at(between).is_ok_and(|value| value.is_ok())));
            marked(warm, 5, || assert!(context.begin(CraneInterface::HOOK, now_ns).is_ok()));
            self.before_ns = now_ns;
            Ok(())
        }
    }

    fn marked(warm: bool, step: i32, part: impl FnOnce()) {
        if warm {
            assert!(getpgid(Some(Pid::from_raw(MARK + step))).is_err());
            part();
            assert!(getpgid(Some(Pid::from_raw(MARK + step))).is_err());
        } else if step != 4 {
            part();
        }
    }

    const CONFIG: &str = r#"
installation = "stream-calls-NUMBER"
[system]
name = "robot"
id = 1
[classes]
crane = { id = 100, text = "Lifts" }
logd = { id = 24, text = "Records" }
tool = { id = 16, text = "By hand" }
[nodes.main]
[[module]]
name = "crane.0"
program = "crane"
optional = true
"#;

    /// With a journal.
    const EXACT: &str = include_str!("../../tests/testbed/journal.toml");

    /// The system calls within each step, of each time that it was done.
    fn follow(pid: Pid) -> Vec<(usize, Vec<u64>)> {
        assert_eq!(waitpid(pid, None).unwrap(), WaitStatus::Stopped(pid, Signal::SIGSTOP));
        ptrace::setoptions(pid, ptrace::Options::PTRACE_O_TRACESYSGOOD | ptrace::Options::PTRACE_O_EXITKILL).unwrap();
        let (mut all, mut inside) = (Vec::new(), None::<(usize, Vec<u64>)>);
        let (mut signal, mut entering) = (None, false);
        loop {
            ptrace::syscall(pid, signal.take()).unwrap();
            match waitpid(pid, None).unwrap() {
                WaitStatus::PtraceSyscall(_) => entering = !entering,
                WaitStatus::Stopped(_, sent) => {
                    signal = Some(sent);
                    continue;
                }
                end => {
                    assert_eq!(end, WaitStatus::Exited(pid, 0), "see above");
                    return all;
                }
            }
            if !entering {
                continue;
            }
            let registers = ptrace::getregs(pid).unwrap();
            let step = registers.rdi.checked_sub(MARK as u64).filter(|step| *step < STEPS.len() as u64);
            let is_mark = registers.orig_rax == nix::libc::SYS_getpgid as u64;
            match (step.filter(|_| is_mark), &mut inside) {
                (Some(step), None) => inside = Some((step as usize, Vec::new())),
                (Some(_), Some(_)) => all.extend(inside.take()),
                (None, Some((_, calls))) => calls.push(registers.orig_rax),
                (None, None) => {}
            }
        }
    }

    pub(crate) fn main() {
        if std::env::var_os("ROHRPOST_TEST_CONFIG").is_some() {
            ptrace::traceme().unwrap();
            raise(Signal::SIGSTOP).unwrap();
            return play::<Hook>("crane.0");
        }
        for more in ["", EXACT] {
            traced(&format!("{CONFIG}{}", more.replace("MODULE", "crane.0")));
        }
    }

    fn traced(config: &str) {
        let place = Place::new(config, &[]);
        #[expect(clippy::zombie_processes, reason = "`follow` waits until it has ended")]
        let child = Command::new(std::env::current_exe().unwrap())
            .env("ROHRPOST_TEST_CONFIG", &place.installation.path)
            .stdin(Stdio::null())
            .spawn()
            .unwrap();
        let all = follow(Pid::from_raw(child.id() as i32));
        // Not ours to fix: a clock source that cannot be read without the kernel.
        let slow_clock = all.iter().any(|(step, calls)| *step == 0 && !calls.is_empty());
        for (step, name) in STEPS.iter().enumerate() {
            let here: Vec<_> = all.iter().filter(|(of, _)| *of == step).collect();
            assert_eq!(here.len(), TIMES, "{name}");
            let called = |call: &u64| !(slow_clock && *call == nix::libc::SYS_clock_gettime as u64);
            for (_, calls) in here {
                let calls: Vec<_> = calls.iter().filter(|call| called(call)).collect();
                assert!(calls.is_empty(), "{name}: system calls {calls:?}");
            }
        }
        println!("{} operations on streams traced: no system call", all.len());
    }
}

fn main() {
    #[cfg(target_arch = "x86_64")]
    traced::main();
    #[cfg(not(target_arch = "x86_64"))]
    rohrpost_testbed::report::skipped("system calls of streams; they are traced on x86-64 only");
}
