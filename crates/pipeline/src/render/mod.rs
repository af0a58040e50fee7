//! Internals of the render stage.
//!
//! | file | contents |
//! | --- | --- |
//! | [`scheduler`] | passes and rounds, which determine the samples to render next |
//! | [`film_state`], [`film_cache`] | the current film, and films cached for earlier settings |
//! | [`noise_goals`], [`time_budget`] | sample placement with a noise target or time limit |
//! | [`commands`] | the user's commands during a render |
//! | [`share`], [`checkpointer`] | one process's share of an image, and checkpoints |
//! | [`layers`] | additional channels of EXR files |
//! | [`forecast`] | progress, remaining time and final noise |
//! | [`coarse_image`], [`preview`] | images for the screen |

pub(super) mod checkpointer;
pub(super) mod coarse_image;
pub(super) mod commands;
pub(super) mod film_cache;
pub(super) mod film_state;
mod forecast;
pub(super) mod layers;
mod noise_goals;
pub(super) mod preview;
pub(super) mod scheduler;
pub(super) mod share;
mod time_budget;
