//! Source and destination of an IP packet, version 4 or 6, if its header agrees with its length.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

const V4_HEAD_BYTES: usize = 20;
const V6_HEAD_BYTES: usize = 40;

/// Where a packet says that it comes from and goes to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Addresses {
    /// The source.
    pub source: IpAddr,
    /// The destination.
    pub destination: IpAddr,
}

impl Addresses {
    /// Reads a packet; none if it is of another version, shorter than its header says, or of another length than it
    /// says.
    pub fn of(packet: &[u8]) -> Option<Self> {
        match packet.first()? >> 4 {
            4 => Self::of_v4(packet),
            6 => Self::of_v6(packet),
            _ => None,
        }
    }

    fn of_v4(packet: &[u8]) -> Option<Self> {
        let head: &[u8; V4_HEAD_BYTES] = packet.first_chunk()?;
        let head_bytes = usize::from(head[0] & 0x0f) * 4;
        let is_whole = (V4_HEAD_BYTES..=packet.len()).contains(&head_bytes)
            && usize::from(u16::from_be_bytes([head[2], head[3]])) == packet.len();
        let address = |at: usize| Ipv4Addr::new(head[at], head[at + 1], head[at + 2], head[at + 3]).into();
        is_whole.then(|| Self { source: address(12), destination: address(16) })
    }

    fn of_v6(packet: &[u8]) -> Option<Self> {
        let (head, rest) = packet.split_first_chunk::<V6_HEAD_BYTES>()?;
        let is_whole = usize::from(u16::from_be_bytes([head[4], head[5]])) == rest.len();
        let address = |at: usize| {
            let bytes: [u8; 16] = std::array::from_fn(|index| head[at + index]);
            Ipv6Addr::from(bytes).into()
        };
        is_whole.then(|| Self { source: address(8), destination: address(24) })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A packet of version 4 without options.
    pub(crate) fn v4(source: Ipv4Addr, destination: Ipv4Addr, payload: &[u8]) -> Vec<u8> {
        let mut packet = vec![0; V4_HEAD_BYTES];
        packet[0] = 0x45;
        packet[2..4].copy_from_slice(&((V4_HEAD_BYTES + payload.len()) as u16).to_be_bytes());
        packet[12..16].copy_from_slice(&source.octets());
        packet[16..20].copy_from_slice(&destination.octets());
        [packet, payload.to_vec()].concat()
    }

    fn v6(payload: &[u8]) -> Vec<u8> {
        let mut packet = vec![0; V6_HEAD_BYTES];
        packet[0] = 0x60;
        packet[4..6].copy_from_slice(&(payload.len() as u16).to_be_bytes());
        (packet[23], packet[39]) = (1, 2);
        [packet, payload.to_vec()].concat()
    }

    #[test]
    fn only_a_packet_with_a_header_that_agrees_with_its_length_has_addresses() {
        let (one, two) = (Ipv4Addr::new(10, 78, 0, 1), Ipv4Addr::new(10, 78, 0, 2));
        let whole = v4(one, two, b"payload");
        let changed = |at: usize, byte: u8| {
            let mut packet = whole.clone();
            packet[at] = byte;
            packet
        };
        let mut options = v4(one, two, &[0; 4]);
        options[0] = 0x46;
        let both = Some(Addresses { source: one.into(), destination: two.into() });
        let last = |byte: u8| IpAddr::from(Ipv6Addr::new(0, 0, 0, 0, 0, 0, 0, byte.into()));
        for (packet, addresses, why) in [
            (whole.clone(), both, "version 4"),
            (options, both, "with options"),
            (changed(0, 0x44), None, "a header shorter than the shortest"),
            (changed(0, 0x4f), None, "a header longer than the packet"),
            (changed(0, 0x55), None, "no version that there is"),
            (changed(3, 26), None, "shorter than it is"),
            (whole[..26].to_vec(), None, "cut short"),
            ([&whole[..], &[0]].concat(), None, "with something behind it"),
            (whole[..19].to_vec(), None, "no whole header"),
            (Vec::new(), None, "nothing"),
            (v6(b"payload"), Some(Addresses { source: last(1), destination: last(2) }), "version 6"),
            (v6(b"payload")[..46].to_vec(), None, "of version 6, cut short"),
            (v6(b"")[..39].to_vec(), None, "no whole header of version 6"),
        ] {
            assert_eq!(Addresses::of(&packet), addresses, "{why}");
        }
    }

    proptest! {
        #[test]
        fn whatever_comes_is_read_without_harm(packet: Vec<u8>) {
            let _ = Addresses::of(&packet);
        }
    }
}
