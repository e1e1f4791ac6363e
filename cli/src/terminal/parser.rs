//! What the parser of the command line lacks. `rohrpost --help` groups the subcommands, the most used ones first. Words
//! that begin with `-` and are numbers are values, and no options: the parser knows `-1` and `-1.5e3` as numbers, but
//! neither `-1e-3` nor `-.5` or `-inf`.

use clap::{Arg, Command};
use std::ffi::OsString;

/// Headings and their subcommands, in the order in which a newcomer needs them.
const GROUPS: [(&str, &[&str]); 9] = [
    ("To begin", &["demo", "new", "interface", "check", "launch"]),
    ("A robot that runs", &["list", "top", "log", "data", "echo", "call", "param", "status", "halt", "resume"]),
    ("One of its modules", &["restart", "stop", "start"]),
    ("To measure", &["hz", "bw", "delay", "mailbox", "stream", "graph", "ping", "send"]),
    ("Recordings", &["record", "replay"]),
    ("Several nodes", &["net", "time", "keys", "bundle"]),
    ("Teams of robots", &["team", "wormhole", "station", "path", "entrances"]),
    ("This computer", &["doctor", "bench", "clean", "completions", "man", "version"]),
    ("Else", &["run", "arena", "router", "tcp-router", "tcp-client", "team-router", "help"]),
];

/// A command line with its subcommands in groups.
pub(crate) fn grouped(command: Command) -> Command {
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{}\nOptions:\n{{options}}{{after-help}}",
        groups(&command)
    );
    command.help_template(template)
}

fn groups(command: &Command) -> String {
    let width = command.get_subcommands().map(|sub| sub.get_name().len()).max().unwrap_or_default();
    let line = |name: &&str| match command.find_subcommand(name) {
        Some(sub) => format!("  {name:width$}  {}\n", sub.get_about().cloned().unwrap_or_default()),
        // Clap adds `help` by itself, later.
        None => format!("  {name:width$}  Print this, or the help of a command: `rohrpost help echo`\n"),
    };
    let group =
        |(heading, names): &(&str, &[&str])| format!("{heading}:\n{}", names.iter().map(line).collect::<String>());
    GROUPS.iter().map(group).collect::<Vec<_>>().join("\n")
}

/// The words of a command line, the options of a subcommand that takes numbers before its values: behind `--` nothing
/// is an option. Words of other subcommands stay as they are.
pub(crate) fn options_first(program: &Command, words: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let mut words: Vec<OsString> = words.into_iter().collect();
    let Some(command) = words.get(1).and_then(|name| program.find_subcommand(name)) else { return words };
    let takes_numbers = command.get_positionals().any(Arg::is_allow_negative_numbers_set);
    if !takes_numbers || !words[2..].iter().any(is_number_below_zero) {
        return words;
    }
    let (mut options, mut values, mut rest) = (Vec::new(), Vec::new(), words.split_off(2).into_iter());
    while let Some(word) = rest.next() {
        if word == "--" {
            values.extend(rest.by_ref());
        } else if is_number_below_zero(&word) || !word.as_encoded_bytes().starts_with(b"-") {
            values.push(word);
        } else {
            let has_value = takes_value(command, &word);
            options.push(word);
            if has_value {
                options.extend(rest.next());
            }
        }
    }
    words.into_iter().chain(options).chain(["--".into()]).chain(values).collect()
}

/// Whether the next word is the value of this option: `--timeout`, but not `--timeout=1`.
fn takes_value(command: &Command, option: &OsString) -> bool {
    let Some(text) = option.to_str() else { return false };
    let is_meant = |arg: &&Arg| match text.strip_prefix("--") {
        Some(long) => arg.get_long() == Some(long),
        None => arg.get_short().is_some_and(|short| text.strip_prefix('-') == Some(short.encode_utf8(&mut [0; 4]))),
    };
    command.get_arguments().find(is_meant).is_some_and(|arg| arg.get_action().takes_values())
}

fn is_number_below_zero(word: &OsString) -> bool {
    let Some(number) = word.to_str().and_then(|text| text.strip_prefix('-')) else { return false };
    let is_hexadecimal = number.strip_prefix("0x").is_some_and(|digits| u128::from_str_radix(digits, 16).is_ok());
    is_hexadecimal || !number.starts_with(['-', '+']) && number.parse::<f64>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Arguments;
    use clap::CommandFactory;

    #[test]
    fn each_subcommand_is_in_one_group() {
        let mut grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
        let command = Arguments::command();
        let mut there: Vec<&str> = command.get_subcommands().map(Command::get_name).chain(["help"]).collect();
        grouped.sort_unstable();
        there.sort_unstable();
        assert_eq!(grouped, there);
    }

    #[test]
    fn help_lists_common_commands_first_in_eighty_columns() {
        let help = grouped(Arguments::command()).render_help().to_string();
        let at = |text: &str| help.find(text).unwrap_or_else(|| panic!("{text}: {help}"));
        assert!(
            at("Usage: rohrpost") < at("To begin:")
                && at("\n  demo ") < at("\n  top ")
                && at("\n  top ") < at("\n  run ")
        );
        let long = help.lines().find(|line| line.chars().count() > 80);
        assert_eq!(long, None);
    }

    fn ordered(line: &str) -> String {
        let words = line.split(' ').map(OsString::from);
        options_first(&crate::Arguments::command(), words).join(" ".as_ref()).into_string().unwrap()
    }

    #[test]
    fn numbers_below_zero_are_values_and_options_stand_before_them() {
        for (typed, read) in [
            ("rohrpost call m.0 f -1e-3", "rohrpost call -- m.0 f -1e-3"),
            ("rohrpost call m.0 f -.5 --json -inf", "rohrpost call --json -- m.0 f -.5 -inf"),
            ("rohrpost call --timeout 2 m.0 f -NaN", "rohrpost call --timeout 2 -- m.0 f -NaN"),
            ("rohrpost call m.0 f -0x1f --timeout=2 1", "rohrpost call --timeout=2 -- m.0 f -0x1f 1"),
            ("rohrpost send m.0 f -5. -c 3 --rate 2", "rohrpost send -c 3 --rate 2 -- m.0 f -5."),
            ("rohrpost call m.0 f -1 -- --json", "rohrpost call -- m.0 f -1 --json"),
            // None of these has a number below zero among its values.
            ("rohrpost call m.0 f 1 --json", "rohrpost call m.0 f 1 --json"),
            ("rohrpost call m.0 f -e -i --1", "rohrpost call m.0 f -e -i --1"),
            ("rohrpost stream interp m.0 x --at -1e-3s", "rohrpost stream interp m.0 x --at -1e-3s"),
            ("rohrpost", "rohrpost"),
        ] {
            assert_eq!(ordered(typed), read);
        }
    }
}
