//! `rohrpost certify`: makes what the TCP router and the nodes of a system show each other, so that sessions are sealed and everyone is who he
//! says.

use super::check::load;
use super::{Failure, say};
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair, KeyUsagePurpose,
    date_time_ymd,
};
use rohrpost::config::Installation;
use rohrpost::mailbox::realtime_ns;
use rohrpost_routers::tcp::{AUTHORITY, Holder};
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

const DAY: Duration = Duration::from_secs(24 * 3600);
/// What the authority itself holds, days.
const AUTHORITY_DAYS: u32 = 3650;
/// Clocks of computers without a network are behind now and then.
const BEFORE: Duration = DAY;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost certify robot.toml
The first time it makes the authority of the installation, `ca.pem` and `ca.key`, in the folder that `certificates` of [tcp] names, and each time new \
certificates of all nodes of the file, and of the TCP router if one of them runs it. For another system of the installation, let its configuration name \
the same folder, or put both files into its own first. A node needs `ca.pem` and its own two files; whoever has `ca.key` can make more, so keep it off \
the robots. Old certificates hold until their time is over; for none of them to count any more, remove `ca.pem` and `ca.key` and begin anew.")]
pub(super) struct Arguments {
    /// Configuration of the system.
    file: PathBuf,
    /// They hold for so many days.
    #[arg(long, default_value_t = 730, value_parser = clap::value_parser!(u32).range(1..=3650))]
    days: u32,
}

/// Why there are no certificates.
#[derive(Debug, thiserror::Error)]
enum CertificateError {
    /// Nothing would use them.
    #[error("{0}: nothing here is sealed; write `security = \"tls\"` and `certificates = \"certificates\"` in [tcp]")]
    NotWanted(PathBuf),
    /// A file.
    #[error("{0}: {1}")]
    File(PathBuf, io::Error),
    /// Half of the authority.
    #[error(
        "{0} is there, and {1} is not: without it nothing can be signed. Bring it from where the authority was made, or remove {0} and \
         begin anew, with all systems of the installation"
    )]
    NoKey(PathBuf, PathBuf),
    /// What lies there is no key, or a certificate cannot be made.
    #[error("{0}: {1}")]
    Unfit(PathBuf, rcgen::Error),
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let installation = load(&arguments.file)?;
    for path in make(&installation, arguments.days)? {
        say(path.display());
    }
    Ok(ExitCode::SUCCESS)
}

/// Makes all that is needed; the files that are new.
fn make(installation: &Installation, days: u32) -> Result<Vec<PathBuf>, CertificateError> {
    let tcp = installation.tcp.as_ref();
    let Some((tcp, folder)) = tcp.and_then(|tcp| Some((tcp, installation.resolve(tcp.certificates.as_ref()?)))) else {
        return Err(CertificateError::NotWanted(installation.shown.clone()));
    };
    fs::create_dir_all(&folder).map_err(|error| CertificateError::File(folder.clone(), error))?;
    let (issuer, mut made) = authority(&folder, &installation.name)?;
    let system = installation.system.id;
    let nodes = installation.nodes.iter().map(|node| Holder::Node { node: node.name.clone(), system });
    for holder in nodes.chain(tcp.server.as_ref().map(|_| Holder::Router)) {
        made.extend(issue(&folder, &issuer, &holder, days)?);
    }
    Ok(made)
}

/// The authority that is there, or a new one and its files.
fn authority(folder: &Path, installation: &str) -> Result<(Issuer<'static, KeyPair>, Vec<PathBuf>), CertificateError> {
    let [certificate, secret] = ["pem", "key"].map(|end| folder.join(format!("{AUTHORITY}.{end}")));
    let unfit = |error| CertificateError::Unfit(secret.clone(), error);
    let mut params = CertificateParams::default();
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign];
    params.distinguished_name.push(DnType::CommonName, format!("Rohrpost installation {installation}"));
    hold(&mut params, AUTHORITY_DAYS);
    match fs::read_to_string(&secret) {
        Ok(text) => Ok((Issuer::new(params, KeyPair::from_pem(&text).map_err(unfit)?), Vec::new())),
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(CertificateError::File(secret, error)),
        Err(_) if certificate.exists() => Err(CertificateError::NoKey(certificate, secret)),
        Err(_) => {
            let key = KeyPair::generate().map_err(unfit)?;
            let signed = params.self_signed(&key).map_err(unfit)?;
            write(&secret, &key.serialize_pem(), SECRET)?;
            write(&certificate, &signed.pem(), PUBLIC)?;
            Ok((Issuer::new(params, key), vec![certificate, secret]))
        }
    }
}

/// A new key and certificate of a holder, which take the place of older ones.
fn issue(
    folder: &Path,
    issuer: &Issuer<'static, KeyPair>,
    holder: &Holder,
    days: u32,
) -> Result<[PathBuf; 2], CertificateError> {
    let [certificate, secret] = ["pem", "key"].map(|end| folder.join(format!("{}.{end}", holder.file_name())));
    let unfit = |error| CertificateError::Unfit(certificate.clone(), error);
    let key = KeyPair::generate().map_err(unfit)?;
    let mut params = CertificateParams::new([holder.dns_name()]).map_err(unfit)?;
    params.distinguished_name.push(DnType::CommonName, holder.dns_name());
    params.extended_key_usages = vec![match holder {
        Holder::Router => ExtendedKeyUsagePurpose::ServerAuth,
        Holder::Node { .. } => ExtendedKeyUsagePurpose::ClientAuth,
    }];
    hold(&mut params, days);
    let signed = params.signed_by(&key, issuer).map_err(unfit)?;
    write(&secret, &key.serialize_pem(), SECRET)?;
    write(&certificate, &signed.pem(), PUBLIC)?;
    Ok([certificate, secret])
}

/// From a little before now on.
fn hold(params: &mut CertificateParams, days: u32) {
    let now = date_time_ymd(1970, 1, 1) + Duration::from_nanos(realtime_ns());
    (params.not_before, params.not_after) = (now - BEFORE, now + days * DAY);
}

/// Who may read what.
const SECRET: u32 = 0o600;
const PUBLIC: u32 = 0o644;

/// Writes a file as a whole, or not at all.
fn write(path: &Path, text: &str, mode: u32) -> Result<(), CertificateError> {
    let unfinished = path.with_extension("new");
    let write = || {
        let _ = fs::remove_file(&unfinished);
        let mut file = OpenOptions::new().write(true).create_new(true).mode(mode).open(&unfinished)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        fs::rename(&unfinished, path)
    };
    write().map_err(|error| CertificateError::File(path.into(), error))
}
