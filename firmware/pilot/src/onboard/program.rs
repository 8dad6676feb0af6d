//! What a program adds to its pilot: other models, and files for ground stations.

use super::Onboard;
use crate::{Deliberator, State};
use gleaner_link::{Address, ParameterId, Severity};

impl<P: Deliberator> Onboard<P> {
    /// The program has several models. It watches `GLN_MODEL` and answers with [`Onboard::replace_policy`] and
    /// [`Onboard::show_model`]. Without this call `GLN_MODEL` stays 0.
    pub fn offer_models(&mut self) {
        self.offers_models = true;
    }

    /// Whether the policy may be replaced: nothing is decided or flown with it.
    #[must_use]
    pub const fn may_replace_policy(&self) -> bool {
        !self.state().commands() && !matches!(self.state(), State::Shadow)
    }

    /// Puts a policy that passed its self-test in the place of the present one, which is returned.
    ///
    /// # Errors
    /// Returns `policy` while [`Onboard::may_replace_policy`] is false.
    pub fn replace_policy(&mut self, policy: P) -> Result<P, P> {
        if !self.may_replace_policy() {
            return Err(policy);
        }
        self.inference_time = None;
        Ok(core::mem::replace(&mut self.policy, policy))
    }

    /// Shows in `GLN_MODEL` which model decides. A number out of the parameter's range changes nothing.
    pub fn show_model(&mut self, number: u8) {
        if self.link.parameters().model() != i8::try_from(number).unwrap_or(i8::MAX) {
            let _ = self.link.set_parameter(ParameterId::Model, f32::from(number));
        }
    }

    /// `GLN_MODEL` stays 0 in a program that has one model.
    pub(super) fn show_only_model(&mut self) {
        if !self.offers_models && self.link.parameters().model() != 0 {
            self.show_model(0);
            self.link.say(Severity::Warning, format_args!("gleaner: no other model is installed"));
        }
    }

    /// Names the general metadata file: [`gleaner_link::Component::set_metadata`].
    pub fn set_metadata(&mut self, uri: &str, crc: u32) -> bool {
        self.link.set_metadata(uri, crc)
    }

    /// Answers a MAVLink FTP request: [`gleaner_link::Component::reply_file`].
    pub fn reply_file(&mut self, to: Address, header: [u8; 12], data: &[u8]) {
        self.link.reply_file(to, header, data);
    }
}
