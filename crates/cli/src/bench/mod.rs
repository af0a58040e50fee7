//! Time against error: scenes × methods × sample counts × seeds, each picture measured against two references.
//!
//! [`run`] does an [`Order`] and gives [`Results`]; [`table`], [`csv`] and [`plot`] show them, [`baseline`] compares them with older
//! ones. References are made once and kept in [`cache`].

pub mod baseline;
mod bias;
mod brightness;
pub mod cache;
pub mod csv;
mod measure;
mod methods;
mod order;
mod pace;
pub mod plot;
mod reference;
mod results;
mod run;
mod slope;
mod statistics;
pub mod table;

pub use bias::{Bias, LEAST_SEEDS};
pub use brightness::Brightness;
pub use methods::{Method, Toggles, methods};
pub use order::{News, Order, ReferenceOrder, Steps, Trouble, Unfinished};
pub use results::{MethodResult, Picture, ReferenceResult, Results, SceneResult, Step, Verdict};
pub use run::{run, size};
pub use slope::{Slope, TimeTo};
