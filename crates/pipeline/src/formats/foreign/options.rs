//! Command-line options for scenes from other renderers.

use crate::choice;
use crate::scene::fingerprint::FingerprintHasher;

/// Options for scenes from other renderers. They have no effect on models or on glimt's own scenes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForeignOptions {
    /// Names and values of parameters such as `$spp`, in command-line order.
    pub defines: Vec<(String, String)>,
    /// Whether to treat substitutions as errors.
    pub is_strict: bool,
    /// How to treat missing meshes and images.
    pub missing: MissingAssetMode,
    /// Number, starting at 1, or name of the sensor to use. `None` uses the first one.
    pub sensor: Option<String>,
}

choice! {
    /// How to treat missing meshes and images in scenes from other renderers.
    pub enum MissingAssetMode {
        /// Report an error.
        Error = "error",
        /// Leave out missing meshes, and replace missing images with gray.
        Note = "note",
    }
}

#[expect(clippy::derivable_impls, reason = "`choice!` derives no `Default`")]
impl Default for MissingAssetMode {
    fn default() -> Self {
        Self::Error
    }
}

impl ForeignOptions {
    /// Adds all fields to a fingerprint.
    pub(crate) fn add_to_fingerprint(&self, key: &mut FingerprintHasher) {
        key.add_u64(self.defines.len() as u64);
        for (name, value) in &self.defines {
            key.add_str(name).add_str(value);
        }
        key.add_bool(self.is_strict).add_choice_name(self.missing);
        key.add_bool(self.sensor.is_some()).add_str(self.sensor.as_deref().unwrap_or_default());
    }
}
