//! What the type mask of a position target says.

/// `POSITION_TARGET_TYPEMASK`: all three axes of the position.
pub(super) const IGNORE_POSITION: u16 = 0b111;
/// `POSITION_TARGET_TYPEMASK`: all three axes of the velocity.
pub(super) const IGNORE_VELOCITY: u16 = 0b111 << 3;
