//! Files of saved parameters (`param save`, `param load`) for the demonstration's installation: values with their
//! lines, or mistakes, line by line; and a value that a parameter accepts reads back as the same.

use crate::config::validate;
use crate::split;
use rohrpost_builtin::check_saved;
use rohrpost_config::{Installation, Saved};
use rohrpost_modules::parameter::{from_file, from_word, toml_text, value_text};
use rohrpost_modules::schema::{Schema, Type, Value, decode};
use rohrpost_modules::types::Twist;
use std::sync::LazyLock;

const CONFIG: &str = include_str!("../../../config/demo.toml");

static INSTALLATION: LazyLock<Installation> =
    LazyLock::new(|| Installation::parse(CONFIG, "demo.toml".as_ref()).unwrap_or_else(|errors| panic!("{errors}")));

pub(crate) fn run(data: &[u8]) {
    let Some((file, word)) = split::texts(data) else { return };
    on_a_command_line(word);
    let saved = match Saved::parse(file, "saved.toml".as_ref(), &INSTALLATION) {
        Ok(saved) => saved,
        Err(errors) => return validate(&errors, file),
    };
    let lines = file.lines().count();
    let document = saved.document(&INSTALLATION);
    for module in saved.modules() {
        let values = document.values::<Value>(module);
        for value in values.unwrap_or_else(|error| panic!("checked before: {error}")) {
            assert!((1..=lines).contains(&value.line), "`{}` in line {} of {lines}", value.name, value.line);
            taken(&value.value);
        }
        let known: Vec<_> = INSTALLATION.module(module).into_iter().collect();
        assert_eq!(known.len(), 1);
        if let Err(error) = document.check_names(known[0], &["cruise-m-s"]) {
            assert!((1..=lines).contains(&error.line));
        }
    }
    let mut with = INSTALLATION.clone();
    with.saved = Some(saved);
    for problem in check_saved(&with) {
        assert!(!problem.message.is_empty());
    }
    let document = with.document();
    for module in &with.modules {
        let _ = document.settings_as::<toml::Table>(module);
    }
}

fn types() -> [Type; 7] {
    [
        bool::schema(),
        u8::schema(),
        i64::schema(),
        f32::schema(),
        String::schema(),
        rohrpost_modules::common::OutputLevel::schema(),
        Twist::schema(),
    ]
}

/// A type that accepts the value gives it back, and writes it as TOML that reads back.
fn taken(value: &Value) {
    for ty in types() {
        let Ok(bytes) = from_file(&ty, value) else { continue };
        let read = decode(&ty, &bytes).unwrap_or_else(|error| panic!("{ty:?}: {error}"));
        let _ = value_text(&read);
        let Ok(table) = toml::from_str::<toml::Table>(&format!("x = {}", toml_text(&ty, &read))) else {
            assert!(ty.is::<Twist>(), "`x = {}` is no TOML", toml_text(&ty, &read));
            continue;
        };
        let again = table["x"].clone().try_into::<Value>().unwrap_or_else(|error| panic!("{error}"));
        let again = from_file(&ty, &again).map(|bytes| decode(&ty, &bytes));
        // By text, since a NaN is not itself.
        assert_eq!(format!("{again:?}"), format!("{:?}", Ok::<_, String>(Ok::<_, ()>(&read))), "{ty:?}");
    }
}

fn on_a_command_line(word: &str) {
    for ty in types() {
        match from_word(&ty, word) {
            Ok(bytes) => assert!(decode(&ty, &bytes).is_ok()),
            Err(error) => assert!(!error.is_empty()),
        }
    }
}
