//! The files that a merge must not replace: the inputs of the render that wrote the parts.

use std::cell::OnceCell;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::control::{CancelToken, Canceled};
use crate::output::part::{self, PartFile};
use crate::output::{may_be_same_file, scene_path};
use crate::pipeline::{files_referenced_by_assets, not_a_scene_file_error};
use crate::scene::referenced_files;
use crate::scene::sanitize::escape_invisible_chars;

/// Input files of the parts and their scenes.
pub(super) struct RenderInputFiles<'a> {
    parts: &'a [PartFile],
    token: &'a CancelToken,
    /// The parts' scenes, and the files that these scenes name.
    named: BTreeSet<PathBuf>,
    /// Files referenced by the files in `named`, listed on demand.
    companions: OnceCell<BTreeSet<PathBuf>>,
}

impl<'a> RenderInputFiles<'a> {
    /// Collects the input files that a merge into `out` must not replace.
    pub(super) fn new(parts: &'a [PartFile], out: &Path, token: &'a CancelToken) -> Self {
        // The output may be a link into the scene's folder.
        let target = out.canonicalize().ok();
        let outs = [Some(out), target.as_deref()].into_iter().flatten();
        let scenes: BTreeSet<PathBuf> = outs.flat_map(|out| possible_scene_paths(parts, out)).collect();
        let texts = scenes.iter().filter(|scene| not_a_scene_file_error(scene).is_none());
        let named = texts.flat_map(|scene| referenced_files(scene)).collect::<Vec<_>>();
        Self { parts, token, named: scenes.into_iter().chain(named).collect(), companions: OnceCell::new() }
    }

    /// Returns the reason why the file at `path` must be kept, if it is an input. Checks the files that
    /// meshes reference last, because listing them requires reading the meshes.
    ///
    /// # Errors
    /// Returns [`Canceled`] if the token is canceled.
    pub(super) fn reason_not_to_overwrite(&self, path: &Path) -> Result<Option<String>, Canceled> {
        let find = |files: &BTreeSet<PathBuf>| {
            let input = files.iter().find(|input| may_be_same_file(input, path))?;
            // Show the path relative to the working directory.
            let name = scene_path::relative_to_image(input, Path::new(""));
            let name = escape_invisible_chars(name.strip_prefix("./").unwrap_or(&name)).into_owned();
            Some(format!("the parts' scene references it ({name})"))
        };
        let by_name = || {
            let name = part::find_input_that_is_path_suffix(self.parts, path)?;
            Some(format!("the parts' scene references a file with this name ({name})"))
        };
        let by_content = || {
            let name = part::find_render_input_by_content(self.parts, path)?;
            Some(format!("the parts were rendered from it ({name})"))
        };
        match by_name().or_else(|| find(&self.named)).or_else(by_content) {
            None => Ok(find(self.files_referenced_by_inputs()?)),
            reason => Ok(reason),
        }
    }

    fn files_referenced_by_inputs(&self) -> Result<&BTreeSet<PathBuf>, Canceled> {
        match self.companions.get() {
            Some(companions) => Ok(companions),
            None => {
                let companions = files_referenced_by_assets(self.named.iter(), self.token)?;
                Ok(self.companions.get_or_init(|| companions))
            }
        }
    }
}

/// Returns every path at which a part's scene may be, whether or not it exists: first relative to each part,
/// then next to the output.
pub(super) fn possible_scene_paths(parts: &[PartFile], out: &Path) -> impl Iterator<Item = PathBuf> {
    let named = parts.iter().filter(|part| !part.head.scene.is_empty());
    let named = named.map(|part| part.path.with_file_name(&part.head.scene));
    let metadata = parts.iter().flat_map(|part| &part.head.picture.metadata);
    let names = metadata.filter(|(name, _)| name == "glimt:scene");
    named.chain(names.map(|(_, scene)| out.with_file_name(scene)))
}
