//! The report of a finished request, and its file.

pub(super) mod finish;
mod marks;

pub(super) use self::marks::Marks;
use super::protocol::StageReport;
use super::settings::Effective;

/// The report of one finished request: the JSON of `--report`.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// Version.
    pub glimt: &'static str,
    /// The scene file as named by the caller.
    pub scene: String,
    /// The picture.
    pub image: ImageReport,
    /// The settings it was made with.
    pub settings: Effective,
    /// The lights, and how vertices sample them.
    pub lights: LightsReport,
    /// The photons that were sent for it; none where nothing gathers them.
    pub photons: Option<PhotonsReport>,
    /// All eight stages, in order.
    pub stages: Vec<StageReport>,
    /// Counters of the work.
    pub counters: Counters,
    /// Wall-clock time of the request.
    pub seconds: f64,
    /// Highest resident memory of the process so far.
    pub peak_memory_bytes: u64,
}

/// The picture in a report.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ImageReport {
    /// The first output, or none where nothing was written.
    pub path: Option<String>,
    /// Every output.
    pub paths: Vec<String>,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Samples per pixel.
    pub samples: SampleCounts,
    /// The error to expect, relative to the picture's mean luminance; see
    /// [`Film::relative_error`](crate::film::Film::relative_error). None below two samples a pixel.
    pub error: Option<f64>,
    /// Seconds that it was rendered for: by this request, and by those before that it goes on from.
    pub render_seconds: f64,
    /// Whether every pixel got the requested samples.
    pub complete: bool,
    /// Numbers at both ends of a view that is stretched to its range. `depth`: the least distance, which is white, and the
    /// greatest. Others: 0, and the greatest number, which is white.
    pub range: Option<[f32; 2]>,
}

/// Samples per pixel over a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct SampleCounts {
    /// Fewest.
    pub min: u32,
    /// On average.
    pub mean: f64,
    /// Most.
    pub max: u32,
}

/// The lights of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct LightsReport {
    /// Number of lights; a mesh counts for each of its emitting materials.
    pub count: u64,
    /// Lights that each vertex samples.
    pub sampled: LightsSampled,
    /// Lights that a vertex picks: 32 × `shadow_samples` in whitted, 4 × in path; 0 without a tree.
    pub picks: u64,
    /// Nodes of the tree that it picks from.
    pub tree_nodes: u64,
    /// Bytes held by trees over lights, and over the triangles of lights.
    pub memory_bytes: u64,
}

/// The photons of a picture.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PhotonsReport {
    /// Photons that a pass sends out.
    pub count: u64,
    /// Passes that were sent; others were kept from before.
    pub passes: u64,
    /// Photons that were sent.
    pub emitted: u64,
    /// Photons that were stored.
    pub stored: u64,
    /// Texture look-ups on their ways.
    #[serde(skip)]
    pub lookups: u64,
    /// Seconds that it took to send and store them.
    pub seconds: f64,
    /// Photons sent in each of these seconds.
    pub per_second: f64,
    /// Radius of the first pass's kernel for caustics.
    pub caustic_radius: f32,
    /// Radius of the first pass's kernel for what is thrown back from caustics.
    pub bounced_radius: f32,
    /// Bytes held by maps that are kept.
    pub kept_memory_bytes: u64,
    /// Most bytes of maps that were in use at once.
    pub used_memory_bytes: u64,
}

/// Selection of lights at a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LightsSampled {
    /// All of them.
    All,
    /// Some lights that it picks by their expected contribution.
    Picked,
}

/// Counts of the work of a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counters {
    /// Triangles over all mesh instances and single triangles.
    pub triangles: u64,
    /// Shapes of any kind; a mesh instance counts as one.
    pub objects: u64,
    /// Rays from the camera.
    pub camera_rays: u64,
    /// Rays towards lights.
    pub shadow_rays: u64,
    /// Mirrored rays.
    pub reflected_rays: u64,
    /// Refracted rays.
    pub refracted_rays: u64,
    /// Rays that go on from diffuse and glossy surfaces.
    pub scattered_rays: u64,
    /// Photons sent out.
    pub photons_emitted: u64,
    /// Photons stored.
    pub photons_stored: u64,
    /// Texels read from files.
    pub texels_loaded: u64,
    /// Bytes held by images and their mipmap levels.
    pub texture_memory_bytes: u64,
    /// Texture look-ups.
    pub texture_lookups: u64,
    /// Samples that were not finite and count as 0.
    pub non_finite_samples: u64,
    /// Bytes held by trees.
    pub accel_memory_bytes: u64,
    /// FilmCache kept: that of the picture, and those that a toggle that is switched back finds again.
    pub films: u64,
    /// Bytes held by them.
    pub film_memory_bytes: u64,
}
