//! Sealed sessions: a client with the right certificate takes part, and each other end learns why it does not.

use crate::ground::{Router, System, address, module, two, wait};
use rcgen::{CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair, date_time_ymd};
use rohrpost_mailbox::Name;
use rohrpost_routers::session::frame::Range;
use rohrpost_routers::tcp::{AUTHORITY, ClientSeal, Holder, LinkState, SealError, ServerSeal};
use std::collections::BTreeMap;
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use tempfile::TempDir;

/// When a certificate holds.
#[derive(Clone, Copy)]
pub(crate) enum Holds {
    Now,
    UntilLongAgo,
    NotYet,
}

/// An authority of its own, with a folder of certificates.
pub(crate) struct Authority {
    folder: TempDir,
    issuer: Issuer<'static, KeyPair>,
}

impl Authority {
    pub(crate) fn new() -> Self {
        let (folder, key) = (tempfile::tempdir().unwrap(), KeyPair::generate().unwrap());
        let mut params = CertificateParams::default();
        params.is_ca = IsCa::Ca(rcgen::BasicConstraints::Unconstrained);
        params.distinguished_name.push(DnType::CommonName, "test");
        let certificate = params.self_signed(&key).unwrap();
        std::fs::write(folder.path().join(format!("{AUTHORITY}.pem")), certificate.pem()).unwrap();
        let authority = Self { issuer: Issuer::new(params, key), folder };
        authority.issue(&Holder::Router, Holds::Now);
        authority
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }

    fn issue(&self, holder: &Holder, holds: Holds) {
        self.issue_as(holder, &holder.dns_name(), holds);
    }

    /// The owner of these files, and what the certificate says.
    fn issue_as(&self, holder: &Holder, dns_name: &str, holds: Holds) {
        let (key, mut params) = (KeyPair::generate().unwrap(), CertificateParams::new([dns_name.to_owned()]).unwrap());
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth, ExtendedKeyUsagePurpose::ServerAuth];
        match holds {
            Holds::Now => {}
            Holds::UntilLongAgo => params.not_after = date_time_ymd(2020, 1, 1),
            Holds::NotYet => params.not_before = date_time_ymd(2200, 1, 1),
        }
        let certificate = params.signed_by(&key, &self.issuer).unwrap();
        let file = |end: &str| self.path().join(format!("{}.{end}", holder.file_name()));
        std::fs::write(file("pem"), certificate.pem()).unwrap();
        std::fs::write(file("key"), key.serialize_pem()).unwrap();
        std::fs::set_permissions(file("key"), Permissions::from_mode(0o600)).unwrap();
    }

    /// What a node of a system begins its connections with.
    pub(crate) fn seal(&self, system: u8, holds: Holds) -> ClientSeal {
        let holder = holder(system);
        self.issue(&holder, holds);
        ClientSeal::load(self.path(), &holder).unwrap()
    }

    /// What the TCP router begins its connections with.
    pub(crate) fn server(&self) -> ServerSeal {
        ServerSeal::load(self.path()).unwrap()
    }

    fn router(&self) -> Router {
        Router::at(address(), Some(self.server()))
    }

    /// A client that trusts this authority, with a certificate of another.
    pub(crate) fn forged(&self, system: u8) -> ClientSeal {
        let foreign = Self::new();
        foreign.issue(&holder(system), Holds::Now);
        std::fs::copy(self.path().join("ca.pem"), foreign.path().join("ca.pem")).unwrap();
        ClientSeal::load(foreign.path(), &holder(system)).unwrap()
    }
}

/// What a node of a system begins its connections with, if there is an authority.
pub(crate) fn seal(authority: Option<&Authority>, system: u8) -> Option<ClientSeal> {
    authority.map(|authority| authority.seal(system, Holds::Now))
}

fn holder(system: u8) -> Holder {
    Holder::Node { node: "base".into(), system }
}

#[test]
fn a_client_with_a_certificate_takes_part_under_the_name_in_it() {
    let authority = Authority::new();
    let server = authority.router();
    let (one, mut two) = two(server.address, Some(&authority));
    let mut sender = one.sender(2);
    for number in 0..50 {
        one.say(&mut sender, number);
        assert_eq!(two.hear_within("a package"), number);
    }
    let names = || server.members().members.into_iter().map(|member| member.name).collect::<Vec<_>>();
    wait("names of certificates", || names().contains(&"node base of system 2".to_owned()).then_some(()));
}

#[test]
fn what_is_wrong_with_a_certificate_is_told_to_its_owner() {
    let authority = Authority::new();
    let server = authority.router();
    let other_system = {
        authority.issue(&holder(7), Holds::Now);
        ClientSeal::load(authority.path(), &holder(7)).unwrap()
    };
    let nobody = {
        authority.issue_as(&holder(8), "base.example", Holds::Now);
        ClientSeal::load(authority.path(), &holder(8)).unwrap()
    };
    // What the client says, and what the server says.
    for (seal, words, said, what) in [
        (Some(authority.seal(3, Holds::UntilLongAgo)), "expired", "has expired", "an expired one"),
        (
            Some(authority.seal(3, Holds::NotYet)),
            "as expired, or not valid yet; is the date right at both ends?",
            "not valid yet",
            "one of the future",
        ),
        (Some(authority.forged(9)), "foreign", "is foreign", "one of another authority"),
        (Some(other_system), "certificate is of system 7", "certificate is of system 7", "one of another system"),
        (Some(nobody), "does not fit: it names no node", "certificate: it names no node", "one that names no node"),
        (None, "it speaks TLS; write the same `security`", "does not speak TLS", "none, and no TLS"),
    ] {
        let client = System::sealed(3, "three", server.address, seal);
        let link = wait(what, || Some(client.client.link()).filter(|link| link.why.contains(words)));
        assert_ne!(link.state, LinkState::Up, "{what}");
        wait(&format!("the server says {said}"), || server.members().refusal.contains(said).then_some(()));
    }
    assert!(server.members().members.iter().all(|member| !member.is_member));
}

#[test]
fn a_client_that_seals_at_a_tcp_router_that_does_not_is_told_so_at_both_ends() {
    let server = Router::start();
    let client = System::sealed(1, "one", server.address, seal(Some(&Authority::new()), 1));
    wait("the client says it", || client.client.link().why.contains("does not speak TLS").then_some(()));
    wait("the server says it", || server.members().refusal.contains("it speaks TLS; write the same").then_some(()));
}

#[test]
fn a_certificate_of_the_own_system_hosts_what_its_file_gives_that_node_and_no_more() {
    let authority = Authority::new();
    let others = [Range::module(Name::new(1, 101, 0, 0))];
    let with = |ranges: &[Range]| Some(BTreeMap::from([("base".to_owned(), ranges.iter().copied().collect())]));
    let mut server = Router::of(address(), Some(authority.server()), with(&others));
    let [one, two] = [(1, "one"), (2, "two")]
        .map(|(system, name)| System::sealed(system, name, server.address, seal(Some(&authority), system)));
    wait("why", || one.client.link().why.contains("or of its node").then_some(()));
    // Of another system it knows nothing.
    two.wait_up();
    assert!(one.client.link().state != LinkState::Up);
    server.end();
    // That it went away is told, and when it is there again what it says.
    wait("away", || one.client.link().why.contains("is not reached").then_some(()));
    server.begin_again(with(&others));
    wait("why again", || one.client.link().why.contains("or of its node").then_some(()));
    server.end();
    server.begin_again(with(&[Range::module(module(1)), others[0]]));
    one.wait_up();
}

#[test]
fn a_server_of_another_installation_is_not_believed() {
    let (authority, foreign) = (Authority::new(), Authority::new());
    let client_of = |server: &Router| System::sealed(1, "one", server.address, seal(Some(&authority), 1));
    let server = foreign.router();
    let client = client_of(&server);
    wait("why", || client.client.link().why.contains("its certificate is foreign").then_some(()));
    // A node's certificate makes nobody a server.
    authority.issue_as(&Holder::Router, "base.system-1.rohrpost", Holds::Now);
    let server = authority.router();
    let client = client_of(&server);
    wait("why", || client.client.link().why.contains("not that of a TCP router").then_some(()));
}

#[test]
fn a_key_that_others_may_read_is_refused() {
    let authority = Authority::new();
    drop(authority.seal(4, Holds::Now));
    let key = authority.path().join("base.system-4.key");
    std::fs::set_permissions(&key, Permissions::from_mode(0o640)).unwrap();
    let error = ClientSeal::load(authority.path(), &holder(4)).unwrap_err().to_string();
    assert!(error.contains("mode 640") && error.contains(&format!("chmod 600 {}", key.display())), "{error}");
}

#[test]
fn files_that_are_not_there_are_named() {
    let authority = Authority::new();
    let error = ClientSeal::load(authority.path(), &holder(4)).unwrap_err();
    assert!(
        matches!(&error, SealError::File(path, _)
            if path.ends_with("base.system-4.pem") || path.ends_with("base.system-4.key")),
        "{error}"
    );
    assert!(error.to_string().contains("`rohrpost keys "), "{error}");
}
