//! The component's metadata for ground stations over MAVLink FTP: two files, to read only.
//!
//! The MAVLink guide ("Component Metadata Protocol", "File Transfer Protocol") lets a ground station request
//! `COMPONENT_METADATA`, which names `general.json`; that names `parameter.json`, with names, units and ranges of the
//! parameters. Each client has one session, number 0, as with the autopilots: MAVSDK knows no other number.

use crate::routing::Packet;
use gleaner_link::{Address, FILE_DATA_BYTES, metadata};
use std::collections::VecDeque;

/// `FILE_TRANSFER_PROTOCOL`.
const FILE_TRANSFER_PROTOCOL: u32 = 110;
/// Where the files are. A ground station takes what follows `mftp://` as the path.
const FOLDER: &str = "gleaner";
const GENERAL: &str = "general.json";
const PARAMETER: &str = "parameter.json";
/// Answers that leave in one turn of the decision loop: 12 kB/s, which a telemetry radio cannot take anyway.
const PER_TURN: usize = 2;
/// Clients with an open file. The oldest one gives way.
const CLIENTS: usize = 8;
/// Answers that wait. A client that asks for more than it receives asks again.
const WAITING: usize = 64;

/// Opcodes of MAVLink FTP.
mod opcode {
    pub const NONE: u8 = 0;
    pub const TERMINATE: u8 = 1;
    pub const RESET: u8 = 2;
    pub const LIST: u8 = 3;
    pub const OPEN: u8 = 4;
    pub const READ: u8 = 5;
    pub const CRC32: u8 = 14;
    pub const BURST: u8 = 15;
    pub const ACK: u8 = 128;
    pub const NAK: u8 = 129;
    /// Operations that would write.
    pub const WRITING: [u8; 8] = [6, 7, 8, 9, 10, 11, 12, 13];
}

/// The number of every session.
const SESSION: u8 = 0;

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum Refusal {
    InvalidSession = 4,
    EndOfFile = 6,
    UnknownCommand = 7,
    FileProtected = 9,
    FileNotFound = 10,
}

/// A request.
#[derive(Clone, Copy, Debug)]
struct Request<'p> {
    sequence: u16,
    session: u8,
    opcode: u8,
    size: u8,
    offset: u32,
    data: &'p [u8],
}

/// One answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reply {
    /// To whom.
    pub to: Address,
    /// Sequence number to offset.
    pub header: [u8; 12],
    /// The rest.
    pub data: Vec<u8>,
}

/// The files, and the answers that wait.
pub struct Files {
    files: [(&'static str, Vec<u8>); 2],
    /// Which file each client has opened last.
    open: VecDeque<(Address, usize)>,
    waiting: VecDeque<Reply>,
}

impl Files {
    /// The files of this program.
    pub fn new() -> Files {
        let (mut parameter, mut general) = (String::new(), String::new());
        let uri = format!("mftp://{FOLDER}/{PARAMETER}");
        // Writing into a text cannot fail.
        let _ = metadata::write_parameters(&mut parameter);
        let _ = metadata::write_general(&mut general, &uri, metadata::checksum(&parameter));
        let files = [(GENERAL, general.into_bytes()), (PARAMETER, parameter.into_bytes())];
        Files { files, open: VecDeque::new(), waiting: VecDeque::new() }
    }

    /// URI and checksum of the general file, for `COMPONENT_METADATA`.
    pub fn general(&self) -> (String, u32) {
        let [(name, content), _] = &self.files;
        (format!("mftp://{FOLDER}/{name}"), checksum(content))
    }

    /// Takes a request to `own`; whether it was one.
    pub fn take(&mut self, packet: &Packet, own: Address) -> bool {
        if packet.message_id != FILE_TRANSFER_PROTOCOL || packet.target != Some((own.system, own.component)) {
            return false;
        }
        // MAVLink 2 leaves out trailing zeros. The target takes three bytes.
        let mut payload = packet.payload().to_vec();
        payload.resize(3 + 12 + 239, 0);
        let [low, high, session, opcode, size, _, _, _, o0, o1, o2, o3] =
            std::array::from_fn(|index| payload[3 + index]);
        let data = &payload[15..];
        let request = Request {
            sequence: u16::from_le_bytes([low, high]),
            session,
            opcode,
            size,
            offset: u32::from_le_bytes([o0, o1, o2, o3]),
            data: data.get(..usize::from(size)).unwrap_or(data),
        };
        let to = Address::new(packet.sender.0, packet.sender.1);
        match request.opcode {
            opcode::BURST => self.burst(to, &request),
            _ => {
                let answer = self.answer(to, &request);
                self.put(to, reply(&request, request.sequence, request.offset, false, answer));
            }
        }
        true
    }

    /// The answers that leave now.
    pub fn replies(&mut self) -> impl Iterator<Item = Reply> + '_ {
        let count = self.waiting.len().min(PER_TURN);
        self.waiting.drain(..count)
    }

    fn put(&mut self, to: Address, (header, data): ([u8; 12], Vec<u8>)) {
        if self.waiting.len() < WAITING {
            self.waiting.push_back(Reply { to, header, data });
        }
    }

    fn answer(&mut self, client: Address, request: &Request<'_>) -> Result<Vec<u8>, Refusal> {
        match request.opcode {
            opcode::NONE => Ok(Vec::new()),
            opcode::TERMINATE | opcode::RESET => {
                self.close(client);
                Ok(Vec::new())
            }
            opcode::LIST => self.list(request),
            opcode::OPEN => self.open_file(client, request.data),
            opcode::READ => match self.part(client, request, request.offset)? {
                [] => Err(Refusal::EndOfFile),
                part => Ok(part.to_vec()),
            },
            opcode::CRC32 => {
                let (_, content) = &self.files[self.find(request.data)?];
                Ok(checksum(content).to_le_bytes().to_vec())
            }
            code if opcode::WRITING.contains(&code) => Err(Refusal::FileProtected),
            _ => Err(Refusal::UnknownCommand),
        }
    }

    /// Opens a file; its length.
    fn open_file(&mut self, client: Address, path: &[u8]) -> Result<Vec<u8>, Refusal> {
        let at = self.find(path)?;
        self.close(client);
        if self.open.len() >= CLIENTS {
            self.open.pop_front();
        }
        self.open.push_back((client, at));
        Ok((self.files[at].1.len() as u32).to_le_bytes().to_vec())
    }

    fn close(&mut self, client: Address) {
        self.open.retain(|(other, _)| *other != client);
    }

    /// All parts from the offset on. The last one says that the burst is complete.
    fn burst(&mut self, client: Address, request: &Request<'_>) {
        let (mut sequence, mut offset) = (request.sequence, request.offset);
        loop {
            let part = match self.part(client, request, offset) {
                Ok([]) => Err(Refusal::EndOfFile),
                Ok(part) => Ok(part.to_vec()),
                Err(refusal) => Err(refusal),
            };
            let end = offset.saturating_add(part.as_ref().map_or(0, |part| part.len() as u32));
            let is_last = matches!(self.part(client, request, end), Ok([]) | Err(_));
            self.put(client, reply(request, sequence, offset, is_last, part));
            if is_last {
                return;
            }
            (sequence, offset) = (sequence.wrapping_add(1), end);
        }
    }

    /// One part of the client's file from `offset` on, empty at its end.
    fn part(&self, client: Address, request: &Request<'_>, offset: u32) -> Result<&[u8], Refusal> {
        let open = self.open.iter().find(|(other, _)| *other == client && request.session == SESSION);
        let (_, at) = open.ok_or(Refusal::InvalidSession)?;
        let (_, content) = &self.files[*at];
        let rest = usize::try_from(offset).ok().and_then(|offset| content.get(offset..)).unwrap_or(&[]);
        let wanted = match request.size {
            0 => FILE_DATA_BYTES,
            size => usize::from(size).min(FILE_DATA_BYTES),
        };
        Ok(&rest[..rest.len().min(wanted)])
    }

    /// The file at a path: with or without the folder and a leading slash.
    fn find(&self, path: &[u8]) -> Result<usize, Refusal> {
        let path = path_of(path);
        let name = path.strip_prefix(FOLDER).map_or(path, |rest| rest.trim_start_matches('/'));
        self.files.iter().position(|&(file, _)| file == name).ok_or(Refusal::FileNotFound)
    }

    /// The entries from the offset on: `F`, name, tab, size and a zero each.
    fn list(&self, request: &Request<'_>) -> Result<Vec<u8>, Refusal> {
        if !matches!(path_of(request.data), "" | "." | FOLDER) {
            return Err(Refusal::FileNotFound);
        }
        let skip = usize::try_from(request.offset).unwrap_or(usize::MAX);
        let entries = self.files.iter().skip(skip);
        let text: String = entries.map(|(name, content)| format!("F{name}\t{}\0", content.len())).collect();
        if text.is_empty() { Err(Refusal::EndOfFile) } else { Ok(text.into_bytes()) }
    }
}

/// Header and data of an answer.
fn reply(
    request: &Request<'_>,
    sequence: u16,
    offset: u32,
    burst_complete: bool,
    answer: Result<Vec<u8>, Refusal>,
) -> ([u8; 12], Vec<u8>) {
    let (code, data) = match answer {
        Ok(data) => (opcode::ACK, data),
        Err(refusal) => (opcode::NAK, vec![refusal as u8]),
    };
    let [low, high] = sequence.wrapping_add(1).to_le_bytes();
    let [o0, o1, o2, o3] = offset.to_le_bytes();
    // An answer names the session of its request, where it does not open one: pymavlink counts them.
    let session =
        if code == opcode::ACK && request.opcode == opcode::OPEN { SESSION } else { request.session };
    let (asked, burst) = (request.opcode, u8::from(burst_complete));
    ([low, high, session, code, data.len() as u8, asked, burst, 0, o0, o1, o2, o3], data)
}

fn path_of(data: &[u8]) -> &str {
    let text = data.split(|&byte| byte == 0).next().unwrap_or(&[]);
    std::str::from_utf8(text).unwrap_or("?").trim_matches('/')
}

fn checksum(content: &[u8]) -> u32 {
    std::str::from_utf8(content).map_or(0, metadata::checksum)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OWN: Address = Address::new(7, 191);

    /// What is answered to one request.
    fn ask(files: &mut Files, opcode: u8, size: u8, offset: u32, data: &[u8]) -> Vec<Reply> {
        ask_as(files, (255, 190), opcode, size, offset, data)
    }

    fn ask_as(
        files: &mut Files,
        sender: (u8, u8),
        opcode: u8,
        size: u8,
        offset: u32,
        data: &[u8],
    ) -> Vec<Reply> {
        let [o0, o1, o2, o3] = offset.to_le_bytes();
        let mut payload = vec![0, 7, 191, 9, 0, SESSION, opcode, size, 0, 0, 0, o0, o1, o2, o3];
        payload.extend_from_slice(data);
        let mut bytes = vec![0xFD, payload.len() as u8, 0, 0, 0, sender.0, sender.1, 110, 0, 0];
        bytes.extend(payload);
        bytes.extend([0, 0]);
        let packet = Packet {
            bytes,
            sender,
            message_id: FILE_TRANSFER_PROTOCOL,
            target: Some((7, 191)),
            verified: true,
        };
        assert!(!files.take(&packet, Address::new(7, 192)), "another component's");
        assert!(files.take(&packet, OWN));
        files.waiting.drain(..).collect()
    }

    fn open(files: &mut Files, sender: (u8, u8), path: &str) -> usize {
        let opened = ask_as(files, sender, opcode::OPEN, path.len() as u8, 0, path.as_bytes());
        let [reply] = &opened[..] else { panic!("{opened:?}") };
        assert_eq!((reply.header[2], reply.header[3]), (SESSION, opcode::ACK), "{path}");
        u32::from_le_bytes(reply.data[..].try_into().unwrap()) as usize
    }

    fn code(reply: &Reply) -> (u8, u8) {
        (reply.header[3], reply.data.first().copied().unwrap_or(0))
    }

    #[test]
    fn a_file_is_opened_and_read_to_its_end() {
        let mut files = Files::new();
        let whole = files.files[1].1.clone();
        for path in ["gleaner/parameter.json", "/gleaner/parameter.json", "parameter.json\0"] {
            assert_eq!(open(&mut files, (255, 190), path), whole.len());
        }
        // Another client reads another file meanwhile.
        open(&mut files, (245, 190), "general.json");
        let mut text = Vec::new();
        loop {
            let replies = ask(&mut files, opcode::READ, 100, text.len() as u32, &[]);
            if code(&replies[0]) == (opcode::NAK, Refusal::EndOfFile as u8) {
                break;
            }
            assert_eq!(replies[0].header[..2], [10, 0], "the sequence number goes on");
            text.extend_from_slice(&replies[0].data);
        }
        assert!(text == whole);
        ask(&mut files, opcode::TERMINATE, 0, 0, &[]);
        let closed = ask(&mut files, opcode::READ, 100, 0, &[]);
        assert_eq!(code(&closed[0]), (opcode::NAK, Refusal::InvalidSession as u8));
        let general = ask_as(&mut files, (245, 190), opcode::READ, 10, 0, &[]);
        assert_eq!(general[0].data, b"{\"version\"");
    }

    #[test]
    fn a_burst_ends_with_its_last_part() {
        let mut files = Files::new();
        let nowhere = ask(&mut files, opcode::BURST, 239, u32::MAX, &[]);
        assert_eq!(code(&nowhere[0]), (opcode::NAK, Refusal::InvalidSession as u8));
        open(&mut files, (255, 190), "parameter.json");
        let replies = ask(&mut files, opcode::BURST, 239, 0, &[]);
        let text: Vec<u8> = replies.iter().flat_map(|reply| reply.data.clone()).collect();
        assert!(text == files.files[1].1);
        let (last, rest) = replies.split_last().unwrap();
        assert!(last.header[6] == 1 && rest.iter().all(|reply| reply.header[6] == 0));
        let sequences: Vec<u8> = replies.iter().map(|reply| reply.header[0]).collect();
        assert!(sequences.windows(2).all(|pair| pair[1] == pair[0] + 1), "{sequences:?}");
        for offset in [text.len() as u32, u32::MAX] {
            let after = ask(&mut files, opcode::BURST, 239, offset, &[]);
            assert_eq!(code(&after[0]), (opcode::NAK, Refusal::EndOfFile as u8));
        }
    }

    #[test]
    fn everything_else_is_refused() {
        let mut files = Files::new();
        let path = b"general.json";
        for (opcode, refusal) in [
            (6, Refusal::FileProtected),
            (8, Refusal::FileProtected),
            (13, Refusal::FileProtected),
            (99, Refusal::UnknownCommand),
        ] {
            let replies = ask(&mut files, opcode, path.len() as u8, 0, path);
            assert_eq!(code(&replies[0]), (opcode::NAK, refusal as u8), "{opcode}");
        }
        let replies = ask(&mut files, opcode::OPEN, 11, 0, b"/etc/passwd");
        assert_eq!(code(&replies[0]), (opcode::NAK, Refusal::FileNotFound as u8));
        let listed = ask(&mut files, opcode::LIST, 1, 0, b"/");
        assert!(listed[0].data.starts_with(b"Fgeneral.json\t"), "{listed:?}");
        assert_eq!(code(&ask(&mut files, opcode::LIST, 1, 2, b"/")[0]).0, opcode::NAK);
        let terminate =
            Request { sequence: 1, session: 3, opcode: opcode::TERMINATE, size: 0, offset: 0, data: &[] };
        assert_eq!(reply(&terminate, 1, 0, false, Ok(Vec::new())).0[..4], [2, 0, 3, opcode::ACK]);
        for client in 1..=20 {
            open(&mut files, (client, 190), "general.json");
        }
        assert_eq!(files.open.len(), CLIENTS);
    }
}
