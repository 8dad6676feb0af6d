//! The radio's port and the format of its reports.

use crate::clock;
use crate::config::RadioFormat;
use gleaner_pilot::{Deliberator, Onboard};
use gleaner_ports::Port;
use gleaner_radio::{Format, JsonLines, SemtechUdp};

/// Decoder of a radio's bytes. The pilot decodes COBS frames itself.
pub enum RadioDecoder {
    /// COBS frames.
    Cobs,
    /// Another format.
    Other(Box<dyn Format + Send>),
}

impl RadioDecoder {
    /// The decoder of this format.
    pub fn new(format: RadioFormat) -> RadioDecoder {
        match format {
            RadioFormat::Cobs => RadioDecoder::Cobs,
            RadioFormat::JsonLines(calibration) => RadioDecoder::Other(Box::new(JsonLines::new(calibration))),
            RadioFormat::SemtechUdp(calibration) => {
                RadioDecoder::Other(Box::new(SemtechUdp::new(calibration)))
            }
        }
    }

    /// Gives the pilot the reports in `bytes`, and answers their sender.
    pub fn receive<P: Deliberator>(&mut self, bytes: &[u8], onboard: &mut Onboard<P>, port: &mut Port) {
        let now = clock::now();
        match self {
            RadioDecoder::Cobs => onboard.receive_radio(now, bytes),
            RadioDecoder::Other(format) => {
                onboard.observe_radio(bytes);
                format.receive(bytes, &mut |report| onboard.receive_report(now, &report), &mut |reply| {
                    port.reply(reply);
                });
            }
        }
    }
}
