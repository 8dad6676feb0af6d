//! Updates of the learning algorithm against PyTorch.

use super::peer::Peer;
use super::timing::{Contender, in_turns};
use crate::python;
use anyhow::Result;
use std::cell::RefCell;
use std::fmt::Write;

#[path = "../../../host-trainer/benches/twin/mod.rs"]
mod twin;

const ROUNDS: usize = 15;
const UPDATES: usize = 2;

/// One update of MOSAC: 96 samples, three networks.
pub(super) fn updates(page: &mut String) -> Result<()> {
    let mut twin = twin::Twin::new();
    let update = || twin.update();
    writeln!(
        page,
        "## Learning\n\nOne update of MOSAC on one thread: {} samples of six devices, three forward passes for the \
         targets, forward and backward passes of two critics and the actor, Adam, Polyak averages.\n",
        twin::SAMPLES
    )?;
    let peer = python::pytorch().and_then(|python| Peer::start(&python, "pytorch_bench.py", &[]));
    let peer = peer.map(RefCell::new);
    let mut contenders = vec![Contender::ours("`gleaner-train`", UPDATES, update)];
    match &peer {
        Ok(peer) => {
            writeln!(page, "{}.\n", peer.borrow().about())?;
            for name in ["eager", "compiled"] {
                if peer.borrow_mut().round(name).is_ok() {
                    let title = if name == "eager" { "PyTorch, eager" } else { "PyTorch, compiled" };
                    contenders.push(Contender::peer(title, peer, name.into()));
                }
            }
        }
        Err(cause) => writeln!(page, "PyTorch was not measured: {cause:#}.\n")?,
    }
    in_turns(&mut contenders[..1], 2)?;
    let times = in_turns(&mut contenders, ROUNDS)?;
    writeln!(page, "| program | time | updates/s | program / `gleaner-train` |\n|---|---|---|---|")?;
    for (contender, theirs) in contenders.iter().zip(&times) {
        let ratio = times[0].ratio(theirs);
        let updates = 1e6 / theirs.median();
        writeln!(page, "| {} | {} | {updates:.0} | {ratio} |", contender.name, theirs.text())?;
    }
    Ok(())
}
