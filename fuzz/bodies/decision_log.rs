//! Arbitrary bytes as a line of a decision log: nothing panics, and what is read survives writing.

use gleaner_pilot::{DecisionRecord, LoggedDecision};

pub fn run(data: &[u8]) {
    // The same decision as it travels in TUNNEL.
    let _ = DecisionRecord::decode(data);
    for line in data.split(|&byte| byte == b'\n') {
        let Ok(decision) = serde_json::from_slice::<LoggedDecision>(line) else { continue };
        let text = serde_json::to_string(&decision).expect("a decision can be written");
        // A number beyond the range of f32 is read as infinite and written as null.
        let Ok(again) = serde_json::from_str::<LoggedDecision>(&text) else { continue };
        assert_eq!(again, decision);
    }
}
