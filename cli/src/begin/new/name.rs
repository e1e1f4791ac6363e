//! Valid names of a module's project: each is a class, a crate and a program at once.

use rohrpost_config::is_class_name;
use std::str::FromStr;

/// Rust's keywords; a crate of such a name cannot be used.
const KEYWORDS: &str = "abstract as async await become box break const continue crate do dyn else enum extern false \
    final fn for gen if impl in let loop macro match mod move mut override priv pub ref return self static struct \
    super trait true try type typeof union unsafe unsized use virtual where while yield";
/// Crates that every project uses, our own crates, and folders that Cargo creates beside programs.
const CRATES: &str = "alloc build core deps examples incremental module proc-macro rohrpost std test tests";

#[derive(Debug)]
pub(super) struct ModuleName(String);

/// Why a name is not valid for a module's project.
#[derive(Debug, PartialEq, thiserror::Error)]
pub(super) enum NameError {
    #[error("`{0}` is no class name; use lower-case letters, digits and `-`, a letter first{1}")]
    NoClass(String, String),
    #[error("`{0}`: a `-` stands alone, between letters or digits; write for example `{1}`")]
    Dashes(String, String),
    #[error("`{0}` is a keyword of Rust; choose another name, such as `{0}-module`")]
    Keyword(String),
    #[error("`{0}` would be taken for something of Cargo's or Rohrpost's own; choose another name, such as `my-{0}`")]
    Crate(String),
    #[error("`{0}` is the class of {1}; a module of yours needs another name, such as `my-{0}`")]
    Class(String, &'static str),
    #[error("`{0}` is built in (`builtin = \"{1}\"`); a module of yours needs another name, such as `my-{0}`")]
    BuiltIn(String, &'static str),
}

impl FromStr for ModuleName {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        let own = || text.to_owned();
        if !is_class_name(text) {
            return Err(NameError::NoClass(own(), likely(text)));
        }
        if text.ends_with('-') || text.contains("--") {
            let parts: Vec<&str> = text.split('-').filter(|part| !part.is_empty()).collect();
            return Err(NameError::Dashes(own(), parts.join("-")));
        }
        let among = |words: &str| words.split(' ').any(|word| word == text);
        if among(KEYWORDS) {
            return Err(NameError::Keyword(own()));
        }
        if among(CRATES) {
            return Err(NameError::Crate(own()));
        }
        match text {
            "tool" => Err(NameError::Class(own(), "programs run by hand")),
            "output" => Err(NameError::Class(own(), "the collector of the modules' output")),
            _ => match rohrpost_builtin::of_class(text) {
                Some(builtin) => Err(NameError::BuiltIn(own(), builtin)),
                None => Ok(Self(own())),
            },
        }
    }
}

/// The likely intention: `WindVane`, `wind_vane` and `Wind Vane` as `wind-vane`.
fn likely(text: &str) -> String {
    let mut word = String::new();
    for c in text.chars() {
        if c.is_ascii_uppercase() && word.ends_with(|last: char| last.is_ascii_lowercase() || last.is_ascii_digit()) {
            word.push('-');
        }
        match c {
            '_' | ' ' | '.' | '-' if !word.is_empty() && !word.ends_with('-') => word.push('-'),
            c if c.is_ascii_alphanumeric() => word.push(c.to_ascii_lowercase()),
            _ => {}
        }
    }
    let word = word.trim_matches('-');
    if is_class_name(word) { format!(": `{word}`") } else { String::new() }
}

impl ModuleName {
    pub(super) fn as_str(&self) -> &str {
        &self.0
    }

    /// As Rust's paths write it: `wind_vane`.
    pub(super) fn crate_name(&self) -> String {
        self.0.replace('-', "_")
    }

    /// As Rust's types are written: `WindVane`.
    pub(super) fn type_name(&self) -> String {
        let capital = |part: &str| format!("{}{}", part[..1].to_ascii_uppercase(), &part[1..]);
        self.0.split('-').map(capital).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_valid_rust_names() {
        for (text, krate, ty) in [
            ("arm", "arm", "Arm"),
            ("wind-vane", "wind_vane", "WindVane"),
            ("arm-2", "arm_2", "Arm2"),
            ("a1b", "a1b", "A1b"),
        ] {
            let name: ModuleName = text.parse().unwrap();
            assert_eq!((name.crate_name().as_str(), name.type_name().as_str()), (krate, ty));
        }
    }

    #[test]
    fn errors_of_names_suggest_valid_names() {
        let rule = "use lower-case letters, digits and `-`, a letter first";
        for (text, message) in [
            ("WindVane", format!("`WindVane` is no class name; {rule}: `wind-vane`")),
            ("wind_vane", format!("`wind_vane` is no class name; {rule}: `wind-vane`")),
            ("arm.0", format!("`arm.0` is no class name; {rule}: `arm-0`")),
            ("../arm", format!("`../arm` is no class name; {rule}: `arm`")),
            ("2arms", format!("`2arms` is no class name; {rule}")),
            ("", format!("`` is no class name; {rule}")),
            ("grüße", format!("`grüße` is no class name; {rule}: `gre`")),
            ("arm-", "`arm-`: a `-` stands alone, between letters or digits; write for example `arm`".into()),
            ("a--b", "`a--b`: a `-` stands alone, between letters or digits; write for example `a-b`".into()),
            ("loop", "`loop` is a keyword of Rust; choose another name, such as `loop-module`".into()),
            (
                "tool",
                "`tool` is the class of programs run by hand; a module of yours needs another name, such as `my-tool`"
                    .into(),
            ),
        ] {
            assert_eq!(text.parse::<ModuleName>().unwrap_err().to_string(), message);
        }
        for (text, builtin) in
            [("motor", "sim"), ("laser", "sim"), ("pilot", "pilot"), ("sim", "sim"), ("router", "router")]
        {
            let error = text.parse::<ModuleName>().unwrap_err();
            assert_eq!(error, NameError::BuiltIn(text.into(), builtin));
        }
        for text in ["std", "test", "deps", "rohrpost"] {
            assert!(matches!(text.parse::<ModuleName>(), Err(NameError::Crate(_))), "{text}");
        }
    }
}
