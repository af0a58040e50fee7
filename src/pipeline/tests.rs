use crate::scene::description::Scene;

/// A scene of this text; a camera is added where there is none.
pub(super) fn scene_of(text: &str) -> Scene {
    let place = "position = [0, 1, 4]\nlook_at = [0, 1, 0]\n";
    let text = if text.contains("[camera]\n") {
        text.replace("[camera]\n", &format!("[camera]\n{place}"))
    } else {
        format!("{text}\n[camera]\n{place}")
    };
    let folder = tempfile::tempdir().expect("a scratch folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).expect("written");
    super::standins::scene::load(&path).expect("a scene that is right").scene
}
