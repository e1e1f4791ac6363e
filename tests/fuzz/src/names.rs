//! Names of mailboxes and modules, durations and sizes as people type them: an accepted text is printed in a form that
//! reads back as the same.

use rohrpost_config::{Installation, duration_text, is_class_name, nearest, parse_duration, parse_size, size_text};
use rohrpost_mailbox::Name;
use std::sync::LazyLock;

const CONFIG: &str = include_str!("../corpus/config/small.toml");

static INSTALLATION: LazyLock<Installation> =
    LazyLock::new(|| Installation::parse(CONFIG, "small.toml".as_ref()).unwrap_or_else(|errors| panic!("{errors}")));

pub(crate) fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let classes = &INSTALLATION.classes;
    match text.parse::<Name>() {
        Ok(name) => {
            assert_eq!(name.to_string().parse(), Ok(name));
            assert_eq!(name.module().with_local(name.local()), name);
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
    if let Ok(name) = classes.parse_name(text) {
        assert_eq!(classes.parse_name(&classes.format_full(name)).ok(), Some(name), "{}", classes.format_full(name));
    }
    if let Ok(name) = classes.parse_module(text) {
        assert_eq!(classes.parse_module(&classes.format(name)).ok(), Some(name), "{}", classes.format(name));
    }
    if let [a, b, c, d, ..] = *data {
        let name = Name::new(a, b, c, d);
        assert_eq!(name.to_string().parse(), Ok(name));
        let _ = (classes.format(name), classes.format_full(name), INSTALLATION.node_of(name));
        let _ = INSTALLATION.output_level(name);
    }
    if let Ok(duration) = parse_duration(text) {
        // The text is for people and may be rounded, but is valid all the same.
        assert!(parse_duration(&duration_text(duration)).is_ok(), "{}", duration_text(duration));
    }
    if let Ok(bytes) = parse_size(text) {
        assert!(parse_size(&size_text(bytes)).is_ok(), "{}", size_text(bytes));
    }
    let _ = (is_class_name(text), nearest(text, ["motor.0", "laser.0", "mapper"]));
}
