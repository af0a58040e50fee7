//! Stages of a request and their results.

/// A stage of a request. Variants are in execution order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Read and validate the scene file.
    Parse,
    /// Load mesh files.
    Meshes,
    /// Load textures.
    Textures,
    /// Build acceleration structures.
    Accel,
    /// Collect the lights.
    Lights,
    /// Trace photons.
    Photons,
    /// Trace camera rays.
    Render,
    /// Encode and write images.
    Write,
}

impl Stage {
    /// All stages in order.
    pub const ALL: [Self; 8] = [
        Self::Parse,
        Self::Meshes,
        Self::Textures,
        Self::Accel,
        Self::Lights,
        Self::Photons,
        Self::Render,
        Self::Write,
    ];

    /// Name of the stage in reports and on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parse => "parse",
            Self::Meshes => "meshes",
            Self::Textures => "textures",
            Self::Accel => "accel",
            Self::Lights => "lights",
            Self::Photons => "photons",
            Self::Render => "render",
            Self::Write => "write",
        }
    }
}

/// Status of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum StageStatus {
    /// In progress. Never used in a finished report.
    Running,
    /// Run by this request.
    Done,
    /// Not run, because its inputs are unchanged.
    Reused,
    /// Not needed for this scene.
    Skipped,
}

/// Report of one stage.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StageReport {
    /// The stage.
    pub name: Stage,
    /// Status of the stage.
    pub status: StageStatus,
    /// Wall-clock time of the stage.
    pub seconds: f64,
    /// CPU time used by all threads of the process during the stage.
    pub processor_seconds: f64,
    /// Why the stage was skipped or its result reused, or a summary of its result. May be empty.
    pub why: String,
}
