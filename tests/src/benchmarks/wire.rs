//! MAVLink packets against pymavlink.

use super::golden::golden_packet;
use super::timing::{Contender, Times, in_turns};
use crate::python;
use anyhow::Result;
use gleaner_link::{Address, FrameDecoder, Packet};
use std::fmt::Write;
use std::fs;
use std::hint::black_box;

/// Golden packets of a flight's stream.
const NAMES: [&str; 4] = ["heartbeat_copter_guided", "local_position_ned", "battery_status", "rc_channels"];
const ROUNDS: usize = 20;
/// Packets of one reading.
const PACKETS: usize = 2_000;
/// Bytes of one read.
const READ_BYTES: usize = 512;
/// `SET_POSITION_TARGET_LOCAL_NED`: id, CRC_EXTRA and payload length.
const SETPOINT: (u32, u8, usize) = (84, 143, 53);

/// The packets as one stream.
fn stream() -> Result<Vec<u8>> {
    let packets: Vec<Vec<u8>> = NAMES.into_iter().map(golden_packet).collect::<Result<_>>()?;
    Ok(packets.iter().cycle().take(PACKETS).flatten().copied().collect())
}

/// Frames that the decoder finds in the stream.
fn decode(stream: &[u8]) -> usize {
    let mut decoder = FrameDecoder::new();
    let mut found = 0;
    for mut read in stream.chunks(READ_BYTES) {
        while !read.is_empty() {
            let taken = decoder.push(read);
            read = &read[taken..];
            while let Some(frame) = decoder.next_frame() {
                black_box(&frame);
                found += 1;
            }
        }
    }
    found
}

/// Packets per second, in and out.
pub(super) fn packets(page: &mut String) -> Result<()> {
    let stream = stream()?;
    anyhow::ensure!(decode(&stream) == PACKETS, "the decoder finds all packets of the stream");
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("stream.bin");
    fs::write(&file, &stream)?;
    let payload = [1; SETPOINT.2];
    let sender = Address { system: 42, component: 191 };
    let mut contenders: [Contender<'_>; 2] = [
        (
            "read",
            Box::new(|| {
                let _ = black_box(decode(black_box(&stream)));
            }),
        ),
        (
            "write",
            Box::new(|| {
                for sequence in 0..PACKETS {
                    let packet = Packet::from_payload(SETPOINT.0, SETPOINT.1, black_box(&payload));
                    let _ = black_box(packet.map(|packet| packet.frame(sender, sequence as u8)));
                }
            }),
        ),
    ];
    let mut ours = in_turns(&mut contenders, ROUNDS, 1);
    ours.iter_mut().for_each(|times| times.divide(PACKETS as f64));
    let rounds = ROUNDS.to_string();
    let peer = python::run("wire_bench.py", [file.as_os_str(), rounds.as_ref()])?;
    writeln!(
        page,
        "## Wire\n\nMAVLink 2 packets, one thread. In: a stream of heartbeats, positions, battery states and RC channels \
         in reads of {READ_BYTES} bytes. Out: position targets. pymavlink runs directly after; ratios are of repetitions \
         in the same order.\n\n| direction | ours | million packets/s | pymavlink | pymavlink / ours |\n|---|---|---|---|---|"
    )?;
    for (((name, _), ours), line) in contenders.iter().zip(&ours).zip(peer.lines()) {
        let theirs: Vec<f64> = line.split_whitespace().filter_map(|number| number.parse().ok()).collect();
        let theirs = Times::from_micros(theirs);
        writeln!(
            page,
            "| {name} | {} | {:.2} | {} | {} |",
            ours.text(),
            1.0 / ours.median(),
            theirs.text(),
            ours.ratio(&theirs)
        )?;
    }
    Ok(())
}
