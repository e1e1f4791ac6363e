//! Commands as ROS 2 has them, and what does the same here. [`answer`] never takes the place of a command of ours.

use std::ffi::OsString;

/// What is typed by habit, and our command for it.
const HABITS: [(&str, &str, &str); 15] = [
    ("topic", "list", "rohrpost data"),
    ("topic", "echo", "rohrpost echo MODULE [DATA]"),
    ("topic", "hz", "rohrpost hz MODULE [DATA]"),
    ("topic", "bw", "rohrpost bw MODULE"),
    ("topic", "delay", "rohrpost delay MODULE"),
    ("topic", "info", "rohrpost data MODULE"),
    ("topic", "pub", "rohrpost send MODULE FUNCTION [ARGUMENTS...]"),
    ("node", "list", "rohrpost list"),
    ("node", "info", "rohrpost call MODULE"),
    ("service", "list", "rohrpost call MODULE"),
    ("service", "type", "rohrpost call MODULE"),
    ("service", "call", "rohrpost call MODULE FUNCTION [ARGUMENTS...]"),
    ("bag", "record", "rohrpost record on"),
    ("bag", "play", "rohrpost replay FILE"),
    ("bag", "info", "rohrpost record info FILE"),
];

/// What to say if the words of a command line, the program's name first, are a command of ROS 2. All commands of its
/// noun, if its verb is none of [`HABITS`].
pub(crate) fn answer(words: &[OsString]) -> Option<String> {
    let mut typed = words.iter().skip(1).map(|word| word.to_str().unwrap_or_default());
    let (noun, verb) = (typed.next()?, typed.next().unwrap_or_default());
    let line = |(noun, verb, ours): &(&str, &str, &str)| format!("\n  {noun} {verb:<7}{ours}");
    let of_noun: Vec<_> = HABITS.iter().filter(|habit| habit.0 == noun).collect();
    if of_noun.is_empty() {
        return None;
    }
    let meant = of_noun.iter().find(|habit| habit.1 == verb);
    Some(match meant {
        Some((.., ours)) => format!("error: `{noun} {verb}` is a command of ROS 2; here it is: {ours}"),
        None => {
            let all: String = of_noun.iter().copied().map(line).collect();
            format!("error: `{noun}` is a command of ROS 2; here it is:{all}")
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Arguments;
    use clap::CommandFactory;

    fn answered(line: &str) -> Option<String> {
        answer(&line.split(' ').map(OsString::from).collect::<Vec<_>>())
    }

    #[test]
    fn a_command_of_ros_is_answered_by_ours() {
        for (typed, ours) in [
            ("rohrpost node list", "`node list` is a command of ROS 2; here it is: rohrpost list"),
            ("rohrpost topic echo /scan --once", "`topic echo` is a command of ROS 2; here it is: rohrpost echo"),
            ("rohrpost bag", "`bag` is a command of ROS 2; here it is:\n  bag record rohrpost record on\n  bag play"),
        ] {
            let text = answered(typed).unwrap();
            assert!(text.starts_with(&format!("error: {ours}")), "{text}");
        }
        for ours in ["rohrpost", "rohrpost list", "rohrpost echo topic list"] {
            assert_eq!(answered(ours), None);
        }
    }

    #[test]
    fn each_answer_is_a_command_and_none_hides_one() {
        let program = Arguments::command();
        for (noun, verb, ours) in HABITS {
            assert!(program.find_subcommand(noun).is_none(), "{noun} is a command of ours");
            let mut words = ours.split(' ').skip(1).take_while(|word| word.starts_with(char::is_lowercase));
            let first = words.next().and_then(|word| program.find_subcommand(word));
            let command = first.unwrap_or_else(|| panic!("{noun} {verb}: {ours}"));
            assert!(words.all(|word| command.find_subcommand(word).is_some()), "{noun} {verb}: {ours}");
        }
    }
}
