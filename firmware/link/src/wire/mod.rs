//! Bytes on the wire: frames in, frames out.
//!
//! `decoder` finds frames in a stream, `candidate` judges the bytes at one place, `packet` makes frames and
//! `outgoing` orders them.

mod candidate;
pub mod decoder;
pub mod frame;
pub mod outgoing;
pub mod packet;
