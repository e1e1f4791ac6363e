//! What a file of several nodes means for routers.

use rohrpost_config::{Digest, Installation, Program, ROUTER, RestartPolicy, TRANSIT, TimeSource};
use rohrpost_mailbox::{Name, Priority};
use rohrpost_network::{LEVEL_NOT_REAL_TIME, Route};
use std::path::Path;
use std::time::Duration;

const FULL: &str = include_str!("full.toml");

fn parse(text: &str) -> Installation {
    Installation::parse(text, Path::new("full.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// The least that two nodes need.
fn two(nodes: [&str; 2], network: &str) -> Installation {
    parse(&format!(
        "installation = \"two\"\n[system]\nname = \"robot\"\nid = 1\n[classes]\nrouter = {{ id = 250 }}\nlaser = {{ id \
         = 150 }}\ntool = {{ id = 16 }}\n[nodes.base]\naddress = \"{}\"\ntools = [0, 3]\n[nodes.desk]\naddress = \
         \"{}\"\ntools = [4, 7]\n[network]\nsecurity = \"none\"\n{network}\n[time]\nsource = \
         \"master\"\n[[module]]\nname = \"laser.0\"\nnode = \"desk\"\nbuiltin = \"sim\"\n",
        nodes[0], nodes[1]
    ))
}

#[test]
fn every_node_has_a_router_which_is_its_first_module() {
    let full = parse(FULL);
    for (index, node) in full.nodes.iter().enumerate() {
        let router = full.modules_on(&node.name).next().unwrap();
        assert_eq!(router.name, Name::new(7, 250, index as u8, 0));
        assert_eq!(full.router_of(&node.name), Some(router.name));
        assert_eq!(full.node_index(&node.name), Some(index as u8));
        assert_eq!(router.program, Program::Builtin(ROUTER.into()));
        assert_eq!((router.restart.policy, router.restart.backoff), (RestartPolicy::Always, Duration::from_millis(10)));
        assert!(!router.is_in_file() && router.settings.is_empty());
        assert_eq!(router.line, node.line, "its messages name the node's line");
    }
    assert!(full.modules.iter().skip(2).all(|module| module.is_in_file()), "the file's come then");
    assert_eq!((full.router_of("roof"), full.node_index("roof")), (None, None));
}

#[test]
fn one_node_has_no_router_and_no_network() {
    let demo = parse(include_str!("../demo.toml"));
    assert!(demo.network.is_none() && demo.modules.iter().all(|module| module.is_in_file()));
    assert_eq!((demo.router_of("main"), demo.routes_from("main")), (None, Vec::new()));
}

#[test]
fn routes_lead_to_all_that_other_nodes_have() {
    let full = parse(FULL);
    let text = |route: &Route| {
        let node = &full.nodes[usize::from(route.node)].name;
        format!("{}..{} {node}", full.classes.format_full(route.first), full.classes.format_full(route.last))
    };
    let routes = |node: &str| full.routes_from(node).iter().map(text).collect::<Vec<_>>();
    assert_eq!(
        routes("base"),
        [
            "7.tool.16.0..7.tool.31.255 desk",
            "7.output.0.0..7.output.0.255 desk",
            "7.mapper.0.0..7.mapper.0.255 desk",
            "7.router.1.0..7.router.1.255 desk"
        ]
    );
    assert_eq!(
        routes("desk"),
        [
            "7.tool.0.0..7.tool.15.255 base",
            "7.laser.0.0..7.laser.0.255 base",
            "7.motor.0.0..7.motor.0.255 base",
            "7.router.0.0..7.router.0.255 base"
        ]
    );
}

#[test]
fn a_class_has_the_level_of_its_highest_four_bits() {
    let network = two(["10.0.0.1", "10.0.0.2"], "").network.unwrap();
    for (class, level) in
        [(255, 0), (250, 0), (240, 0), (239, 2), (150, 12), (128, 14), (31, 28), (16, 28), (15, LEVEL_NOT_REAL_TIME)]
    {
        assert_eq!(network.level(Priority(class)), level, "class {class}");
    }
    let all = two(["10.0.0.1", "10.0.0.2"], "bulk-below = 0").network.unwrap();
    assert_eq!(all.level(Priority(0)), 30, "the last real-time level");
}

#[test]
fn datagrams_fit_in_packets() {
    for (nodes, mtu, bytes) in [
        (["10.0.0.1", "10.0.0.2"], 1500, 1472),
        (["10.0.0.1", "10.0.0.2"], 576, 548),
        (["10.0.0.1", "10.0.0.2"], 65_535, 65_507),
        (["fd00::1", "fd00::2"], 1500, 1452),
        (["fd00::1", "fd00::2"], 65_535, 65_487),
    ] {
        let network = two(nodes, &format!("mtu = {mtu}")).network.unwrap();
        assert_eq!(network.datagram_bytes_max, bytes, "mtu {mtu}");
    }
}

#[test]
fn what_seals_a_datagram_has_its_place_in_the_packet() {
    for (mtu, bytes) in [(1500, 1456), (576, 532), (65_535, 65_491)] {
        let text = FULL.replacen("security = \"none\"", "security = \"keys\"", 1).replacen(
            "mtu = 9000",
            &format!("mtu = {mtu}"),
            1,
        );
        let installation = parse(&text);
        assert_eq!(installation.network.unwrap().datagram_bytes_max, bytes, "mtu {mtu}");
    }
}

#[test]
fn keys_lie_beside_the_file_or_where_it_says() {
    let folder = |security: &str| parse(&FULL.replacen("security = \"none\"", security, 1)).keys;
    assert_eq!(folder("security = \"none\""), None);
    assert_eq!(folder("security = \"keys\"").as_deref(), Some(Path::new("./keys")));
    assert_eq!(folder("security = \"keys\"\nkeys = \"/etc/robot\"").as_deref(), Some(Path::new("/etc/robot")));
}

#[test]
fn what_is_not_said_has_its_default() {
    let installation = two(["10.0.0.1", "10.0.0.2"], "");
    let network = installation.network.unwrap();
    assert_eq!((network.port, network.time_port(), network.mtu, network.bulk_below), (21_117, 21_118, 1500, 16));
    assert_eq!((network.rate_bytes_s, network.quota_bytes), (100 << 20, 256 << 10));
    assert_eq!(installation.time, TimeSource::Master { masters: vec![0, 1], interval: Duration::from_secs(1) });
    assert!(TRANSIT.memory() < 8 << 20);
}

#[test]
fn routers_agree_on_what_is_on_the_wire() {
    let lan = |text: &str| parse(text).digest().lan();
    for (old, new, equal, why) in [
        ("Drives the wheels", "Turns the wheels", true, "a text"),
        ("rate = \"10 MiB\"", "rate = \"20 MiB\"", true, "a node's own pace"),
        ("quota = \"1 MiB\"", "quota = \"2 MiB\"", true, "a node's own memory"),
        ("port = 4000", "port = 4002", false, "another port"),
        ("security = \"none\"", "security = \"keys\"", false, "one seals"),
        ("security = \"none\"", "security = \"none\"\n#", true, "a remark"),
        ("mtu = 9000", "mtu = 1500", false, "another MTU"),
        ("[\"desk\", \"base\"]", "[\"base\", \"desk\"]", false, "another first master"),
        ("interval = \"500 ms\"", "interval = \"1 s\"", false, "another interval"),
        ("id = 150", "id = 151", false, "other names"),
        ("10.0.0.2", "10.0.0.3", false, "another address"),
    ] {
        assert!(FULL.contains(old), "{old}");
        assert_eq!(lan(&FULL.replacen(old, new, 1)) == lan(FULL), equal, "{why}");
    }
    let (one, other) = (Digest { common: 1, system: 2 }, Digest { common: 2, system: 1 });
    assert_ne!(one.lan(), other.lan());
}

#[test]
fn routers_may_be_called_and_have_levels_of_output() {
    let text = FULL.replace("calls = [", "calls = [{ to = \"router.0\", subscribes = true }, ");
    let text = text.replace("\"laser.0\" = \"trace\"", "\"router.1\" = \"trace\"");
    let full = parse(&text);
    let mapper = full.module(full.classes.parse_module("mapper.0").unwrap()).unwrap();
    assert!(mapper.calls.contains(&full.router_of("base").unwrap()));
    assert_eq!(full.output_level(full.router_of("desk").unwrap()), rohrpost_config::Level::Trace);
}

#[test]
fn replicas_are_carried_sealed_or_not() {
    for security in ["none", "keys"] {
        let text = include_str!("replica.toml").replace("security = \"none\"", &format!("security = \"{security}\""));
        let replicas = parse(&text).replicas;
        assert_eq!(replicas.iter().map(|replica| replica.changed).collect::<Vec<_>>(), [false, true], "{security}");
    }
}

#[test]
fn nodes_beyond_the_lan_count_as_well() {
    let text = |laptops: usize| {
        let laptops: String = (0..laptops).map(|at| format!("[nodes.laptop-{at}]\nnetwork = \"tcp\"\n")).collect();
        let text = format!(
            "installation = \"many\"\n[system]\nname = \"robot\"\nid = 1\n[classes]\nrouter = {{ id = 250 }}\ntcp = \
             {{ id = 64 }}\nlaser = {{ id = 150 }}\n[nodes.base]\naddress = \"10.0.0.1\"\n{laptops}[tcp]\naddress = \
             \"10.0.0.1\"\nserver = \"base\"\nsecurity = \"none\"\n[[module]]\nname = \"laser.0\"\nnode = \
             \"base\"\nbuiltin = \"sim\"\n"
        );
        Installation::parse(&text, Path::new("many.toml")).map_err(|errors| errors.to_string())
    };
    let said = |laptops| text(laptops).err().unwrap_or_default();
    let many = "there are 65; a system has at most 64";
    assert!(said(64).contains(many), "{}", said(64));
    assert!(!said(63).contains("a system has at most"), "{}", said(63));
}

#[test]
fn sixty_four_replicas_are_taken_and_one_more_is_not() {
    let with = |count: usize| {
        let replica = |at: usize| format!("[[replica]]\nstream = \"motor.0/s{at}\"\nto = [\"desk\"]\n");
        let text = include_str!("two_nodes.toml").to_owned() + &(0..count).map(replica).collect::<String>();
        Installation::parse(&text, Path::new("two_nodes.toml")).map(|installation| installation.replicas.len())
    };
    assert_eq!(with(64).unwrap_or_else(|errors| panic!("{errors}")), 64);
    let errors = with(65).expect_err("65 are too many").to_string();
    assert!(errors.contains("there are more than 64; drop some") && errors.trim().lines().count() == 1, "{errors}");
}

#[test]
fn sixteen_modules_have_several_nodes_and_one_more_has_not() {
    let with = |count: usize| {
        let module =
            |at: usize| format!("[[module]]\nname = \"mapper.{at}\"\nprogram = \"m\"\nnodes = [\"desk\", \"base\"]\n");
        let text = include_str!("standby.toml").to_owned() + &(1..count - 1).map(module).collect::<String>();
        Installation::parse(&text, Path::new("standby.toml")).map(|all| all.modules_with_standby().count())
    };
    assert_eq!(with(16).unwrap_or_else(|errors| panic!("{errors}")), 16);
    let errors = with(17).expect_err("17 are too many").to_string();
    assert!(
        errors.contains("more than 16 modules with several nodes") && errors.trim().lines().count() == 1,
        "{errors}"
    );
}
