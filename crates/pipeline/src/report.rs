//! Report of a finished request, and its JSON file.

pub(super) mod finish;
mod marks;

pub(super) use self::marks::ReportMarks;
use super::protocol::StageReport;
use super::settings::Effective;

/// Report of a finished request, written as JSON with `--report`.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// Version of glimt.
    pub glimt: &'static str,
    /// Scene file as named by the caller.
    pub scene: String,
    /// The image.
    pub image: ImageReport,
    /// Effective settings.
    pub settings: Effective,
    /// The lights and how they are sampled.
    pub lights: LightsReport,
    /// The traced photons. `None` if the image does not use photons.
    pub photons: Option<PhotonsReport>,
    /// All eight stages, in order.
    pub stages: Vec<StageReport>,
    /// Counters.
    pub counters: Counters,
    /// Wall-clock time of the request.
    pub seconds: f64,
    /// Highest resident memory of the process so far.
    pub peak_memory_bytes: u64,
}

/// The image in a report.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ImageReport {
    /// First output file. `None` if no file was written.
    pub path: Option<String>,
    /// All output files.
    pub paths: Vec<String>,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples per pixel.
    pub samples: SampleCounts,
    /// Expected error, relative to the mean luminance of the image: see
    /// [`Film::relative_error`](crate::film::Film::relative_error). `None` below two samples per pixel.
    pub error: Option<f64>,
    /// Render time in seconds, including earlier requests that this one continued.
    pub render_seconds: f64,
    /// Whether every pixel has the requested samples.
    pub complete: bool,
    /// Range of values mapped to black and white. `depth`: the minimum distance (white) and the maximum. Other data: 0
    /// and the maximum (white).
    pub range: Option<[f32; 2]>,
}

/// Statistics of the samples per pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct SampleCounts {
    /// Minimum.
    pub min: u32,
    /// Mean.
    pub mean: f64,
    /// Maximum.
    pub max: u32,
}

/// The lights in a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct LightsReport {
    /// Number of lights. A mesh counts once per emissive material.
    pub count: u64,
    /// Which lights each vertex samples.
    pub sampled: LightsSampled,
    /// Lights that a vertex samples from the tree: 32 × `shadow_samples` in whitted, 4 × in path; 0 without a tree.
    pub picks: u64,
    /// Nodes of the light tree.
    pub tree_nodes: u64,
    /// Bytes of the trees over lights and over the triangles of lights.
    pub memory_bytes: u64,
}

/// The photons in a report.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PhotonsReport {
    /// Photons per pass.
    pub count: u64,
    /// Passes traced by this request; others were cached.
    pub passes: u64,
    /// Photons emitted.
    pub emitted: u64,
    /// Photons stored.
    pub stored: u64,
    /// Texture lookups by photons.
    #[serde(skip)]
    pub lookups: u64,
    /// Seconds spent on emitting and storing photons.
    pub seconds: f64,
    /// Photons emitted per second.
    pub per_second: f64,
    /// Kernel radius of the first pass for caustics.
    pub caustic_radius: f32,
    /// Kernel radius of the first pass for light reflected from caustics.
    pub bounced_radius: f32,
    /// Bytes of the cached maps.
    pub kept_memory_bytes: u64,
    /// Maximum number of bytes of maps in use at once.
    pub used_memory_bytes: u64,
}

/// Which lights a vertex samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LightsSampled {
    /// All lights.
    All,
    /// A subset sampled by expected contribution.
    Picked,
}

/// Work counters of a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counters {
    /// Triangles of all mesh instances, and single triangles.
    pub triangles: u64,
    /// Shapes of all kinds. A mesh instance counts as one.
    pub objects: u64,
    /// Camera rays.
    pub camera_rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Reflected rays.
    pub reflected_rays: u64,
    /// Refracted rays.
    pub refracted_rays: u64,
    /// Rays scattered by diffuse and glossy surfaces.
    pub scattered_rays: u64,
    /// Photons emitted.
    pub photons_emitted: u64,
    /// Photons stored.
    pub photons_stored: u64,
    /// Texels read from files.
    pub texels_loaded: u64,
    /// Bytes of images and their mipmaps.
    pub texture_memory_bytes: u64,
    /// Texture lookups.
    pub texture_lookups: u64,
    /// Non-finite samples, which count as 0.
    pub non_finite_samples: u64,
    /// Bytes of acceleration structures.
    pub accel_memory_bytes: u64,
    /// Films in memory: the image's, and others that a toggle can return to.
    pub films: u64,
    /// Bytes of these films.
    pub film_memory_bytes: u64,
}
