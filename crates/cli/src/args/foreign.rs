//! Options for scenes from other renderers.

use super::parsers::{choice_long_help, choice_parser};
use crate::pipeline::settings::{ForeignOptions, MissingAssetMode};

/// Options for scenes from other renderers.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ForeignArgs {
    /// Set a parameter of a Mitsuba scene, such as -D spp=64
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_define, help_heading = "Scenes from other renderers")]
    pub defines: Vec<(String, String)>,
    /// Fail if a feature of the scene must be replaced
    #[arg(long, help_heading = "Scenes from other renderers")]
    pub strict: bool,
    /// Treatment of missing meshes and images: error, note
    #[arg(long, value_parser = choice_parser::<MissingAssetMode>(), hide_possible_values = true, long_help = choice_long_help::<MissingAssetMode>("Treatment of missing meshes and images"), value_name = "HOW", help_heading = "Scenes from other renderers")]
    pub missing: Option<MissingAssetMode>,
    /// Use this sensor of the scene instead of the first
    #[arg(long, value_name = "N|NAME", help_heading = "Scenes from other renderers")]
    pub sensor: Option<String>,
}

impl ForeignArgs {
    /// Returns the options.
    pub fn options(&self) -> ForeignOptions {
        ForeignOptions {
            defines: self.defines.clone(),
            is_strict: self.strict,
            missing: self.missing.unwrap_or_default(),
            sensor: self.sensor.clone(),
        }
    }
}

/// Parses `NAME=VALUE`.
fn parse_define(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value.to_owned())),
        Some(_) | None => Err("expected NAME=VALUE, as in spp=64".to_owned()),
    }
}
