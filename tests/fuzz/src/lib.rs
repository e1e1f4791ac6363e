//! Fuzz targets: each takes any bytes, passes them to a reader of foreign bytes, and panics if a promise is broken.
//!
//! ```text
//! corpus/NAME/*  ──┬── tests/corpus.rs    each file once, in every `cargo xtask test`
//!                  └── libFuzzer          changes them, guided by what code they reach: `cargo xtask fuzz`
//! ```
//!
//! The common promise: no panic, no read out of bounds, an end in bounded time and memory. Targets add others.
//! An input that broke a promise stays in the corpus, under a name that describes the mistake.

#![forbid(unsafe_code)]

mod bundles;
mod calls;
mod config;
mod descriptions;
mod frames;
mod grids;
mod head;
mod impairments;
mod journals;
mod lines;
mod log_control;
mod logs;
mod maps;
mod members;
mod names;
mod parameters;
mod planted;
mod recordings;
mod routers;
mod seals;
mod segments;
mod sessions;
mod split;
mod streams;
mod team_datagrams;
mod team_traffic;
mod teams;

/// One target.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name, which is also its folder in `corpus/`.
    pub name: &'static str,
    /// Reads the bytes; panics if a promise is broken.
    pub run: fn(&[u8]),
}

/// All targets.
pub const TARGETS: [Target; 27] = [
    Target { name: "head", run: head::run },
    Target { name: "names", run: names::run },
    Target { name: "config", run: config::run },
    Target { name: "parameters", run: parameters::run },
    Target { name: "descriptions", run: descriptions::run },
    Target { name: "calls", run: calls::run },
    Target { name: "lines", run: lines::run },
    Target { name: "logs", run: logs::run },
    Target { name: "maps", run: maps::run },
    Target { name: "grids", run: grids::run },
    Target { name: "recordings", run: recordings::run },
    Target { name: "journals", run: journals::run },
    Target { name: "log-control", run: log_control::run },
    Target { name: "segments", run: segments::run },
    Target { name: "frames", run: frames::run },
    Target { name: "routers", run: routers::run },
    Target { name: "seals", run: seals::run },
    Target { name: "sessions", run: sessions::run },
    Target { name: "members", run: members::run },
    Target { name: "bundles", run: bundles::run },
    Target { name: "impairments", run: impairments::run },
    Target { name: "team-hellos", run: teams::run_hellos },
    Target { name: "team-records", run: teams::run_records },
    Target { name: "team-events", run: teams::run_events },
    Target { name: "team-traffic", run: team_traffic::run },
    Target { name: "team-datagrams", run: team_datagrams::run },
    Target { name: "team-hosts", run: team_datagrams::run_hosts },
];

/// A target that must fail: it shows that the fuzzer finds planted mistakes.
pub const PLANTED: Target = Target { name: "planted", run: planted::run };

/// The target of this name.
///
/// # Errors
/// Says which there are.
pub fn target(name: &str) -> Result<Target, String> {
    let mut all = TARGETS.into_iter().chain([PLANTED]);
    all.find(|target| target.name == name).ok_or_else(|| {
        let names = TARGETS.map(|target| target.name).join(", ");
        format!("no target `{name}`; there are {names}")
    })
}
