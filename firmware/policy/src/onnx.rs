//! The tract engine. (being written)
