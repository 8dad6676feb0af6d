//! The page as a ground station: orders become MAVLink commands, acknowledgements become answers.

use crate::order::{Command, Order, Request};
use gleaner_link::{Address, Frame, Message};
use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, HEARTBEAT_DATA};
use mavlink::dialects::ardupilotmega::{MavAutopilot, MavCmd, MavModeFlag, MavState, MavType};
use mavlink::{MavHeader, MessageData};
use std::time::{Duration, Instant};

/// A command that is not acknowledged is sent again, with the next `confirmation` (MAVLink command protocol).
const RESEND_AFTER: Duration = Duration::from_millis(500);
/// Transmissions of one command.
const TRANSMISSIONS: u8 = 4;

/// Turns orders into commands, one at a time.
#[derive(Debug)]
pub struct GroundClient {
    own: Address,
    pilot: Address,
    sequence: u8,
    next_heartbeat: Instant,
    pending: Option<Pending>,
}

#[derive(Debug)]
struct Pending {
    order: Order,
    command: MavCmd,
    param1: f32,
    transmissions: u8,
    resend_at: Instant,
}

impl GroundClient {
    /// The ground station `own`, which commands the pilot at `pilot`.
    #[must_use]
    pub fn new(own: Address, pilot: Address, now: Instant) -> GroundClient {
        GroundClient { own, pilot, sequence: 0, next_heartbeat: now, pending: None }
    }

    /// The pilot's address, once it is known.
    pub const fn set_pilot(&mut self, pilot: Address) {
        self.pilot = pilot;
    }

    /// Whether a command waits for its acknowledgement: the next order must wait, too.
    #[must_use]
    pub const fn is_busy(&self) -> bool {
        self.pending.is_some()
    }

    /// Takes an order that is a command to the pilot; gives back one that is not.
    pub fn take(&mut self, now: Instant, order: Order) -> Option<Order> {
        let (command, param1) = match order.command {
            Command::Preference(w_data) => (MavCmd::MAV_CMD_USER_1, w_data),
            Command::Request(Request::Off) => (MavCmd::MAV_CMD_USER_2, 0.0),
            Command::Request(Request::Engage) => (MavCmd::MAV_CMD_USER_2, 1.0),
            Command::Request(Request::Shadow) => (MavCmd::MAV_CMD_USER_2, 2.0),
            Command::Request(Request::Return) => (MavCmd::MAV_CMD_USER_3, 0.0),
            Command::Incident(_) => return Some(order),
        };
        self.pending = Some(Pending { order, command, param1, transmissions: 0, resend_at: now });
        None
    }

    /// The frames that are due: heartbeat, command, repeated command.
    pub fn poll(&mut self, now: Instant) -> Vec<Vec<u8>> {
        let mut frames = Vec::new();
        if now >= self.next_heartbeat {
            self.next_heartbeat = now + Duration::from_secs(1);
            frames.push(self.frame(&HEARTBEAT_DATA {
                custom_mode: 0,
                mavtype: MavType::MAV_TYPE_GCS,
                autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
                base_mode: MavModeFlag::empty(),
                system_status: MavState::MAV_STATE_ACTIVE,
                mavlink_version: 3,
            }));
        }
        if let Some(pending) = self.pending.take_if(|pending| now >= pending.resend_at) {
            if pending.transmissions == TRANSMISSIONS {
                pending.order.answer("not acknowledged: the pilot does not answer");
            } else {
                frames.push(self.frame(&COMMAND_LONG_DATA {
                    param1: pending.param1,
                    command: pending.command,
                    target_system: self.pilot.system,
                    target_component: self.pilot.component,
                    confirmation: pending.transmissions,
                    ..COMMAND_LONG_DATA::DEFAULT
                }));
                let transmissions = pending.transmissions + 1;
                self.pending = Some(Pending { transmissions, resend_at: now + RESEND_AFTER, ..pending });
            }
        }
        frames
    }

    /// A frame of the pilot; an acknowledgement answers the order.
    pub fn receive(&mut self, frame: &Frame) {
        if frame.sender != self.pilot {
            return;
        }
        let Ok(Some(Message::CommandAck(ack))) = Message::decode(frame) else { return };
        let answers = |pending: &mut Pending| u32::from(ack.command) == pending.command as u32;
        if let Some(pending) = self.pending.take_if(answers) {
            pending.order.answer(verdict(ack.result.to_wire()));
        }
    }

    fn frame<D: MessageData>(&mut self, data: &D) -> Vec<u8> {
        let Address { system, component } = self.own;
        let header = MavHeader { system_id: system.into(), component_id: component, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let mut raw = mavlink::MAVLinkV2MessageRaw::new();
        raw.serialize_message_data(header, data);
        raw.raw_bytes().to_vec()
    }
}

/// `MAV_RESULT` in words.
fn verdict(result: u8) -> String {
    match result {
        0 => "acknowledged: accepted".into(),
        1 => "acknowledged: temporarily rejected".into(),
        2 => "acknowledged: denied".into(),
        3 => "acknowledged: not supported".into(),
        4 => "acknowledged: failed".into(),
        5 => "acknowledged: in progress".into(),
        other => format!("acknowledged with result {other}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gleaner_link::FrameDecoder;
    use mavlink::dialects::ardupilotmega::{COMMAND_ACK_DATA, MavResult};

    const OWN: Address = Address::new(255, 190);
    const PILOT: Address = Address::new(1, 191);

    fn decoded(bytes: &[u8]) -> Frame {
        let mut rest = bytes;
        let frame = FrameDecoder::new().read(&mut rest).unwrap();
        assert!(rest.is_empty());
        frame
    }

    fn command(frame: &[u8]) -> Option<gleaner_link::Command> {
        match Message::decode(&decoded(frame)) {
            Ok(Some(Message::Command(command))) => Some(command),
            _ => None,
        }
    }

    fn acknowledgement(sender: Address, command: MavCmd) -> Frame {
        let mut speaker = GroundClient::new(sender, OWN, Instant::now());
        // Its other fields depend on a feature of the dialect.
        let mut ack = COMMAND_ACK_DATA::DEFAULT;
        (ack.command, ack.result) = (command, MavResult::MAV_RESULT_DENIED);
        decoded(&speaker.frame(&ack))
    }

    #[test]
    fn an_order_is_repeated_and_answered_by_the_pilot_only() {
        let start = Instant::now();
        let mut client = GroundClient::new(OWN, PILOT, start);
        let (order, mut answered) = Order::new(Command::Preference(0.25));
        assert!(client.take(start, order).is_none() && client.is_busy());
        let frames = client.poll(start);
        assert_eq!(frames.len(), 2, "heartbeat and command");
        let first = command(&frames[1]).unwrap();
        assert_eq!((first.id, first.params[0], first.confirmation), (31010, 0.25, 0));
        assert!(client.poll(start + RESEND_AFTER / 2).is_empty());
        let again = client.poll(start + RESEND_AFTER);
        assert_eq!(command(&again[0]).unwrap().confirmation, 1);
        client.receive(&acknowledgement(Address::new(1, 1), MavCmd::MAV_CMD_USER_1));
        client.receive(&acknowledgement(PILOT, MavCmd::MAV_CMD_USER_2));
        assert!(client.is_busy(), "another sender or another command is no answer");
        client.receive(&acknowledgement(PILOT, MavCmd::MAV_CMD_USER_1));
        assert!(!client.is_busy());
        assert_eq!(answered.try_recv().unwrap(), "acknowledged: denied");
    }

    #[test]
    fn a_silent_pilot_is_told_after_four_transmissions() {
        let mut now = Instant::now();
        let mut client = GroundClient::new(OWN, PILOT, now);
        let (order, mut answered) = Order::new(Command::Request(Request::Return));
        assert!(client.take(now, order).is_none());
        let mut sent = 0;
        for _ in 0..6 {
            sent += client.poll(now).iter().filter_map(|frame| command(frame)).count();
            now += RESEND_AFTER;
        }
        assert_eq!(sent, usize::from(TRANSMISSIONS));
        assert!(answered.try_recv().unwrap().starts_with("not acknowledged"));
    }

    #[test]
    fn an_incident_is_no_command() {
        let mut client = GroundClient::new(OWN, PILOT, Instant::now());
        let (order, _) = Order::new(Command::Incident("line cut".into()));
        assert!(client.take(Instant::now(), order).is_some() && !client.is_busy());
    }
}
