//! What the parts of a decision cost on the board, and what look-ahead would. The figures are in `docs/results.md`.
//!
//! `cargo test --release --workspace --test lookahead_cost -- --nocapture`

use gleaner_tests::board::LookAheadCost;

const CLOCK_MHZ: f64 = 168.0;
/// As for the inference, see `budget.rs`.
const CYCLES_PER_INSTRUCTION: f64 = 2.4;
/// The documented figures, with a tolerance of some percent.
const BYTES_MAX: u64 = 7_900;
const BEGIN_MAX: u64 = 1_900_000;
const DECISION: std::ops::RangeInclusive<u64> = 12_000_000..=15_000_000;
const TOKENS: std::ops::RangeInclusive<u64> = 400_000..=540_000;
const MASK_MAX: u64 = 130;
const RECEIVED_MAX: u64 = 1_100;
const SENT_MAX: u64 = 1_800;

#[test]
fn parts_of_a_decision_cost_on_the_board_what_results_say() {
    let LookAheadCost { bytes, begin, decisions, tokens, masks, received, sent } =
        LookAheadCost::measure().unwrap_or_else(|cause| panic!("{cause:#}"));
    let ms = |instructions: u64| instructions as f64 * CYCLES_PER_INSTRUCTION / CLOCK_MHZ / 1e3;
    println!("planner for 12 devices: {bytes} bytes of RAM");
    println!("begin of a mission: {begin} instructions, {:.0} ms", ms(begin));
    for &decision in &decisions {
        println!("decision with 100 tours: {decision} instructions, {:.0} ms", ms(decision));
    }
    println!("tokens: {tokens:?} instructions; guard: {masks:?}");
    println!("MAVLink: a position taken in {received:?} instructions, a target sent {sent:?}");
    assert!(received.iter().all(|&instructions| instructions <= RECEIVED_MAX), "{received:?}");
    assert!(sent.iter().all(|&instructions| instructions <= SENT_MAX), "{sent:?}");
    assert!(tokens.iter().all(|instructions| TOKENS.contains(instructions)), "{tokens:?}");
    assert!(masks.iter().all(|&instructions| instructions <= MASK_MAX), "{masks:?}");
    assert!(bytes <= BYTES_MAX, "{bytes} bytes");
    assert!(begin <= BEGIN_MAX, "{begin} instructions");
    assert!(decisions.iter().all(|instructions| DECISION.contains(instructions)), "{decisions:?}");
}
