//! Compile errors of invalid interfaces.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use super::{expand, quote};
use proc_macro2::TokenStream;

fn error(attributes: &TokenStream, item: &TokenStream) -> String {
    match expand(attributes.clone(), item.clone()) {
        Ok(_) => format!("accepted: {item}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn mistakes_are_told_with_what_would_be_right() {
    for (item, says) in [
        ("#[command(15)] fn f(&mut self);", "own functions have numbers from 16 to 16383"),
        ("#[command(16384)] fn f(&mut self);", "own functions have numbers from 16 to 16383"),
        ("#[command(70000)] fn f(&mut self);", "number too large"),
        ("#[command] fn f(&mut self);", "expected attribute arguments in parentheses: #[command(...)]"),
        ("#[command(\"x\")] fn f(&mut self);", "expected integer literal"),
        ("#[command(16, twice)] fn f(&mut self);", "unknown word; `idempotent` is the only one"),
        ("#[command(16)] fn f(&mut self) {}", "have no body here"),
        ("#[command(16)] fn f(&self);", "functions take `&mut self` first"),
        ("#[command(16)] fn f();", "functions take `&mut self` first"),
        ("#[command(16)] fn f(&mut self, text: &str);", "arguments travel to another process; take an owned value"),
        ("#[command(16)] fn f(&mut self) -> &str;", "results travel to another process; return an owned value"),
        ("#[command(16)] fn f(&mut self, (a, b): (u8, u8));", "write a plain name"),
        ("#[command(16)] fn f<T>(&mut self, t: T);", "have no generics"),
        ("#[command(16)] async fn f(&mut self);", "functions are not async"),
        (
            "#[command(16)] fn f(&mut self, a: u8, b: u8, c: u8, d: u8, e: u8, f: u8, g: u8, h: u8, i: u8);",
            "at most eight arguments; put them into a struct",
        ),
        ("#[command(16)] fn f(&mut self); #[command(16)] fn g(&mut self);", "this number is taken"),
        ("#[data(1)] fn f() -> u8; #[data(1)] fn g() -> u8;", "this number is taken"),
        ("#[data(1)] fn f() -> u8; #[stream(1)] fn g() -> u8;", "this number is taken"),
        ("#[data(1)] fn f() -> u8; #[stream(2)] fn f() -> u8;", "this name is taken"),
        ("#[stream(0)] fn f() -> u8;", "data and streams have numbers from 1 to 16384"),
        ("#[stream(1)] fn f(&mut self) -> u8;", "data and streams are declared as `fn name() -> Type;`"),
        ("#[stream(1, idempotent)] fn f() -> u8;", "`idempotent` is for commands"),
        ("#[command(16)] fn f(&mut self); #[data(1)] fn f() -> u8;", "this name is taken"),
        ("#[command(16)] fn with_timeout(&mut self);", "`with_timeout` is a function of every proxy"),
        ("#[data(0)] fn f() -> u8;", "data and streams have numbers from 1 to 16384"),
        ("#[data(16385)] fn f() -> u8;", "data and streams have numbers from 1 to 16384"),
        ("#[data(1)] fn f();", "data and streams are declared as `fn name() -> Type;`"),
        ("#[data(1)] fn f(&mut self) -> u8;", "data and streams are declared as `fn name() -> Type;`"),
        ("#[data(1)] fn f() -> &'static str;", "data travel to other processes; name an owned type"),
        ("#[data(1, idempotent)] fn f() -> u8;", "`idempotent` is for commands"),
        ("fn f(&mut self);", "write #[command(16)], #[data(1)] or #[stream(1)] before it"),
        ("type Error;", "an interface has functions only"),
    ] {
        let said = error(&quote!(class = "motor"), &format!("trait T {{ {item} }}").parse().unwrap());
        assert!(said.contains(says), "{item}\n  says: {said}\n  should say: {says}");
    }
}

#[test]
fn mistakes_in_the_attribute_are_told() {
    let item = quote!(
        trait T {}
    );
    for (attributes, says) in [
        (quote!(), "which class? write `#[interface(class = \"motor\")]`"),
        (quote!(klass = "motor"), "unknown key; write `class = \"motor\"`"),
        (quote!(class = motor), "expected string literal"),
    ] {
        let said = error(&attributes, &item);
        assert!(said.contains(says), "{attributes}\n  says: {said}");
    }
    assert!(
        expand(
            quote!(class = "motor"),
            quote!(
                struct T;
            )
        )
        .is_err()
    );
    assert!(expand(quote!(class = "motor"), item).is_ok(), "an interface may be empty");
}

#[test]
fn names_that_are_keywords_are_told_without_their_mark() {
    let item = "trait T {
        #[command(16)] fn r#continue(&mut self, r#in: u8);
        #[data(1)] fn r#type() -> u8;
    }";
    let written = expand(quote!(class = "odd"), item.parse().unwrap()).unwrap().to_string();
    for told in ["\"continue\"", "\"in\"", "\"type\"", "const TYPE"] {
        assert!(written.contains(told), "{told}: {written}");
    }
    assert!(!written.contains("\"r#"), "{written}");
}

#[test]
fn a_description_has_functions_and_data_by_number() {
    let item = "trait T {
        #[command(30)] fn later(&mut self);
        #[command(16)] fn first(&mut self);
        #[stream(3)] fn third() -> u8;
        #[data(2)] fn second() -> u8;
    }";
    let written = expand(quote!(class = "odd"), item.parse().unwrap()).unwrap().to_string();
    let described = written.split("fn description").nth(1).unwrap();
    let at = |name: &str| described.find(&format!("\"{name}\"")).unwrap();
    assert!(at("first") < at("later") && at("later") < at("second") && at("second") < at("third"), "{described}");
}
