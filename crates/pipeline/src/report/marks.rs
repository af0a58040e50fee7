//! Recognizes reports among JSON files.

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::protocol::Stage;

/// Keys shared by reports of all versions. No other JSON file is expected to contain all of them.
#[derive(Deserialize)]
pub(crate) struct ReportRecognitionFields {
    #[serde(rename = "glimt")]
    _version: String,
    #[serde(rename = "scene")]
    _scene: String,
    #[serde(rename = "image")]
    _image: IgnoredAny,
    #[serde(rename = "settings")]
    _settings: IgnoredAny,
    stages: Vec<ReportStageName>,
    #[serde(rename = "counters")]
    _counters: IgnoredAny,
    #[serde(rename = "seconds")]
    _seconds: f64,
    #[serde(rename = "peak_memory_bytes")]
    _peak_memory_bytes: u64,
}

#[derive(Deserialize)]
struct ReportStageName {
    name: String,
}

impl ReportRecognitionFields {
    /// Whether the report contains all render stages.
    pub(crate) fn have_all_stages(&self) -> bool {
        self.stages.iter().map(|stage| stage.name.as_str()).eq(Stage::ALL.map(Stage::name))
    }
}
