//! Bytes on the wire: frames in, frames out.
//!
//! `decoder` finds frames in a stream, `candidate` judges the bytes at one place, `packet` makes frames, `outgoing` orders
//! them, and `checksum` computes what ends each of them.

mod candidate;
pub mod checksum;
pub mod decoder;
pub mod frame;
pub mod outgoing;
pub mod packet;
