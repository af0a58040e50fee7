//! Edits to the bundled scenes.

use std::fs;
use std::path::{Path, PathBuf};

use super::BenchResult;

/// A bundled scene and its edits. Each edit has a kind, the text to replace, and a replacement in which `{}`
/// becomes a different number between 0.1 and 1 each time. An edit without `{}` darkens the texture file with
/// that name.
pub struct EditedScene {
    pub name: &'static str,
    pub edits: &'static [Edit],
    pub keys: &'static [&'static str],
}

/// Kind of edit, text to replace, and replacement.
pub type Edit = (&'static str, &'static str, &'static str);

impl EditedScene {
    /// The camera edit, which is always the second edit.
    pub fn camera(&self) -> Edit {
        self.edits[1]
    }
}

pub const SCENES: &[EditedScene] = &[
    EditedScene {
        name: "cornell",
        edits: &[
            ("material", "red = { diffuse = [0.63,", "red = { diffuse = [{},"),
            ("camera", "position = [0, 1, 4.4]", "position = [{}, 1, 4.4]"),
            ("object", "center = [-0.35, 0.6,", "center = [-{}, 0.6,"),
            ("light", "emission = [17,", "emission = [1{},"),
        ],
        keys: &["s", "v"],
    },
    EditedScene {
        name: "cornell_glass",
        edits: &[
            ("material", "red = { diffuse = [0.63,", "red = { diffuse = [{},"),
            ("camera", "position = [0, 1, 4.4]", "position = [{}, 1, 4.4]"),
            ("object", "center = [-0.42, 0.42,", "center = [-{}, 0.42,"),
            ("light", "emission = [17,", "emission = [1{},"),
        ],
        keys: &["s", "v"],
    },
    EditedScene {
        name: "textures",
        edits: &[
            ("material", "normal_map = \"bumps\"", "normal_map = \"bumps\"\nnormal_strength = {}"),
            ("camera", "position = [0, 1.6, 5.6]", "position = [{}, 1.6, 5.6]"),
            ("object", "translate = [-1.6,", "translate = [-{},"),
            ("light", "emission = [15,", "emission = [1{},"),
            ("texture", "assets/textures/bricks.png", ""),
        ],
        keys: &["s", "v"],
    },
    EditedScene {
        name: "dof",
        edits: &[
            ("material", "lime = { diffuse = [0.5,", "lime = { diffuse = [{},"),
            ("camera", "position = [0, 1.5, 6]", "position = [{}, 1.5, 6]"),
            ("object", "center = [-0.10, 0.45, 0.00]", "center = [-{}, 0.45, 0.00]"),
            ("light", "emission = [14,", "emission = [1{},"),
        ],
        keys: &["s", "v", "d"],
    },
    EditedScene {
        name: "mesh",
        edits: &[
            ("material", "coral = { diffuse = [0.74,", "coral = { diffuse = [{},"),
            ("camera", "position = [0, 1.9, 5.4]", "position = [{}, 1.9, 5.4]"),
            ("object", "translate = [-1.15,", "translate = [-{},"),
            ("light", "emission = [16,", "emission = [1{},"),
        ],
        keys: &["s", "v"],
    },
    EditedScene {
        name: "million",
        edits: &[
            ("material", "diffuse = [0.58,", "diffuse = [{},"),
            ("camera", "position = [0, 0.7, 3.6]", "position = [{}, 0.7, 3.6]"),
            ("object", "[[mesh]]", "[[mesh]]\ntranslate = [{}, 0, 0]"),
            ("light", "intensity = [3.4,", "intensity = [{},"),
        ],
        keys: &["s", "v"],
    },
    EditedScene {
        name: "photons",
        edits: &[
            ("material", "red = { diffuse = [0.63,", "red = { diffuse = [{},"),
            ("camera", "position = [0, 1, 4.4]", "position = [{}, 1, 4.4]"),
            ("object", "center = [-0.42, 0.42,", "center = [-{}, 0.42,"),
            ("light", "emission = [150,", "emission = [15{},"),
        ],
        keys: &["p", "v"],
    },
    EditedScene {
        name: "water",
        edits: &[
            ("material", "table = { diffuse = [0.62,", "table = { diffuse = [{},"),
            ("camera", "position = [0.5, 3.3, 5.2]", "position = [{}, 3.3, 5.2]"),
            ("object", "corner = [-4, 0, 3]", "corner = [-{}, 0, 3]"),
            ("light", "irradiance = [3.6,", "irradiance = [{},"),
        ],
        keys: &["p", "v"],
    },
];

/// Editable copies of the scenes and assets.
pub struct SceneCopies {
    folder: tempfile::TempDir,
    /// Number of previous edits.
    edits: u32,
}

impl SceneCopies {
    /// Copies all scenes and assets, and generates the large mesh.
    pub fn new() -> BenchResult<Self> {
        let folder = tempfile::tempdir()?;
        let project = Path::new(env!("CARGO_MANIFEST_DIR"));
        for name in ["scenes", "assets", "assets/textures", "assets/stairs", "assets/furniture"] {
            fs::create_dir(folder.path().join(name))?;
            for entry in fs::read_dir(project.join(name))? {
                let entry = entry?;
                if entry.file_type()?.is_file() {
                    fs::copy(entry.path(), folder.path().join(name).join(entry.file_name()))?;
                }
            }
        }
        let mut make = std::process::Command::new(env!("CARGO_BIN_EXE_glimt-assets"));
        make.arg("million").current_dir(folder.path()).stdout(std::process::Stdio::null());
        if !make.status()?.success() {
            return Err("failed to generate the large mesh".into());
        }
        Ok(Self { folder, edits: 0 })
    }

    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Paths of the copies of all bundled scenes, sorted.
    pub fn all(&self) -> BenchResult<Vec<PathBuf>> {
        let entries = fs::read_dir(self.folder.path().join("scenes"))?.collect::<Result<Vec<_>, _>>()?;
        let mut paths: Vec<PathBuf> = entries.iter().map(fs::DirEntry::path).collect();
        paths.retain(|path| path.extension().is_some_and(|ending| ending == "toml"));
        paths.sort();
        Ok(paths)
    }

    pub fn scene(&self, scene: &EditedScene) -> PathBuf {
        self.folder.path().join("scenes").join(scene.name).with_extension("toml")
    }

    /// Returns the file to edit and its new contents.
    pub fn edit(&mut self, scene: &EditedScene, (_, from, to): Edit) -> BenchResult<(PathBuf, Vec<u8>)> {
        self.edits += 1;
        let number = 0.1 + f64::from(self.edits) * 0.377 % 0.9;
        let of_project = |name: &Path| Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
        if to.is_empty() {
            let mut picture = image::open(of_project(Path::new(from)))?.to_rgb8();
            picture.iter_mut().for_each(|value| *value = (f64::from(*value) * number) as u8);
            let mut bytes = std::io::Cursor::new(Vec::new());
            picture.write_to(&mut bytes, image::ImageFormat::Png)?;
            return Ok((self.folder.path().join(from), bytes.into_inner()));
        }
        let path = self.scene(scene);
        let name = Path::new("scenes").join(scene.name).with_extension("toml");
        let text = fs::read_to_string(of_project(&name))?;
        if !text.contains(from) {
            return Err(format!("{} does not contain {from:?}", name.display()).into());
        }
        Ok((path, text.replacen(from, &to.replace("{}", &format!("{number:.3}")), 1).into_bytes()))
    }
}
