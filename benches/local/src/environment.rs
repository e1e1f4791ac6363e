//! The computer that it is measured on.

use crate::harness::{Child, Failure, processors, refusals};
use serde::Serialize;
use std::fs;
use std::time::{Duration, Instant};

/// What figures depend on besides the code.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Environment {
    /// Model of the processor.
    pub processor: String,
    /// Those that this program may use.
    pub processors: Vec<usize>,
    /// Kernel's release.
    pub kernel: String,
    /// Mean number of busy threads during the last minute.
    pub load: String,
    /// What the kernel refuses of pinning, real-time scheduling and locked memory; empty: nothing.
    #[serde(rename = "refused")]
    pub refusals: Vec<String>,
    /// Versions of what is measured that is not of this repository.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub versions: Vec<String>,
}

impl Environment {
    /// Looks.
    ///
    /// # Errors
    /// When not even a process can be forked.
    pub fn look(versions: &[String]) -> Result<Self, Failure> {
        let read = |path| fs::read_to_string(path).unwrap_or_default().trim().to_string();
        let cpuinfo = read("/proc/cpuinfo");
        let model = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
        Ok(Self {
            processor: model.map_or("unknown", |(_, name)| name.trim()).to_string(),
            processors: processors(),
            kernel: read("/proc/sys/kernel/osrelease"),
            load: load(),
            refusals: ask_refusals()?,
            versions: versions.to_vec(),
        })
    }
}

/// Mean number of busy threads during the last minute.
pub fn load() -> String {
    let line = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    line.split(' ').next().unwrap_or("unknown").to_string()
}

/// Asks in a child, which is changed by the asking.
fn ask_refusals() -> Result<Vec<String>, Failure> {
    let child = Child::start(|| match refusals().as_slice() {
        [] => Ok(()),
        refused => Err(Failure::Skipped(refused.join("\n"))),
    })?;
    match child.finish(Instant::now() + Duration::from_secs(5)) {
        Ok(()) => Ok(Vec::new()),
        Err(Failure::Skipped(text)) => Ok(text.lines().map(str::to_string).collect()),
        Err(failure) => Err(failure),
    }
}
