//! The directory where a node would be created, its limits, and what exists there already.

use super::finding::{Check, Finding};
use super::machine::{Bridge, Machine, Needs, NodeDirectory, StreamsFound};
use crate::terminal::units::{date, size};
use rohrpost_modules::runtime::clock_was_set;
use std::path::Path;

/// Room for tools, for mailboxes that modules create at run time, and for streams that the configuration does not name,
/// bytes.
const SPARE: u64 = 16 << 20;
/// Size of the smallest node: its own pages, an output module, and one tool.
const LEAST: u64 = 2 << 20;
/// A clock that shows an earlier time was never set, ns since 1970: 2020.
const NEVER_SET_NS: u64 = 1_577_836_800_000_000_000;
/// Upper limit of our threads in a process of a node.
const THREADS: u64 = 4;

pub(super) fn findings(machine: &Machine, needs: &Needs) -> Vec<Finding> {
    let found = [file_system(machine), room(machine, needs), container(machine)];
    let mut found: Vec<Finding> = found.into_iter().flatten().collect();
    found.extend(groups_of_control(machine, needs));
    found.extend(nodes(machine));
    found.extend(clocks(machine));
    found.extend(gui(machine, needs));
    found.push(systemd(machine));
    found
}

/// A mount point, and its file system type.
struct Mount {
    point: String,
    kind: String,
}

/// The file system of the nodes; none where the kernel does not tell.
fn mount(machine: &Machine) -> Option<Mount> {
    let mounts = machine.read("/proc/mounts")?;
    let mounts = mounts.lines().filter_map(|line| {
        let mut words = line.split(' ').skip(1);
        // White space in a path is written in octal.
        let point = words.next()?.replace("\\040", " ").replace("\\011", "\t").replace("\\134", "\\");
        Some(Mount { point, kind: words.next()?.to_owned() })
    });
    // The longest match wins; of equal ones the last, since a later mount hides an earlier one.
    mounts.filter(|mount| machine.asked.base.starts_with(&mount.point)).max_by_key(|mount| mount.point.len())
}

impl Mount {
    fn is_memory(&self) -> bool {
        matches!(self.kind.as_str(), "tmpfs" | "ramfs")
    }

    /// Its path for a command line.
    fn quoted(&self) -> String {
        if self.point.contains(char::is_whitespace) { format!("'{}'", self.point) } else { self.point.clone() }
    }
}

fn file_system(machine: &Machine) -> Option<Finding> {
    let check = Check(
        "node directory",
        "mailboxes and streams are files there; on any other file system the kernel writes them to a disk",
    );
    let mount = mount(machine)?;
    let is = format!("{} ({})", machine.asked.base.display(), mount.kind);
    if mount.is_memory() {
        return Some(check.ok(is));
    }
    Some(check.warn(is, "unset ROHRPOST_DIR, or set it to a folder below /dev/shm"))
}

fn room(machine: &Machine, needs: &Needs) -> Option<Finding> {
    let check = Check("shared memory", "mailboxes and streams take all of their memory when they are made");
    let mount = mount(machine);
    let Some(room) = machine.asked.room else {
        let fix = match &mount {
            Some(mount) if mount.is_memory() => format!("df {}", mount.quoted()),
            _ => "mount -t tmpfs tmpfs /dev/shm".to_owned(),
        };
        return Some(check.warn("its size is unknown", fix));
    };
    let needed = match &needs.from {
        Some(file) => format!("; {} needs {} for its mailboxes and streams", file.display(), size(needs.memory)),
        None => String::new(),
    };
    let is = format!("{} free of {}{needed}", size(room.free), size(room.bytes));
    let fix = || {
        let wanted = (needs.memory + 2 * SPARE + room.bytes - room.free).next_power_of_two() >> 20;
        format!("rohrpost clean; {}", more_room(mount.as_ref(), wanted))
    };
    Some(match room.free {
        free if free < needs.memory.max(LEAST) => check.bad(is, fix()),
        free if free < needs.memory + SPARE => check.warn(is, fix()),
        _ => check.ok(is),
    })
}

/// The command that gives a file system this size.
fn more_room(mount: Option<&Mount>, mib: u64) -> String {
    let Some(mount) = mount else { return format!("give the node directory a tmpfs of {mib} MiB") };
    if !mount.is_memory() {
        return format!("free some of the disk at {}, or better move to /dev/shm, with {mib} MiB", mount.quoted());
    }
    let remount = format!("sudo mount -o remount,size={mib}M {}", mount.quoted());
    if mount.point == "/dev/shm" { format!("{remount}; in a container: `--shm-size={mib}m`") } else { remount }
}

fn container(machine: &Machine) -> Option<Finding> {
    let why = "a container's host decides on rights, shared memory and cores";
    let marks = [
        ("/.dockerenv", "Docker"),
        ("/run/.containerenv", "Podman"),
        ("/run/systemd/container", "systemd-nspawn or LXC"),
    ];
    let kind = marks.iter().find(|(mark, _)| machine.exists(mark)).map(|(_, kind)| *kind);
    Some(Check("container", why).ok(kind.unwrap_or("none known")))
}

/// Limits of this process's control group and of its ancestors.
fn groups_of_control(machine: &Machine, needs: &Needs) -> Vec<Finding> {
    let mut found: Vec<Finding> = share_of_time(machine).into_iter().chain(share_of_real_time(machine)).collect();
    // Version 2, then version 1.
    found.extend(["memory.max", "memory.limit_in_bytes"].iter().filter_map(|file| memory_limit(machine, needs, file)));
    found.extend(process_limit(machine, needs));
    found
}

fn share_of_time(machine: &Machine) -> Option<Finding> {
    let why = "a control group that has used up its share is stopped, however urgent its threads are";
    let (value, path) = tightest(machine, "cpu", "cpu.max", |text| {
        let (quota, period) = text.split_once(' ')?;
        Some(quota.parse::<f64>().ok()? / period.parse::<f64>().ok()?)
    })?;
    let fix = format!("echo max | sudo tee {path}, or start the container without `--cpus`");
    Some(Check("CPU quota", why).warn(format!("{value} cores ({path})"), fix))
}

/// Version 1 of control groups gives real-time threads no time by default.
fn share_of_real_time(machine: &Machine) -> Option<Finding> {
    let least = tightest(machine, "cpu", "cpu.rt_runtime_us", |text| text.parse::<f64>().ok());
    let (_, path) = least.filter(|(value, _)| *value <= 0.0)?;
    let fix = format!("echo 950000 | sudo tee {path}, in the groups around it first");
    let why = "without this share, the group may not use SCHED_FIFO";
    Some(Check("real-time quota", why).warn(format!("0 µs ({path})"), fix))
}

fn memory_limit(machine: &Machine, needs: &Needs, file: &str) -> Option<Finding> {
    let check = Check("memory limit", "a process beyond it is killed; shared memory counts");
    let (limit, path) = tightest(machine, "memory", file, whole)?;
    let (limit, is) = (limit as u64, format!("{} ({path})", size(limit as u64)));
    if limit >= needs.memory + SPARE {
        return Some(check.ok(is));
    }
    let fix = "start the container with more `--memory`, or MemoryMax= in the unit";
    Some(check.bad(is, fix))
}

fn process_limit(machine: &Machine, needs: &Needs) -> Option<Finding> {
    let check = Check("processes", "each module is a process of a few threads");
    let (limit, path) = tightest(machine, "pids", "pids.max", whole)?;
    let (limit, wanted) = (limit as u64, needs.processes as u64 * THREADS);
    let used = machine.number(&path.replace("pids.max", "pids.current")).unwrap_or(0);
    let is = format!("{limit}, {used} in use ({path})");
    if limit >= used + wanted {
        return Some(check.ok(is));
    }
    let more = used + 10 * wanted;
    let fix = format!("echo {more} | sudo tee {path}, or `--pids-limit` of the container, TasksMax= of the unit");
    Some(check.bad(is, fix))
}

/// A limit in bytes or processes. A huge limit counts as none (version 1 writes "none" as the largest number of pages).
fn whole(text: &str) -> Option<f64> {
    text.parse::<u64>().ok().filter(|limit| *limit < 1 << 60).map(|limit| limit as f64)
}

/// The least value of a file in this process's control group and its ancestors, and that file. `max` is no value.
fn tightest(
    machine: &Machine,
    controller: &str,
    file: &str,
    read: impl Fn(&str) -> Option<f64>,
) -> Option<(f64, String)> {
    let groups = machine.read("/proc/self/cgroup")?;
    // `0::/path` is version 2, `4:memory:/path` version 1.
    let folders = groups.lines().filter_map(|line| {
        let mut words = line.splitn(3, ':').skip(1);
        match (words.next()?, words.next()?) {
            ("", path) => Some((String::from("/sys/fs/cgroup"), path)),
            (controllers, path) if controllers.split(',').any(|name| name == controller) => {
                Some((format!("/sys/fs/cgroup/{controllers}"), path))
            }
            _ => None,
        }
    });
    let files = folders.flat_map(|(root, path)| {
        Path::new(path)
            .ancestors()
            .map(|path| format!("{root}{}/{file}", path.display().to_string().trim_end_matches('/')))
            .collect::<Vec<_>>()
    });
    let values = files.filter_map(|path| Some((read(&machine.read(&path)?)?, path)));
    values.min_by(|a, b| a.0.total_cmp(&b.0))
}

fn nodes(machine: &Machine) -> Vec<Finding> {
    let check = Check("node", "a node of this user, launched by this computer or left by a crash");
    let finding = |node: &super::machine::NodeFound| {
        let path = node.path.display();
        let streams = streams(&node.streams);
        match &node.seen {
            NodeDirectory::Launched(pid) => check.ok(format!("{path}: launched by process {pid}{streams}")),
            NodeDirectory::InUse => check.ok(format!("{path}: in use, without a launch{streams}")),
            NodeDirectory::Dead => check.warn(format!("{path}: no process uses it{streams}"), "rohrpost clean"),
            NodeDirectory::OtherVersion(version) => check.warn(
                format!(
                    "{path}: made by another version (layout {version}, this program {})",
                    rohrpost_mailbox::LAYOUT_VERSION
                ),
                format!("stop the node (with the program that launched it), then rm -r {path}"),
            ),
            NodeDirectory::Foreign(error) => {
                Check("node", "programs leave it alone, and a node of this name cannot be launched")
                    .warn(error.clone(), format!("sudo rm -r {path}"))
            }
            NodeDirectory::Unreadable(error) => check.warn(error.clone(), format!("rm -r {path}, if nothing uses it")),
        }
    };
    machine.asked.nodes.iter().map(finding).collect()
}

/// The computer's clock, and each node with another time.
fn clocks(machine: &Machine) -> Vec<Finding> {
    let check = Check("clock", "system time begins with it; certificates are checked by it");
    let set = date(machine.asked.wall_ns);
    let own = match machine.asked.wall_ns {
        0..NEVER_SET_NS => check.warn(
            format!("{set}: it was not set since the computer was switched on"),
            "set it before launch: sudo date -s TIME, or sudo systemctl enable systemd-time-wait-sync (see boot.md)",
        ),
        _ => check.ok(set),
    };
    let why = "stamps, streams and recordings of the node go on in its system time";
    let apart = machine.asked.nodes.iter().filter_map(|node| {
        let is = format!("{}: {}", node.path.display(), clock_was_set(node.clock_set_by_ns?));
        Some(Check("system time", why).warn(is, "rohrpost time --new-epoch"))
    });
    std::iter::once(own).chain(apart).collect()
}

/// The streams of a node, behind what else is said of it.
fn streams(found: &StreamsFound) -> String {
    match found.number {
        0 => String::new(),
        1 => format!("; 1 stream takes {}", size(found.bytes)),
        number => format!("; {number} streams take {}", size(found.bytes)),
    }
}

fn gui(machine: &Machine, needs: &Needs) -> Vec<Finding> {
    // Without a GUI the bridge is not needed.
    let missing = |check: Check, fix: &str| match &needs.from {
        Some(file) if !needs.gui => check.ok(format!("not found; {} has no GUI", file.display())),
        _ => check.warn("not found", fix),
    };
    let check = Check("GUI bridge", "draws the modules' data; the demo's module `gui.0` uses it");
    let bridge = match &machine.asked.bridge {
        Some(Bridge { path, pid: Some(pid) }) => check.ok(format!("{}, process {pid}", path.display())),
        Some(Bridge { path, pid: None }) => check.ok(path.display().to_string()),
        None => missing(check, "cargo build -p rohrpost-gui-bridge, then PATH=target/debug:$PATH"),
    };
    let check = Check("viewer", "shows drawings, live or from a file");
    let viewer = match &machine.asked.viewer {
        Some(path) => check.ok(path.display().to_string()),
        None => missing(check, "pip install rerun-sdk==0.36.3"),
    };
    vec![bridge, viewer]
}

fn systemd(machine: &Machine) -> Finding {
    let is = if machine.exists("/run/systemd/system") { "runs" } else { "does not run here" };
    Check("systemd", "can start a node at boot, and restart it").ok(is)
}
