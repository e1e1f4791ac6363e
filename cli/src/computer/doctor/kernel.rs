//! The kernel and the processor: what may delay a thread.

use super::finding::{Check, Finding};
use super::machine::Machine;
use crate::daemons::{self, Daemon};

/// The first version with open-file-description locks.
const KERNEL_LEAST: (u32, u32) = (3, 15);
/// Idle states with a longer exit latency delay a wake-up noticeably, µs.
const IDLE_LATENCY_US: u64 = 50;
const CPUS: &str = "/sys/devices/system/cpu";

pub(super) fn findings(machine: &Machine) -> Vec<Finding> {
    let found =
        [version(machine), preemption(machine), throttling(machine), fair_server(machine), clock_source(machine)];
    let found = found.into_iter().flatten();
    let found = found.chain([governor(machine), idle(machine), cores(machine), isolated(machine)]);
    found.chain(time_daemons(machine)).collect()
}

/// If nodes have a common time, no other program may slew their clocks.
fn time_daemons(machine: &Machine) -> Vec<Finding> {
    let finding = |daemon: Daemon| {
        let is = format!("{} runs", daemon.name);
        match machine.asked.lan {
            Some(_) => Check("time daemon", daemons::WHY).warn(is, daemon.ends),
            None => Check("time daemon", "it does no harm, unless nodes follow a master clock").ok(is),
        }
    };
    let running = daemons::running(&machine.folder("/proc"));
    if running.is_empty() {
        return vec![Check("time daemon", daemons::WHY).ok("none runs")];
    }
    running.into_iter().map(finding).collect()
}

fn version(machine: &Machine) -> Option<Finding> {
    let why = "a module's death is detected by open-file-description locks, which need Linux 3.15";
    let text = machine.read("/proc/sys/kernel/osrelease")?;
    let mut parts = text.split(|c: char| !c.is_ascii_digit()).map(|part| part.parse().unwrap_or(0));
    let version = (parts.next()?, parts.next().unwrap_or(0));
    Some(if version >= KERNEL_LEAST {
        Check("kernel", why).ok(text)
    } else {
        Check("kernel", why).bad(text, "install a newer kernel")
    })
}

fn preemption(machine: &Machine) -> Option<Finding> {
    let why = "bounds how long the kernel itself delays an urgent thread";
    let built = machine.read("/proc/version")?;
    if machine.number("/sys/kernel/realtime") == Some(1) || built.contains("PREEMPT_RT") {
        return Some(Check("preemption", why).ok("PREEMPT_RT"));
    }
    // `none voluntary (full) lazy`: the mode in brackets is active. Mostly only root may read the file.
    let chosen = machine.read("/sys/kernel/debug/sched/preempt");
    let chosen = chosen.as_deref().and_then(|text| text.split(['(', ')']).nth(1));
    let model = match chosen {
        Some(model) => format!("dynamic, now `{model}`"),
        None if built.contains("PREEMPT_DYNAMIC") => "dynamic (only root may read the active mode)".into(),
        None if built.contains("PREEMPT") => "full".into(),
        None => "none or voluntary".into(),
    };
    Some(Check("preemption", why).warn(
        format!("{model}; not PREEMPT_RT"),
        "boot a kernel with PREEMPT_RT (Debian: `apt install linux-image-rt-amd64`), or at least with `preempt=full`",
    ))
}

fn throttling(machine: &Machine) -> Option<Finding> {
    let check = Check("real-time share", "a SCHED_FIFO thread that never sleeps must leave some time to other threads");
    let runtime: i64 = machine.read("/proc/sys/kernel/sched_rt_runtime_us")?.parse().ok()?;
    let period = machine.number("/proc/sys/kernel/sched_rt_period_us").unwrap_or(1_000_000).max(1);
    let fix = "sudo sysctl -w kernel.sched_rt_runtime_us=950000";
    Some(match runtime {
        0 => check.bad("0 µs: SCHED_FIFO threads never run", fix),
        ..0 => check.warn("no limit: an endless loop blocks the computer", fix),
        _ => check.ok(format!("{runtime} of {period} µs")),
    })
}

/// Since 6.12 the kernel reserves time for ordinary threads by a deadline server; the share above no longer matters.
fn fair_server(machine: &Machine) -> Option<Finding> {
    let runtime = machine.number("/sys/kernel/debug/sched/fair_server/cpu0/runtime")?;
    let period = machine.number("/sys/kernel/debug/sched/fair_server/cpu0/period")?;
    let is = format!("{} of {} ms go to ordinary threads if they starve", runtime / 1_000_000, period / 1_000_000);
    let why = "a real-time thread may be delayed this long when others starve";
    Some(Check("fair server", why).ok(is))
}

fn clock_source(machine: &Machine) -> Option<Finding> {
    let folder = "/sys/devices/system/clocksource/clocksource0";
    let check =
        Check("clock source", "every package and deadline reads the clock; some clock sources need a system call");
    let source = machine.read(&format!("{folder}/current_clocksource"))?;
    let slow = ["hpet", "acpi_pm", "jiffies", "refined-jiffies", "pit"];
    if !slow.contains(&source.as_str()) {
        return Some(check.ok(source));
    }
    let available = machine.read(&format!("{folder}/available_clocksource")).unwrap_or_default();
    let better = available.split_whitespace().find(|source| !slow.contains(source));
    let fix = match better {
        Some(better) => format!("echo {better} | sudo tee {folder}/current_clocksource"),
        None => "find out why the kernel rejected the better one: `dmesg | grep -i clocksource`".into(),
    };
    Some(check.warn(format!("{source} (slow)"), fix))
}

fn governor(machine: &Machine) -> Finding {
    let check = Check("CPU governor", "a core that must first speed up is late by tens of microseconds");
    let cpus = machine.numbered(CPUS, "cpu").into_iter();
    let mut governors: Vec<String> =
        cpus.filter_map(|cpu| machine.read(&format!("{CPUS}/{cpu}/cpufreq/scaling_governor"))).collect();
    governors.sort();
    governors.dedup();
    match &governors[..] {
        [] => check.ok("none: firmware or the host sets the clock rate"),
        [only] if only == "performance" => check.ok("performance"),
        several => {
            let fix = "sudo cpupower frequency-set -g performance";
            check.warn(several.join(", "), fix)
        }
    }
}

fn idle(machine: &Machine) -> Finding {
    let check = Check("idle states", "a core in a deep idle state takes this long to wake up");
    let folder = format!("{CPUS}/cpu0/cpuidle");
    let states = machine.numbered(&folder, "state").into_iter().filter_map(|state| {
        let of = |file| machine.read(&format!("{folder}/{state}/{file}"));
        let used = of("disable").is_none_or(|disabled| disabled == "0");
        Some((of("latency")?.parse::<u64>().ok()?, of("name")?)).filter(|_| used)
    });
    match states.max() {
        None => check.ok("none, or controlled by the host"),
        Some((latency, name)) if latency <= IDLE_LATENCY_US => check.ok(format!("deepest is {name}, {latency} µs")),
        Some((latency, name)) => {
            let fix = format!("sudo cpupower idle-set -D {IDLE_LATENCY_US}");
            check.warn(format!("deepest is {name}, {latency} µs"), fix)
        }
    }
}

fn cores(machine: &Machine) -> Finding {
    let check = Check("cores", "with one core, a busy module delays all less urgent ones");
    let allowed = machine.field("/proc/self/status", "Cpus_allowed_list");
    let count = allowed.as_deref().map_or(0, count_of_list);
    let is = match (count, allowed) {
        (0, _) => "unknown".into(),
        (1, Some(list)) => format!("1 (number {list})"),
        (count, list) => format!("{count} (numbers {})", list.unwrap_or_default()),
    };
    if count == 1 {
        let fix = "give it more cores, or lift the restriction (`taskset -pc $$`, cpuset of the container)";
        return check.warn(is, fix);
    }
    check.ok(is)
}

/// Counts the processors of a list: `0-3,8` is five.
fn count_of_list(list: &str) -> u32 {
    let range = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(last.parse::<u32>().ok()?.saturating_sub(first.parse().ok()?) + 1)
    };
    list.split(',').filter_map(range).sum()
}

fn isolated(machine: &Machine) -> Finding {
    let list = machine.read(&format!("{CPUS}/isolated")).unwrap_or_default();
    let is = if list.is_empty() {
        "none".into()
    } else {
        format!("numbers {list}; start there with `taskset -c {list} rohrpost launch …`")
    };
    Check(
        "isolated cores",
        "the kernel schedules no other threads there (boot with `isolcpus=`); useful only for the last microseconds",
    )
    .ok(is)
}
