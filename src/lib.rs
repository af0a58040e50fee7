//! # glimt: a ray tracer that lives in the terminal
//!
//! glimt reads a scene file, lowers it to a small description, prepares it for tracing, renders it in passes and writes
//! the picture. The terminal UI and `--once` drive the same pipeline by messages.
//!
//! ## The rooms
//!
//! | room | what it knows |
//! | --- | --- |
//! | [`system`] | the operating system: its errors in plain words, files that have an end, priorities, processor time, aborts |
//! | [`choice`](mod@choice) | values with names: the same words in scene files, options and reports |
//! | [`math`] | numbers, vectors, transforms, colour |
//! | [`control`] | the cancel token and the progress sink |
//! | [`geometry`] | rays, boxes, shapes, hits with error bounds |
//! | [`accel`] | bounding volume hierarchies over any shapes, which a closure tests, and over triangles, by vector instructions; a k-d tree over triangles |
//! | [`sampling`] | sample streams, warps, distributions |
//! | [`materials`] | rough BSDFs in rows (phong, metal, plastic, principled, frosted glass), smooth coats, mirror, glass, panes; opacity; texture lookup, normal maps, heights, Fresnel |
//! | [`lights`] | lights without extent (`delta`), from beyond the scene (`infinite`), and shapes that emit (`area`); a tree over many lights; photon emission |
//! | [`scene`] | the scene file: the definition of its keys, parsing, validation, diagnostics, the lowered description |
//! | [`assets`] | bytes → meshes, glTF files, textures, orbiter cameras |
//! | [`world`] | everything ready to trace, immutable |
//! | [`film`] | sums of samples, the noise that their steps forecast, tone mapping, pictures |
//! | [`integrators`] | whitted, path, photons, views |
//! | [`compare`] | the error of a picture against a reference |
//! | [`output`] | encoders, atomic writes, metadata |
//! | [`pipeline`] | stages, caches, the worker, watching files, scenes of models |
//! | [`mod@bench`] | error against time: references, estimates, tables, plots |
//! | [`tui`] | the terminal front end |
//! | [`cli`] | arguments, the headless front end |
//!
//! ## The crates
//!
//! The rooms are in member crates under `crates/`. Crates compile side by side, and an edit only recompiles its own crate and those
//! above it; this crate re-exports them all. Each crate names the rooms below it at its root: `crate::math` is the same everywhere.
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
//! The build does no optimisation across crates: mark `#[inline]` on small functions that other crates call for each ray or
//! sample.
//!
//! ## The life of a save
//!
//! From the event of the watcher to the picture on the screen, and to the written file. Paths begin with the room: `tui/run.rs` is
//! `crates/tui/src/tui/run.rs`; the table above names the crate of each room.
//!
//! 1. `pipeline/watch/mod.rs`: the system hints at a change; the watcher compares contents and reports
//!    only real differences. `cli/live.rs` forwards them.
//! 2. `tui/run.rs` receives it as an event (`tui/event.rs`); `tui/update/mod.rs` notes the change.
//! 3. `tui/update/request.rs` makes a request; `tui/run.rs` sends it. The first cell that changes is the header's
//!    (`tui/view/header.rs`), which goes to the screen as in step 9: it says that a render runs.
//! 4. `pipeline/worker.rs`: the mailbox of one request; a newer request cancels the render under way.
//! 5. `pipeline/engine/mod.rs`: `pipeline/stages/parse.rs`, `pipeline/plan.rs`, then meshes, glass, textures, accel, lights and photons, each reused
//!    if its key in `pipeline/keys.rs` is that of before. A broken scene ends here: the picture before it stays.
//! 6. `pipeline/render/scheduler.rs` starts passes, `pipeline/trace.rs` renders tiles on the pool. A large picture begins with a coarse
//!    one, `pipeline/render/first_picture.rs`; with photons, `engine/mod.rs` shows one before it traces them.
//! 7. `integrators/mod.rs` renders a tile: see below. `pipeline/render/film_state.rs` adds its samples to the film.
//! 8. `pipeline/render/preview.rs` puts a preview into the slot; `cli/live.rs` tells the front end.
//! 9. `tui/presenter.rs` takes it when its time comes, `tui/view/preview.rs` makes cells of it, `tui/display.rs` decides how many of them
//!    go now, `tui/paint/mod.rs` makes the cheapest bytes, and `tui/writer.rs` writes them.
//! 10. `pipeline/stages/write.rs` encodes the finished picture; `output/write.rs` renames the temporary file into its place.
//!
//! ## The life of a ray
//!
//! From the camera to the film; all files are in `integrators/` but where another room is named:
//!
//! 1. `mod.rs`: takes the tile's samples and the settings that count; `behavior.rs` derives what paths do; `transport/tile.rs` stores all.
//! 2. `transport/camera.rs` makes rows of sixteen rays; `camera_paths.rs` follows them bounce by bounce.
//! 3. `transport/packet.rs` intersects a row: `world/geometry.rs`, then the trees of `accel/wide_bvh/`, or `geometry/triangle_list.rs` for few
//!    triangles.
//! 4. `transport/packet.rs` puts surfaces of simple materials into rows of sixteen vertices, `transport/batch.rs`; all BSDFs of a row are of
//!    one kind, `materials/rough/mod.rs`.
//! 5. Others go one by one: `transport/walk.rs` passes parts of one glass (`transport/crossing.rs`), `transport/vertex.rs` prepares the surface.
//! 6. At mirrors and glass, `transport/interface.rs` makes the rays of the next round.
//! 7. `direct/queue.rs` lights rows: `direct/all_lights.rs` or `direct/light_tree.rs` sample lights, `direct/mis.rs` weighs, `direct/shadow_rays.rs`
//!    traces.
//! 8. `direct/lobe_rays.rs` finds lights in narrow lobes; `photons/gather.rs` adds photons, which `photons/emit.rs` has traced.
//! 9. `transport/scatter.rs` scatters paths that go on, for the next round.
//! 10. `transport/accumulator.rs` sums what the view shows, by sample; `film/sums.rs` adds samples to pixels.
//!
//! CONTRIBUTING tells, step by step, how to add a key, a shape, a light, a material, an integrator; `tests/README.md` where tests go
//! and how to run one.
//!
//! ## The arrows
//!
//! Each room uses the rooms on its right and no others: `tests/suite/house` compares the sources with this table.
//! Within a room, files import in one direction too, but for the pairs listed there.
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
//! output      -> film math choice control system
//! pipeline    -> integrators world assets scene film output lights materials math choice control system
//! bench       -> pipeline compare output scene film math choice control
//! tui         -> pipeline scene film math choice system
//! cli         -> bench pipeline tui compare output scene accel film math choice control system
//! ```
//!
//! ## What holds everywhere
//!
//! - The same scene, settings and seed give the same bits, whatever the number of threads, on every machine. Random numbers are a
//!   function of pixel, sample and dimension, every sum has a fixed order, and no function of the system's mathematical library
//!   affects a picture.
//! - Rays travel in batches. A hit carries a bound on its error, from which the next ray starts: no epsilon is a constant.
//!   A constant that separates degenerate from usable is relative to the size of what it judges.
//! - A scene's coordinates are `f64`. Tracing uses `f32` relative to an origin near the camera's target (`world::origin`); each
//!   mesh has an origin of its own.
//! - Rendering cannot fail, only be cancelled. Errors are values that name the file and the place.
//! - Only `assets`, `output`, `scene` (the scene, and whether the files that it names exist), `pipeline::watch`,
//!   `pipeline::identity`, `pipeline::render::keeping` (checkpoints), `bench::cache`, `cli::new`, `cli::import` and `cli::doctor` access
//!   files.
//! - `unsafe` code is in `accel::wide_bvh::simd`, with a portable twin that gives the same bits, and in `system::abort`, which
//!   restores the terminal if an allocation fails.
//! - `tui` does not know `world`; `world` does not know pixels or time.

pub use glimt_base::{choice, control, film, math, sampling, system};
pub use glimt_cli::{bench, cli};
pub use glimt_files::{assets, compare, output};
pub use glimt_kernel::{accel, geometry, lights, materials};
pub use glimt_pipeline::pipeline;
pub use glimt_scene::scene;
pub use glimt_trace::{integrators, world};
pub use glimt_tui::tui;
