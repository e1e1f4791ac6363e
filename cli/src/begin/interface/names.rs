//! Names of an interface as names of code: each language has its alphabet, its keywords, and its way of writing words.
//! Types that come with Rohrpost are taken from there.

use rohrpost::schema::Type;
use rohrpost::types;
use std::collections::{BTreeMap, BTreeSet};

/// Names of one scope, each given once.
#[derive(Default)]
pub(super) struct Scope {
    taken: BTreeSet<String>,
    /// Of names that were asked for more than once, the number to try next: somebody may call thousands alike.
    next: BTreeMap<String, usize>,
}

impl Scope {
    /// One in which these are taken.
    pub(super) fn with<'a>(taken: impl IntoIterator<Item = &'a str>) -> Self {
        Self { taken: taken.into_iter().map(str::to_owned).collect(), next: BTreeMap::new() }
    }

    /// This name, or the first of `name_2`, `name_3` … that is free.
    pub(super) fn give(&mut self, name: &str, between: &str) -> String {
        self.give_with(name, between, &[])
    }

    /// The same, with other names that follow from it.
    pub(super) fn give_with(&mut self, name: &str, between: &str, ends: &[&str]) -> String {
        let all = |name: &str| [""].iter().chain(ends).map(|end| format!("{name}{end}")).collect::<Vec<_>>();
        let next = self.next.entry(name.to_owned()).or_insert(1);
        loop {
            let numbered = if *next == 1 { name.to_owned() } else { format!("{name}{between}{next}") };
            *next += 1;
            let all = all(&numbered);
            if all.iter().all(|name| !self.taken.contains(name)) {
                self.taken.extend(all);
                return numbered;
            }
        }
    }
}

/// Whether it is a name in plain ASCII, as each language has them.
pub(super) fn is_plain(name: &str) -> bool {
    let mut chars = name.chars();
    chars.next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_')
        && chars.all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Words of a name: at its signs, and where a capital begins one.
fn words(name: &str) -> Vec<String> {
    let (mut all, mut word) = (Vec::new(), String::new());
    let chars: Vec<char> = name.chars().collect();
    for (at, &c) in chars.iter().enumerate() {
        let before = at.checked_sub(1).map(|before| chars[before]);
        let ends_capitals = c.is_ascii_uppercase()
            && before.is_some_and(|before| before.is_ascii_uppercase())
            && chars.get(at + 1).is_some_and(char::is_ascii_lowercase);
        let begins = c.is_ascii_uppercase() && before.is_some_and(|it| it.is_ascii_lowercase() || it.is_ascii_digit());
        if !c.is_ascii_alphanumeric() || begins || ends_capitals {
            all.extend(Some(std::mem::take(&mut word)).filter(|word| !word.is_empty()));
        }
        if c.is_ascii_alphanumeric() {
            word.push(c);
        }
    }
    all.extend(Some(word).filter(|word| !word.is_empty()));
    all
}

/// As functions, fields and modules are called: `speed_m_s`. A name without a plain letter becomes `other`.
pub(super) fn snake(name: &str, other: &str) -> String {
    let joined = words(name).join("_").to_lowercase();
    begun_with_a_letter(joined, "n", other)
}

/// As types and variants are called: `DriveError`.
pub(super) fn camel(name: &str, other: &str) -> String {
    let capital = |word: String| {
        let (first, rest) = word.split_at(1);
        first.to_uppercase() + rest
    };
    let joined: String = words(name).into_iter().map(capital).collect();
    begun_with_a_letter(joined, "N", other)
}

fn begun_with_a_letter(name: String, before: &str, other: &str) -> String {
    match name.chars().next() {
        None => other.to_owned(),
        Some(first) if first.is_ascii_digit() => format!("{before}{name}"),
        Some(_) => name,
    }
}

/// What stands behind the last dot: `Pose` of `rohrpost.Pose`.
pub(super) fn last(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or(name)
}

/// A name in Rust's `rohrpost::types`, and whether a description is of that type.
type Standard = (&'static str, fn(&Type) -> bool);

const ALL: [Standard; 9] = [
    ("Image", Type::is::<types::Image>),
    ("ImageFormat", Type::is::<types::ImageFormat>),
    ("LaserScan", Type::is::<types::LaserScan>),
    ("OccupancyGrid", Type::is::<types::OccupancyGrid>),
    ("Odometry", Type::is::<types::Odometry>),
    ("PointCloud", Type::is::<types::PointCloud>),
    ("PointFormat", Type::is::<types::PointFormat>),
    ("Pose", Type::is::<types::Pose>),
    ("Twist", Type::is::<types::Twist>),
];

/// The name of a type that comes with Rohrpost, if this is it: another of the same name is not.
pub(super) fn standard_name(ty: &Type, known: &str) -> Option<&'static str> {
    let own = known.strip_prefix("rohrpost.")?;
    ALL.iter().find(|(name, is)| *name == own && is(ty)).map(|(name, _)| *name)
}
