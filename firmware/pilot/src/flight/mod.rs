//! What a flight is made of: the plan fixed at engage, the leg under way, the account, the pace of targets.

pub(crate) mod ledger;
pub(crate) mod leg;
pub(crate) mod plan;
pub(crate) mod stream;
