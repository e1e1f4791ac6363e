//! Compile errors of invalid parameters.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use super::{expand, expand_choice, quote};
use proc_macro2::TokenStream;

fn said(result: syn::Result<TokenStream>) -> String {
    match result {
        Ok(tokens) => format!("accepted: {tokens}"),
        Err(error) => error.to_string(),
    }
}

fn declared(attributes: &str, item: &str) -> String {
    said(expand(attributes.parse().unwrap(), item.parse().unwrap()))
}

#[test]
fn mistakes_in_a_field_are_told_with_what_would_be_right() {
    for (field, says) in [
        ("#[parameter] speed: f64", "what is it for? write a doc comment before it"),
        (
            "/// S.\n #[parameter(units = \"m\")] speed: f64",
            "unknown key; there are `unit`, `min`, `max` and `default`",
        ),
        ("/// S.\n #[parameter(unit = \" \")] speed: f64", "an empty unit is none; leave `unit` out"),
        ("/// S.\n #[parameter(unit = 3)] speed: f64", "expected string literal"),
        ("/// S.\n #[parameter(min = 0.0, min = 1.0)] speed: f64", "`min` is given twice"),
        ("/// S.\n #[parameter(min = false)] flag: bool", "only numbers have a range: u8, u16"),
        ("/// S.\n #[parameter(max = 3)] word: String", "only numbers have a range"),
        ("/// S.\n #[serde(rename = \"v\")] #[parameter] speed: f64", "called as its field; rename the field"),
        ("/// S.\n #[serde(default)] #[parameter(default = 1.0)] speed: f64", "its default is given twice"),
        (
            "/// S.\n #[serde(with = \"x\")] #[parameter] speed: f64",
            "are written by #[parameter(…)], but for `default`",
        ),
        ("speed: f64", "no field is a parameter; write #[parameter("),
    ] {
        let said = declared("", &format!("struct Settings {{ {field} }}"));
        assert!(said.contains(says), "{field}\n  says: {said}\n  should say: {says}");
    }
}

#[test]
fn mistakes_in_the_struct_are_told() {
    let good = "{ /** S. */ #[parameter] speed: f64 }";
    for (attributes, item, says) in [
        ("min = 0.0", format!("struct S {good}"), "belong to #[parameter(…)] of a field"),
        ("", "enum S { A }".into(), "parameters are fields of a struct"),
        ("", "struct S(f64);".into(), "settings are a struct with named fields"),
        ("", "struct S<T> { speed: T }".into(), "settings have no generics"),
        ("", format!("#[derive(Clone, Deserialize)] struct S {good}"), "derives `Deserialize` itself; drop this one"),
        ("", format!("#[derive(serde::Deserialize)] struct S {good}"), "derives `Deserialize` itself"),
        ("", format!("#[serde(default, rename_all = \"kebab-case\")] struct S {good}"), "writes `rename_all` itself"),
        ("", format!("#[serde(deny_unknown_fields)] struct S {good}"), "writes `deny_unknown_fields` itself"),
        ("", format!("#[serde(crate = \"x\")] struct S {good}"), "writes `crate` itself"),
    ] {
        let said = declared(attributes, &item);
        assert!(said.contains(says), "{item}\n  says: {said}\n  should say: {says}");
    }
}

#[test]
fn what_is_right_is_taken_and_proved() {
    let said = declared(
        "",
        "#[derive(Clone)] #[serde(default)] struct S {
            /// Speed.
            #[parameter(unit = \"m/s\", min = 0.0, max = 1.5, default = 0.5)] cruise_m_s: f64,
            /// Word.
            #[serde(default)] #[parameter] r#type: String,
            plain: u8,
        }",
    );
    let tokens = said.strip_prefix("accepted: ").unwrap_or_else(|| panic!("{said}")).replace([' ', '\n'], "");
    for words in [
        "names(&self)->::std::vec::Vec<&str>{::std::vec![\"cruise-m-s\",\"type\"]}",
        "rename_all=\"kebab-case\"",
        "deserialize_with=\"S::__read_cruise_m_s\"",
        "default=\"S::__default_cruise_m_s\"",
        "unit:\"m/s\"",
        "\"`cruise-m-s`:`min`isabove`max`\"",
        "\"`cruise-m-s`:`default`isbelow`min`\"",
        "\"`cruise-m-s`:`default`isabove`max`\"",
        "\"`min`of`cruise-m-s`isnonumber\"",
    ] {
        assert!(tokens.contains(words), "no `{words}` in {tokens}");
    }
}

#[test]
fn mistakes_in_a_choice_are_told() {
    for (item, says) in [
        ("struct S;", "a choice is an enum with variants that carry nothing"),
        ("enum Side {}", "at least one variant"),
        ("enum Side { Left, Right(u8) }", "variants of a choice carry nothing"),
        ("enum Side<T> { Left }", "a choice has no generics"),
        ("#[derive(Serialize)] enum Side { Left }", "derives `Serialize` itself"),
        ("#[serde(rename_all = \"lowercase\")] enum Side { Left }", "writes `rename_all` itself"),
    ] {
        let said = said(expand_choice(quote!(), item.parse().unwrap()));
        assert!(said.contains(says), "{item}\n  says: {said}\n  should say: {says}");
    }
    assert!(
        expand_choice(
            quote!(),
            quote!(
                enum Side {
                    Left,
                    Right,
                }
            )
        )
        .is_ok()
    );
}
