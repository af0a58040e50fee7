//! # glimt: a ray tracer that lives in the terminal
//!
//! glimt parses a scene file into a small description, builds acceleration structures, renders in passes and
//! writes the image. The terminal UI and `--once` use the same pipeline and communicate with it through
//! messages.
//!
//! ## Modules
//!
//! | module | contents |
//! | --- | --- |
//! | [`system`] | the operating system: error messages, file size limits, priorities, processor time, aborts |
//! | [`choice`](mod@choice) | named values, spelled the same in scene files, options and reports |
//! | [`math`] | numbers, vectors, transforms, color |
//! | [`control`] | the cancel token and the progress sink |
//! | [`geometry`] | rays, boxes, shapes, hits with error bounds |
//! | [`accel`] | bounding volume hierarchies over any shapes and, with vector instructions, over triangles; a k-d tree over triangles |
//! | [`sampling`] | sample streams, warps, distributions |
//! | [`materials`] | BSDFs in packets (Phong, metal, plastic, principled, frosted glass), coats over them, blends, mirrors, glass, panes; opacity; image and procedural textures, normal maps, height maps, Fresnel |
//! | [`lights`] | point lights (`delta`), lights beyond the scene (`infinite`) and emitting shapes (`area`); the light tree; photon emission |
//! | [`scene`] | the scene file: definitions of its keys, parsing, writing, validation, diagnostics, the lowered description |
//! | [`assets`] | readers for meshes, images, glTF and orbiter cameras |
//! | [`world`] | the immutable structures that rays are traced against |
//! | [`film`] | pixel sums, convergence and noise estimates, tone mapping |
//! | [`integrators`] | whitted, path, photons, AOVs |
//! | [`compare`] | error metrics for an image compared with a reference |
//! | [`output`] | encoders, atomic writes, metadata |
//! | [`pipeline`] | scene preparation, sessions, the worker, file watching, importers of foreign formats |
//! | [`tui`] | the terminal front end |
//! | [`cli`] | arguments, subcommands, the headless front end; `bench`, which plots error against time |
//!
//! ## Crates
//!
//! The modules are divided into member crates under `crates/`. Crates compile in parallel, and an edit
//! recompiles only its own crate and dependent crates. This crate re-exports all of them. Each crate
//! re-exports the modules it depends on at its root, so `crate::math` has the same meaning everywhere.
//!
//! | crate | modules |
//! | --- | --- |
//! | `base` | [`system`], [`choice`](mod@choice), [`math`], [`control`], [`sampling`], [`film`] |
//! | `kernel` | [`geometry`], [`accel`], [`materials`], [`lights`] |
//! | `scene` | [`scene`] |
//! | `files` | [`assets`], [`output`], [`compare`] |
//! | `trace` | [`world`], [`integrators`] |
//! | `pipeline` | [`pipeline`] |
//! | `tui` | [`tui`] |
//! | `cli` | [`cli`] |
//!
//! There is no cross-crate optimization. Small functions that other crates call per ray or sample must be
//! marked `#[inline]`.
//!
//! ## The life of a save
//!
//! From a file notification to the preview and the written image. Paths start with the module: `tui/run.rs`
//! is `crates/tui/src/run.rs`. The table above lists each module's crate.
//!
//! 1. `pipeline/watch/mod.rs`: the operating system reports a change. The watcher compares contents and puts
//!    only actual changes into the event loop's queue (`tui/event_queue.rs`).
//! 2. `tui/run.rs` takes the change from the queue (`tui/event.rs`), and `tui/update/mod.rs` updates the state.
//! 3. `tui/update/request.rs` creates a request, and `tui/run.rs` sends it. The header (`tui/view/header.rs`)
//!    changes first: it is redrawn as in step 9 and shows that a render is running.
//! 4. `pipeline/worker/mailbox.rs` holds at most one pending request. A newer request cancels the current
//!    render.
//! 5. `pipeline/session/request.rs` runs the steps of the request. The first is
//!    `pipeline/session/preparation.rs`: it reads the scene with `pipeline/prepare/mod.rs`
//!    (`pipeline/stages/parse.rs`, `pipeline/plan.rs`, then meshes, textures and glass), and builds its world
//!    with `pipeline/prepare/build.rs` (accel and lights). A stage reuses its result if its key in
//!    `pipeline/keys.rs` is unchanged. If the scene has errors, the request ends here and the last image stays
//!    on the screen.
//! 6. `pipeline/session/render.rs` traces photons and renders the film: `pipeline/render/scheduler.rs`
//!    schedules passes, and `pipeline/trace.rs` renders their tiles on the thread pool. For large images, and
//!    while photons are traced, `pipeline/render/coarse_image.rs` renders a coarse image first.
//! 7. `integrators/mod.rs` renders a tile (see below). `pipeline/render/film_state.rs` adds the samples to
//!    the film.
//! 8. `pipeline/render/preview.rs` puts a preview into its slot, and `cli/live.rs` puts an event into the event
//!    loop's queue.
//! 9. `tui/presenter.rs` takes the preview when a frame is due, `tui/view/preview.rs` converts it to cells,
//!    `tui/display.rs` limits the cells per frame, `tui/paint/mod.rs` encodes them in the fewest bytes, and
//!    `tui/writer.rs` writes the bytes.
//! 10. `pipeline/session/outputs.rs` writes the finished image: `pipeline/stages/write.rs` encodes it, and
//!     `output/write.rs` writes it to a temporary file and renames the file.
//!
//! ## The life of a ray
//!
//! From the camera to the film. Files are in `integrators/` unless the path starts with another module.
//!
//! 1. `mod.rs` receives a tile's samples and the effective settings. `behavior.rs` determines how paths
//!    behave with these settings. `transport/tile.rs` contains the tile's state.
//! 2. `path.rs` contains the main loop: it traces packets of sixteen rays from `transport/camera.rs`, bounce
//!    by bounce. `path/emission.rs` adds the light that the rays find.
//! 3. `transport/packet.rs` intersects a packet with the scene: `world/geometry.rs`, then the trees in
//!    `accel/wide_bvh/`, or `geometry/triangle_list.rs` if there are few triangles.
//! 4. `transport/packet.rs` collects hits on simple materials in packets of sixteen vertices
//!    (`transport/batch.rs`). All BSDFs in a packet are of the same kind (`materials/bxdfs/mod.rs`).
//! 5. Other hits are handled one at a time: `transport/walk.rs` skips boundaries within a single glass body
//!    (`transport/crossing.rs`), `transport/vertex.rs` evaluates the surface, and `path/interactions.rs`
//!    shades it or passes it to `path/vertices.rs`, which queues diffuse and glossy surfaces.
//! 6. At mirrors and glass, `transport/interface.rs` generates the rays for the next round.
//! 7. `direct/queue.rs` computes direct light for packets: `direct/all_lights.rs` or `direct/light_tree.rs`
//!    samples lights, `direct/mis.rs` computes MIS weights, and `direct/shadow_rays.rs` traces shadow rays.
//! 8. `direct/lobe_rays.rs` finds lights in narrow lobes. `photons/gather.rs` adds photons traced by
//!    `photons/emit.rs`.
//! 9. `transport/scatter.rs` samples the next direction of each continuing path.
//! 10. `transport/accumulator.rs` sums the view's values per sample. `film/sums.rs` adds samples to pixels.
//!
//! CONTRIBUTING explains how to add a key, a shape, a light, a material, an integrator or a foreign format.
//! `tests/README.md` explains where to put tests and how to run them.
//!
//! ## Dependencies
//!
//! Each module uses only the modules to the right of its arrow. `tests/suite/architecture` compares the
//! sources with this table. The files within a module have no import cycles, except for the pairs listed in
//! that test.
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
//! film        -> math choice system
//! integrators -> world scene materials lights geometry sampling film math choice control
//! compare     -> assets film math control
//! output      -> film math choice control system
//! pipeline    -> integrators world assets scene film output lights materials math choice control system
//! tui         -> pipeline scene film math choice system
//! cli         -> pipeline tui compare output scene accel film math choice control system
//! ```
//!
//! ## Invariants
//!
//! - The same scene, settings and seed produce the same bits with any number of threads on every machine.
//!   Random numbers are a function of pixel, sample and dimension. Every sum has a fixed order. Images do not
//!   depend on the system's math library.
//! - Rays are traced in batches. Each hit has an error bound, which offsets the origin of the next ray. There
//!   are no constant epsilons. Thresholds for degenerate input are relative to the size of the input.
//! - Scene coordinates are `f64`. Tracing uses `f32` relative to an origin near the camera's target
//!   (`world::origin`). Each mesh has its own origin.
//! - Rendering cannot fail, but it can be canceled. Errors are values that contain the file and the
//!   position.
//! - Only `assets`, `output`, `scene` (the scene file, and whether the files it references exist),
//!   `pipeline::watch`, `pipeline::identity`, `pipeline::render::checkpointer` (checkpoints),
//!   `cli::bench::cache` and the commands `new`, `import` and `doctor` access files.
//! - `unsafe` code is used only in `accel::wide_bvh::simd`, which has a portable version with bitwise
//!   identical results, and in `system::abort`, which restores the terminal if an allocation fails.
//! - `tui` does not use `world`. `world` is independent of pixels and time.

pub use glimt_base::{choice, control, film, math, sampling, system};
pub use glimt_cli::{self as cli, bench};
pub use glimt_files::{assets, compare, output};
pub use glimt_kernel::{accel, geometry, lights, materials};
pub use glimt_pipeline as pipeline;
pub use glimt_scene as scene;
pub use glimt_trace::{integrators, world};
pub use glimt_tui as tui;
