//! Tests of the values that are kept from request to request.

use std::fs;
use std::sync::mpsc;

use super::*;
use crate::protocol::{PreviewSlot, Writing};
use crate::session::NoOrders;
use crate::tests::{OBJ, SCENE};
use crate::world::{Geometry, MeshTree};

/// Values that a request made.
struct Made {
    geometry: Arc<Geometry>,
    mesh: Arc<MeshTree>,
    lights: Arc<Lights>,
    world: Arc<World>,
}

/// The same scene again and again with edits.
struct Desk {
    folder: tempfile::TempDir,
    engine: Engine,
    text: String,
}

impl Desk {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a scratch folder");
        fs::write(folder.path().join("one.obj"), OBJ).expect("written");
        fs::write(folder.path().join("skin.ppm"), "P6\n1 1\n255\nabc").expect("written");
        Self { folder, engine: Engine::new(Means::default(), Arc::default()), text: text.to_owned() }
    }

    /// Sends a request for the current scene; returns its events.
    fn send(&mut self) -> Vec<Event> {
        fs::write(self.folder.path().join("scene.toml"), &self.text).expect("written");
        self.send_unsaved()
    }

    fn send_unsaved(&mut self) -> Vec<Event> {
        let scene = self.folder.path().join("scene.toml");
        let (events, received) = mpsc::channel();
        let sink = Sink { generation: 1, events, previews: PreviewSlot::default(), within: None };
        let request = Request {
            generation: 1,
            scene,
            overrides: Default::default(),
            preview: None,
            write: Writing::No,
            own: None,
            force: false,
            first: None,
        };
        let token = CancelToken::new();
        self.engine.request(&request, &sink, &Meanwhile::new(&token, &token, &NoOrders));
        received.try_iter().collect()
    }

    fn request(&mut self) -> Made {
        let events = self.send();
        assert!(matches!(events.last(), Some(Event::Done { .. })), "{events:?}");
        let geometry = self.engine.accel.latest().expect("it was built").clone();
        let mesh = geometry.objects()[1].mesh().expect("the mesh comes second").tree.clone();
        let lights = self.engine.lights.latest().expect("they were gathered").clone();
        Made { geometry, mesh, lights, world: self.engine.world.latest().expect("it was made").clone() }
    }

    /// Returns whether geometry, mesh, lights and world survive an edit as the same value, not as an equal one.
    fn kept(&mut self, from: &str, to: &str) -> [bool; 4] {
        let before = self.request();
        assert!(self.text.contains(from), "{from}");
        self.text = self.text.replace(from, to);
        let after = self.request();
        assert!(Arc::ptr_eq(&after.world.geometry, &after.geometry), "the world has what was made");
        assert!(Arc::ptr_eq(&after.world.lights, &after.lights), "the world has what was gathered");
        [
            Arc::ptr_eq(&before.geometry, &after.geometry),
            Arc::ptr_eq(&before.mesh, &after.mesh),
            Arc::ptr_eq(&before.lights, &after.lights),
            Arc::ptr_eq(&before.world, &after.world),
        ]
    }
}

#[test]
fn each_edit_keeps_what_does_not_depend_on_it() {
    let mut desk = Desk::new(&format!("{SCENE}[materials.lamp]\nemission = [0, 0, 0]\n"));
    let mut kept = |from: &str, to: &str| desk.kept(from, to);
    assert_eq!(kept("[camera]", "# a comment\n[camera]"), [true, true, true, true]);
    let settings = "exposure = 0.0\nbackground = [1, 0, 0]\nambient = [1, 1, 1]\nseed = 3\nmax_depth = 2";
    assert_eq!(kept("exposure = 0.0", settings), [true, true, true, true]);
    assert_eq!(kept("[0.5, 0.5, 0.5]", "[0.6, 0.5, 0.5]"), [true, true, true, false], "a colour");
    assert_eq!(kept("position = [0, 1, 4]", "position = [0, 1, 5]"), [true, true, true, false], "the eye");
    assert_eq!(kept("[10, 10, 10]", "[9, 10, 10]"), [true, true, false, false], "a light");
    assert_eq!(
        kept("translate = [0, 0, 0]", "translate = [1, 0, 0]"),
        [false, true, true, false],
        "a mesh moved"
    );
    assert_eq!(kept("radius = 0.5", "radius = 0.6"), [false, true, true, false], "a shape");
    assert_eq!(kept("seed = 3", "accel = \"kdtree\""), [false, false, true, false], "another tree");
    assert_eq!(kept("material = \"wall\"", "material = \"lamp\""), [true, true, true, false], "it is dark");
    assert_eq!(kept("emission = [0, 0, 0]", "emission = [1, 0, 0]"), [true, true, false, false], "it shines");
    assert_eq!(
        kept("translate = [1, 0, 0]", "translate = [2, 0, 0]"),
        [false, true, false, false],
        "a lamp moved"
    );
}

#[test]
fn a_scene_that_is_switched_back_to_has_the_trees_that_it_had() {
    let mut desk = Desk::new(SCENE);
    fs::write(desk.folder.path().join("two.obj"), format!("{OBJ}f 1 3 2\n")).expect("written");
    let own = desk.text.clone();
    let before = desk.request();
    for broken in [false, true] {
        desk.text = own.replace("one.obj", "two.obj");
        assert!(!Arc::ptr_eq(&desk.request().mesh, &before.mesh));
        if broken {
            desk.text = own.replace("one.obj", "three.obj");
            assert!(matches!(desk.send()[..], [.., Event::Failed { .. }, Event::LastGoodEnded { .. }]));
        }
        desk.text = own.clone();
        let after = desk.request();
        assert!(Arc::ptr_eq(&after.geometry, &before.geometry) && Arc::ptr_eq(&after.mesh, &before.mesh));
        assert!(Arc::ptr_eq(&after.world.geometry, &before.geometry), "the world has them");
    }
}

#[test]
fn of_several_pictures_those_that_were_not_saved_stay_as_they_are() {
    let other = "[textures.bark]\nfile = \"bark.ppm\"\n[materials.trunk]\ndiffuse = { texture = \"bark\" }\n\
                 [[sphere]]\ncenter = [1, 1, 0]\nradius = 0.2\nmaterial = \"trunk\"\n";
    let mut desk = Desk::new(&format!("{SCENE}{other}"));
    let write = |desk: &Desk, text: &str| {
        fs::write(desk.folder.path().join("bark.ppm"), format!("P6\n1 1\n255\n{text}")).expect("written");
    };
    let texels = |desk: &Desk, name: &str| {
        desk.engine.textures.latest(&desk.folder.path().join(name)).expect("it was read").clone()
    };
    write(&desk, "xyz");
    desk.request();
    let (skin, bark) = (texels(&desk, "skin.ppm"), texels(&desk, "bark.ppm"));
    write(&desk, "uvw");
    desk.request();
    assert!(Arc::ptr_eq(&texels(&desk, "skin.ppm"), &skin));
    assert!(!Arc::ptr_eq(&texels(&desk, "bark.ppm"), &bark));
}

#[test]
fn a_renamed_scene_is_named_in_the_error() {
    let mut desk = Desk::new(SCENE);
    desk.request();
    let renamed = desk.folder.path().join("third.toml");
    fs::rename(desk.folder.path().join("scene.toml"), &renamed).expect("renamed");
    let help = |events: Vec<Event>| {
        let of_scene = |event| match event {
            Event::Failed { failure: Failure::Scene(errors), .. } => errors.into_iter().next()?.help,
            _ => None,
        };
        events.into_iter().find_map(of_scene).expect("an error with a way out")
    };
    let found = help(desk.send_unsaved());
    assert!(found.contains("third.toml has the same text"), "{found}");
    fs::write(&renamed, "another text").expect("written");
    let other = help(desk.send_unsaved());
    assert!(!other.contains("same text"), "{other}");
}
