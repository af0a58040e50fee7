//! Internals of the render stage.
//!
//! | file | contents |
//! | --- | --- |
//! | [`scheduler`] | passes and rounds: which samples are rendered next |
//! | [`film_state`], [`film_cache`] | the current film, and cached films of earlier settings |
//! | [`noise_goals`], [`time_budget`] | placement of samples: up to a noise target, or within a time limit |
//! | [`share`], [`checkpointer`] | the share of one of several processes; checkpoints |
//! | [`layers`] | additional channels of EXR files |
//! | [`forecast`] | progress, remaining time and final noise |
//! | [`first_picture`], [`preview`] | images for the screen |

pub(super) mod checkpointer;
pub(super) mod film_cache;
pub(super) mod film_state;
pub(super) mod first_picture;
mod forecast;
pub(super) mod layers;
mod noise_goals;
pub(super) mod preview;
pub(super) mod scheduler;
pub(super) mod share;
mod time_budget;
