//! One module per state that acts: waiting and shadow, flying and handing back.

pub(crate) mod flying;
pub(crate) mod waiting;
