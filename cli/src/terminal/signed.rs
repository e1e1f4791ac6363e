//! Words of a command line that begin with `-` and are numbers: values, and no options.
//!
//! The parser of options knows `-1` and `-1.5e3` as numbers, but neither `-1e-3` nor `-.5` or `-inf`.

use clap::{Arg, Command};
use std::ffi::OsString;

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
    use clap::CommandFactory;

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
