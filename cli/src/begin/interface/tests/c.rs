//! The header, compiled and run: bytes of Rust come back the same, and bytes that are none are refused.

use super::zoo;
use rohrpost::schema::Data;
use std::path::Path;
use std::process::Command;

/// Reads the file that Rust wrote, looks at some values, writes them again, and then reads each beginning of it, and
/// the whole with each byte changed, of which none may be read beyond its end: the compiler's sanitizers see it.
const PROGRAM: &str = r#"
#include "zoo.h"
#include "gripper.h"
#include <stdio.h>
#include <stdlib.h>

static _Alignas(16) uint8_t memory[1 << 16];

static int wrong(const char *what) {
    fprintf(stderr, "%s\n", what);
    return 1;
}

int main(int argc, char **argv) {
    uint8_t bytes[4096], again[4096];
    zoo_data_animals all;
    size_t length, used = 0, at;
    rp_code code;
    unsigned change;
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    if (file == NULL) {
        return wrong("no file");
    }
    length = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    code = zoo_data_animals_decode(&all, bytes, length, memory, sizeof memory);
    if (code != RP_OK) {
        return wrong(rp_code_text(code));
    }
    if (all.numbers.signed_.v3 != INT64_MIN || all.numbers.signed_.v1 != INT16_MIN || all.letter != 0x1f980
        || all.pair.v0 != -300 || all.orders.count != 6 || all.orders.items[4].as.turn.v0 != INT32_MAX
        || all.orders.items[5].tag != ZOO_ORDER_DRIVE || all.orders.items[5].as.drive.until.some != ZOO_LAMP_ON_FULL
        || all.name.length != 12 || memcmp(all.name.text, "Rohr\x1bpost", 9) != 0 || all.units.count != 3
        || all.lists.items[1].items[2] != INT16_MAX || all.class_ != 1 || all.from != -2 || all.odd_name != 4
        || all.odd_name_2 != 5 || all.numbers.huge.high != UINT64_MAX || all.nested.items[2].some.some != 9) {
        return wrong("other values");
    }
    if (zoo_data_animals_encode(&all, again, sizeof again, &used) != RP_OK || used != length
        || memcmp(bytes, again, length) != 0) {
        return wrong("other bytes");
    }
    if (zoo_data_animals_encode(&all, NULL, 0, &used) != RP_ROOM || used != length) {
        return wrong("it does not say how much room it needs");
    }
    if (zoo_data_animals_decode(&all, bytes, length, NULL, 0) != RP_ROOM) {
        return wrong("lists without memory");
    }
    for (at = 0; at < length; at++) {
        uint8_t *cut = (uint8_t *)malloc(at + 1);
        memcpy(cut, bytes, at);
        code = zoo_data_animals_decode(&all, cut, at, memory, sizeof memory);
        free(cut);
        if (code == RP_OK) {
            return wrong("a beginning is taken for the whole");
        }
    }
    for (at = 0; at < length; at++) {
        for (change = 1; change < 256; change++) {
            uint8_t *other = (uint8_t *)malloc(length);
            memcpy(other, bytes, length);
            other[at] = (uint8_t)(other[at] ^ change);
            if (zoo_data_animals_decode(&all, other, length, memory, sizeof memory) == RP_OK
                && (zoo_data_animals_encode(&all, again, sizeof again, &used) != RP_OK || used > length)) {
                return wrong("what was read is not written");
            }
            free(other);
        }
    }
    bytes[length] = 0;
    if (zoo_data_animals_decode(&all, bytes, length + 1, memory, sizeof memory) != RP_LONG) {
        return wrong("a byte too many");
    }
    printf("%08x %08x %zu\n", (unsigned)ZOO_HASH, (unsigned)GRIPPER_HASH, sizeof zoo_description);
    return 0;
}
"#;

fn compile(folder: &Path, program: &str, words: &[&str]) {
    let mut command = Command::new(program);
    command.args(words).args(["-Wall", "-Wextra", "-Werror", "-I"]).arg(super::folder());
    let said = command.current_dir(folder).output().unwrap();
    assert!(said.status.success(), "{program}: {}", String::from_utf8_lossy(&said.stderr));
}

#[test]
fn a_header_reads_and_writes_the_bytes_of_rust() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("main.c"), PROGRAM).unwrap();
    std::fs::write(place.path().join("main.cpp"), "#include \"zoo.h\"\n#include \"gripper.h\"\n").unwrap();
    compile(place.path(), "g++", &["-std=c++17", "-fsyntax-only", "main.cpp"]);
    let sanitized = ["-std=c11", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
    compile(place.path(), "gcc", &[&sanitized[..], &["main.c", "-o", "main"]].concat());
    let file = place.path().join("animals");
    std::fs::write(&file, bytes(&zoo::animals())).unwrap();
    let said = Command::new(place.path().join("main")).arg(&file).output().unwrap();
    let err = String::from_utf8_lossy(&said.stderr);
    let gripper = super::file::load(&super::python_folder().join("gripper.json")).unwrap();
    let zoo = zoo::description();
    let expected = format!("{:08x} {:08x} {}\n", zoo.hash(), gripper.hash(), zoo.to_bytes().len());
    assert_eq!(String::from_utf8_lossy(&said.stdout), expected, "{err}");
}

/// By serde and postcard, as a module sends it.
fn bytes(value: &impl Data) -> Vec<u8> {
    let mut bytes = Vec::new();
    rohrpost::wire::append(&mut bytes, value).unwrap();
    bytes
}
