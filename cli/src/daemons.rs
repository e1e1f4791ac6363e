//! Daemons that slew a computer's clock, found by their names. The bounds of the nodes' common time hold only without
//! them.

use std::path::Path;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Daemon {
    /// Its name in the kernel: 15 bytes at most.
    comm: &'static str,
    pub(super) name: &'static str,
    /// The command that stops it for good.
    pub(super) ends: &'static str,
}

const fn daemon(comm: &'static str, name: &'static str, ends: &'static str) -> Daemon {
    Daemon { comm, name, ends }
}

const ALL: [Daemon; 6] = [
    daemon("chronyd", "chronyd", "sudo systemctl disable --now chronyd (Debian: chrony)"),
    daemon("ntpd", "ntpd", "sudo systemctl disable --now ntpd (Debian: ntpsec)"),
    daemon("systemd-timesyn", "systemd-timesyncd", "sudo timedatectl set-ntp false"),
    daemon("ptp4l", "ptp4l", "sudo systemctl disable --now ptp4l"),
    daemon("phc2sys", "phc2sys", "sudo systemctl disable --now phc2sys"),
    daemon("timemaster", "timemaster", "sudo systemctl disable --now timemaster"),
];

/// The daemons that run, by the processes in a computer's `/proc`.
pub(super) fn running(processes: &Path) -> Vec<Daemon> {
    let entries = std::fs::read_dir(processes).into_iter().flatten().flatten();
    let ids = entries.filter(|entry| entry.file_name().to_str().is_some_and(|name| name.parse::<u32>().is_ok()));
    let names: Vec<String> = ids.filter_map(|entry| std::fs::read_to_string(entry.path().join("comm")).ok()).collect();
    ALL.into_iter().filter(|daemon| names.iter().any(|name| name.trim_end() == daemon.comm)).collect()
}

/// The problem in one sentence.
pub(super) const WHY: &str = "it slews the clock by more than the nodes' common time allows for: whenever it does, \
    nothing is known of the time, and the node sends nothing in its time slots";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn daemons_are_found_by_the_names_of_their_processes() {
        let folder = tempfile::tempdir().unwrap();
        for (process, name) in [("1", "systemd"), ("77", "systemd-timesyn"), ("812", "chronyd"), ("self", "ntpd")] {
            std::fs::create_dir(folder.path().join(process)).unwrap();
            std::fs::write(folder.path().join(process).join("comm"), format!("{name}\n")).unwrap();
        }
        let found: Vec<_> = running(folder.path()).into_iter().map(|daemon| daemon.name).collect();
        assert_eq!(found, ["chronyd", "systemd-timesyncd"]);
        assert!(running(&folder.path().join("nowhere")).is_empty());
    }
}
