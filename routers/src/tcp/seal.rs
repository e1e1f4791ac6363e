//! TLS 1.3 under a session, with certificates on both sides: eavesdroppers learn nothing, and each client has a
//! certificate of the installation. A certificate names its owner by its DNS name:
//!
//! ```text
//!  tcp-router.rohrpost          the TCP router
//!  base.system-1.rohrpost       node `base` of system 1: it may host names of that system, and of no other
//! ```

use rohrpost_config::{KeysError, open_secret};
use rustls::client::{Resumption, WebPkiServerVerifier};
use rustls::crypto::ring;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName, UnixTime};
use rustls::server::{NoServerSessionStorage, WebPkiClientVerifier};
use rustls::{
    AlertDescription, CertificateError, ClientConfig, Connection, Error, RootCertStore, ServerConfig, version,
};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Owner of these certificates.
const REALM: &str = "rohrpost";
const ROUTER: &str = "tcp-router";
const SYSTEM: &str = "system-";
/// The name of an authority begins with this.
pub const PREFIX: &str = "Rohrpost installation ";
/// The authority that has signed all of an installation.
pub const AUTHORITY: &str = "ca";
/// Plain and sealed bytes that a connection keeps until the socket takes them, at most.
const KEPT_BYTES: usize = 32 * 1024;

/// The end that shows a certificate.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Holder {
    /// The TCP router.
    Router,
    /// A node of a system.
    Node {
        /// Its name.
        node: String,
        /// First byte of the names that it may host.
        system: u8,
    },
}

impl Holder {
    /// The name in its certificate.
    pub fn dns_name(&self) -> String {
        match self {
            Self::Router => format!("{ROUTER}.{REALM}"),
            Self::Node { node, system } => format!("{node}.{SYSTEM}{system}.{REALM}"),
        }
    }

    /// What its files begin with.
    pub fn file_name(&self) -> String {
        match self {
            Self::Router => ROUTER.into(),
            Self::Node { node, system } => format!("{node}.{SYSTEM}{system}"),
        }
    }

    fn of(dns_name: &str) -> Option<Self> {
        let (node, system) = dns_name.strip_suffix(REALM)?.strip_suffix('.')?.split_once('.')?;
        Some(Self::Node { node: node.into(), system: system.strip_prefix(SYSTEM)?.parse().ok()? })
    }
}

/// Why certificates cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SealError {
    /// A file is not there, or holds something else.
    #[error("{0}: {1}; copy it from the first computer, where `rohrpost keys new` with the configuration makes it")]
    File(PathBuf, String),
    /// Others than its owner may read the key.
    #[error(transparent)]
    Open(#[from] KeysError),
    /// They do not belong together.
    #[error(
        "the certificates in {0} do not fit together: {1}; `rohrpost keys rotate` with the configuration makes new ones"
    )]
    Unfit(PathBuf, String),
}

/// The authority that signs the certificates of an installation.
pub struct Authority {
    /// What people call it.
    pub name: String,
    certificate: CertificateDer<'static>,
}

impl Authority {
    /// Reads its certificate.
    ///
    /// # Errors
    /// [`SealError::File`]
    pub fn load(path: &Path) -> Result<Self, SealError> {
        let pem = std::fs::read(path).map_err(|error| SealError::File(path.into(), error.to_string()))?;
        Self::read(path, &pem)
    }

    /// Reads what is in its certificate, or will be.
    ///
    /// # Errors
    /// [`SealError::File`]
    pub fn read(path: &Path, pem: &[u8]) -> Result<Self, SealError> {
        let bad = |error: &dyn std::fmt::Display| SealError::File(path.into(), error.to_string());
        let certificate = CertificateDer::from_pem_slice(pem).map_err(|error| bad(&error))?;
        let anchor = webpki::anchor_from_trusted_cert(&certificate).map_err(|error| bad(&error))?;
        // Its subject has one part, a common name, which is behind all that says so.
        let subject = String::from_utf8_lossy(&anchor.subject);
        let at = subject.find(PREFIX).ok_or_else(|| bad(&"it is no authority of Rohrpost's"))?;
        let name = subject[at..].into();
        Ok(Self { name, certificate })
    }

    /// Whether this public key is its own.
    pub fn has_key(&self, public: &[u8]) -> bool {
        webpki::anchor_from_trusted_cert(&self.certificate)
            .is_ok_and(|anchor| anchor.subject_public_key_info.ends_with(public))
    }

    /// Whether it has signed a certificate, which holds now.
    pub fn has_signed(&self, path: &Path) -> bool {
        let Ok(shown) = CertificateDer::from_pem_file(path) else { return false };
        let (Ok(shown), Ok(anchor)) =
            (webpki::EndEntityCert::try_from(&shown), webpki::anchor_from_trusted_cert(&self.certificate))
        else {
            return false;
        };
        let algorithms = ring::default_provider().signature_verification_algorithms.all;
        let (anchors, now) = ([anchor], UnixTime::now());
        let usages = [webpki::KeyUsage::client_auth(), webpki::KeyUsage::server_auth()];
        usages
            .into_iter()
            .any(|usage| shown.verify_for_usage(algorithms, &anchors, &[], now, usage, None, None).is_ok())
    }
}

/// Whether a certificate is about this public key.
pub fn is_about(certificate: &Path, public: &[u8]) -> bool {
    CertificateDer::from_pem_file(certificate).is_ok_and(|shown| {
        webpki::EndEntityCert::try_from(&shown).is_ok_and(|shown| shown.subject_public_key_info().ends_with(public))
    })
}

/// TLS configuration of a client.
#[derive(Clone, Debug)]
pub struct ClientSeal(Arc<ClientConfig>);

/// TLS configuration of the server.
#[derive(Clone, Debug)]
pub struct ServerSeal(Arc<ServerConfig>);

/// Files of one holder in the folder.
struct Files {
    folder: PathBuf,
    roots: Arc<RootCertStore>,
    chain: Vec<CertificateDer<'static>>,
    key: PrivateKeyDer<'static>,
}

impl Files {
    fn load(folder: &Path, holder: &Holder) -> Result<Self, SealError> {
        let path = |name: &str, end: &str| folder.join(format!("{name}.{end}"));
        let (authority, own, key) =
            (path(AUTHORITY, "pem"), path(&holder.file_name(), "pem"), path(&holder.file_name(), "key"));
        let certificate = |path: &Path| {
            CertificateDer::from_pem_file(path).map_err(|error| SealError::File(path.into(), error.to_string()))
        };
        let mut roots = RootCertStore::empty();
        let trusted = roots.add(certificate(&authority)?);
        trusted.map_err(|error| SealError::File(authority.clone(), error.to_string()))?;
        let file = open_secret(&key, |error| SealError::File(key.clone(), error.to_string()))?;
        let secret =
            PrivateKeyDer::from_pem_reader(file).map_err(|error| SealError::File(key.clone(), error.to_string()))?;
        Ok(Self { folder: folder.into(), roots: Arc::new(roots), chain: vec![certificate(&own)?], key: secret })
    }
}

impl ClientSeal {
    /// Reads the certificates of a node.
    ///
    /// # Errors
    /// [`SealError`]
    pub fn load(folder: &Path, holder: &Holder) -> Result<Self, SealError> {
        let Files { folder, roots, chain, key } = Files::load(folder, holder)?;
        let unfit = |error: &dyn std::fmt::Display| SealError::Unfit(folder.clone(), error.to_string());
        let provider = Arc::new(ring::default_provider());
        let verifier = WebPkiServerVerifier::builder_with_provider(roots, provider.clone()).build();
        let config = ClientConfig::builder_with_provider(provider)
            .with_protocol_versions(&[&version::TLS13])
            .map_err(|error| unfit(&error))?
            .with_webpki_verifier(verifier.map_err(|error| unfit(&error))?)
            .with_client_auth_cert(chain, key);
        let mut config = config.map_err(|error| unfit(&error))?;
        // A session that goes on where another ended would not look at certificates again.
        config.resumption = Resumption::disabled();
        Ok(Self(Arc::new(config)))
    }

    /// The seal of one connection.
    ///
    /// # Errors
    /// What TLS says.
    pub fn begin(&self) -> io::Result<Sealed> {
        let name = ServerName::try_from(Holder::Router.dns_name()).map_err(io::Error::other)?;
        let connection = rustls::ClientConnection::new(self.0.clone(), name).map_err(io::Error::other)?;
        Ok(Sealed::new(connection.into()))
    }
}

impl ServerSeal {
    /// Reads the certificates of the TCP router.
    ///
    /// # Errors
    /// [`SealError`]
    pub fn load(folder: &Path) -> Result<Self, SealError> {
        let Files { folder, roots, chain, key } = Files::load(folder, &Holder::Router)?;
        let unfit = |error: &dyn std::fmt::Display| SealError::Unfit(folder.clone(), error.to_string());
        let provider = Arc::new(ring::default_provider());
        let verifier = WebPkiClientVerifier::builder_with_provider(roots, provider.clone()).build();
        let config = ServerConfig::builder_with_provider(provider)
            .with_protocol_versions(&[&version::TLS13])
            .map_err(|error| unfit(&error))?
            .with_client_cert_verifier(verifier.map_err(|error| unfit(&error))?)
            .with_single_cert(chain, key);
        let mut config = config.map_err(|error| unfit(&error))?;
        // As for clients: each connection shows a certificate that holds.
        config.send_tls13_tickets = 0;
        config.session_storage = Arc::new(NoServerSessionStorage {});
        Ok(Self(Arc::new(config)))
    }

    pub(super) fn begin(&self) -> io::Result<Sealed> {
        let connection = rustls::ServerConnection::new(self.0.clone()).map_err(io::Error::other)?;
        Ok(Sealed::new(connection.into()))
    }
}

/// One sealed connection, without its socket.
#[derive(Debug)]
pub struct Sealed(Box<Connection>);

impl Sealed {
    fn new(mut connection: Connection) -> Self {
        connection.set_buffer_limit(Some(KEPT_BYTES));
        Self(Box::new(connection))
    }

    /// Whether bytes wait for the socket.
    pub(super) fn has_unsent(&self) -> bool {
        self.0.wants_write()
    }

    /// Hands on what waits, until the socket takes no more.
    pub(super) fn flush(&mut self, socket: &mut impl io::Write) -> io::Result<()> {
        while self.0.wants_write() {
            match self.0.write_tls(socket) {
                Ok(_) => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Takes bytes to be sealed, as long as the socket takes what was sealed before; how many. What was sealed together
    /// is opened together, and nothing goes before it: of a slow connection that is little.
    pub(super) fn write(&mut self, bytes: &[u8], together: usize, socket: &mut impl io::Write) -> io::Result<usize> {
        let mut taken = 0;
        self.flush(socket)?;
        while taken < bytes.len() && !self.0.wants_write() {
            let piece = &bytes[taken..bytes.len().min(taken + together)];
            let sealed = io::Write::write(&mut self.0.writer(), piece)?;
            if sealed == 0 {
                break;
            }
            taken += sealed;
            self.flush(socket)?;
        }
        if taken == 0 { Err(io::ErrorKind::WouldBlock.into()) } else { Ok(taken) }
    }

    /// Decrypts what the socket has. The loop ends, since TLS accepts only a few empty records.
    pub(super) fn read(&mut self, into: &mut [u8], socket: &mut (impl io::Read + io::Write)) -> io::Result<usize> {
        loop {
            match io::Read::read(&mut self.0.reader(), into) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                done => return done,
            }
            if self.0.read_tls(socket)? == 0 {
                return Ok(0);
            }
            let opened = self.0.process_new_packets();
            // What speaks against the other end is told to it, too.
            let flushed = self.flush(socket);
            opened.map_err(|error| io::Error::other(words(&error)))?;
            flushed?;
        }
    }

    /// Identity of the other end, by its certificate, as soon as that was shown and holds.
    pub(super) fn holder(&self) -> Option<Holder> {
        let shown = self.0.peer_certificates().filter(|_| !self.0.is_handshaking())?;
        let certificate = webpki::EndEntityCert::try_from(shown.first()?).ok()?;
        certificate.valid_dns_names().find_map(Holder::of)
    }
}

/// Why there is no sealed connection, and what would be right.
fn words(error: &Error) -> String {
    const NEW: &str = "make new ones with `rohrpost keys rotate`";
    const FOREIGN: &str =
        "another authority has signed it than `ca.pem` here: use the certificates of one installation at both ends";
    match error {
        Error::InvalidCertificate(CertificateError::Expired | CertificateError::ExpiredContext { .. }) => {
            format!("its certificate has expired; {NEW}")
        }
        Error::InvalidCertificate(CertificateError::NotValidYet | CertificateError::NotValidYetContext { .. }) => {
            "its certificate is not valid yet; \
                     is the date right at both ends?"
                .into()
        }
        Error::InvalidCertificate(CertificateError::UnknownIssuer | CertificateError::BadSignature) => {
            format!("its certificate is foreign: {FOREIGN}")
        }
        Error::InvalidCertificate(
            CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. },
        ) => {
            format!("its certificate is not that of a TCP router; {NEW}")
        }
        Error::InvalidCertificate(other) => format!("its certificate does not hold: {other:?}; {NEW}"),
        Error::NoCertificatesPresented => format!("it shows no certificate; {NEW}"),
        Error::PeerIncompatible(_) => "it speaks an older TLS than 1.3; run a newer version there".into(),
        Error::AlertReceived(alert) => match alert {
            // It says the same of one that does not hold yet.
            AlertDescription::CertificateExpired => {
                format!(
                    "it refuses this end's certificate as expired, or not valid yet; \
                     is the date right at both ends? If so, {NEW}"
                )
            }
            AlertDescription::UnknownCA | AlertDescription::DecryptError => {
                format!("it refuses this end's certificate as foreign: {FOREIGN}")
            }
            AlertDescription::CertificateRequired => format!("it demands a certificate; {NEW}"),
            AlertDescription::ProtocolVersion => "it refuses this end's version of TLS; both need 1.3".into(),
            AlertDescription::BadCertificate | AlertDescription::CertificateUnknown => {
                format!("it refuses this end's certificate; {NEW}")
            }
            other => format!("it ended TLS with {other:?}"),
        },
        Error::InvalidMessage(_) => "it does not speak TLS; write the same `security` in [tcp] at both ends".into(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests;
