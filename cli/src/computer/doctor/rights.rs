//! The rights of this user and this process.

use super::finding::{Check, Finding};
use super::machine::{Limit, Machine, Needs};
use crate::terminal::units::size;
use rohrpost_config::FIFO_MAX;

/// Bit of CAP_SYS_NICE.
const SYS_NICE: u32 = 23;
/// A process of a node keeps a few files open for each mailbox that it owns or sends to.
const FILES_LEAST: u64 = 1024;

pub(super) fn findings(machine: &Machine, needs: &Needs) -> Vec<Finding> {
    let found = [real_time(machine, needs), nice(machine), memory_lock(machine), swap(machine), files(machine)];
    found.into_iter().flatten().chain([groups(machine)]).collect()
}

fn real_time(machine: &Machine, needs: &Needs) -> Option<Finding> {
    let check = Check(
        "real time",
        "without the right, modules of classes from 128 up run under the normal scheduler, and other threads delay \
         them",
    );
    let wanted = match (&needs.from, needs.priority) {
        (Some(file), 0) => return Some(check.ok(format!("{} asks for none", file.display()))),
        (Some(file), priority) => format!("{} asks for SCHED_FIFO {priority}", file.display()),
        (None, priority) => format!("modules may ask for up to SCHED_FIFO {priority}"),
    };
    let capable = machine.field("/proc/self/status", "CapEff");
    let capable =
        capable.and_then(|bits| u64::from_str_radix(&bits, 16).ok()).is_some_and(|bits| bits >> SYS_NICE & 1 == 1);
    let right = match machine.limit("Max realtime priority")? {
        Limit::None => "rtprio limit: none".into(),
        Limit::Of(limit) if capable => format!("rtprio limit {limit}, but CAP_SYS_NICE"),
        Limit::Of(limit) => format!("rtprio limit {limit}"),
    };
    match &machine.asked.fifo {
        Ok(()) => Some(check.ok(format!("granted ({right}); {wanted}"))),
        Err(error) => {
            let fix = format!(
                "echo \"$USER - rtprio {FIFO_MAX}\" | sudo tee -a /etc/security/limits.d/rohrpost.conf, and log in \
                 anew; in a container: `--ulimit rtprio={FIFO_MAX} --cap-add=SYS_NICE`"
            );
            Some(check.warn(format!("refused ({right}): {error}; {wanted}"), fix))
        }
    }
}

fn nice(machine: &Machine) -> Option<Finding> {
    // The limit counts from the other end: 20 minus the lowest nice value.
    let is = match machine.limit("Max nice priority")? {
        Limit::Of(..=20) => "from 0 on".into(),
        Limit::Of(limit) => format!("from -{} on", limit.min(40) - 20),
        Limit::None => "from -20 on".into(),
    };
    Some(Check("nice", "classes below 128 run with nice 0 to 19, which need no right").ok(is))
}

fn memory_lock(machine: &Machine) -> Option<Finding> {
    let check = Check(
        "locked memory",
        "real-time modules lock their memory only if the limit allows all of it; else page faults delay them",
    );
    Some(match machine.limit("Max locked memory")? {
        Limit::None => check.ok("no limit"),
        Limit::Of(bytes) => {
            let fix = "echo \"$USER - memlock unlimited\" | sudo tee -a /etc/security/limits.d/rohrpost.conf, and log \
                in anew; in a container: `--ulimit memlock=-1`";
            check.warn(format!("at most {}", size(bytes)), fix)
        }
    })
}

fn swap(machine: &Machine) -> Option<Finding> {
    let check = Check("swap", "swapped-out memory takes milliseconds to come back");
    let text = machine.read("/proc/swaps")?;
    let areas: Vec<&str> = text.lines().skip(1).filter_map(|line| line.split_whitespace().next()).collect();
    if areas.is_empty() {
        return Some(check.ok("none"));
    }
    let is = areas.join(", ");
    // Locked memory is not paged out.
    if machine.limit("Max locked memory") == Some(Limit::None) {
        return Some(check.ok(format!("{is}; real-time modules lock their memory")));
    }
    Some(check.warn(is, "sudo swapoff -a, or lift the limit of locked memory"))
}

fn files(machine: &Machine) -> Option<Finding> {
    let check = Check("open files", "a process opens each mailbox that it owns or sends to");
    Some(match machine.limit("Max open files")? {
        Limit::Of(limit) if limit < FILES_LEAST => {
            let fix =
                format!("ulimit -n {FILES_LEAST}, or a line `$USER - nofile {FILES_LEAST}` in /etc/security/limits.d");
            check.warn(format!("at most {limit}"), fix)
        }
        Limit::Of(limit) => check.ok(format!("at most {limit}")),
        Limit::None => check.ok("no limit"),
    })
}

fn groups(machine: &Machine) -> Finding {
    let uid = machine.field("/proc/self/status", "Uid").unwrap_or_default();
    let uid = uid.split_whitespace().next().unwrap_or("?").to_owned();
    let ids = machine.field("/proc/self/status", "Groups").unwrap_or_default();
    let table = machine.read("/etc/group").unwrap_or_default();
    // `name:password:id:members`
    let name = |id: &str| {
        let line = table.lines().find(|line| line.split(':').nth(2) == Some(id));
        line.and_then(|line| line.split(':').next()).unwrap_or(id).to_owned()
    };
    let names: Vec<String> = ids.split_whitespace().map(name).collect();
    let names = if names.is_empty() { "no further groups".into() } else { format!("groups {}", names.join(", ")) };
    Check("user", "devices, and the right to real time, are often given to groups such as dialout or realtime")
        .ok(format!("{uid}, {names}"))
}
