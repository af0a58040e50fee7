//! The files that a request writes.

use std::path::{Path, PathBuf};

use crate::output::AnimationFormat;
use crate::settings::Overrides;
use crate::turntable::{self, TurntableFrame};

/// The files that a request writes.
#[derive(Clone, Debug)]
pub(crate) struct OutputFiles {
    /// Files of this image.
    pub(crate) images: Vec<PathBuf>,
    /// Animations that contain this image as a frame.
    pub(crate) animations: Vec<PathBuf>,
    /// Image files of later turntable frames.
    pub(crate) later_images: Vec<PathBuf>,
    pub(crate) report: Option<PathBuf>,
    pub(crate) named_by: OutputNameSource,
    /// Default file name pattern for turntable frames, with `#` for the number, or `None` if this is not a
    /// turntable or the user named the files.
    pub(crate) default_names: Option<PathBuf>,
    /// Whether the report, and images with default names, may replace files that glimt did not write.
    pub(crate) replaces_foreign: bool,
}

/// Source of the output file names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OutputNameSource {
    /// The `-o` option.
    CommandLine,
    /// The `output` key in `[render]`.
    Scene,
    /// The scene's name with the extension `.png`.
    Default,
}

/// Returns the output files specified on the command line or, failing that, in the scene. The default is a
/// `.png` file in the working directory with the scene's name.
fn output_paths(
    of_scene: Option<&PathBuf>,
    path: &Path,
    overrides: &Overrides,
) -> (Vec<PathBuf>, OutputNameSource) {
    if !overrides.outputs.is_empty() {
        return (overrides.outputs.clone(), OutputNameSource::CommandLine);
    }
    if let Some(of_scene) = of_scene {
        return match overrides.turn {
            None => (vec![of_scene.clone()], OutputNameSource::Scene),
            // The scene specifies only one file, so the turntable uses default names.
            Some(_) => (vec![turntable::add_frame_placeholder(of_scene)], OutputNameSource::Default),
        };
    }
    let mut name = path.file_stem().unwrap_or("glimt".as_ref()).to_owned();
    name.push(".png");
    let name = PathBuf::from(name);
    (
        vec![if overrides.turn.is_some() { turntable::add_frame_placeholder(&name) } else { name }],
        OutputNameSource::Default,
    )
}

/// Returns the report's path. For a turntable, it includes the frame number.
fn requested_report_path(overrides: &Overrides) -> Option<PathBuf> {
    let path = overrides.report.as_ref()?;
    let numbered = overrides.turn.and_then(|turn| turntable::frame_path(path, turn));
    Some(numbered.unwrap_or_else(|| path.clone()))
}

impl OutputFiles {
    /// Resolves the files that a request writes. `of_scene` is the output file specified in the scene.
    pub(super) fn resolve(of_scene: Option<&PathBuf>, scene: &Path, overrides: &Overrides) -> Self {
        let (paths, named_by) = output_paths(of_scene, scene, overrides);
        let mut files = Self {
            images: Vec::new(),
            animations: Vec::new(),
            later_images: Vec::new(),
            report: requested_report_path(overrides),
            named_by,
            default_names: None,
            replaces_foreign: overrides.replaces_foreign,
        };
        let Some(turn) = overrides.turn else { return Self { images: paths, ..files } };
        files.default_names = paths.first().filter(|_| named_by == OutputNameSource::Default).cloned();
        for path in paths {
            if AnimationFormat::from_path(&path).is_some() {
                files.animations.push(path);
                continue;
            }
            // For the first frame, also list the files for later frames, so that conflicts are detected
            // before hours of rendering.
            let others = (turn.number + 1..turn.of).filter(|_| turn.number == 0);
            let of = |number| turntable::frame_path(&path, TurntableFrame { number, ..turn });
            files.later_images.extend(others.filter_map(of));
            files.images.push(of(turn.number).unwrap_or(path));
        }
        files
    }
}
