//! Modules without Rust types beside tools with theirs: served, set, followed, read and filled in place.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod eye;
mod place;
mod seer;

use eye::{LOOK, WIDTH_BYTES};
use place::Place;
use rohrpost_modules::call::{CallError, Fault};
use rohrpost_modules::common::{SetParameters, State};
use rohrpost_modules::parameter::Refusal;
use rohrpost_modules::runtime::{StartError, describe};
use std::time::Duration;

#[test]
fn tools_take_it_for_a_module_like_any_other() {
    let place = Place::new("");
    place.start_eye();
    let (mut tool, eye) = (place.tool(), place.name("eye.0"));
    place.wait_until("it is on", || tool.status(eye).ok().filter(|status| status.state == State::On));
    let described = describe(&mut tool.link, eye, Duration::from_secs(10)).unwrap();
    assert_eq!(described, eye::description());
    let hash = described.hash();
    let mut call = |number: u16, arguments: &[u8]| {
        let write = |body: &mut Vec<u8>| {
            body.extend_from_slice(arguments);
            Ok(())
        };
        tool.call(eye, number, hash, write, |reply| Ok(reply.to_vec()))
    };
    assert_eq!(call(LOOK, &[7]).unwrap(), [7, 0xee], "arguments and what the module adds");
    let unknown = call(99, &[]);
    assert!(matches!(unknown, Err(CallError::Fault(_, Fault::Unknown(99)))), "{unknown:?}");
    let failed = call(LOOK, &[]);
    let text = "it sees nothing".to_owned();
    assert!(matches!(failed, Err(CallError::Fault(_, Fault::ModuleError(told))) if told == text));
    assert_eq!(tool.status(eye).unwrap().state, State::Error, "a failure puts it in error");
    tool.switch(eye, false).unwrap();
    tool.switch(eye, true).unwrap();
    assert_eq!(tool.status(eye).unwrap().state, State::On);
}

#[test]
fn parameters_are_configured_set_and_refused_as_those_with_types() {
    let place = Place::new("speed = 0.1, port = \"/dev/null\"");
    place.start_eye();
    let (mut tool, eye) = (place.tool(), place.name("eye.0"));
    place.wait_until("it is on", || tool.status(eye).ok().filter(|status| status.state == State::On));
    let page = tool.parameters(eye).unwrap();
    assert_eq!((page.len(), page[0].value.clone()), (1, 0.1_f64.to_le_bytes().to_vec()), "as configured");
    let mut set = |number: f64| {
        let values = vec![("speed".to_owned(), number.to_le_bytes().to_vec())];
        match tool.set_parameters(eye, &SetParameters { values, only_check: false }) {
            Err(CallError::Module(_, refusal)) => Some(refusal),
            set => set.map(|_| None).unwrap(),
        }
    };
    assert_eq!(set(0.15), None);
    assert!(matches!(set(0.3), Some(Refusal::Range { .. })));
    assert_eq!(set(0.2), Some(Refusal::Module("too fast".into())), "the module itself refuses this one");
    assert_eq!(tool.parameters(eye).unwrap()[0].value, 0.15_f64.to_le_bytes(), "the old value is put back");
}

#[test]
fn settings_that_it_does_not_have_end_the_start() {
    for (settings, told) in [
        ("spede = 0.1", "it has no setting `spede`; it has speed, port"),
        ("speed = 3.0", "`speed` is 3 m/s, out of range: 0..=0.2 m/s"),
    ] {
        let refused = Place::new(settings).run_eye().unwrap_err();
        assert!(matches!(&refused, StartError::Module { text, .. } if text.contains(told)), "{refused}");
        assert_eq!(refused.exit_code(), StartError::CONFIGURATION, "started again, it would end in the same way");
    }
}

#[test]
fn what_is_filled_in_place_is_followed_and_looked_at_where_it_lies() {
    let place = Place::new("");
    // It follows before the other one is there.
    let seen = place.start_seer();
    let (mut tool, seer) = (place.tool(), place.name("seer.0"));
    place.wait_until("it is on", || tool.status(seer).ok().filter(|status| status.state == State::On));
    place.start_eye();
    let mut records = Vec::new();
    for _ in 0..3 {
        records.push(seen.recv_timeout(place::PATIENCE).unwrap());
    }
    for seer::Seen { sequence, len, first, last, is_in_place, counted } in records {
        assert_eq!((len, first, last), (WIDTH_BYTES, sequence as u8, sequence as u8));
        assert!(is_in_place, "the bytes lie in the stream's memory");
        assert!(counted.is_some(), "the small stream has records, too");
    }
}
