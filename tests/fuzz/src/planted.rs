//! A mistake that a coverage-guided fuzzer finds in seconds; a blind one would need some 2^40 tries.

pub(crate) fn run(data: &[u8]) {
    let mut rest = data;
    for expected in b"rohr!" {
        match rest.split_first() {
            Some((byte, after)) if byte == expected => rest = after,
            _ => return,
        }
    }
    panic!("planted: the fuzzer has found it");
}
