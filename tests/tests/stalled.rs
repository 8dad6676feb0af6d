//! A pilot process that is stopped and continued (SIGSTOP, SIGCONT), as a busy or suspended computer would stop it.
//!
//! Real autopilots have shown the danger: on waking, a companion with old state takes the aircraft out of the mode that
//! its pilot has chosen meanwhile.

use gleaner_tests::python;
use gleaner_tests::serving::{Link, Serving};

fn stall(link: Link, kind: &str, case: &str) -> String {
    let serving = Serving::start(link, &["--autopilot-kind", kind]);
    let pilot = serving.pilot.id().to_string();
    python::run("stalled.py", [&format!("udpout:{}", serving.station), &pilot, kind, case])
        .unwrap_or_else(|cause| panic!("{cause:#}"))
}

#[test]
fn a_take_over_during_a_stall_is_respected() {
    // A UDP socket returns one datagram a read, so that old ones hide the take-over longest.
    for link in [Link::Udp, Link::Tcp] {
        println!("{link:?}: {}", stall(link, "ardupilot", "taken"));
    }
}

#[test]
fn without_a_take_over_it_hands_back_on_fresh_evidence() {
    println!("{}", stall(Link::Udp, "ardupilot", "untouched"));
}

#[test]
fn px4_stays_in_the_mode_that_it_has_after_a_stall() {
    for case in ["taken", "untouched"] {
        println!("{}", stall(Link::Udp, "px4", case));
    }
}
