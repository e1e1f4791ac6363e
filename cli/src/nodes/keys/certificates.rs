//! The certificates of the TCP router and of a system's nodes: sessions are sealed, and each end proves its identity.

mod shown;

use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair, KeyUsagePurpose,
    date_time_ymd,
};
use rohrpost_config::{Installation, KeysError, open_secret};
use rohrpost_mailbox::realtime_ns;
use rohrpost_routers::tcp::{AUTHORITY, Authority, Holder, PREFIX, SealError, is_about};
pub(crate) use shown::lacking;
pub(super) use shown::show;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

pub(super) const DAY: Duration = Duration::from_secs(24 * 3600);
/// Validity of the authority's own certificate, days.
const AUTHORITY_DAYS: u32 = 3650;
/// Backdating: clocks of computers without a network are sometimes behind.
const BEFORE: Duration = DAY;

/// What to make.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Renewal {
    /// Certificates that are missing or not valid.
    Missing,
    /// New certificates for all holders, signed by the existing authority.
    All,
    /// New certificates signed by a new authority; the old one is kept under another name.
    WithAuthority,
}

/// Their folder, if the file requires certificates.
pub(super) fn folder(installation: &Installation) -> Option<PathBuf> {
    installation.tcp.as_ref()?.certificates.as_ref().map(|folder| installation.resolve(folder))
}

/// All holders: the nodes of the file, and the TCP router if one of them runs it.
fn holders(installation: &Installation) -> impl Iterator<Item = Holder> {
    let system = installation.system.id;
    let nodes = installation.nodes.iter().map(move |node| Holder::Node { node: node.name.clone(), system });
    let server = installation.tcp.as_ref().and_then(|tcp| tcp.server.as_ref());
    nodes.chain(server.map(|_| Holder::Router))
}

/// The files of a holder: certificate and secret key.
fn files(folder: &Path, name: &str) -> [PathBuf; 2] {
    ["pem", "key"].map(|end| folder.join(format!("{name}.{end}")))
}

/// A holder's existing files.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum HolderState {
    Holds,
    Missing,
    /// The key does not belong to the certificate.
    NoPair,
    /// Not signed by the existing authority, or not valid now.
    Unsigned,
}

fn state(folder: &Path, authority: Option<&Authority>, holder: &Holder) -> HolderState {
    let [certificate, secret] = files(folder, &holder.file_name());
    if !certificate.exists() || !secret.exists() {
        HolderState::Missing
    } else if !is_pair(&certificate, &secret) {
        HolderState::NoPair
    } else if authority.is_some_and(|authority| authority.has_signed(&certificate)) {
        HolderState::Holds
    } else {
        HolderState::Unsigned
    }
}

fn is_pair(certificate: &Path, secret: &Path) -> bool {
    let text = fs::read_to_string(secret).unwrap_or_default();
    KeyPair::from_pem(&text).is_ok_and(|key| is_about(certificate, key.public_key_raw()))
}

/// Makes the certificates, valid for this many days; returns the new files. None if the file requires no certificates.
///
/// Everything is made in memory before the first file is written.
pub(crate) fn make(installation: &Installation, which: Renewal, days: u32) -> Result<Vec<PathBuf>, CertificateError> {
    let Some(folder) = folder(installation) else { return Ok(Vec::new()) };
    let Signing { authority, issuer, mut made } = match which {
        Renewal::WithAuthority => begin(&folder, installation)?,
        Renewal::Missing | Renewal::All => signing(&folder, installation)?,
    };
    for holder in holders(installation) {
        if which != Renewal::Missing || state(&folder, Some(&authority), &holder) != HolderState::Holds {
            let [certificate, secret] = files(&folder, AUTHORITY);
            let issuer = issuer.as_ref();
            let issuer = issuer.ok_or_else(|| CertificateError::NoKey(certificate, secret, installation.shown.clone()));
            made.extend(issue(&folder, issuer?, &holder, days)?);
        }
    }
    put(&folder, &made, || if which == Renewal::WithAuthority { keep_aside(&folder) } else { Ok(()) })?;
    Ok(made.into_iter().map(|made| made.path).collect())
}

struct Signing {
    authority: Authority,
    /// None if its key is not here.
    issuer: Option<Issuer<'static, KeyPair>>,
    /// Its files that are new.
    made: Vec<Written>,
}

/// The existing authority, fixed if only its certificate is lost; a new one where nothing is signed yet.
fn signing(folder: &Path, installation: &Installation) -> Result<Signing, CertificateError> {
    let [certificate, secret] = files(folder, AUTHORITY);
    let file = || installation.shown.clone();
    let failed = |error| CertificateError::File(secret.clone(), error);
    let key = match open_secret(&secret, failed) {
        Ok(file) => {
            let text = io::read_to_string(file).map_err(failed)?;
            Some(KeyPair::from_pem(&text).map_err(|error| CertificateError::Unfit(secret.clone(), error))?)
        }
        Err(CertificateError::File(_, error)) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    if certificate.exists() {
        let authority = Authority::load(&certificate)?;
        if key.as_ref().is_some_and(|key| !authority.has_key(key.public_key_raw())) {
            return Err(CertificateError::OtherKey(certificate, secret, file()));
        }
        // Uses the name in the certificate: the installation may have been renamed.
        let issuer = key.map(|key| Issuer::new(authority_params(&authority.name), key));
        return Ok(Signing { authority, issuer, made: Vec::new() });
    }
    match (key, a_certificate(folder)) {
        (Some(key), _) => signed_by_itself(folder, installation, key),
        (None, Some(signed)) => Err(CertificateError::NoKey(signed, secret, file())),
        (None, None) => begin(folder, installation),
    }
}

/// A certificate that exists already: it was signed by an authority.
fn a_certificate(folder: &Path) -> Option<PathBuf> {
    let paths = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    paths.filter(|path| path.extension().is_some_and(|end| end == "pem")).min()
}

/// Makes a new authority.
fn begin(folder: &Path, installation: &Installation) -> Result<Signing, CertificateError> {
    let [_, secret] = files(folder, AUTHORITY);
    let key = KeyPair::generate().map_err(|error| CertificateError::Unfit(secret.clone(), error))?;
    let made = Written { path: secret, text: key.serialize_pem(), mode: SECRET };
    let mut signing = signed_by_itself(folder, installation, key)?;
    signing.made.insert(0, made);
    Ok(signing)
}

/// An authority's certificate, made from its key.
fn signed_by_itself(folder: &Path, installation: &Installation, key: KeyPair) -> Result<Signing, CertificateError> {
    let [certificate, _] = files(folder, AUTHORITY);
    let params = authority_params(&format!("{PREFIX}{}", installation.name));
    let signed = params.self_signed(&key).map_err(|error| CertificateError::Unfit(certificate.clone(), error))?;
    let text = signed.pem();
    let authority = Authority::read(&certificate, text.as_bytes())?;
    let made = vec![Written { path: certificate, text, mode: PUBLIC }];
    Ok(Signing { authority, issuer: Some(Issuer::new(params, key)), made })
}

/// Links the authority's files under a second, unused name: the old authority is still needed if the new one is
/// rejected.
fn keep_aside(folder: &Path) -> Result<(), CertificateError> {
    let files = files(folder, AUTHORITY);
    let aside = |number: u32| {
        let end = if number == 1 { "old".into() } else { format!("old-{number}") };
        files.each_ref().map(|file| PathBuf::from(format!("{}.{end}", file.display())))
    };
    let is_free = |aside: &[PathBuf; 2]| !aside.iter().any(|path| path.exists());
    let Some(aside) = (1..).map(aside).find(is_free) else { return Ok(()) };
    for (file, aside) in files.iter().zip(aside).filter(|(file, _)| file.exists()) {
        fs::hard_link(file, &aside).map_err(|error| CertificateError::File(aside, error))?;
    }
    Ok(())
}

fn authority_params(name: &str) -> CertificateParams {
    let mut params = CertificateParams::default();
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign];
    params.distinguished_name.push(DnType::CommonName, name);
    hold(&mut params, AUTHORITY_DAYS);
    params
}

/// A new key and certificate of a holder; they replace older ones.
fn issue(
    folder: &Path,
    issuer: &Issuer<'static, KeyPair>,
    holder: &Holder,
    days: u32,
) -> Result<[Written; 2], CertificateError> {
    let [certificate, secret] = files(folder, &holder.file_name());
    let unfit = |error| CertificateError::Unfit(certificate.clone(), error);
    let key = KeyPair::generate().map_err(unfit)?;
    let mut params = CertificateParams::new([holder.dns_name()]).map_err(unfit)?;
    params.distinguished_name.push(DnType::CommonName, holder.dns_name());
    params.extended_key_usages = vec![match holder {
        Holder::Router => ExtendedKeyUsagePurpose::ServerAuth,
        Holder::Node { .. } => ExtendedKeyUsagePurpose::ClientAuth,
    }];
    // RFC 5280 requires all of these, and strict verifiers check them: that it is no authority, the purpose of its key,
    // and the key that signed it.
    params.is_ca = IsCa::ExplicitNoCa;
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.use_authority_key_identifier_extension = true;
    hold(&mut params, days);
    let signed = params.signed_by(&key, issuer).map_err(unfit)?;
    let secret = Written { path: secret, text: key.serialize_pem(), mode: SECRET };
    Ok([secret, Written { path: certificate, text: signed.pem(), mode: PUBLIC }])
}

/// The start of the validity, a little in the past.
fn hold(params: &mut CertificateParams, days: u32) {
    let now = date_time_ymd(1970, 1, 1) + Duration::from_nanos(realtime_ns());
    (params.not_before, params.not_after) = (now - BEFORE, now + days * DAY);
}

/// Why certificates cannot be made or read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CertificateError {
    #[error("{0}: {1}")]
    File(PathBuf, io::Error),
    /// Other users may read a key.
    #[error(transparent)]
    Open(#[from] KeysError),
    #[error(transparent)]
    Authority(#[from] SealError),
    /// Only half of the authority is there.
    #[error(
        "{certificate} is there, and {secret} is not: without it nothing can be signed. Bring it from where the \
         authority was made; if it is lost, `rohrpost keys rotate --authority {file}` begins anew, and then the same \
         without `--authority` for each other system of the installation",
        certificate = .0.display(), secret = .1.display(), file = .2.display()
    )]
    NoKey(PathBuf, PathBuf, PathBuf),
    #[error(
        "{secret} is not the key of {certificate}: they are of two authorities. Bring both from where one of them was \
         made, or `rohrpost keys rotate --authority {file}` begins anew",
        certificate = .0.display(), secret = .1.display(), file = .2.display()
    )]
    OtherKey(PathBuf, PathBuf, PathBuf),
    /// A file holds no valid key, or a certificate cannot be made.
    #[error("{0}: {1}")]
    Unfit(PathBuf, rcgen::Error),
}

/// Permissions of a file.
pub(super) const SECRET: u32 = 0o600;
pub(super) const PUBLIC: u32 = 0o644;

/// A file that will be written.
pub(super) struct Written {
    pub(super) path: PathBuf,
    pub(super) text: String,
    /// Permissions of the file.
    pub(super) mode: u32,
}

impl Written {
    /// The temporary name of the file.
    fn beside(&self) -> PathBuf {
        let mut beside = self.path.clone().into_os_string();
        beside.push(".new");
        beside.into()
    }

    /// Writes it under its temporary name. Nothing that has this name is touched: it may be a user's.
    fn write(&self) -> Result<(), CertificateError> {
        let (beside, failed) = (self.beside(), |error| CertificateError::File(self.path.clone(), error));
        let opened = OpenOptions::new().write(true).create_new(true).mode(self.mode).open(&beside);
        let mut file = opened.map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => KeysError::Left(beside.clone()).into(),
            _ => failed(error),
        })?;
        let written = file.write_all(self.text.as_bytes()).and_then(|()| file.sync_all());
        written.inspect_err(|_| _ = fs::remove_file(&beside)).map_err(failed)
    }
}

/// Moves the files into the folder in this order, after `before`; they replace older ones. If they cannot be written,
/// nothing changes.
pub(super) fn put(
    folder: &Path,
    files: &[Written],
    before: impl FnOnce() -> Result<(), CertificateError>,
) -> Result<(), CertificateError> {
    if files.is_empty() {
        return Ok(());
    }
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |error| CertificateError::File(path, error)
    };
    fs::create_dir_all(folder).map_err(failed(folder))?;
    let mut made = Vec::new();
    let written = files.iter().try_for_each(|file| {
        file.write()?;
        made.push(file.beside());
        Ok(())
    });
    written.and_then(|()| before()).inspect_err(|_| {
        for beside in made {
            let _ = fs::remove_file(beside);
        }
    })?;
    for file in files {
        fs::rename(file.beside(), &file.path).map_err(failed(&file.path))?;
    }
    // Otherwise a crash of the computer may lose the names.
    File::open(folder).and_then(|folder| folder.sync_all()).map_err(failed(folder))
}
