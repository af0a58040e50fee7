//! Recognition of reports among JSON files.

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::protocol::Stage;

/// Keys that reports of all versions have, and that other JSON files do not have together.
#[derive(Deserialize)]
pub(crate) struct ReportMarks {
    #[serde(rename = "glimt")]
    _version: String,
    #[serde(rename = "scene")]
    _scene: String,
    #[serde(rename = "image")]
    _image: IgnoredAny,
    #[serde(rename = "settings")]
    _settings: IgnoredAny,
    stages: Vec<StageMark>,
    #[serde(rename = "counters")]
    _counters: IgnoredAny,
    #[serde(rename = "seconds")]
    _seconds: f64,
    #[serde(rename = "peak_memory_bytes")]
    _peak_memory_bytes: u64,
}

#[derive(Deserialize)]
struct StageMark {
    name: String,
}

impl ReportMarks {
    /// Whether the report has all stages of a render.
    pub(crate) fn have_all_stages(&self) -> bool {
        self.stages.iter().map(|stage| stage.name.as_str()).eq(Stage::ALL.map(Stage::name))
    }
}
