//! Tests that values are kept between requests.

use std::fs;

use super::*;
use crate::protocol::WriteRequirement;
use crate::session::NoPendingCommands;
use crate::tests::{OBJ, SCENE};
use crate::world::{Geometry, MeshTree};

/// Values created by a request.
struct CreatedValues {
    geometry: Arc<Geometry>,
    mesh: Arc<MeshTree>,
    lights: Arc<Lights>,
    world: Arc<World>,
}

/// A scene that is edited and requested repeatedly.
struct EngineFixture {
    folder: tempfile::TempDir,
    engine: Engine,
    text: String,
}

impl EngineFixture {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a scratch folder");
        fs::write(folder.path().join("one.obj"), OBJ).expect("written");
        fs::write(folder.path().join("skin.ppm"), "P6\n1 1\n255\nabc").expect("written");
        Self { folder, engine: Engine::new(EngineConfig::default(), Arc::default()), text: text.to_owned() }
    }

    /// Requests the current scene and returns the events.
    fn send(&mut self) -> Vec<Event> {
        fs::write(self.folder.path().join("scene.toml"), &self.text).expect("written");
        self.send_unsaved()
    }

    fn send_unsaved(&mut self) -> Vec<Event> {
        let scene = self.folder.path().join("scene.toml");
        let (sink, received) = EventSink::with_channel(1);
        let request = Request {
            generation: 1,
            scene,
            overrides: Default::default(),
            preview: None,
            write: WriteRequirement::No,
            own: None,
            saves: 0,
            force: false,
            first: None,
        };
        let token = CancelToken::new();
        self.engine.handle_request(&request, &sink, &RequestContext::new(&token, &token, &NoPendingCommands));
        received.try_iter().collect()
    }

    fn request(&mut self) -> CreatedValues {
        let events = self.send();
        assert!(matches!(events.last(), Some(Event::Done { .. })), "{events:?}");
        let geometry = self.engine.accel.latest().expect("the geometry was built").clone();
        let mesh = geometry.objects()[1].mesh().expect("the second object is a mesh").tree.clone();
        let lights = self.engine.lights.latest().expect("the lights were collected").clone();
        CreatedValues { geometry, mesh, lights, world: self.engine.world.latest().expect("a world").clone() }
    }

    /// Returns whether an edit kept the geometry, mesh, lights and world. Compares pointers, not values.
    fn kept(&mut self, from: &str, to: &str) -> [bool; 4] {
        let before = self.request();
        assert!(self.text.contains(from), "{from}");
        self.text = self.text.replace(from, to);
        let after = self.request();
        assert!(Arc::ptr_eq(&after.world.geometry, &after.geometry), "the world uses the new geometry");
        assert!(Arc::ptr_eq(&after.world.lights, &after.lights), "the world uses the new lights");
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
    let mut fixture = EngineFixture::new(&format!("{SCENE}[materials.light]\nemission = [0, 0, 0]\n"));
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
fn switching_back_reuses_cached_trees() {
    let mut fixture = EngineFixture::new(SCENE);
    fs::write(fixture.folder.path().join("two.obj"), format!("{OBJ}f 1 3 2\n")).expect("written");
    let own = fixture.text.clone();
    let before = fixture.request();
    for broken in [false, true] {
        fixture.text = own.replace("one.obj", "two.obj");
        assert!(!Arc::ptr_eq(&fixture.request().mesh, &before.mesh));
        if broken {
            fixture.text = own.replace("one.obj", "three.obj");
            assert!(matches!(fixture.send()[..], [.., Event::Failed { .. }, Event::LastGoodEnded { .. }]));
        }
        fixture.text = own.clone();
        let after = fixture.request();
        assert!(Arc::ptr_eq(&after.geometry, &before.geometry) && Arc::ptr_eq(&after.mesh, &before.mesh));
        assert!(Arc::ptr_eq(&after.world.geometry, &before.geometry), "the world uses the cached trees");
    }
}

#[test]
fn unchanged_textures_are_kept() {
    let other = "[textures.bark]\nfile = \"bark.ppm\"\n[materials.trunk]\ndiffuse = { texture = \"bark\" }\n\
                 [[sphere]]\ncenter = [1, 1, 0]\nradius = 0.2\nmaterial = \"trunk\"\n";
    let mut fixture = EngineFixture::new(&format!("{SCENE}{other}"));
    let write = |fixture: &EngineFixture, text: &str| {
        fs::write(fixture.folder.path().join("bark.ppm"), format!("P6\n1 1\n255\n{text}")).expect("written");
    };
    let texels = |fixture: &EngineFixture, name: &str| {
        fixture.engine.textures.latest(&fixture.folder.path().join(name)).expect("a loaded texture").clone()
    };
    write(&fixture, "xyz");
    fixture.request();
    let (skin, bark) = (texels(&fixture, "skin.ppm"), texels(&fixture, "bark.ppm"));
    write(&fixture, "uvw");
    fixture.request();
    assert!(Arc::ptr_eq(&texels(&fixture, "skin.ppm"), &skin));
    assert!(!Arc::ptr_eq(&texels(&fixture, "bark.ppm"), &bark));
}

#[test]
fn error_mentions_the_renamed_scene() {
    let mut fixture = EngineFixture::new(SCENE);
    fixture.request();
    let renamed = fixture.folder.path().join("third.toml");
    fs::rename(fixture.folder.path().join("scene.toml"), &renamed).expect("renamed");
    let help = |events: Vec<Event>| {
        let of_scene = |event| match event {
            Event::Failed { failure: Failure::Scene(errors), .. } => errors.into_iter().next()?.help,
            _ => None,
        };
        events.into_iter().find_map(of_scene).expect("an error with a hint")
    };
    let found = help(fixture.send_unsaved());
    let is_same_text = |help: &str| help.contains(crate::scene::SAME_TEXT);
    assert!(found.contains("third.toml") && is_same_text(&found), "{found}");
    fs::write(&renamed, "another text").expect("written");
    let other = help(fixture.send_unsaved());
    assert!(!is_same_text(&other), "{other}");
}

#[test]
fn check_never_mixes_file_versions() {
    for (renamed, is_moved) in
        [(SCENE.replace("radius = 0.5", "radius = 0.6"), false), (SCENE.replace("skin.ppm", "new.ppm"), true)]
    {
        let mut fixture = EngineFixture::new(SCENE);
        let at = |name: &str| fixture.folder.path().join(name);
        let scene = at("scene.toml");
        fs::write(&scene, SCENE).expect("written");
        // The scene is replaced while its mesh is being read. In the second case, the texture has been
        // renamed and the file with the old name is invalid.
        if is_moved {
            fs::rename(at("skin.ppm"), at("new.ppm")).expect("renamed");
            fs::write(at("skin.ppm"), "P6\n").expect("written");
        }
        let replacement = (scene.clone(), renamed.clone().into_bytes());
        fixture.engine.contents.replacements.lock().expect("not poisoned").insert(at("one.obj"), replacement);
        let sink = EventSink::silent(1);
        let read = fixture.engine.load_scene_and_all_assets(&scene, &[], &sink, &CancelToken::new());
        let (parsed, ..) = read.expect("a valid scene");
        assert_eq!(parsed.loaded.source.file_text(), renamed);
    }
}
