//! Tests that values are kept between requests.

use std::fs;

use rayon::ThreadPool;

use super::*;
use crate::control::CancelToken;
use crate::formats::foreign::ForeignOptions;
use crate::formats::model::ModelViewOptions;
use crate::lights::Lights;
use crate::plan::resolve_plan;
use crate::protocol::Failure;
use crate::scene::description::CameraOverrides;
use crate::settings::Overrides;
use crate::sink::EventSink;
use crate::table::StageRecorder;
use crate::tests::{OBJ, SCENE};
use crate::watch::content::FileHashCache;
use crate::world::{Geometry, MeshTree};

/// Values created by a request.
struct CreatedValues {
    geometry: Arc<Geometry>,
    mesh: Arc<MeshTree>,
    lights: Arc<Lights>,
    world: Arc<World>,
}

/// A scene that is edited and prepared repeatedly.
struct SceneFixture {
    folder: tempfile::TempDir,
    contents: Arc<FileHashCache>,
    pool: ThreadPool,
    scenes: SceneCache,
    text: String,
}

impl SceneFixture {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a scratch folder");
        fs::write(folder.path().join("one.obj"), OBJ).expect("written");
        fs::write(folder.path().join("skin.ppm"), "P6\n1 1\n255\nabc").expect("written");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
        let (contents, scenes) = (Arc::default(), SceneCache::default());
        Self { folder, contents, pool, scenes, text: text.to_owned() }
    }

    /// Prepares the current scene.
    fn prepare(&mut self) -> Result<ReadyScene, AbortReason> {
        fs::write(self.folder.path().join("scene.toml"), &self.text).expect("written");
        self.prepare_unsaved()
    }

    fn prepare_unsaved(&mut self) -> Result<ReadyScene, AbortReason> {
        let path = self.folder.path().join("scene.toml");
        let (sink, token, mut findings) = (EventSink::silent(1), CancelToken::new(), Findings::default());
        let mut table = StageRecorder::new(None, &token);
        let reader = FileReader { contents: &self.contents, pool: &self.pool, sink: &sink, token: &token };
        let scenes = &mut self.scenes;
        let assets = reader.read_until_files_unchanged(&mut table, &mut findings, |reading| {
            let foreign = ForeignOptions::default();
            let show = ModelViewOptions::default();
            let scene = SceneParseRequest { path: &path, sets: &[], show, foreign: &foreign };
            let parsed = scenes.parse_scene(scene, reading)?;
            let all = TextureSelection::ForImage(TextureRolesNeededByRender::ALL);
            let assets = scenes.load_assets(&parsed, all, reading)?;
            match reading.findings.errors.is_empty() {
                true => Ok(Arc::new(assets)),
                false => Err(AbortReason::Failed(reading.findings.take_diagnostics_as_failure())),
            }
        });
        let ready = assets.and_then(|assets| {
            let plan = resolve_plan(&assets.parsed.loaded.scene, &path, &Overrides::default())?;
            scenes.build_ready_scene(assets, plan, &CameraOverrides::default(), &mut table, &self.pool)
        });
        self.scenes.end_request(ready.is_ok());
        ready
    }

    fn request(&mut self) -> CreatedValues {
        let ready = self.prepare().expect("a valid scene");
        let (geometry, lights) = (Arc::clone(&ready.world.geometry), Arc::clone(&ready.world.lights));
        let mesh = geometry.objects()[1].mesh().expect("the second object is a mesh").tree.clone();
        CreatedValues { geometry, mesh, lights, world: ready.world }
    }

    /// Returns whether an edit kept the geometry, mesh, lights and world. Compares pointers, not values.
    fn kept(&mut self, from: &str, to: &str) -> [bool; 4] {
        let before = self.request();
        assert!(self.text.contains(from), "{from}");
        self.text = self.text.replace(from, to);
        let after = self.request();
        [
            Arc::ptr_eq(&before.geometry, &after.geometry),
            Arc::ptr_eq(&before.mesh, &after.mesh),
            Arc::ptr_eq(&before.lights, &after.lights),
            Arc::ptr_eq(&before.world, &after.world),
        ]
    }
}

#[test]
fn edits_keep_unaffected_values() {
    let mut fixture = SceneFixture::new(&format!("{SCENE}[materials.light]\nemission = [0, 0, 0]\n"));
    let mut kept = |from: &str, to: &str| fixture.kept(from, to);
    assert_eq!(kept("[camera]", "# a comment\n[camera]"), [true, true, true, true]);
    let settings = "exposure = 0.0\nbackground = [1, 0, 0]\nambient = [1, 1, 1]\nseed = 3\nmax_depth = 2";
    assert_eq!(kept("exposure = 0.0", settings), [true, true, true, true]);
    assert_eq!(kept("[0.5, 0.5, 0.5]", "[0.6, 0.5, 0.5]"), [true, true, true, false], "a color");
    assert_eq!(kept("position = [0, 1, 4]", "position = [0, 1, 5]"), [true, true, true, false], "the camera");
    assert_eq!(kept("[10, 10, 10]", "[9, 10, 10]"), [true, true, false, false], "a light");
    assert_eq!(
        kept("translate = [0, 0, 0]", "translate = [1, 0, 0]"),
        [false, true, true, false],
        "a mesh moved"
    );
    assert_eq!(kept("radius = 0.5", "radius = 0.6"), [false, true, true, false], "a shape");
    assert_eq!(kept("seed = 3", "accel = \"kdtree\""), [false, false, true, false], "another tree");
    assert_eq!(
        kept("material = \"wall\"", "material = \"light\""),
        [true, true, true, false],
        "a dark material"
    );
    assert_eq!(
        kept("emission = [0, 0, 0]", "emission = [1, 0, 0]"),
        [true, true, false, false],
        "an emission"
    );
    assert_eq!(
        kept("translate = [1, 0, 0]", "translate = [2, 0, 0]"),
        [false, true, false, false],
        "a light moved"
    );
}

#[test]
fn edits_of_groups_keep_unaffected_values() {
    let text = SCENE.replace("[[mesh]]", "[[groups.flags.mesh]]");
    let instance = |x: u32| format!("[[instance]]\ngroup = \"flags\"\ntranslate = [{x}, 0, 1]\n");
    let mut fixture = SceneFixture::new(&format!("{text}{}{}", instance(1), instance(2)));
    let meshes: Vec<Arc<MeshTree>> = fixture
        .request()
        .geometry
        .objects()
        .iter()
        .filter_map(|one| Some(Arc::clone(&one.mesh()?.tree)))
        .collect();
    assert!(meshes.len() == 2 && Arc::ptr_eq(&meshes[0], &meshes[1]), "copies share a tree");
    let mut kept = |from: &str, to: &str| fixture.kept(from, to);
    assert_eq!(kept("[2, 0, 1]", "[3, 0, 1]"), [false, true, true, false], "an instance moved");
    assert_eq!(kept("translate = [0, 0, 0]", "scale = 2"), [false, true, true, false], "a group's mesh");
    assert_eq!(kept("[0.5, 0.5, 0.5]", "[0.6, 0.5, 0.5]"), [true, true, true, false], "a color");
    assert_eq!(kept("group = ", "name = \"flag\"\ngroup = "), [true, true, true, true], "names");
    let third = instance(4);
    assert_eq!(
        kept("[[light]]", &format!("{third}[[light]]")),
        [false, true, true, false],
        "another instance"
    );
}

#[test]
fn switching_back_reuses_cached_trees() {
    let mut fixture = SceneFixture::new(SCENE);
    fs::write(fixture.folder.path().join("two.obj"), format!("{OBJ}f 1 3 2\n")).expect("written");
    let own = fixture.text.clone();
    let before = fixture.request();
    for broken in [false, true] {
        fixture.text = own.replace("one.obj", "two.obj");
        assert!(!Arc::ptr_eq(&fixture.request().mesh, &before.mesh));
        if broken {
            fixture.text = own.replace("one.obj", "three.obj");
            assert!(matches!(fixture.prepare(), Err(AbortReason::Failed(Failure::Scene(_)))));
        }
        fixture.text = own.clone();
        let after = fixture.request();
        assert!(Arc::ptr_eq(&after.geometry, &before.geometry) && Arc::ptr_eq(&after.mesh, &before.mesh));
    }
}

#[test]
fn unchanged_textures_are_kept() {
    let other = "[textures.bark]\nfile = \"bark.ppm\"\n[materials.trunk]\ndiffuse = { texture = \"bark\" }\n\
                 [[sphere]]\ncenter = [1, 1, 0]\nradius = 0.2\nmaterial = \"trunk\"\n";
    let mut fixture = SceneFixture::new(&format!("{SCENE}{other}"));
    let write = |fixture: &SceneFixture, text: &str| {
        fs::write(fixture.folder.path().join("bark.ppm"), format!("P6\n1 1\n255\n{text}")).expect("written");
    };
    let texels = |fixture: &mut SceneFixture| {
        let ready = fixture.prepare().expect("a valid scene");
        let images = &ready.assets.textures.images;
        ["skin.ppm", "bark.ppm"].map(|name| {
            let image = images.iter().find(|(source, _)| source.path.ends_with(name));
            Arc::clone(&image.expect("a loaded texture").1.texels)
        })
    };
    write(&fixture, "xyz");
    let [skin, bark] = texels(&mut fixture);
    write(&fixture, "uvw");
    let [skin_after, bark_after] = texels(&mut fixture);
    assert!(Arc::ptr_eq(&skin_after, &skin) && !Arc::ptr_eq(&bark_after, &bark));
}

#[test]
fn error_mentions_the_renamed_scene() {
    let mut fixture = SceneFixture::new(SCENE);
    fixture.request();
    let renamed = fixture.folder.path().join("third.toml");
    fs::rename(fixture.folder.path().join("scene.toml"), &renamed).expect("renamed");
    let mut help = || match fixture.prepare_unsaved() {
        Err(AbortReason::Failed(Failure::Scene(errors))) => errors[0].help.clone().expect("a hint"),
        Err(other) => panic!("{other:?}"),
        Ok(_) => panic!("the scene should be missing"),
    };
    let found = help();
    let is_same_text = |help: &str| help.contains(crate::scene::SAME_TEXT);
    assert!(found.contains("third.toml") && is_same_text(&found), "{found}");
    fs::write(&renamed, "another text").expect("written");
    let other = help();
    assert!(!is_same_text(&other), "{other}");
}
