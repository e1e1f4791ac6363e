//! Owners of certificates, and a client that sends sealed empty records without end.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use super::*;
use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};
use rustls::crypto::cipher::{MessageEncrypter, OutboundChunks, OutboundPlainMessage};
use rustls::{ConnectionTrafficSecrets, ContentType, ProtocolVersion, SupportedCipherSuite};
use std::collections::VecDeque;
use std::os::unix::fs::PermissionsExt;

#[test]
fn a_certificate_names_its_owner() {
    let base = Holder::Node { node: "base".into(), system: 7 };
    assert_eq!(base.dns_name(), "base.system-7.rohrpost");
    assert_eq!(Holder::of(&base.dns_name()), Some(base));
    for name in
        ["tcp-router.rohrpost", "base.system-7.example", "base.system-x.rohrpost", "base.system-256.rohrpost", ""]
    {
        assert_eq!(Holder::of(name), None, "{name}");
    }
}
/// One end of a connection: what came, and what leaves.
#[derive(Default)]
struct Pipe {
    came: VecDeque<u8>,
    leaves: Vec<u8>,
}

impl io::Read for Pipe {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.came.is_empty() { Err(io::ErrorKind::WouldBlock.into()) } else { self.came.read(into) }
    }
}

impl io::Write for Pipe {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.leaves.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A folder with certificates of the TCP router and of a node.
fn certificates(node: &Holder) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (key, mut params) = (KeyPair::generate().unwrap(), CertificateParams::default());
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    std::fs::write(folder.path().join("ca.pem"), params.self_signed(&key).unwrap().pem()).unwrap();
    let issuer = Issuer::new(params, key);
    for holder in [&Holder::Router, node] {
        let (key, params) = (KeyPair::generate().unwrap(), CertificateParams::new([holder.dns_name()]).unwrap());
        let file = |end: &str| folder.path().join(format!("{}.{end}", holder.file_name()));
        std::fs::write(file("pem"), params.signed_by(&key, &issuer).unwrap().pem()).unwrap();
        std::fs::write(file("key"), key.serialize_pem()).unwrap();
        std::fs::set_permissions(file("key"), std::fs::Permissions::from_mode(0o600)).unwrap();
    }
    folder
}

/// Seals by itself what a client says, whatever that is.
struct Says {
    sealer: Box<dyn MessageEncrypter>,
    sequence: u64,
}

impl Says {
    fn of(Sealed(client): Sealed) -> Self {
        let Some(SupportedCipherSuite::Tls13(suite)) = client.negotiated_cipher_suite() else { panic!("TLS 1.3") };
        let (sequence, secrets) = client.dangerous_extract_secrets().unwrap().tx;
        let (key, iv) = match secrets {
            ConnectionTrafficSecrets::Aes128Gcm { key, iv }
            | ConnectionTrafficSecrets::Aes256Gcm { key, iv }
            | ConnectionTrafficSecrets::Chacha20Poly1305 { key, iv } => (key, iv),
            _ => panic!("a cipher of TLS 1.3"),
        };
        Self { sealer: suite.aead_alg.encrypter(key, iv), sequence }
    }

    /// A record with these bytes in it.
    fn record(&mut self, bytes: &[u8]) -> Vec<u8> {
        let plain = OutboundPlainMessage {
            typ: ContentType::ApplicationData,
            version: ProtocolVersion::TLSv1_2,
            payload: OutboundChunks::Single(bytes),
        };
        let sealed = self.sealer.encrypt(plain, self.sequence).unwrap();
        self.sequence += 1;
        sealed.encode()
    }
}

#[test]
fn endless_empty_records_are_refused() {
    let node = Holder::Node { node: "base".into(), system: 7 };
    let folder = certificates(&node);
    let mut seal = ClientSeal::load(folder.path(), &node).unwrap();
    Arc::make_mut(&mut seal.0).enable_secret_extraction = true;
    let mut ends = [
        (seal.begin().unwrap(), Pipe::default()),
        (ServerSeal::load(folder.path()).unwrap().begin().unwrap(), Pipe::default()),
    ];
    let carry = |ends: &mut [(Sealed, Pipe); 2]| {
        for at in 0..2 {
            let (sealed, pipe) = &mut ends[at];
            sealed.flush(pipe).unwrap();
            let said = std::mem::take(&mut pipe.leaves);
            ends[1 - at].1.came.extend(said);
        }
    };
    let mut nothing = [0; 100];
    for _ in 0..4 {
        carry(&mut ends);
        for (sealed, pipe) in &mut ends {
            let nothing = sealed.read(&mut nothing, pipe).unwrap_err();
            assert_eq!(nothing.kind(), io::ErrorKind::WouldBlock);
        }
    }
    assert_eq!(ends[1].0.holder(), Some(node), "they know each other");
    let [(client, _), (mut sealed, mut pipe)] = ends;
    let mut says = Says::of(client);
    pipe.came.extend(says.record(b""));
    pipe.came.extend(says.record(b"word"));
    assert_eq!(sealed.read(&mut nothing, &mut pipe).unwrap(), 4, "some are not refused");
    for _ in 0..10_000 {
        pipe.came.extend(says.record(b""));
    }
    let refused = sealed.read(&mut nothing, &mut pipe).unwrap_err();
    assert_eq!((refused.kind(), pipe.came.is_empty()), (io::ErrorKind::Other, false), "{refused}");
}
