//! What a file with a TCP router means.

use rohrpost_config::{Installation, Program, TCP_CLIENT, TCP_ROUTER};
use rohrpost_mailbox::{ALL_SYSTEMS, Name, Priority, local};
use std::path::Path;

const TCP: &str = include_str!("tcp.toml");

fn parse(text: &str) -> Installation {
    Installation::parse(text, Path::new("tcp.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

#[test]
fn every_key_arrives() {
    let tcp = parse(TCP).tcp.unwrap();
    assert_eq!(tcp.address, "192.168.7.1:4001".parse().unwrap());
    assert_eq!((tcp.server.as_deref(), tcp.clients, tcp.quota_bytes), (Some("base"), 20, 2 << 20));
    assert_eq!([32, 33, 200].map(|priority| tcp.level(Priority(priority))), [31, 26, 6]);
}

#[test]
fn sealed_sessions_need_a_folder_of_certificates_and_open_ones_must_not_have_one() {
    let sealed = TCP.replace("security = \"none\"", "security = \"tls\"\ncertificates = \"certificates\"");
    assert_eq!(parse(&sealed).tcp.unwrap().certificates, Some("certificates".into()));
    for (section, words) in [
        ("security = \"tls\"", "`certificates` is missing"),
        ("security = \"none\"\ncertificates = \"certificates\"", "of no use"),
    ] {
        let text = TCP.replace("security = \"none\"", section);
        let errors = Installation::parse(&text, Path::new("tcp.toml")).unwrap_err().to_string();
        assert!(errors.contains(words), "{errors}");
    }
}

#[test]
fn the_server_and_a_client_of_each_node_are_there_by_themselves() {
    let north = parse(TCP);
    let names: Vec<Name> = north.modules.iter().map(|module| module.name).collect();
    let name = |class, instance| Name::new(1, class, instance, 0);
    assert_eq!(names, [name(64, 255), name(64, 0), name(200, 0)], "in the order of their start");
    let programs = [TCP_ROUTER, TCP_CLIENT].map(|program| Program::Builtin(program.into()));
    assert_eq!([&north.modules[0].program, &north.modules[1].program], [&programs[0], &programs[1]]);
    assert_eq!((north.tcp_router(), north.tcp_client_of("base")), (Some(name(64, 255)), Some(name(64, 0))));
    assert_eq!((north.modules[0].has_transit(), north.modules[1].has_transit()), (false, true));
    let south = parse(&TCP.replace("server = \"base\"\n", ""));
    assert_eq!((south.tcp_router(), south.modules.len()), (None, 2), "another installation runs it");
    let elsewhere = [&north, &south].map(|system| system.tcp_router_elsewhere());
    assert_eq!(elsewhere, [None, Some(Name::new(ALL_SYSTEMS, 64, 255, 0))]);
}

#[test]
fn a_node_hosts_its_own_names_and_all_others_are_beyond() {
    let north = parse(TCP);
    let (hosts, beyond) = (north.names_on("base"), north.names_beyond("base"));
    let has = |ranges: &[(Name, Name)], name: &str| {
        let name = north.classes.parse_name(name).unwrap();
        ranges.iter().any(|(first, last)| (*first..=*last).contains(&name))
    };
    for (name, is_own) in [
        ("motor.0", true),
        ("laser.0.2", true),
        ("tcp.255", true),
        ("tool.63.1", true),
        ("tool.64", false),
        ("motor.1", false),
        ("2.motor.0.0", false),
        ("255.motor.0.0", false),
    ] {
        assert_eq!((has(&hosts, name), has(&beyond, name)), (is_own, !is_own), "{name}");
    }
    assert!(hosts.windows(2).chain(beyond.windows(2)).all(|pair| pair[0].1 < pair[1].0), "in order, and apart");
}

#[test]
fn the_mailboxes_by_which_routers_carry_packages_are_never_registered() {
    let field = parse(include_str!("beyond.toml"));
    for (node, own, module) in
        [("base", "router.0", "motor.0"), ("brain", "tcp.1", "pilot.0"), ("base", "tcp.255", "motor.0")]
    {
        let registered = field.names_registered(node);
        let has = |module: &str, local| {
            let name = field.classes.parse_name(module).unwrap().with_local(local);
            registered.iter().any(|(first, last)| (*first..=*last).contains(&name))
        };
        for mailbox in 0..=u8::MAX {
            assert_eq!(has(own, mailbox), mailbox <= local::DATA, "{own}.{mailbox}");
            assert!(has(module, mailbox), "{module}.{mailbox}, which is a module's");
        }
        assert!(registered.windows(2).all(|pair| pair[0].1 < pair[1].0), "in order, and apart");
    }
    let own = field.names_on("base");
    assert!(
        own.iter().all(|(first, last)| (first.local(), last.local()) == (0, u8::MAX)),
        "the node itself has them all"
    );
}

#[test]
fn a_name_that_moves_is_reached_at_each_of_its_nodes_and_registered_at_none() {
    let text =
        include_str!("beyond.toml").replace("node = \"brain\"\nbuiltin", "nodes = [\"brain\", \"base\"]\nbuiltin");
    let pilot = parse(&text).classes.parse_module("pilot.0").unwrap();
    for node in ["brain", "base"] {
        let field = parse(&text).seen_from(node);
        let has = |ranges: Vec<(Name, Name)>| ranges.iter().any(|(first, last)| (*first..=*last).contains(&pilot));
        assert_eq!((has(field.names_reached(node)), has(field.names_registered(node))), (true, false), "{node}");
    }
}

#[test]
fn without_the_section_nothing_is_beyond() {
    let demo = parse(include_str!("../demo.toml"));
    assert_eq!((demo.tcp.clone(), demo.tcp_client_of("main"), demo.tcp_router()), (None, None, None));
}

#[test]
fn sessions_cross_a_network_of_time_slots_by_the_tunnel_alone() {
    let broken = include_str!("broken/tcp-beside-slots.toml");
    for (address, is_right) in
        [("10.77.0.2", false), ("10.77.0.200", false), ("10.78.0.1", true), ("192.168.7.1", true)]
    {
        let text = broken.replace("address = \"10.77.0.1\"\nserver", &format!("address = \"{address}\"\nserver"));
        let read = Installation::parse(&text, Path::new("tcp.toml"));
        assert_eq!(read.is_ok(), is_right, "{address}: {:?}", read.err());
    }
}
