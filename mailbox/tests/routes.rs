//! Names on other nodes: what is here goes before any route, and what is not goes to the router's mailbox, address and
//! all.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, HIGH, LOW, MAILBOX, PATIENCE, label, shape, stay, tell};
use rohrpost_mailbox::{Name, Receiver, SendError, Sender, Shape, local};

/// The mailbox of the router, and a name that it leads to.
const TRANSIT: Name = Name::new(1, 250, 0, local::TRANSIT);
const FAR: Name = Name::new(1, 199, 0, 0);

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    match role.as_str() {
        "router" => {
            let _transit = transit(&ground);
            tell("there");
            stay();
        }
        "sender" => {
            let mut sender = ground.join().sender(FAR).unwrap();
            (0..10).for_each(|id| sender.send(&label(LOW, id), &[b"from afar"]).unwrap());
            sender.send(&label(HIGH, 10), &[b"first"]).unwrap();
            tell("sent");
            stay();
        }
        other => panic!("no role {other}"),
    }
}

fn transit(ground: &Ground) -> Receiver {
    ground.join().receiver(TRANSIT, Shape { claims: 255, ..shape(16) }).unwrap()
}

/// A node from which `FAR`, and all else of its module, is reached through the router.
fn routed() -> Ground {
    let ground = Ground::new();
    ground.node().set_routes(TRANSIT, &[(FAR, FAR.with_local(255))]).unwrap();
    ground
}

fn send(sender: &mut Sender, id: u16) {
    sender.send(&label(LOW, id), &[b"some", b"thing"]).unwrap();
}

#[test]
fn a_routed_package_comes_to_the_router_as_it_was_sent() {
    let ground = routed();
    let mut transit = transit(&ground);
    let mut sender = ground.join().sender(FAR).unwrap();
    assert_eq!(sender.name(), FAR);
    send(&mut sender, 7);
    let mut loan = sender.loan(HIGH).unwrap();
    loan.body()[..4].copy_from_slice(b"lent");
    loan.send(&label(HIGH, 8), 4).unwrap();
    let first = transit.receive_timeout(PATIENCE).unwrap();
    assert_eq!((first.head().to, first.head().id, first.body()), (FAR, 8, &b"lent"[..]));
    drop(first);
    let second = transit.receive_timeout(PATIENCE).unwrap();
    assert_eq!((second.head().to, second.head().id, second.body()), (FAR, 7, &b"something"[..]));
    drop(second);
    // A reader of what is sent sees which name it is for.
    let flows = ground.node().traffic();
    assert!(flows.iter().all(|flow| flow.to == FAR) && !flows.is_empty());
}

/// A module that sends to each mailbox of another node has the router's mailbox in its memory once, and each of its own
/// node's once.
#[test]
fn a_mailbox_is_mapped_once_however_many_send_there() {
    let ground = routed();
    let mut transit = transit(&ground);
    let mappings = |name: Name| {
        let file = format!("{}/{:08x}.mbx", ground.node().path().display(), name.raw());
        let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
        maps.lines().filter(|line| line.ends_with(&file)).count()
    };
    // The receiver's own.
    assert_eq!(mappings(TRANSIT), 1);
    let me = ground.join();
    let mut senders: Vec<Sender> = (0..200).map(|local| me.sender(FAR.with_local(local)).unwrap()).collect();
    senders.push(ground.join().sender(FAR).unwrap());
    assert_eq!(mappings(TRANSIT), 2);
    for (id, sender) in (0..).zip(&mut senders) {
        send(sender, id);
        let received = transit.receive_timeout(PATIENCE).unwrap();
        assert_eq!((received.head().id, received.head().to), (id, sender.name()));
    }
    drop(senders.split_off(1));
    send(&mut senders[0], 7);
    assert_eq!(mappings(TRANSIT), 2, "as long as one sends there");
    drop(senders);
    assert_eq!(mappings(TRANSIT), 1);
    send(&mut me.sender(FAR).unwrap(), 8);
}

#[test]
fn a_mailbox_of_this_node_goes_before_any_route() {
    let ground = routed();
    let mut transit = transit(&ground);
    let mut here = ground.join().receiver(FAR, shape(4)).unwrap();
    send(&mut ground.join().sender(FAR).unwrap(), 1);
    assert_eq!(here.receive_timeout(PATIENCE).unwrap().head().id, 1);
    assert!(transit.try_receive().is_none());
}

#[test]
fn a_name_without_mailbox_and_route_is_no_mailbox() {
    let (ground, elsewhere) = (routed(), Name::new(1, 199, 1, 0));
    let _transit = transit(&ground);
    assert!(matches!(ground.join().sender(elsewhere), Err(SendError::NoMailbox(name)) if name == elsewhere));
    assert!(matches!(ground.join().sender(MAILBOX), Err(SendError::NoMailbox(MAILBOX))));
}

#[test]
fn without_a_router_the_sender_is_told_which_one_is_missing() {
    let ground = routed();
    let error = ground.join().sender(FAR).err().unwrap();
    assert!(matches!(error, SendError::NoRouter { name: FAR, router: TRANSIT }));
    let text =
        "mailbox 1.199.0.0 is on another node, and the router that leads there, 1.250.0.3, does not run; start it";
    assert_eq!(error.to_string(), text);

    let transit = transit(&ground);
    let mut sender = ground.join().sender(FAR).unwrap();
    transit.close();
    let sent = sender.send(&label(LOW, 1), &[]);
    assert!(matches!(sent, Err(SendError::NoRouter { name: FAR, router: TRANSIT })), "also when it went");
    let mut transit = self::transit(&ground);
    send(&mut sender, 2);
    assert_eq!(transit.receive_timeout(PATIENCE).unwrap().head().id, 2, "and finds the next one by itself");
}

#[test]
fn packages_in_transit_outlive_a_killed_router_and_their_killed_sender() {
    let ground = routed();
    let router = ground.start("router");
    assert_eq!(router.hear(), "there");
    let sender = ground.start("sender");
    assert_eq!(sender.hear(), "sent");
    let mut other = ground.join().sender(FAR).unwrap();
    router.kill();
    sender.kill();
    send(&mut other, 11);
    let mut next = transit(&ground);
    send(&mut other, 12);
    for id in [10, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12] {
        let package = next.receive_timeout(PATIENCE).unwrap();
        assert_eq!((package.head().to, package.head().id), (FAR, id));
    }
    assert!(next.try_receive().is_none());
}

#[test]
fn a_name_that_comes_here_later_is_found_and_one_that_goes_is_routed() {
    let ground = routed();
    let mut transit = transit(&ground);
    let mut sender = ground.join().sender(FAR).unwrap();
    send(&mut sender, 1);
    let mut here = ground.join().receiver(FAR, shape(4)).unwrap();
    send(&mut sender, 2);
    drop(sender.loan(LOW).unwrap());
    send(&mut sender, 3);
    here.close();
    send(&mut sender, 4);
    here = ground.join().receiver(FAR, shape(4)).unwrap();
    send(&mut sender, 5);
    let ids = |mailbox: &mut Receiver| {
        std::iter::from_fn(|| mailbox.try_receive().map(|package| package.head().id)).collect::<Vec<_>>()
    };
    assert_eq!((ids(&mut transit), ids(&mut here)), (vec![1, 4], vec![5]), "2 and 3 were lost with their mailbox");
}

#[test]
fn a_way_of_the_lan_goes_before_one_beyond_it_as_soon_as_there_is_one() {
    const CLIENT: Name = Name::new(1, 64, 0, local::TRANSIT);
    let ground = Ground::new();
    ground.node().set_routes_beyond(CLIENT, &[(FAR, FAR)]).unwrap();
    let mut client = ground.join().receiver(CLIENT, shape(4)).unwrap();
    let mut sender = ground.join().sender(FAR).unwrap();
    send(&mut sender, 1);
    ground.node().set_routes(TRANSIT, &[(FAR, FAR)]).unwrap();
    // Its router does not run yet: what there is stays good.
    send(&mut sender, 2);
    let mut transit = transit(&ground);
    send(&mut sender, 3);
    let ids = |mailbox: &mut Receiver| {
        std::iter::from_fn(|| mailbox.try_receive().map(|package| package.head().id)).collect::<Vec<_>>()
    };
    assert_eq!((ids(&mut client), ids(&mut transit)), (vec![1, 2], vec![3]));
}

#[test]
fn a_sender_by_a_router_keeps_to_it_whatever_name_its_packages_are_for() {
    const BESIDE: Name = Name::new(1, 65, 0, local::TRANSIT);
    let ground = routed();
    let mut transit = transit(&ground);
    let beside = ground.join().receiver(BESIDE, shape(4)).unwrap();
    let mut sender = ground.join().sender(BESIDE).unwrap();
    sender.readdress(FAR);
    send(&mut sender, 1);
    // The name comes here, and the router's mailbox is another one: each time what was known is old.
    let mut here = ground.join().receiver(FAR, shape(4)).unwrap();
    send(&mut sender, 2);
    beside.close();
    let mut beside = ground.join().receiver(BESIDE, shape(4)).unwrap();
    send(&mut sender, 3);
    let came = beside.try_receive().map(|package| (package.head().to, package.head().id));
    assert_eq!(came, Some((FAR, 3)), "1 and 2 were lost with their mailbox");
    assert!(here.try_receive().is_none() && transit.try_receive().is_none());
    beside.close();
    assert!(matches!(sender.send(&label(LOW, 4), &[]), Err(SendError::NoMailbox(_))), "no other way is taken");
}

#[test]
fn one_participant_sends_to_as_many_far_mailboxes_as_the_router_has_claims() {
    let ground = routed();
    let mut transit = transit(&ground);
    let me = ground.join();
    let mut senders: Vec<_> = (0..255).map(|local| me.sender(FAR.with_local(local)).unwrap()).collect();
    assert!(matches!(me.sender(FAR.with_local(255)), Err(SendError::InUse(name)) if name == FAR.with_local(255)));
    // One comes here: it takes no claim of the router's any more, and one of its own mailbox.
    let _here = ground.join().receiver(FAR, shape(4)).unwrap();
    send(&mut senders[0], 0);
    assert!(matches!(me.sender(FAR), Err(SendError::InUse(FAR))));
    senders.push(me.sender(FAR.with_local(255)).unwrap());
    for sender in &mut senders[1..] {
        send(sender, 1);
        assert_eq!(transit.receive_timeout(PATIENCE).unwrap().head().to, sender.name());
    }
}

#[test]
fn what_comes_from_another_node_is_not_sent_back_there() {
    let ground = routed();
    let mut transit = transit(&ground);
    let me = ground.join();
    assert!(matches!(me.sender_here(FAR), Err(SendError::NoMailbox(FAR))));
    let here = ground.join().receiver(FAR, shape(4)).unwrap();
    let mut sender = me.sender_here(FAR).unwrap();
    send(&mut sender, 1);
    here.close();
    assert!(matches!(sender.send(&label(LOW, 2), &[]), Err(SendError::NoMailbox(FAR))), "also when it went");
    assert!(transit.try_receive().is_none());
}

#[test]
fn damaged_routes_are_told_and_not_followed() {
    let ground = routed();
    let _transit = transit(&ground);
    std::fs::write(ground.path().join("routes"), b"rohrpost, but what then?").unwrap();
    let error = ground.join().sender(FAR).err().unwrap().to_string();
    assert!(error.contains("`routes` is damaged") && error.contains("start the node's router again"), "{error}");
    assert_eq!(ground.node().route(FAR), None);
    std::fs::remove_file(ground.path().join("routes")).unwrap();
    std::fs::write(ground.path().join("routes.beyond"), b"rohrpost, but what then?").unwrap();
    let error = ground.join().sender(FAR).err().unwrap().to_string();
    assert!(error.contains("`routes.beyond` is damaged") && error.contains("client of the TCP router"), "{error}");
}
