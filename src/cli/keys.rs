//! `rohrpost keys`: what the nodes of an installation know, and nobody else.

use super::{Failure, say};
use clap::{Args, Subcommand};
use rohrpost::config::{Key, Keys};
use rohrpost_routers::security::{self, InstallationKey, KeyId};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(Args)]
#[command(
    after_help = "Example: rohrpost keys new\nIt makes the folder `keys`, which belongs beside the configuration. Copy it to every node, as safely as a password, and \
                  write `security = \"keys\"` in [network]. To change keys: `rotate`, copy the folder and \
                  restart the routers, one node after the other; then `finish`, and the same again."
)]
pub(super) struct Arguments {
    #[command(subcommand)]
    step: Step,
}

#[derive(Subcommand)]
enum Step {
    /// Make the first key of an installation.
    New(Place),
    /// Add a key; the one before stays valid until `finish`.
    Rotate(Place),
    /// Drop the older key, when all nodes have the newer one.
    Finish(Place),
    /// Show which keys there are, by fingerprints that say nothing of the keys.
    Show(Place),
}

#[derive(Args)]
struct Place {
    /// The folder with the keys.
    #[arg(value_name = "FOLDER", default_value = "keys")]
    folder: PathBuf,
}

impl Place {
    fn file(&self) -> PathBuf {
        Keys::file(&self.folder)
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let (place, keys) = match &arguments.step {
        Step::New(place) => {
            let keys = Keys::first(security::random()?);
            keys.create(&place.file())?;
            (place, keys)
        }
        Step::Rotate(place) => {
            let keys = Keys::load(&place.file())?.rotated(security::random()?)?;
            keys.replace(&place.file())?;
            (place, keys)
        }
        Step::Finish(place) => {
            let keys = Keys::load(&place.file())?.finished()?;
            keys.replace(&place.file())?;
            (place, keys)
        }
        Step::Show(place) => (place, Keys::load(&place.file())?),
    };
    say(text(&place.file().display().to_string(), &keys));
    Ok(ExitCode::SUCCESS)
}

fn text(file: &str, keys: &Keys) -> String {
    let line = |key: &Key, note: &str| format!("{file}: key {}, fingerprint {}{note}", key.id, fingerprint(key));
    match &keys.older {
        None => line(&keys.newest, ""),
        Some(older) => format!("{}\n{}", line(&keys.newest, ""), line(older, "; it goes with `rohrpost keys finish`")),
    }
}

fn fingerprint(key: &Key) -> String {
    let bytes = InstallationKey::new(KeyId(key.id), &key.bytes).fingerprint();
    bytes.chunks(2).map(|two| format!("{:02x}{:02x}", two[0], two[1])).collect::<Vec<_>>().join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(step: fn(Place) -> Step, folder: &std::path::Path) -> Result<ExitCode, String> {
        let arguments = Arguments { step: step(Place { folder: folder.into() }) };
        run(&arguments).map_err(|failure| failure.to_string())
    }

    #[test]
    fn keys_are_made_changed_and_shown_but_never_said() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("keys");
        let file = Keys::file(&folder);
        assert!(step(Step::Show, &folder).unwrap_err().contains("rohrpost keys new"));
        step(Step::New, &folder).unwrap();
        let first = Keys::load(&file).unwrap();
        assert!(step(Step::New, &folder).unwrap_err().contains("already"), "no key is ever overwritten by a first one");
        step(Step::Rotate, &folder).unwrap();
        let both = Keys::load(&file).unwrap();
        assert_eq!(both.older, Some(first.newest));
        assert_ne!(both.older.as_ref().map(|older| older.bytes), Some(both.newest.bytes));
        let said = text("udp.keys", &both);
        let secret = std::fs::read_to_string(&file).unwrap();
        let digits = secret.lines().filter_map(|line| line.split_whitespace().nth(2)).filter(|word| word.len() == 64);
        assert_eq!(digits.filter(|digits| said.contains(&digits[..8])).count(), 0, "{said}");
        assert_ne!(fingerprint(&both.newest), fingerprint(both.older.as_ref().unwrap()));
        step(Step::Finish, &folder).unwrap();
        assert_eq!(Keys::load(&file).unwrap(), Keys { older: None, ..both });
    }
}
