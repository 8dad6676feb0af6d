//! The right endpoint for a wrong text.

use crate::endpoint::{DEFAULT_BAUD, EndpointFault};

const KINDS: [&str; 8] = ["udpin", "udpout", "udpbcast", "udp", "tcpin", "tcpout", "tcp", "serial"];
/// The port on which ground stations listen for UDP.
const UDP_PORT: u16 = 14_550;
/// The port on which simulated autopilots listen for TCP.
const TCP_PORT: u16 = 5760;

/// The text that was probably meant. The caller checks that it parses.
pub(crate) fn suggest(text: &str, fault: EndpointFault) -> Option<String> {
    let (kind, rest) = text.split_once(':').unwrap_or(("", text));
    match fault {
        EndpointFault::Kind => suggest_kind(text, kind, rest),
        // "udpin:14550" lacks the host, "udpin:0.0.0.0" the port.
        EndpointFault::Port if rest.parse::<u16>().is_ok() => {
            let default = if kind.starts_with("tcp") { TCP_PORT } else { UDP_PORT };
            let port = rest.parse().ok().filter(|&port| port > 0).unwrap_or(default);
            kind.ends_with("in").then(|| format!("{kind}:0.0.0.0:{port}"))
        }
        EndpointFault::Port if !rest.contains(':') && !rest.is_empty() => {
            let port = if kind.starts_with("tcp") { TCP_PORT } else { UDP_PORT };
            Some(format!("{kind}:{rest}:{port}"))
        }
        EndpointFault::Brackets => {
            let (host, port) = rest.rsplit_once(':')?;
            Some(format!("{kind}:[{}]:{port}", host.trim_start_matches("//")))
        }
        EndpointFault::Host => {
            let (_, port) = rest.rsplit_once(':')?;
            let listening = if kind.starts_with("tcp") { "tcpin" } else { "udpin" };
            Some(format!("{listening}:0.0.0.0:{port}"))
        }
        EndpointFault::Baud => {
            let (path, baud) = rest.rsplit_once([':', ','])?;
            Some(format!("serial:{path}:{}", baud_rate(baud)))
        }
        EndpointFault::Port | EndpointFault::Path => None,
    }
}

fn suggest_kind(text: &str, kind: &str, rest: &str) -> Option<String> {
    if let Ok(port) = text.trim_start_matches(':').parse::<u16>() {
        return Some(format!("udpin:0.0.0.0:{port}"));
    }
    let device = text.trim_start_matches("dev/");
    if ["tty", "serial/"].iter().any(|start| device.starts_with(start)) {
        return Some(format!("serial:/dev/{device}"));
    }
    if let Some(known) = nearest_kind(kind) {
        return Some(format!("{known}:{rest}"));
    }
    let port: u16 = rest.parse().ok()?;
    let kind = if port == TCP_PORT { "tcpout" } else { "udpout" };
    Some(format!("{kind}:{text}"))
}

/// The kind that differs from `typed` by case, punctuation or one slip of the finger.
fn nearest_kind(typed: &str) -> Option<&'static str> {
    let letters: Vec<char> =
        typed.chars().filter(char::is_ascii_alphabetic).map(|c| c.to_ascii_lowercase()).collect();
    let near = |most: usize| {
        KINDS.into_iter().find(move |kind| distance(&letters, &kind.chars().collect::<Vec<_>>()) <= most)
    };
    let exact = near.clone()(0);
    exact.or_else(|| near(1))
}

/// Edit distance with swaps of neighbours (optimal string alignment).
fn distance(a: &[char], b: &[char]) -> usize {
    let mut rows = vec![(0..=b.len()).collect::<Vec<usize>>()];
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let replaced = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut least = replaced.min(rows[i - 1][j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(rows[i - 2][j - 2] + 1);
            }
            row.push(least);
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
}

/// "115k2" is 115200 and "921k6" is 921600; anything else becomes the default.
fn baud_rate(text: &str) -> u32 {
    let (thousands, hundreds) = text.split_once(['k', 'K']).unwrap_or(("", ""));
    match (thousands.parse::<u32>(), hundreds.parse::<u32>()) {
        (Ok(thousands @ 1..=4000), Ok(hundreds @ 0..=9)) => thousands * 1000 + hundreds * 100,
        (Ok(thousands @ 1..=4000), Err(_)) => thousands * 1000,
        _ => DEFAULT_BAUD,
    }
}
