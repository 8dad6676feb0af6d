//! Commands and their acknowledgements.

use crate::address::Address;
use crate::fields::Fields;

/// The message that carried a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandForm {
    /// `COMMAND_LONG`.
    Long,
    /// `COMMAND_INT`: parameters 5 and 6 were integers.
    Int,
}

/// A command, from `COMMAND_LONG` or `COMMAND_INT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Sender; gets the acknowledgement.
    pub sender: Address,
    /// Receiver.
    pub target: Address,
    /// `MAV_CMD`.
    pub id: u16,
    /// Parameters 1..7 as sent, NaN included.
    pub params: [f32; 7],
    /// 0 for the first transmission, more for a resend; always 0 in `COMMAND_INT`.
    pub confirmation: u8,
    /// The message that carried it.
    pub form: CommandForm,
}

impl Command {
    pub(super) fn read_long(sender: Address, fields: Fields<'_>) -> Command {
        Command {
            sender,
            target: Address::new(fields.u8(30), fields.u8(31)),
            id: fields.u16(28),
            params: [0, 4, 8, 12, 16, 20, 24].map(|at| fields.f32(at)),
            confirmation: fields.u8(32),
            form: CommandForm::Long,
        }
    }

    pub(super) fn read_int(sender: Address, fields: Fields<'_>) -> Command {
        let [p1, p2, p3, p4] = [0, 4, 8, 12].map(|at| fields.f32(at));
        Command {
            sender,
            target: Address::new(fields.u8(30), fields.u8(31)),
            id: fields.u16(28),
            params: [p1, p2, p3, p4, fields.i32(16) as f32, fields.i32(20) as f32, fields.f32(24)],
            confirmation: 0,
            form: CommandForm::Int,
        }
    }

    /// Whether `other` is the same command bit for bit, except for the confirmation.
    #[must_use]
    pub fn repeats(&self, other: &Command) -> bool {
        self.sender == other.sender
            && self.target == other.target
            && self.id == other.id
            && self.form == other.form
            && self.params.map(f32::to_bits) == other.params.map(f32::to_bits)
    }
}

/// `MAV_RESULT`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandResult {
    /// Accepted: done, or about to be done.
    Accepted,
    /// Not now.
    TemporarilyRejected,
    /// A parameter is not allowed.
    Denied,
    /// Unknown command.
    Unsupported,
    /// Tried without success.
    Failed,
    /// In progress; another acknowledgement follows.
    InProgress,
    /// Cancelled.
    Cancelled,
    /// Another result.
    Other(u8),
}

impl CommandResult {
    pub(crate) fn from_wire(value: u8) -> CommandResult {
        match value {
            0 => CommandResult::Accepted,
            1 => CommandResult::TemporarilyRejected,
            2 => CommandResult::Denied,
            3 => CommandResult::Unsupported,
            4 => CommandResult::Failed,
            5 => CommandResult::InProgress,
            6 => CommandResult::Cancelled,
            other => CommandResult::Other(other),
        }
    }

    /// The number on the wire.
    #[must_use]
    pub fn to_wire(self) -> u8 {
        match self {
            CommandResult::Accepted => 0,
            CommandResult::TemporarilyRejected => 1,
            CommandResult::Denied => 2,
            CommandResult::Unsupported => 3,
            CommandResult::Failed => 4,
            CommandResult::InProgress => 5,
            CommandResult::Cancelled => 6,
            CommandResult::Other(other) => other,
        }
    }
}

/// `COMMAND_ACK`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandAck {
    /// The command that it answers.
    pub command: u16,
    /// The answer.
    pub result: CommandResult,
    /// Sender of that command; [`Address::ALL`] from senders without the MAVLink 2 extension.
    pub target: Address,
}

impl CommandAck {
    pub(super) fn read(fields: Fields<'_>) -> CommandAck {
        CommandAck {
            command: fields.u16(0),
            result: CommandResult::from_wire(fields.u8(2)),
            target: Address::new(fields.u8(8), fields.u8(9)),
        }
    }
}
