//! How a line is written: for people, in a terminal or a file, and for programs.

use rohrpost_config::{Installation, TimeSource};
use rohrpost_modules::output::{OutputLine, errno_text, plain};
use serde::Serialize;
use std::fmt::Write;
use std::time::{Duration, UNIX_EPOCH};

/// Writes lines of one installation.
#[derive(Clone, Copy)]
pub struct Format<'a> {
    installation: &'a Installation,
}

/// A line as a JSON object has it.
#[derive(Serialize)]
struct Object<'a> {
    time_ns: u64,
    time: String,
    /// Left out for the usual one, the computer's clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    time_source: Option<&'static str>,
    node: Option<&'a str>,
    module: String,
    class: Option<&'a str>,
    level: &'static str,
    lost_before: u32,
    suppressed: u32,
    /// Left out where there is none, and so is its text.
    #[serde(skip_serializing_if = "Option::is_none")]
    errno: Option<u16>,
    #[serde(skip_serializing_if = "Option::is_none")]
    errno_text: Option<String>,
    text: &'a str,
}

impl<'a> Format<'a> {
    /// For lines of the modules of an installation.
    pub fn new(installation: &'a Installation) -> Self {
        Self { installation }
    }

    /// For a terminal: `10:31:03.907 info  main/pilot.0: is on`, without the end of the line.
    pub fn short(&self, line: &OutputLine) -> String {
        let time = line.time_text();
        self.text(line, &time)
    }

    /// For a file: as [`short`](Self::short), with the date, to the microsecond. When system time is not the computer's
    /// clock, its source stands behind it.
    pub fn long(&self, line: &OutputLine) -> String {
        let mut time = iso(line.time_ns);
        if let Some(source) = self.source() {
            // Writing to a string does not fail.
            let _ = write!(time, " {source}");
        }
        self.text(line, &time)
    }

    /// A JSON object in one line, without its end.
    pub fn json(&self, line: &OutputLine) -> String {
        let (module, classes) = (line.module(), &self.installation.classes);
        let object = Object {
            time_ns: line.time_ns,
            time: iso(line.time_ns),
            time_source: self.source(),
            node: self.installation.node_of(module),
            module: classes.format(module),
            class: classes.name(module.class()),
            level: line.level.name(),
            lost_before: line.lost,
            suppressed: line.suppressed,
            errno: line.errno,
            errno_text: line.errno.map(errno_text),
            text: &line.text,
        };
        // Text and numbers can be written.
        serde_json::to_string(&object).unwrap_or_default()
    }

    /// What was lost is a line of its own in front.
    fn text(&self, line: &OutputLine, time: &str) -> String {
        let module = line.module();
        let from = format!(
            "{}/{}",
            self.installation.node_of(module).unwrap_or("?"),
            self.installation.classes.format(module)
        );
        let mut text = String::new();
        if line.lost > 0 {
            let _ = writeln!(text, "{time} {:5} {from}: … {} lines before the next one were lost", "warn", line.lost);
        }
        let _ = write!(text, "{time} {:5} {from}: ", line.level.name());
        escape(&line.full_text(), &mut text);
        text
    }

    fn source(&self) -> Option<&'static str> {
        match self.installation.time {
            TimeSource::Local | TimeSource::Master { .. } => None,
            TimeSource::Simulation { .. } => Some("simulation"),
            TimeSource::Log => Some("log"),
        }
    }
}

/// Date and time, UTC.
pub fn iso(time_ns: u64) -> String {
    humantime::format_rfc3339_micros(UNIX_EPOCH + Duration::from_nanos(time_ns)).to_string()
}

/// A text of several lines goes on behind a tab: only what begins a line of output begins a line of the file. What else
/// a terminal would obey is written out.
fn escape(text: &str, into: &mut String) {
    for c in text.chars() {
        match c {
            '\n' => into.push_str("\n\t"),
            '\t' => into.push('\t'),
            c => into.push_str(&plain::line(c.encode_utf8(&mut [0; 4]))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_mailbox::Name;
    use rohrpost_modules::common::OutputLevel;
    use std::path::Path;

    const CONFIG: &str = include_str!("../../../config/tests/two_nodes.toml");

    fn line(module: Name, text: &str) -> OutputLine {
        OutputLine {
            // A leap day.
            time_ns: 1_709_164_805_006_007_999,
            module: module.raw(),
            level: OutputLevel::Warn,
            lost: 0,
            suppressed: 0,
            errno: None,
            text: text.into(),
        }
    }

    #[test]
    fn a_line_has_its_time_node_level_and_module() {
        let installation = Installation::parse(CONFIG, Path::new("two_nodes.toml")).unwrap();
        let format = Format::new(&installation);
        let motor = line(Name::new(1, 200, 0, 0), "is on");
        assert_eq!(format.short(&motor), "00:00:05.006 warn  base/motor.0: is on");
        assert_eq!(format.long(&motor), "2024-02-29T00:00:05.006007Z warn  base/motor.0: is on");
        for (name, from) in [
            (Name::new(1, 150, 0, 0), "base/laser.0"),
            (Name::new(1, 16, 5, 0), "desk/tool.5"),
            (Name::new(1, 150, 9, 0), "?/laser.9"),
            (Name::new(1, 99, 9, 0), "?/99.9"),
        ] {
            let text = format.short(&line(name, "x"));
            assert!(text.ends_with(&format!("{from}: x")), "{text}");
        }
        let lost = OutputLine { lost: 3, ..motor };
        let text = format.short(&lost);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "00:00:05.006 warn  base/motor.0: … 3 lines before the next one were lost");
        assert_eq!(lines[1], "00:00:05.006 warn  base/motor.0: is on");
    }

    #[test]
    fn a_line_has_the_number_of_an_error_once() {
        let installation = Installation::parse(CONFIG, Path::new("two_nodes.toml")).unwrap();
        let format = Format::new(&installation);
        for (text, shown) in [
            ("the disk is full", "the disk is full (errno 28: No space left on device)"),
            ("a: No space left on device (os error 28)", "a: No space left on device (os error 28)"),
            ("ENOSPC: No space left on device", "ENOSPC: No space left on device"),
            ("voll (os error 28)", "voll (os error 28)"),
        ] {
            let line = OutputLine { errno: Some(28), ..line(Name::new(1, 200, 0, 0), text) };
            assert_eq!(format.short(&line), format!("00:00:05.006 warn  base/motor.0: {shown}"));
            let json: serde_json::Value = serde_json::from_str(&format.json(&line)).unwrap();
            assert_eq!((&json["errno"], &json["text"]), (&28.into(), &text.into()), "as it was said");
            assert_eq!(json["errno_text"], "No space left on device");
        }
    }

    #[test]
    fn only_a_line_of_output_begins_a_line() {
        let installation = Installation::parse(CONFIG, Path::new("two_nodes.toml")).unwrap();
        let format = Format::new(&installation);
        let said = "panicked at a.rs:1:2:\nred \x1b[31m\u{202e}\r\nand\ttab";
        let text = format.short(&line(Name::new(1, 200, 0, 0), said));
        let shown = "panicked at a.rs:1:2:\n\tred \\u001b[31m\\u202e\\r\n\tand\ttab";
        assert_eq!(text, format!("00:00:05.006 warn  base/motor.0: {shown}"));
        let json = format.json(&line(Name::new(1, 200, 0, 0), said));
        assert!(!json.contains('\n'));
        let read: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(read["text"], said);
    }

    #[test]
    fn json_has_all_there_is() {
        let (head, module) = CONFIG.split_once("[network]").unwrap();
        let module = module.split("[[module]]").nth(1).unwrap();
        let text = format!("{head}[time]\nsource = \"log\"\n[nodes.base]\n[[module]]{module}");
        let installation = Installation::parse(&text, Path::new("two_nodes.toml")).unwrap();
        let format = Format::new(&installation);
        let told = OutputLine { lost: 3, suppressed: 12, ..line(Name::new(1, 200, 0, 0), "… \"x\"") };
        let expected = concat!(
            r#"{"time_ns":1709164805006007999,"time":"2024-02-29T00:00:05.006007Z","time_source":"log","node":"base","#,
            r#""module":"motor.0","class":"motor","level":"warn","lost_before":3,"suppressed":12,"text":"… \"x\""}"#
        );
        assert_eq!(format.json(&told), expected);
        let long = format.long(&told);
        assert!(long.starts_with("2024-02-29T00:00:05.006007Z log warn  base/motor.0: … 3 lines"), "{long}");
    }
}
