//! Report of a finished request, and its JSON file.

pub(super) mod finish;
mod marks;

pub(super) use self::marks::ReportRecognitionFields;
use super::protocol::StageReport;
use super::settings::EffectiveSettingsSummary;
use crate::film::SampleCountStats;

/// Report of a finished request. `--report` writes it as JSON.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// The glimt version.
    pub glimt: &'static str,
    /// Scene file, as specified by the caller.
    pub scene: String,
    /// Size, samples and files of the image.
    pub image: ImageReport,
    /// Effective settings.
    pub settings: EffectiveSettingsSummary,
    /// The lights and how they are sampled.
    pub lights: LightSamplingReport,
    /// Photon statistics, or `None` if the image does not use photons.
    pub photons: Option<PhotonsReport>,
    /// All eight stages, in order.
    pub stages: Vec<StageReport>,
    /// Work counters.
    pub counters: WorkCounters,
    /// Wall-clock time of the request.
    pub seconds: f64,
    /// Peak resident memory of the process so far.
    pub peak_memory_bytes: u64,
}

/// The image in a report.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ImageReport {
    /// First output file, or `None` if no file was written.
    pub path: Option<String>,
    /// All output files.
    pub paths: Vec<String>,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples per pixel.
    pub samples: SampleCounts,
    /// Expected error relative to the image's mean luminance. See
    /// [`Film::relative_error`](crate::film::Film::relative_error). `None` with fewer than two samples per
    /// pixel.
    pub error: Option<f64>,
    /// Render time in seconds, including earlier requests that this request continued.
    pub render_seconds: f64,
    /// Whether every pixel has the requested number of samples.
    pub complete: bool,
    /// Range of values shown as grays. For `depth`, from the minimum distance (white) to the maximum (black).
    /// For other data, from 0 (black) to the maximum (white).
    pub range: Option<[f32; 2]>,
}

/// Statistics of the samples per pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct SampleCounts {
    /// Minimum samples per pixel.
    pub min: u32,
    /// Mean samples per pixel.
    pub mean: f64,
    /// Maximum samples per pixel.
    pub max: u32,
}

impl From<SampleCountStats> for SampleCounts {
    fn from(SampleCountStats { min, mean, max }: SampleCountStats) -> Self {
        Self { min, mean, max }
    }
}

/// The lights in a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct LightSamplingReport {
    /// Number of lights. A mesh counts once per emissive material.
    pub count: u64,
    /// Which lights are sampled at each vertex.
    pub sampled: SampledLightSet,
    /// Number of lights sampled from the light tree at each vertex: 32 × `shadow_samples` for `whitted`, or 4
    /// × `shadow_samples` for `path`. This is 0 without a tree.
    pub picks: u64,
    /// Number of nodes in the light tree.
    pub tree_nodes: u64,
    /// Bytes used by the light tree and the trees over emissive triangles.
    pub memory_bytes: u64,
}

/// The photons in a report.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PhotonsReport {
    /// Photons per pass.
    pub count: u64,
    /// Passes traced by this request. The other passes were cached.
    pub passes: u64,
    /// Photons emitted.
    pub emitted: u64,
    /// Photons stored.
    pub stored: u64,
    /// Texture lookups for photons.
    #[serde(skip)]
    pub lookups: u64,
    /// Seconds spent emitting and storing photons.
    pub seconds: f64,
    /// Photons emitted per second.
    pub per_second: f64,
    /// Kernel radius for caustics in the first pass.
    pub caustic_radius: f32,
    /// Kernel radius for light reflected from caustics in the first pass.
    pub bounced_radius: f32,
    /// Bytes used by cached maps.
    pub kept_memory_bytes: u64,
    /// Peak memory use of all maps, in bytes.
    pub used_memory_bytes: u64,
}

/// Which lights are sampled at a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SampledLightSet {
    /// All lights.
    All,
    /// A subset, sampled according to expected contribution.
    Picked,
}

/// Work counters of a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct WorkCounters {
    /// Triangles in all mesh instances, plus standalone triangles.
    pub triangles: u64,
    /// Shapes of all kinds. A mesh instance counts as one.
    pub objects: u64,
    /// Camera rays traced.
    pub camera_rays: u64,
    /// Shadow rays traced.
    pub shadow_rays: u64,
    /// Reflected rays traced.
    pub reflected_rays: u64,
    /// Refracted rays traced.
    pub refracted_rays: u64,
    /// Rays scattered by diffuse and glossy surfaces.
    pub scattered_rays: u64,
    /// Photons emitted.
    pub photons_emitted: u64,
    /// Photons stored.
    pub photons_stored: u64,
    /// Texels read from files.
    pub texels_loaded: u64,
    /// Bytes used by images and their mipmaps.
    pub texture_memory_bytes: u64,
    /// Texture lookups.
    pub texture_lookups: u64,
    /// Non-finite samples, which are treated as 0.
    pub non_finite_samples: u64,
    /// Bytes used by acceleration structures.
    pub accel_memory_bytes: u64,
    /// Number of films in memory: the film of the current image and the films cached for earlier settings.
    pub films: u64,
    /// Bytes used by all films in memory.
    pub film_memory_bytes: u64,
}
