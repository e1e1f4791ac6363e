//! The digests of `docs/src/wire.md` match the code's digests of the texts there.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_config::{Digest, Installation};
use siphasher::sip::SipHasher24;
use std::hash::Hasher;
use std::path::Path;

const PAGE: &str = include_str!("../../docs/src/wire.md");

/// The text of a block, with the end of its last line.
fn block(name: &str) -> &'static str {
    let begins = format!("```text {name}\n");
    let at = PAGE.find(&begins).unwrap_or_else(|| panic!("no ```text {name}")) + begins.len();
    &PAGE[at..at + PAGE[at..].find("```").unwrap()]
}

fn hash(text: &str) -> u64 {
    let mut hasher = SipHasher24::new();
    hasher.write(text.as_bytes());
    hasher.finish()
}

#[test]
fn the_common_digest_is_of_the_documented_text() {
    // The order in the file does not count, nor do texts.
    let file = "installation = \"page\"\n[system]\nname = \"page\"\nid = 1\n[classes]\nmotor = { id = 200, text = \
                \"Drives\" }\ntool = { id = 16 }\npilot = { id = 140 }\noutput = { id = 32 \
                }\n[nodes.main]\n[[module]]\nname = \"motor.0\"\nprogram = \"motor\"\n";
    let file = Installation::parse(file, Path::new("page.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let common = file.digest().common;
    assert_eq!(hash(block("digest-common")), common);
    assert!(PAGE.contains(&format!("With the end of the last line this is `{common:016x}`.")), "{common:016x}");
}

#[test]
fn the_digest_of_the_lan_is_of_the_documented_text() {
    let lan = Digest { common: 0x0123_4567_89ab_cdef, system: 0xfedc_ba98_7654_3210 }.lan();
    assert_eq!(hash(block("digest-lan")), lan);
    assert!(PAGE.contains(&format!("both digests in hexadecimal: `{lan:016x}`.")), "{lan:016x}");
}
