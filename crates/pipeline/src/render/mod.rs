//! The internals of the render stage.
//!
//! | file | |
//! | --- | --- |
//! | [`scheduler`] | passes and rounds: which samples are rendered next |
//! | [`film_state`], [`film_cache`] | films that are being rendered, and those of earlier settings |
//! | [`noise_goals`], [`time_budget`] | where samples go: until the error asked for, until the time is up |
//! | [`share`], [`keeping`] | the share of one of several processes; checkpoints |
//! | [`layers`] | numbers about the pixels of the finished picture |
//! | [`forecast`] | progress, the time left, the noise left |
//! | [`first_picture`], [`preview`] | pictures for the screen |

pub(super) mod film_cache;
pub(super) mod film_state;
pub(super) mod first_picture;
mod forecast;
pub(super) mod keeping;
pub(super) mod layers;
mod noise_goals;
pub(super) mod preview;
pub(super) mod scheduler;
pub(super) mod share;
mod time_budget;
