//! MAVLink packets against the `mavlink` crate and pymavlink.

use super::golden::golden_packet;
use super::peer::Peer;
use super::timing::{Contender, in_turns};
use crate::python;
use anyhow::{Result, ensure};
use gleaner_link::{Address, FrameDecoder, Message, Packet};
use mavlink::dialects::ardupilotmega::{MavMessage, SET_POSITION_TARGET_LOCAL_NED_DATA};
use mavlink::{MavHeader, MavlinkReader, MavlinkVersion};
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

/// The packets as one stream.
fn stream() -> Result<Vec<u8>> {
    let packets: Vec<Vec<u8>> = NAMES.into_iter().map(golden_packet).collect::<Result<_>>()?;
    Ok(packets.iter().cycle().take(PACKETS).flatten().copied().collect())
}

/// Messages that the decoder finds in the stream.
fn decode(stream: &[u8]) -> usize {
    let mut decoder = FrameDecoder::new();
    let mut found = 0;
    for mut read in stream.chunks(READ_BYTES) {
        while let Some(frame) = decoder.read(&mut read) {
            let _ = black_box(Message::decode(&frame));
            found += 1;
        }
    }
    found
}

/// Messages that the `mavlink` crate finds in the stream.
fn decode_with_crate(stream: &[u8]) -> usize {
    let mut reader = MavlinkReader::new(stream);
    let mut found = 0;
    while let Ok((_, message)) = reader.read_message::<MavMessage>(MavlinkVersion::V2) {
        black_box(&message);
        found += 1;
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
    ensure!(decode(&stream) == PACKETS, "the decoder finds all packets of the stream");
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("stream.bin");
    fs::write(&file, &stream)?;
    ensure!(decode_with_crate(&stream) == PACKETS, "the crate finds all packets of the stream");
    let peer = Peer::start(&python::interpreter()?, "wire_bench.py", &[file.display().to_string()])?;
    let peer = RefCell::new(peer);
    let target = SET_POSITION_TARGET_LOCAL_NED_DATA {
        x: 1.0,
        y: 2.0,
        z: -60.0,
        ..SET_POSITION_TARGET_LOCAL_NED_DATA::DEFAULT
    };
    let sender = Address { system: 42, component: 191 };
    let read = || {
        let _ = black_box(decode(black_box(&stream)));
    };
    let read_with_crate = || {
        let _ = black_box(decode_with_crate(black_box(&stream)));
    };
    let write = || {
        for sequence in 0..PACKETS {
            let packet = Packet::new(black_box(&target));
            let _ = black_box(packet.map(|packet| packet.frame(sender, sequence as u8)));
        }
    };
    let message = MavMessage::SET_POSITION_TARGET_LOCAL_NED(target.clone());
    let write_with_crate = || {
        for sequence in 0..PACKETS {
            let mut frame = [0; 280];
            let header = MavHeader { system_id: 42, component_id: 191, sequence: sequence as u8 };
            let _ = mavlink::write_v2_msg(&mut &mut frame[..], header, black_box(&message));
            black_box(&frame);
        }
    };
    let mut contenders = [
        Contender::ours("read", 1, read),
        Contender::ours("read", 1, read_with_crate),
        Contender::peer("read", &peer, "read".into()),
        Contender::ours("write", 1, write),
        Contender::ours("write", 1, write_with_crate),
        Contender::peer("write", &peer, "write".into()),
    ];
    let mut times = in_turns(&mut contenders, ROUNDS)?;
    // The peer's program counts per packet.
    for in_process in [0, 1, 3, 4] {
        times[in_process].divide(PACKETS as f64);
    }
    let pymavlink = peer.borrow().about().to_owned();
    let programs = ["gleaner", "mavlink crate", pymavlink.as_str()];
    writeln!(
        page,
        "## Wire\n\nMAVLink 2 packets, one thread. In: a stream of heartbeats, positions, battery states and RC channels, \
         decoded to messages, in reads of {READ_BYTES} bytes (the crate reads as it likes). Out: position targets.\n\n\
         | direction | program | per packet | million packets/s | program / gleaner |\n|---|---|---|---|---|"
    )?;
    for (contenders, times) in contenders.chunks(3).zip(times.chunks(3)) {
        for ((contender, program), theirs) in contenders.iter().zip(programs).zip(times) {
            writeln!(
                page,
                "| {} | {program} | {} | {:.2} | {} |",
                contender.name,
                theirs.text(),
                1.0 / theirs.median(),
                times[0].ratio(theirs)
            )?;
        }
    }
    Ok(())
}
