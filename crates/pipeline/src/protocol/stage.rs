//! The stages of a request, and what each did.

/// The stages, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Reading and validating the scene file.
    Parse,
    /// Reading mesh files.
    Meshes,
    /// Reading textures.
    Textures,
    /// Building trees.
    Accel,
    /// Gathering the lights.
    Lights,
    /// Shooting photons.
    Photons,
    /// Tracing.
    Render,
    /// Encoding and writing pictures.
    Write,
}

impl Stage {
    /// All of them, in order.
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

    /// Its name in reports and on the screen.
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
pub enum Status {
    /// At work. Never in a finished report.
    Running,
    /// Done in this request.
    Done,
    /// Its inputs did not change.
    Reused,
    /// This scene does not need it.
    Skipped,
}

/// One line of the table of stages.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StageReport {
    /// The stage.
    pub name: Stage,
    /// Its status.
    pub status: Status,
    /// Wall-clock time of the stage.
    pub seconds: f64,
    /// Processor time of all threads of the process during the stage.
    pub processor_seconds: f64,
    /// Why it was skipped or reused, or what it made, in a few words; may be empty.
    pub why: String,
}
