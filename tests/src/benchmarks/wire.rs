//! MAVLink packets against pymavlink.

use super::golden::golden_packet;
use super::peer::Peer;
use super::timing::{Contender, in_turns};
use crate::python;
use anyhow::Result;
use gleaner_link::{Address, FrameDecoder, Packet};
use std::cell::RefCell;
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

/// Reads the stream.
pub(super) fn count(calls: u64) -> Result<()> {
    let stream = stream()?;
    for _ in 0..calls {
        black_box(decode(black_box(&stream)));
    }
    Ok(())
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
    let peer = Peer::start(&python::interpreter()?, "wire_bench.py", &[file.display().to_string()])?;
    let peer = RefCell::new(peer);
    let read = || {
        let _ = black_box(decode(black_box(&stream)));
    };
    let write = || {
        for sequence in 0..PACKETS {
            let packet = Packet::from_payload(SETPOINT.0, SETPOINT.1, black_box(&payload));
            let _ = black_box(packet.map(|packet| packet.frame(sender, sequence as u8)));
        }
    };
    let mut contenders = [
        Contender::ours("read", 1, read),
        Contender::peer("read", &peer, "read".into()),
        Contender::ours("write", 1, write),
        Contender::peer("write", &peer, "write".into()),
    ];
    let mut times = in_turns(&mut contenders, ROUNDS)?;
    times.iter_mut().step_by(2).for_each(|ours| ours.divide(PACKETS as f64));
    writeln!(
        page,
        "## Wire\n\nMAVLink 2 packets, one thread. In: a stream of heartbeats, positions, battery states and RC channels \
         in reads of {READ_BYTES} bytes. Out: position targets. The peer is {}.\n\n\
         | direction | ours | million packets/s | pymavlink | pymavlink / ours |\n|---|---|---|---|---|",
        peer.borrow().about()
    )?;
    for (contenders, times) in contenders.chunks(2).zip(times.chunks(2)) {
        let ([contender, _], [ours, theirs]) = (contenders, times) else { continue };
        writeln!(
            page,
            "| {} | {} | {:.2} | {} | {} |",
            contender.name,
            ours.text(),
            1.0 / ours.median(),
            theirs.text(),
            ours.ratio(theirs)
        )?;
    }
    Ok(())
}
