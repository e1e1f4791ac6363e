//! Output of modules: lines and pages of lines, from any process, as the collector and `rohrpost log` show them.

use rohrpost_builtin::format::Format;
use rohrpost_config::Installation;
use rohrpost_modules::interfaces::Page;
use rohrpost_modules::output::OutputLine;
use std::sync::LazyLock;

const CONFIG: &str = include_str!("../corpus/config/small.toml");

static INSTALLATIONS: LazyLock<[Installation; 2]> = LazyLock::new(|| {
    let simulated = format!("{CONFIG}\n[time]\nsource = \"simulation\"\n");
    [CONFIG.to_owned(), simulated]
        .map(|text| Installation::parse(&text, "small.toml".as_ref()).unwrap_or_else(|errors| panic!("{errors}")))
});

pub(crate) fn run(data: &[u8]) {
    let lines = match (postcard::from_bytes::<OutputLine>(data), postcard::from_bytes::<Page>(data)) {
        (Ok(line), Ok(page)) => page.lines.into_iter().chain([line]).collect(),
        (Ok(line), Err(_)) => vec![line],
        (Err(_), Ok(page)) => page.lines,
        (Err(_), Err(_)) => return,
    };
    for line in &lines {
        INSTALLATIONS.iter().for_each(|installation| shown(&Format::new(installation), line));
    }
}

fn shown(format: &Format<'_>, line: &OutputLine) {
    for text in [format.short(line), format.long(line)] {
        let begun = text.lines().filter(|line| !line.starts_with('\t')).count();
        assert_eq!(begun, if line.lost > 0 { 2 } else { 1 }, "only a line of output begins a line: {text:?}");
        assert!(!text.contains(|c: char| c.is_control() && c != '\n' && c != '\t'), "{text:?}");
    }
    let json = format.json(line);
    assert_eq!(json.lines().count(), 1, "{json:?}");
    let read: serde_json::Value = serde_json::from_str(&json).unwrap_or_else(|error| panic!("{json}: {error}"));
    assert_eq!(read["text"], line.text);
    assert_eq!(read["time_ns"], line.time_ns);
}
