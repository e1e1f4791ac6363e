//! `rohrpost bundle`: all files that nodes run, provably the same everywhere. The crate `rohrpost-bundle` says how.

mod check;
mod collect;
mod patient;
mod place;

use crate::begin::check::load;
use crate::terminal::table::table;
use crate::terminal::units::{counted, size};
use crate::terminal::{Failure, say};
use clap::{Args, Subcommand};
use collect::Collected;
use patient::Patient;
use place::NodePlace;
use rohrpost_bundle::{
    Bundle, FolderSource, NodeFolder, Received, Recipe, SECRET_FILE, SigningKey, StreamSource, make,
};
use rohrpost_config::{duration_text, parse_duration};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Folder of a node, unless another is named.
const ROOT: &str = "/var/lib/rohrpost";

#[derive(Args)]
#[command(after_help = "Examples:
  rohrpost bundle make robot.toml --with maps
  rohrpost bundle push --to base:/var/lib/rohrpost --to arm:/var/lib/rohrpost
  rohrpost bundle push /media/usb/bundles        on the node itself
  rohrpost bundle check base:/var/lib/rohrpost arm:/var/lib/rohrpost
  rohrpost bundle back base:/var/lib/rohrpost
A place is a folder, or HOST:FOLDER by ssh; without one it is /var/lib/rohrpost. A node trusts the keys in its folder \
    `trusted`: copy `bundle.pub` there, which `rohrpost keys bundle` makes. The node launches \
    /var/lib/rohrpost/current/robot.toml. If its modules do not stay up for the time of the trial, it goes back to \
    the bundle before by itself.")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    step: BundleStep,
}

#[derive(Subcommand)]
enum BundleStep {
    /// Make a bundle of a configuration and of all files that it names, and sign it.
    Make(MakeArguments),
    /// Show what is in a bundle, and whether all of it is right.
    Show {
        /// A bundle, a folder of bundles, of which the newest is meant, or the folder of a node.
        #[arg(value_name = "BUNDLE", default_value = "bundles")]
        bundle: PathBuf,
    },
    /// Bring a bundle to nodes. What a node has already is not sent again.
    Push {
        /// A bundle, or a folder of bundles, of which the newest is meant.
        #[arg(value_name = "BUNDLE", default_value = "bundles")]
        bundle: PathBuf,
        /// Folder of a node, or HOST:FOLDER by ssh; several are pushed to one after the other.
        #[arg(long, value_name = "PLACE", default_value = ROOT)]
        to: Vec<NodePlace>,
    },
    /// Compare the files of nodes with their manifests, and their bundles with each other.
    Check {
        /// Folders of nodes, or HOST:FOLDER by ssh.
        #[arg(value_name = "PLACE", default_value = ROOT)]
        places: Vec<NodePlace>,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Go back to the bundle before the current one.
    Back {
        /// Folder of a node, or HOST:FOLDER by ssh.
        #[arg(value_name = "PLACE", default_value = ROOT)]
        place: NodePlace,
    },
    /// Receive a bundle on the standard input: what `push` runs on a node.
    #[command(hide = true)]
    Receive {
        /// Folder of the node.
        folder: PathBuf,
    },
}

#[derive(Args)]
struct MakeArguments {
    /// The configuration. Its programs, files in its settings and saved parameters go into the bundle.
    file: PathBuf,
    /// A further file, or a folder with all in it.
    #[arg(long, value_name = "PATH")]
    with: Vec<PathBuf>,
    /// Version, higher than those before; by itself one more than the highest in the folder of bundles.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    version: Option<u64>,
    /// How long all modules must stay up on a node, until it keeps the bundle.
    #[arg(long, value_name = "TIME", default_value = "30 s", value_parser = parse_duration)]
    trial: Duration,
    /// The key that signs; by itself `keys/bundle.key` beside the configuration.
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
    /// Folder of bundles; by itself `bundles` beside the configuration.
    #[arg(long, short, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.step {
        BundleStep::Make(arguments) => make_bundle(arguments),
        BundleStep::Show { bundle } => show(&found(bundle)?),
        BundleStep::Push { bundle, to } => push(&found(bundle)?, to),
        BundleStep::Check { places, json } => check::run(places, *json),
        BundleStep::Back { place } => back(place),
        BundleStep::Receive { folder } => {
            let (stdin, stdout) = (BufReader::new(Patient::stdin()?), std::io::stdout());
            said(folder, &NodeFolder::new(folder).receive(&mut StreamSource::new(stdin, stdout))?);
            Ok(ExitCode::SUCCESS)
        }
    }
}

fn make_bundle(arguments: &MakeArguments) -> Result<ExitCode, Failure> {
    let installation = load(&arguments.file)?;
    let beside = |path: &Option<PathBuf>, name: &str| path.clone().unwrap_or_else(|| installation.folder.join(name));
    let key = SigningKey::load(&beside(&arguments.key, &format!("keys/{SECRET_FILE}"))).map_err(|error| {
        format!("{error}; `rohrpost keys bundle` makes a key, and --key names one that is elsewhere")
    })?;
    let Collected { configuration, files, notes } = collect::collect(&installation, &arguments.with)?;
    let recipe = Recipe {
        installation: installation.name.clone(),
        version: arguments.version,
        trial: arguments.trial,
        configuration,
        files,
    };
    let bundle = make(&recipe, &key, &beside(&arguments.output, "bundles"))?;
    for note in notes {
        say(format_args!("note: {note}"));
    }
    say(headline(&bundle));
    say(format_args!("made {}", bundle.folder().display()));
    Ok(ExitCode::SUCCESS)
}

fn headline(bundle: &Bundle) -> String {
    let manifest = bundle.manifest();
    format!(
        "version {} of {}, bundle {}: {}, {}, trial {}",
        manifest.version(),
        manifest.installation(),
        bundle.digest().short(),
        counted(manifest.files().len() as u64, "file"),
        size(manifest.size()),
        duration_text(manifest.trial())
    )
}

/// The bundle that is meant: this folder, the current one of a node, or the newest in a folder of bundles.
fn found(path: &Path) -> Result<Bundle, Failure> {
    if path.join("manifest.toml").exists() {
        return Ok(Bundle::open(path)?);
    }
    if path.join("current").is_symlink() {
        return Ok(NodeFolder::new(path).bundle()?);
    }
    let newest = Bundle::newest(path)?;
    newest.ok_or_else(|| format!("{}: no bundle there; `rohrpost bundle make` makes one", path.display()).into())
}

fn show(bundle: &Bundle) -> Result<ExitCode, Failure> {
    let (manifest, signature) = (bundle.manifest(), bundle.signature());
    say(headline(bundle));
    let is_signed = signature.is_of(bundle.manifest_bytes());
    let verdict = if is_signed { "" } else { ", and NOT VALID: manifest or signature was changed" };
    say(format_args!("signed with key {}{verdict}", signature.key().fingerprint()));
    say(format_args!("launched from {}\n", manifest.configuration()));
    let rows = manifest.files().iter().map(|file| {
        let kind = if file.executable { "program" } else { "" };
        [file.path.to_string(), size(file.size), file.sha256.short(), kind.into()]
    });
    say(table(["file", ">size", "sha256", "kind"], rows).trim_end());
    let differences = bundle.differences()?;
    for difference in &differences {
        say(difference);
    }
    Ok(if is_signed && differences.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn push(bundle: &Bundle, places: &[NodePlace]) -> Result<ExitCode, Failure> {
    for place in places {
        match place {
            NodePlace::Folder(folder) => {
                said(folder, &NodeFolder::new(folder).receive(&mut FolderSource(bundle))?);
            }
            NodePlace::Host(host) => host.send(bundle)?,
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// What a node has received.
fn said(folder: &Path, received: &Received) {
    let Received { version, bundle, is_new, configuration, files_sent, files } = received;
    let folder = folder.display();
    let what = if *is_new { "is current now" } else { "was current already" };
    say(format_args!(
        "{folder}: version {version}, bundle {}, {what}; {files_sent} of {} sent",
        bundle.short(),
        counted(*files as u64, "file"),
    ));
    if *is_new {
        say(format_args!("{folder}: start launch of {} again, when the robot may stop", configuration.display()));
    }
}

fn back(place: &NodePlace) -> Result<ExitCode, Failure> {
    match place {
        NodePlace::Folder(folder) => {
            let (from, to) = NodeFolder::new(folder).back()?;
            let folder = folder.display();
            say(format_args!("{folder}: back from version {from} to version {to}; start launch again"));
            Ok(ExitCode::SUCCESS)
        }
        NodePlace::Host(host) => host.run("back"),
    }
}
