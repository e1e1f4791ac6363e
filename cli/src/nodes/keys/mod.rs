//! `rohrpost keys`: the secret keys and certificates of an installation's nodes.

pub(crate) mod certificates;

use crate::begin::check::load;
use crate::terminal::units::counted;
use crate::terminal::{Failure, say};
use certificates::Renewal;
use clap::{Args, Subcommand};
use rohrpost_bundle::{SECRET_FILE, SigningKey};
use rohrpost_config::{Installation, Key, Keys};
use rohrpost_routers::security::{self, InstallationKey, KeyId};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

#[derive(Args)]
#[command(after_help = "Examples:
  rohrpost keys new robot.toml       all missing keys and certificates of the file
  rohrpost keys rotate robot.toml    another key, and new certificates; the older key stays valid until `finish`
  rohrpost keys finish robot.toml
  rohrpost keys new team-keys        the key that all systems of [team] share
  rohrpost keys bundle               the key that signs bundles (`rohrpost bundle`)
Datagrams (`security = \"keys\"` in [network]) are sealed with one file, `udp.keys`, the same on every node. Sessions \
    with the TCP router (`security = \"tls\"` in [tcp]) need a certificate and its key for each node, and for the TCP \
    router; each needs `ca.pem` and its own two files. Copy them as safely as passwords, and keep `ca.key`, which \
    signs new ones, off the robots. For another system of the installation, name in its file the same folders, or \
    copy `ca.pem` and `ca.key` into its own folder first. To change keys: `rotate`, copy and restart, one node after \
    the other; then `finish`, copy and restart again. The TCP router and its clients read new certificates at their \
    next start; old ones are valid until they expire. After `rotate --authority` old ones are invalid: copy to all \
    nodes and restart the TCP router and its clients all at once; meanwhile no package goes through it.")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    step: Step,
}

#[derive(Subcommand)]
enum Step {
    /// Make missing keys and certificates, and replace certificates that are not valid.
    New(Place),
    /// Add a key, and renew certificates; the previous key stays valid until `finish`.
    Rotate {
        #[command(flatten)]
        place: Place,
        /// Make a new authority: certificates that the old one signed are no longer valid, so all nodes change at once.
        #[arg(long)]
        authority: bool,
    },
    /// Drop the older key, when all nodes have the newer one.
    Finish(Place),
    /// Make the key that signs bundles, `bundle.key`, and its public half for nodes, `bundle.pub`.
    Bundle {
        /// Folder of the keys.
        #[arg(value_name = "FOLDER", default_value = "keys")]
        folder: PathBuf,
    },
    /// Show keys as fingerprints, which do not reveal them, their age, and how long certificates are valid.
    Show(Place),
}

#[derive(Args)]
struct Place {
    /// The configuration, for everything that it requires; or a folder, for the keys of datagrams alone.
    #[arg(value_name = "FILE", default_value = "keys")]
    path: PathBuf,
    /// New certificates are valid for this many days.
    #[arg(long, default_value_t = 730, value_parser = clap::value_parser!(u32).range(1..=3650))]
    days: u32,
}

struct KeyFiles {
    /// The file of the keys that seal datagrams between nodes, if there are to be any.
    datagrams: Option<PathBuf>,
    /// That of the keys of the team, if the configuration seals what systems send to each other. Other systems have it,
    /// too, so this configuration does not change it.
    team: Option<PathBuf>,
    installation: Option<Installation>,
}

impl KeyFiles {
    fn by(path: &Path) -> Result<Self, Failure> {
        if !path.exists() && path.extension().is_some_and(|end| end == "toml") {
            return Err(format!("{}: no such file", path.display()).into());
        }
        if !path.is_file() {
            return Ok(Self { datagrams: Some(Keys::file(path)), team: None, installation: None });
        }
        let installation = load(path)?;
        let datagrams = installation.keys.as_deref().map(Keys::file);
        let team = installation.team.as_ref().and_then(|team| team.keys.as_deref()).map(Keys::file);
        if datagrams.is_none() && team.is_none() && certificates::folder(&installation).is_none() {
            return Err(format!(
                "{}: nothing here is sealed; write `security = \"keys\"` in [network], for several nodes on a LAN, or \
                 in [team], or `security = \"tls\"` and `certificates = \"certificates\"` in [tcp]",
                path.display()
            )
            .into());
        }
        Ok(Self { datagrams, team, installation: Some(installation) })
    }

    /// All files of keys that seal datagrams.
    fn all_datagrams(&self) -> impl Iterator<Item = &PathBuf> {
        let team = self.team.as_ref().filter(|team| self.datagrams.as_ref() != Some(team));
        self.datagrams.iter().chain(team)
    }

    /// Says how the keys are changed that this configuration alone must not change, if there are no others.
    fn refuse_team_alone(&self, step: &str) -> Result<(), Failure> {
        let certificates = self.installation.as_ref().and_then(certificates::folder);
        match self.team.as_deref().and_then(Path::parent) {
            Some(folder) if self.datagrams.is_none() && certificates.is_none() => Err(format!(
                "all systems of the team have its keys; `rohrpost keys {step} {}` changes them, then copy that folder \
                 to each system",
                folder.display()
            )
            .into()),
            _ => Ok(()),
        }
    }

    /// Makes certificates, and prints the new files.
    fn certify(&self, which: Renewal, days: u32) -> Result<Vec<String>, Failure> {
        let Some(installation) = &self.installation else { return Ok(Vec::new()) };
        let made = certificates::make(installation, which, days)?;
        Ok(made.iter().map(|path| path.display().to_string()).collect())
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let lines = match &arguments.step {
        Step::New(place) => new(&KeyFiles::by(&place.path)?, place.days)?,
        Step::Rotate { place, authority } => rotate(&KeyFiles::by(&place.path)?, *authority, place.days)?,
        Step::Finish(place) => finish(&KeyFiles::by(&place.path)?)?,
        Step::Bundle { folder } => bundle(folder)?,
        Step::Show(place) => show(&KeyFiles::by(&place.path)?)?,
    };
    say(lines.join("\n"));
    Ok(ExitCode::SUCCESS)
}

fn new(wanted: &KeyFiles, days: u32) -> Result<Vec<String>, Failure> {
    let mut lines = Vec::new();
    for file in wanted.all_datagrams() {
        // Several systems of an installation may share a folder.
        if wanted.installation.is_none() || !file.exists() {
            let keys = Keys::first(security::random()?);
            keys.create(file)?;
            lines.push(text(file, &keys));
        }
    }
    lines.extend(wanted.certify(Renewal::Missing, days)?);
    if lines.is_empty() {
        lines
            .push("everything exists already; `rohrpost keys rotate` changes it, `rohrpost keys show` lists it".into());
    }
    Ok(lines)
}

fn rotate(wanted: &KeyFiles, authority: bool, days: u32) -> Result<Vec<String>, Failure> {
    wanted.refuse_team_alone("rotate")?;
    let rotated = |file: &PathBuf| Ok::<_, Failure>((file.clone(), Keys::load(file)?.rotated(security::random()?)?));
    let keys = wanted.datagrams.as_ref().map(rotated).transpose()?;
    // This comes first: if a later step fails, certificates can be made again, but a key must not change twice.
    let made = wanted.certify(if authority { Renewal::WithAuthority } else { Renewal::All }, days)?;
    let mut lines = Vec::new();
    if let Some((file, keys)) = keys {
        keys.replace(&file)?;
        lines.push(text(&file, &keys));
    }
    lines.extend(made);
    Ok(lines)
}

fn finish(wanted: &KeyFiles) -> Result<Vec<String>, Failure> {
    wanted.refuse_team_alone("finish")?;
    let Some(file) = &wanted.datagrams else {
        return Err("certificates need no `finish`: old ones are valid until they expire".into());
    };
    let keys = Keys::load(file)?.finished()?;
    keys.replace(file)?;
    Ok(vec![text(file, &keys)])
}

fn show(wanted: &KeyFiles) -> Result<Vec<String>, Failure> {
    let mut lines = Vec::new();
    for file in wanted.all_datagrams() {
        lines.push(text(file, &Keys::load(file)?));
        lines.extend(age(file));
    }
    lines.extend(wanted.installation.iter().flat_map(certificates::show));
    Ok(lines)
}

fn bundle(folder: &Path) -> Result<Vec<String>, Failure> {
    let fingerprint = SigningKey::create(folder)?.public().fingerprint();
    let file = folder.join(SECRET_FILE);
    Ok(vec![
        format!("{}: signs bundles, fingerprint {fingerprint}; keep it where bundles are made", file.display()),
        format!("{}: copy it to /var/lib/rohrpost/trusted/ of each node", file.with_extension("pub").display()),
    ])
}

/// Age of the file: the time since its keys were made, changed, or copied here.
fn age(file: &Path) -> Option<String> {
    let days = |since: Duration| since.as_secs() / certificates::DAY.as_secs();
    let ago = match file.metadata().ok()?.modified().ok()?.elapsed().map(days) {
        Ok(0) => "less than a day ago".into(),
        Ok(days) => format!("{} ago", counted(days, "day")),
        Err(_) => "at a time in the future of this clock".into(),
    };
    Some(format!("{}: written {ago}", file.display()))
}

fn text(file: &Path, keys: &Keys) -> String {
    let file = file.display();
    let line = |key: &Key, note: &str| format!("{file}: key {}, fingerprint {}{note}", key.id, fingerprint(key));
    match &keys.older {
        None => line(&keys.newest, ""),
        Some(older) => format!("{}\n{}", line(&keys.newest, ""), line(older, "; `rohrpost keys finish` removes it")),
    }
}

fn fingerprint(key: &Key) -> String {
    let bytes = InstallationKey::new(KeyId(key.id), &key.bytes).fingerprint();
    bytes.chunks(2).map(|two| format!("{:02x}{:02x}", two[0], two[1])).collect::<Vec<_>>().join("-")
}

#[cfg(test)]
mod tests;
