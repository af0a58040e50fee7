//! Measures error over time for all combinations of scenes, methods, sample counts and seeds, with two
//! references per scene.
//!
//! [`run()`] executes a [`BenchRequest`] and returns [`Results`]. [`table`], [`csv`] and [`plot`] present
//! them, and [`baseline`] compares them with an earlier run. References are stored in a [`cache`].

pub mod baseline;
mod bias;
mod brightness;
pub mod cache;
pub mod csv;
mod measure;
mod methods;
pub mod plot;
mod reference;
mod request;
mod results;
mod run;
mod slope;
mod statistics;
pub mod table;
mod time_budget;

pub use bias::{MIN_SEEDS, SquaredBias};
pub use brightness::BrightnessDifference;
pub use methods::{Method, SweptSettingValues, methods_to_measure};
pub use request::{BenchError, BenchEvent, BenchRequest, PartialResultsError, ReferenceSource, StepSchedule};
pub use results::{
    BiasVerdict, ImageMeasurement, MethodAnalysis, ReferenceResult, Results, SceneResult, StepResult,
};
pub use run::{benchmark_image_size, run};
pub use slope::{ErrorOverTimeSlope, TimeToError};
