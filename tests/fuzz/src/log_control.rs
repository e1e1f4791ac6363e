//! Log control: what a connection says to a recorder, divided in any way. Each line is a command that reads back as the
//! same, or is told what is wrong with it, in one line of ASCII; and nothing is read behind that.

use crate::split::Bytes;
use rohrpost_recording::{CONTROL_LINE_BYTES_MAX, ControlAnswer, ControlCommand, ControlError, ControlLines};

type Told = Result<ControlCommand, ControlError>;

pub(crate) fn run(data: &[u8]) {
    let mut input = Bytes(data);
    // How many bytes come at a time, in turn.
    let parts = [input.half(), input.half(), input.byte().into()];
    let said = input.0;
    let at_once = read(said, &[usize::MAX]);
    let parts = parts.map(|part| usize::from(part) % 2000 + 1);
    assert_eq!(read(said, &parts), at_once, "in parts of {parts:?}");
    let lines = said.iter().filter(|byte| **byte == b'\n').count();
    assert!(at_once.len() <= lines + 1, "one answer a line, and one for a last line without end");
    assert!(at_once.iter().rev().skip(1).all(Result::is_ok), "nothing is obeyed behind what is no command");
    at_once.iter().for_each(check);
}

fn read(mut said: &[u8], parts: &[usize]) -> Vec<Told> {
    let (mut lines, mut told) = (ControlLines::default(), Vec::new());
    for part in parts.iter().cycle() {
        if said.is_empty() {
            break;
        }
        let taken = lines.put(&said[..said.len().min(*part)]);
        said = &said[taken..];
        told.extend(std::iter::from_fn(|| lines.next_command()));
        assert!((1..=CONTROL_LINE_BYTES_MAX).contains(&lines.room()), "memory is bounded, and more can come");
    }
    told
}

fn check(told: &Told) {
    let answer = match told {
        Ok(command) => {
            assert_eq!(command.to_string().parse().as_ref(), Ok(command));
            ControlAnswer::ok().with_text("said", &command.to_string())
        }
        Err(error) => ControlAnswer::err(error),
    };
    let line = answer.line();
    assert!(line.bytes().all(|byte| matches!(byte, b' '..=b'~')), "{line:?}");
    assert_eq!((line.starts_with("OK "), line.starts_with("ERR ")), (told.is_ok(), told.is_err()));
    assert!(line.len() <= 6 * CONTROL_LINE_BYTES_MAX, "{line:?}");
    if let Ok(command) = told {
        let quoted = line.split_once("said=").map(|(_, quoted)| quoted);
        let said: Option<String> = quoted.and_then(|quoted| serde_json::from_str(quoted).ok());
        assert_eq!(said, Some(command.to_string()));
    }
}
