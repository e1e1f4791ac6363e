//! The robot that a message names as its sender.

use rohrpost_team::RobotId;

/// Reads the sender of a message; `None` if the bytes are too short, or of no kind that teammates send.
pub fn sender(message: &[u8]) -> Option<RobotId> {
    // A hello has its flags before the sender.
    let at = match message.first()? {
        b'H' => 3,
        b'R' | b'E' | b'T' => 2,
        _ => return None,
    };
    message.get(at).and_then(|id| RobotId::new(*id))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ground, Payload, Settings};
    use std::sync::Arc;

    #[test]
    fn each_kind_of_message_tells_its_sender() {
        let map = b"rohrpost-map 1\ncell_m 1\nmap\n#####\n#   #\n#####\n";
        let ground = Arc::new(Ground::read(map, None, 0.25).unwrap());
        let (settings, me) = (Settings::default(), RobotId::new(7).unwrap());
        let team = settings.team(500_000_000, 3_750_000_000);
        let mut payload = Payload::new(0, me, 1, ground, settings, team, 1).unwrap();
        payload.say(0, "here".into());
        (1..20).for_each(|beat| payload.beat(beat * 500_000_000));
        let messages = payload.take_messages();
        let kinds: Vec<u8> = messages.iter().map(|message| message[0]).collect();
        assert!(kinds.contains(&b'H') && kinds.contains(&b'E'), "{kinds:?}");
        assert!(messages.iter().all(|message| sender(message) == Some(me)));
        for none in [&b""[..], b"H", b"H\x01\x07", b"X\x01\x07\x07", b"T\x01\x00"] {
            assert_eq!(sender(none), None, "{none:?}");
        }
    }
}
