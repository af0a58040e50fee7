//! The scene file: its syntax, its validation and what it means.

pub mod description;
pub mod diagnostic;
