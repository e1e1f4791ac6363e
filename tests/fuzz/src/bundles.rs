//! Bundles: manifests, signatures, what a node remembers, and both ends of a push. What is read is written as the same
//! bytes; paths stay below their folder; what is wrong is told in one line.

use rohrpost_bundle::{
    Bundle, FilePath, Ingredient, Manifest, Recipe, Signature, SigningKey, Source, State, StreamSource, make, send,
};
use std::io::{self, BufReader, Cursor};
use std::path::{Component, Path};
use std::sync::OnceLock;
use std::time::Duration;
use tempfile::TempDir;

pub(crate) fn run(data: &[u8]) {
    manifest(data);
    if let Some(signature) = Signature::parse(data) {
        assert_eq!(signature.text().as_bytes(), data);
        assert!(!signature.is_of(data), "nothing signs itself");
    }
    match State::parse(data) {
        Ok(state) => assert_eq!(State::parse(state.text().as_bytes()), Ok(state)),
        Err(error) => told(&error.to_string()),
    }
    received(data);
    answered(data);
}

fn manifest(data: &[u8]) {
    let manifest = match Manifest::parse(data) {
        Ok(manifest) => manifest,
        Err(error) => return told(&error.to_string()),
    };
    assert_eq!(manifest.text().as_bytes(), data);
    assert!(manifest.version() > 0 && !manifest.trial().is_zero() && manifest.size() <= 1 << 40);
    let paths = || manifest.files().iter().map(|file| &file.path);
    assert!(paths().is_sorted() && paths().any(|path| path == manifest.configuration()));
    for path in paths() {
        let is_plain = |part| matches!(part, Component::Normal(_));
        assert!(Path::new(path.as_str()).components().all(is_plain), "{path}");
        assert!(!path.as_str().chars().any(char::is_control) && path.below("/x".as_ref()).starts_with("/x"));
    }
}

fn told(error: &str) {
    assert!(!error.is_empty() && !error.chars().any(char::is_control), "{error:?}");
}

/// The node's end: a head, and files of it.
fn received(data: &[u8]) {
    let mut source = StreamSource::new(data, io::sink());
    let Ok((manifest, signature)) = source.head() else { return };
    assert!(manifest.len() + signature.len() < data.len());
    let Ok(manifest) = Manifest::parse(&manifest) else { return };
    for file in manifest.files() {
        let read = source.file(file).and_then(|mut content| io::copy(&mut content, &mut io::sink()));
        assert!(read.is_ok_and(|read| read <= file.size.min(data.len() as u64)));
    }
}

/// The other end: a node asks for files of a bundle of two.
fn answered(data: &[u8]) {
    static BUNDLE: OnceLock<(TempDir, Bundle)> = OnceLock::new();
    let (_, bundle) = BUNDLE.get_or_init(|| bundle().unwrap_or_else(|error| panic!("{error}")));
    let mut from = BufReader::new(Cursor::new(data));
    let mut sent = Vec::new();
    let files = send(bundle, &mut sent, &mut from);
    assert!(files.is_ok_and(|files| files <= 2) || sent.len() < 2000, "{}", sent.len());
}

fn bundle() -> Result<(TempDir, Bundle), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let ingredient = |name: &str| {
        let source = folder.path().join(name);
        std::fs::write(&source, name)?;
        Ok::<_, Box<dyn std::error::Error>>(Ingredient { path: FilePath::parse(name)?, source })
    };
    let recipe = Recipe {
        installation: "fuzzed".into(),
        version: Some(1),
        trial: Duration::from_secs(30),
        configuration: FilePath::parse("robot.toml")?,
        files: vec![ingredient("robot.toml")?, ingredient("house.map")?],
    };
    let bundle = make(&recipe, &SigningKey::create(folder.path())?, &folder.path().join("bundles"))?;
    Ok((folder, bundle))
}
