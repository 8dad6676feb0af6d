//! The example configurations of MAVLink routers agree with the example configuration of `gleaner`.
//!
//! Neither program is in Debian, so their files are read here by the rules that their projects document: mavlink-router's
//! `main.conf` (sections with a kind and a name, known keys, no comment behind a value) and mavlink-server's command line.

use gleaner_ports::Endpoint;
use gleaner_tests::programs::repository;
use std::collections::BTreeMap;
use std::fs;

/// Keys of mavlink-router's sections that the example may use.
const KEYS: [(&str, &[&str]); 3] = [
    ("General", &["TcpServerPort", "ReportStats"]),
    ("UartEndpoint", &["Device", "Baud", "FlowControl"]),
    ("UdpEndpoint", &["Mode", "Address", "Port"]),
];

fn dist(name: &str) -> String {
    fs::read_to_string(repository().join("firmware/companion/dist").join(name)).unwrap()
}

/// Ports of the example configuration: the autopilot's, and the serial ones of its comments.
fn gleaner() -> (Endpoint, Vec<Endpoint>) {
    let text = dist("gleaner.toml");
    let file: toml::Table = text.parse().unwrap();
    assert!(!file.contains_key("ground"), "a router reaches the ground station");
    let autopilot = file["autopilot"].as_str().unwrap().parse().unwrap();
    let quoted = text.lines().filter_map(|line| line.strip_prefix("# autopilot = \"")?.strip_suffix('"'));
    (autopilot, quoted.filter_map(|endpoint| endpoint.parse().ok()).collect())
}

/// Sections by their heading, each with its keys.
fn sections(text: &str) -> BTreeMap<&str, BTreeMap<&str, &str>> {
    let mut sections: BTreeMap<&str, BTreeMap<&str, &str>> = BTreeMap::new();
    let mut heading = None;
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#')) {
        if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            assert!(sections.insert(name, BTreeMap::new()).is_none(), "[{name}] stands twice");
            heading = Some(name);
            continue;
        }
        let (key, value) = line.split_once('=').unwrap_or_else(|| panic!("{line} is no key with a value"));
        assert!(!value.contains('#'), "{line}: a comment behind a value is a part of it");
        let heading = heading.unwrap_or_else(|| panic!("{line} stands outside a section"));
        let kind = heading.split_whitespace().next().unwrap();
        let (_, keys) =
            KEYS.iter().find(|(known, _)| *known == kind).unwrap_or_else(|| panic!("[{heading}]"));
        assert!(keys.contains(&key.trim()), "[{heading}] has no key {key}");
        sections.get_mut(heading).unwrap().insert(key.trim(), value.trim());
    }
    sections
}

#[test]
fn mavlink_router_reaches_gleaner_where_it_listens() {
    let text = dist("routers/mavlink-router.conf");
    let sections = sections(&text);
    let (autopilot, serial) = gleaner();
    let own = &sections["UdpEndpoint gleaner"];
    assert_eq!(own["Mode"], "Normal", "the router sends, Gleaner listens");
    assert_eq!(format!("udpin:0.0.0.0:{}", own["Port"]), autopilot.to_string());
    assert_eq!(own["Address"], "127.0.0.1");
    let uart = &sections["UartEndpoint autopilot"];
    let device: Endpoint = format!("serial:{}:{}", uart["Device"], uart["Baud"]).parse().unwrap();
    assert!(serial.contains(&device), "{device} is not among {serial:?}");
    assert_eq!(sections["UdpEndpoint ground"]["Port"], "14550", "where QGroundControl listens");
}

#[test]
fn mavlink_server_reaches_gleaner_and_has_another_id() {
    let text = dist("routers/mavlink-server.sh");
    let command = text.split("exec mavlink-server").nth(1).unwrap().replace("\\\n", " ");
    let words: Vec<&str> = command.split_whitespace().collect();
    let option = |name: &str| words.iter().position(|word| *word == name).map(|at| words[at + 1]);
    let id: u8 = option("--mavlink-component-id").unwrap().parse().unwrap();
    let file: toml::Table = dist("gleaner.toml").parse().unwrap();
    assert_ne!(i64::from(id), file["component_id"].as_integer().unwrap());
    // Its endpoints are written as Gleaner's are.
    let endpoints: Vec<Endpoint> = words[4..].iter().map(|word| word.parse().unwrap()).collect();
    let (autopilot, serial) = gleaner();
    let [uart, own, ground] = &endpoints[..] else { panic!("{endpoints:?}") };
    assert!(serial.contains(uart), "{uart} is not among {serial:?}");
    assert_eq!(own.to_string().replace("udpout:127.0.0.1", "udpin:0.0.0.0"), autopilot.to_string());
    assert!(ground.to_string().ends_with(":14550"));
}
