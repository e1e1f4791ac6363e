//! `cargo xtask bench-page`: the tables of the page of benches, made of the results that lie beside the benches.
//!
//! `benches/results/NAME.json` is what `rohrpost-bench NAME --json` printed, one flat object a line. Its first object
//! says besides when it was measured (`date`), by which command, and what else ran (`conditions`).

use crate::cargo;
use crate::failure::Failure;
use crate::files;
use std::path::PathBuf;
use std::process::ExitCode;

/// Before a table stands this with the name of its results.
const BEGIN: &str = "<!-- results: ";
/// Behind a table.
const END: &str = "<!-- end of results -->";
/// Names of our own contenders.
const OURS: [&str; 3] = ["rohrpost", "C", "Python"];
/// Peers: their ratios are shown without a target, too.
const PEERS: [&str; 5] = ["iceoryx2", "posix-mq", "zenoh", "crossbeam", "CBWare"];
/// Units of rates, where more is better.
const RATES: [&str; 4] = ["packages/s", "records/s", "MB/s", "s/s"];

/// Writes the page anew.
pub(crate) fn command(args: &[String]) -> Result<ExitCode, Failure> {
    if !args.is_empty() {
        return Err(format!("`{}`: cargo xtask bench-page takes no arguments", args.join(" ")));
    }
    let text = files::read(&page_path())?;
    files::write(&page_path(), &with_tables(&text, results)?)?;
    Ok(ExitCode::SUCCESS)
}

fn page_path() -> PathBuf {
    cargo::root().join("docs/src/bench.md")
}

/// The results of this name.
fn results(name: &str) -> Result<String, Failure> {
    files::read(&cargo::root().join(format!("benches/results/{name}.json")))
}

/// A page with its tables made anew of these results.
fn with_tables(page: &str, results: impl Fn(&str) -> Result<String, Failure>) -> Result<String, Failure> {
    let mut parts = page.split(BEGIN);
    let mut made = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, rest) = part.split_once(" -->").ok_or_else(|| format!("`{BEGIN}` without ` -->`"))?;
        let (_, behind) = rest.split_once(END).ok_or_else(|| format!("results `{name}`: no `{END}` behind them"))?;
        let table = table(&results(name)?).map_err(|failure| format!("benches/results/{name}.json: {failure}"))?;
        made += &format!("{BEGIN}{name} -->\n{table}{END}{behind}");
    }
    Ok(made)
}

/// A case beside one floor or peer, in all sizes: a row of the table.
struct Comparison {
    case: String,
    beside: String,
    sizes: Vec<String>,
    p50: Vec<String>,
    p99: Vec<String>,
    targets: Vec<String>,
}

/// The table of a file of results.
fn table(text: &str) -> Result<String, Failure> {
    let mut lines = text.lines();
    let about = lines.next().unwrap_or_default();
    let of = |key| field(about, key).ok_or_else(|| format!("the first object has no `{key}`"));
    let mut made = format!("`{}`\n({}, {}; {})\n\n", of("command")?, of("date")?, of("processor")?, of("conditions")?);
    made += "| case | bytes | beside | ratio | target |\n| --- | --- | --- | --- | --- |\n";
    let mut rows: Vec<Comparison> = Vec::new();
    for line in lines {
        if line.contains('\\') || !line.starts_with('{') {
            return Err(format!("no flat object without escapes: {line}"));
        }
        add(line, &mut rows)?;
    }
    for Comparison { case, beside, sizes, p50, p99, mut targets } in rows {
        let tails = if p99.is_empty() { String::new() } else { format!("p99 {}", p99.join(", ")) };
        let ratio = [p50.join(", "), tails].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ");
        targets.dedup();
        made += &format!("| {case} | {} | {beside} | {ratio} | {} |\n", sizes.join(", "), targets.join(" / "));
    }
    Ok(made)
}

/// Adds a line of the results to the comparison that it belongs to, if it is one to be shown.
fn add(line: &str, rows: &mut Vec<Comparison>) -> Result<(), Failure> {
    let of = |key| field(line, key);
    let (Some(case), Some(contender), Some(beside)) = (of("case"), of("contender"), of("vs")) else {
        return Ok(());
    };
    let has_target = ["target_p50", "target_p99"].into_iter().any(|key| of(key).is_some());
    let is_peer = PEERS.iter().any(|peer| beside.starts_with(peer));
    if !OURS.contains(&contender) || !has_target && !is_peer {
        return Ok(());
    }
    let case = if case.starts_with("memory-") { "memory-N-slots" } else { case };
    let is_rate = of("unit").is_some_and(|unit| RATES.contains(&unit));
    let same = |row: &Comparison| row.case == case && row.beside == beside;
    let index = rows.iter().position(same).unwrap_or(rows.len());
    if index == rows.len() {
        let (case, beside) = (case.to_owned(), beside.to_owned());
        let (sizes, p50, p99, targets) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        rows.push(Comparison { case, beside, sizes, p50, p99, targets });
    }
    let row = &mut rows[index];
    row.sizes.extend(of("bytes").map(str::to_owned));
    let mut targets = Vec::new();
    for (ratios, name, ratio, target) in
        [(&mut row.p50, "", "ratio_p50", "target_p50"), (&mut row.p99, "p99 ", "ratio_p99", "target_p99")]
    {
        let target = number(line, target)?;
        if target.is_some() || !has_target && name.is_empty() {
            let ratio = number(line, ratio)?.ok_or_else(|| format!("no `{ratio}`: {line}"))?;
            let is_missed = target.is_some_and(|target| if is_rate { ratio < target } else { ratio > target });
            let text = if ratio < 100.0 { format!("{ratio:.2}") } else { format!("{ratio:.0}") };
            ratios.push(if is_missed { format!("**{text}**") } else { text });
        }
        targets.extend(target.map(|target| format!("{name}{} {target}", if is_rate { "≥" } else { "≤" })));
    }
    row.targets.push(targets.join(", "));
    Ok(())
}

/// The number of a key; `None`: not there, or null.
fn number(object: &str, key: &str) -> Result<Option<f64>, Failure> {
    let read = |text: &str| text.parse().map_err(|_| format!("`{key}` is no number: {object}"));
    field(object, key).map(read).transpose()
}

/// The value of a key in a flat object without escapes; a text without its quotes. `None`: not there, or null.
fn field<'a>(object: &'a str, key: &str) -> Option<&'a str> {
    let (_, value) = object.split_once(&format!("\"{key}\":"))?;
    let value = match value.strip_prefix('"') {
        Some(text) => text.split('"').next(),
        None => value.split([',', '}']).next(),
    };
    value.filter(|value| *value != "null")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_of_benches_is_made_of_the_results() {
        let page = files::read(&page_path()).unwrap();
        let all = std::fs::read_dir(cargo::root().join("benches/results")).unwrap().count();
        assert_eq!(page.matches(BEGIN).count(), all, "tables of the page, one for each file of results");
        let made = with_tables(&page, results).unwrap();
        assert!(page == made, "docs/src/bench.md differs from benches/results; run `cargo xtask bench-page`");
    }

    /// The first object of results.
    const ABOUT: &str = r#"{"case":"environment","date":"2026-11-25","command":"c","conditions":"q","processor":"P"}"#;

    #[test]
    fn sizes_share_a_row_and_what_is_missed_is_bold() {
        let hop = |bytes: u32, ratio: f64, met: bool| {
            let ratios = format!(r#""ratio_p50":{ratio},"ratio_p99":1.2,"target_p50":1.15,"target_p99":1.3"#);
            let of = format!(r#""case":"hop","bytes":{bytes},"unit":"us","p50":1.0,"vs":"chain""#);
            format!(r#"{{{of},{ratios},"met":{met},"contender":"rohrpost"}}"#)
        };
        let floor = r#"{"case":"hop","bytes":64,"unit":"us","p50":1.0,"vs":null,"contender":"chain"}"#;
        let of = r#""case":"rate","bytes":64,"unit":"MB/s","p50":9.0,"vs":"iceoryx2""#;
        let rate = &format!(r#"{{{of},"ratio_p50":120.6,"ratio_p99":null,"target_p50":null,"contender":"C"}}"#);
        let text = [ABOUT, &hop(64, 1.1, true), floor, &hop(1024, 1.184, false), rate].join("\n");
        let made = table(&text).unwrap();
        let rows: Vec<&str> = made.lines().skip(5).collect();
        assert_eq!(
            rows,
            [
                "| hop | 64, 1024 | chain | 1.10, **1.18**; p99 1.20, 1.20 | ≤ 1.15, p99 ≤ 1.3 |",
                "| rate | 64 | iceoryx2 | 121 |  |"
            ]
        );
        assert!(made.starts_with("`c`\n(2026-11-25, P; q)\n"), "{made}");
    }

    #[test]
    fn results_that_cannot_be_read_are_named() {
        let read = |text: &str| with_tables("<!-- results: x -->\n<!-- end of results -->", |_| Ok(text.to_owned()));
        assert_eq!(read("{}").unwrap_err(), "benches/results/x.json: the first object has no `command`");
        let failure = read(&format!("{ABOUT}\ncase")).unwrap_err();
        assert_eq!(failure, "benches/results/x.json: no flat object without escapes: case");
        let no_ratio = r#"{"case":"hop","vs":"udp","contender":"C","target_p50":1}"#;
        assert!(read(&format!("{ABOUT}\n{no_ratio}")).unwrap_err().contains("no `ratio_p50`"));
        let no_number = no_ratio.replace(":1}", ":1,\"ratio_p50\":\"x\"}");
        assert!(read(&format!("{ABOUT}\n{no_number}")).unwrap_err().contains("`ratio_p50` is no number"));
        let open = with_tables("<!-- results: x -->", |_| Ok(String::new())).unwrap_err();
        assert_eq!(open, "results `x`: no `<!-- end of results -->` behind them");
    }
}
