//! # glimt: a ray tracer that lives in the terminal
//!
//! A scene file is read, lowered to a small description, made ready to trace, rendered in passes
//! and written as a picture; the terminal UI and `--once` drive the same pipeline by messages.
//!
//! ## The rooms
//!
//! | room | what it knows |
//! | --- | --- |
//! | [`system`] | the operating system's errors in plain words, which files have an end |
//! | [`choice`](mod@choice) | values that are chosen by name |
//! | [`math`] | numbers, vectors, transforms, colour |
//! | [`control`] | the cancel token and the progress sink |
//! | [`geometry`] | rays, boxes, shapes, hits with error bounds |
//! | [`accel`] | trees over boxes and ids, a closure tests the shape; over triangles, of boxes by vector instructions and of planes |
//! | [`sampling`] | sample streams, warps, distributions |
//! | [`materials`] | phong and its lobes, mirror, glass; texture lookup, normal maps, Fresnel |
//! | [`lights`] | point and area lights, light from beyond the scene; a tree over many; the photons that they emit |
//! | [`scene`] | the scene file: parsing, validation, diagnostics, the lowered description |
//! | [`assets`] | bytes → meshes, textures, orbiter cameras |
//! | [`world`] | everything ready to trace, immutable |
//! | [`film`] | sums of samples, tone mapping, pictures |
//! | [`integrators`] | whitted, path, photons, views |
//! | [`compare`] | the error of a picture against a reference |
//! | [`output`] | encoders, atomic writes, metadata |
//! | [`pipeline`] | stages, caches, the worker, watching files |
//! | [`mod@bench`] | run time against error: references, estimates, tables, plots |
//! | [`tui`] | the terminal front end |
//! | [`cli`] | arguments, the headless front end |
//!
//! ## The crates
//!
//! The rooms stand in member crates under `crates/`, so that they are compiled side by side and an edit compiles what lies above it
//! alone; this crate hands them all on. Each crate names the rooms below it at its root: `crate::math` is the same everywhere.
//!
//! | crate | rooms |
//! | --- | --- |
//! | `base` | [`system`], [`choice`](mod@choice), [`math`], [`control`], [`sampling`], [`film`] |
//! | `kernel` | [`geometry`], [`accel`], [`materials`], [`lights`] |
//! | `scene` | [`scene`] |
//! | `files` | [`assets`], [`output`], [`compare`] |
//! | `trace` | [`world`], [`integrators`] |
//! | `pipeline` | [`pipeline`] |
//! | `tui` | [`tui`] |
//! | `cli` | [`mod@bench`], [`cli`] |
//!
//! Nothing is optimised across crates at the end of a build: a small function that others call for each ray or sample is marked
//! `#[inline]`.
//!
//! ## The arrows
//!
//! Each room uses the rooms on its right and no others; `tests/suite/house` reads the sources and holds them to
//! this table, and the table to them. Within a room files import in one direction too, but for the pairs listed there.
//!
//! ```text
//! system      ->
//! choice      ->
//! math        ->
//! control     ->
//! geometry    -> sampling math
//! accel       -> geometry math control
//! sampling    -> math choice
//! materials   -> math choice
//! lights      -> geometry sampling materials math choice control
//! scene       -> geometry materials lights sampling film math choice system
//! assets      -> geometry materials math control system
//! world       -> scene assets accel materials lights geometry math control
//! film        -> math choice
//! integrators -> world scene materials lights geometry sampling film math choice control
//! compare     -> assets film math control
//! output      -> film math control system
//! pipeline    -> integrators world assets scene film output lights materials math choice control system
//! bench       -> pipeline compare output scene film math choice control
//! tui         -> pipeline scene film math choice system
//! cli         -> bench pipeline tui compare output scene film math choice control system
//! ```
//!
//! ## What holds everywhere
//!
//! - The same scene, settings and seed give the same bits, whatever the number of threads, on every machine: random
//!   numbers are a function of pixel, sample and dimension, every sum has a fixed order, and no function of the system's
//!   mathematical library is between a scene and its picture.
//! - Rays travel in batches; a hit carries a bound on its error, from which the next ray starts: no distance is a
//!   constant. Where a constant tells degenerate from usable it is relative to the size of what it judges.
//! - A scene's coordinates are `f64`; what is traced is `f32` from an origin near what the camera looks at (`world::origin`),
//!   meshes from one of their own.
//! - Rendering cannot fail, only be cancelled. Errors are values that name the file and the place.
//! - Files are touched in `assets`, `output`, `scene` (the scene, and whether what it names is there),
//!   `pipeline::watch`, `bench::cache` and `cli::new` alone.
//! - `unsafe` code is in `accel::wide_bvh::simd`, with a portable twin that gives the same bits, and in `system::abort`, which gives
//!   the terminal back when an allocation fails.
//! - `tui` does not know `world`; `world` does not know pixels or time.

pub use glimt_base::{choice, control, film, math, sampling, system};
pub use glimt_cli::{bench, cli};
pub use glimt_files::{assets, compare, output};
pub use glimt_kernel::{accel, geometry, lights, materials};
pub use glimt_pipeline::pipeline;
pub use glimt_scene::scene;
pub use glimt_trace::{integrators, world};
pub use glimt_tui::tui;
