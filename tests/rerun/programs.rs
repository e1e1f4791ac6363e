//! Rerun's command line and the GUI bridge, which `cargo xtask test --all` brings.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Rerun's command line.
pub(crate) fn rerun() -> PathBuf {
    program("ROHRPOST_RERUN")
}

/// The GUI bridge.
pub(crate) fn bridge() -> PathBuf {
    program("ROHRPOST_BRIDGE")
}

/// A program that the environment names.
fn program(variable: &str) -> PathBuf {
    let path = std::env::var_os(variable).map(PathBuf::from).filter(|path| path.is_file());
    path.unwrap_or_else(|| {
        panic!("{variable} names no program; run them by \"cargo xtask test --all\", which installs Rerun")
    })
}

/// The search path with a program's folder in front.
pub(crate) fn search_path(program: &Path) -> OsString {
    let folder = program.parent().unwrap().to_owned();
    let search = std::env::var_os("PATH").unwrap_or_default();
    std::env::join_paths(std::iter::once(folder).chain(std::env::split_paths(&search))).unwrap()
}

pub(crate) fn ok(what: &str, output: &Output) -> String {
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{what}: {}\n{out}\n{err}", output.status);
    format!("{out}{err}")
}

pub(crate) fn rrd(rerun: &Path, command: &str, file: &Path) -> String {
    let output = Command::new(rerun).args(["rrd", command]).arg(file).env("NO_COLOR", "1").output();
    ok(&format!("rerun rrd {command}"), &output.unwrap())
}

/// Lines such as `Chunk(…) with 3 rows (4.6 KiB) - /world/map - data columns: […]`.
pub(crate) fn rows(printed: &str) -> BTreeMap<String, u64> {
    let mut all = BTreeMap::new();
    for line in printed.lines().filter(|line| line.starts_with("Chunk(")) {
        let (rows, rest) = line.split_once(" with ").unwrap().1.split_once(" rows ").unwrap();
        let entity = rest.split(" - ").nth(1).unwrap();
        let digits: String = rows.chars().filter(char::is_ascii_digit).collect();
        *all.entry(entity.to_owned()).or_default() += digits.parse::<u64>().unwrap();
    }
    all
}

/// What a drawing has of an entity: the names of its components, and bytes.
pub(crate) fn content(printed: &str, entity: &str) -> (BTreeSet<String>, f64) {
    let (mut components, mut bytes) = (BTreeSet::new(), 0.0);
    let head = format!(" - {entity} - data columns: [");
    for line in printed.lines().filter(|line| line.starts_with("Chunk(")) {
        let Some((chunk, columns)) = line.split_once(&head) else { continue };
        components.extend(columns.trim_end_matches(']').split_whitespace().map(str::to_owned));
        let size = chunk.rsplit_once('(').unwrap().1.trim_end_matches(')');
        let (number, unit) = size.split_once(' ').unwrap();
        let power = ["B", "KiB", "MiB", "GiB"].iter().position(|known| *known == unit).unwrap();
        bytes += number.parse::<f64>().unwrap() * 1024_f64.powi(power as i32);
    }
    (components, bytes)
}

/// The table "Num chunks per entity", lines such as `/world/frame: 18`.
pub(crate) fn entities_of(stats: &str) -> BTreeSet<String> {
    let lines = stats.lines().skip_while(|line| !line.starts_with("Num chunks per entity"));
    lines.filter(|line| line.starts_with('/')).filter_map(|line| Some(line.rsplit_once(": ")?.0.to_owned())).collect()
}

/// The content of a drawing. One that is still being written may be torn at its end.
pub(crate) fn printed(file: &Path, how: &[&str]) -> String {
    let mut print = Command::new(rerun());
    print.args(["rrd", "print"]).args(how).arg(file).env("NO_COLOR", "1");
    String::from_utf8_lossy(&print.output().unwrap().stdout).into_owned()
}

/// The rows of an entity that have a time, in order: the time, ns since 1970, and the data.
pub(crate) fn timed_rows(file: &Path, entity: &str) -> Vec<(u64, String)> {
    let all = printed(file, &["-vvv"]);
    let head = format!(" - {entity} - ");
    let chunks = all.split("\nChunk(").filter(|chunk| chunk.lines().next().unwrap().contains(&head));
    // Columns: row, time since the beginning, system time, then data. Timeless data have no time.
    let rows = chunks.filter(|chunk| chunk.contains(" system_time ")).flat_map(str::lines);
    let rows: Vec<Vec<&str>> =
        rows.filter(|line| line.contains(" row_")).map(|line| line.split('┆').map(str::trim).collect()).collect();
    let times: String = rows.iter().map(|columns| format!("{}Z\n", columns[2])).collect();
    let mut date =
        Command::new("date").args(["-f", "-", "+%s%N"]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut pipe = date.stdin.take().unwrap();
    // It writes while it reads.
    let writer = std::thread::spawn(move || pipe.write_all(times.as_bytes()));
    let output = date.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    let times = String::from_utf8(output.stdout).unwrap();
    let times = times.lines().map(|ns| ns.parse().unwrap());
    let mut rows: Vec<(u64, String)> = times.zip(rows.iter().map(|columns| columns[3..].join(" "))).collect();
    rows.sort_unstable();
    rows
}

/// Times of the rows of an entity, ns since 1970, in order.
pub(crate) fn times_ns(file: &Path, entity: &str) -> Vec<u64> {
    timed_rows(file, entity).into_iter().map(|(ns, _)| ns).collect()
}
