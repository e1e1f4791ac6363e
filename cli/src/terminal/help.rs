//! `rohrpost --help`: groups the subcommands, the most used ones first.

use clap::Command;

/// Headings and their subcommands, in the order in which a newcomer needs them.
const GROUPS: [(&str, &[&str]); 8] = [
    ("To begin", &["demo", "new", "interface", "check", "launch"]),
    ("A robot that runs", &["list", "top", "log", "echo", "call", "param", "status"]),
    ("One of its modules", &["restart", "stop", "start"]),
    ("To measure", &["hz", "bw", "delay", "mailbox", "stream", "graph", "ping", "send"]),
    ("Recordings", &["record", "replay"]),
    ("Several nodes", &["net", "time", "keys"]),
    ("This computer", &["doctor", "bench", "clean", "completions", "version"]),
    ("Else", &["run", "router", "tcp-router", "tcp-client", "help"]),
];

/// The same command line, with its subcommands in groups.
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
}
