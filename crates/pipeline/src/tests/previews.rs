//! Tests for previews: size, section and range.

use super::commands::render_slowly;
use super::*;
use crate::settings::ViewMode;

#[test]
fn preview_size_change_does_not_render() {
    let mut bench = Bench::new(SCENE);
    bench.preview = Some(PreviewBounds { width: 12, height: 12, around: None });
    let generation = bench.send();
    assert!(bench.until_end(generation).iter().any(|event| matches!(event, Event::Preview { .. })));
    let latest = bench.worker.previews.lock().expect("not poisoned").clone().expect("a preview");
    assert_eq!((latest.generation, latest.picture.width, latest.picture.height), (generation, 12, 9));
    bench.preview = Some(PreviewBounds { width: 20, height: 30, around: None });
    assert_statuses(&bench.done().0, "rrrrrsrr");
    let latest = bench.worker.previews.lock().expect("not poisoned").clone().expect("a preview");
    assert_eq!((latest.picture.width, latest.picture.height), (20, 15));
}

#[test]
fn close_up_shows_image_pixels() {
    let mut bench = Bench::new(SCENE);
    bench.preview = Some(PreviewBounds { width: 40, height: 30, around: None });
    bench.done();
    let latest =
        |bench: &Bench| bench.worker.previews.lock().expect("not poisoned").clone().expect("a preview");
    let whole = latest(&bench);
    assert_eq!((whole.picture.width, whole.section), (40, None));
    for (spot, left, top) in [((0.5, 0.5), 14, 11), ((0.0, 1.0), 0, 22), ((2.0, -1.0), 28, 0)] {
        let around = Some(NormalizedPosition { x: spot.0, y: spot.1 });
        bench.preview = Some(PreviewBounds { width: 12, height: 8, around });
        assert_statuses(&bench.done().0, "rrrrrsrr");
        let PreviewUpdate { picture, section, .. } = latest(&bench);
        let section = section.expect("a part");
        assert_eq!((picture.width, picture.height), (12, 8));
        assert_eq!((section.left, section.top), (f64::from(left) / 40.0, f64::from(top) / 30.0));
        for (i, pixel) in (0..).zip(&picture.pixels) {
            let at = (top + i / 12) * 40 + left + i % 12;
            assert_eq!(*pixel, whole.picture.pixels[at as usize], "pixel {i} around {spot:?}");
        }
    }
    bench.preview =
        Some(PreviewBounds { width: 200, height: 200, around: Some(NormalizedPosition { x: 0.3, y: 0.3 }) });
    bench.done();
    assert_eq!(
        latest(&bench).picture,
        whole.picture,
        "a small image should be shown entirely at its own size"
    );
}

#[test]
fn previews_identify_their_image() {
    let mut bench = Bench::new(SCENE);
    bench.preview = Some(PreviewBounds { width: 12, height: 12, around: None });
    let source = |bench: &mut Bench| {
        bench.done();
        let latest = bench.worker.previews.lock().expect("not poisoned").clone().expect("a preview");
        let source = latest.source.expect("a source");
        assert!(source.is_finished);
        source.image
    };
    let own = source(&mut bench);
    // A different size, a comment or a new render does not change the image's identity.
    bench.preview = Some(PreviewBounds { width: 20, height: 30, around: None });
    assert!(source(&mut bench) == own);
    bench.edit("[camera]", "# a comment\n[camera]");
    assert!(source(&mut bench) == own);
    bench.force = true;
    assert!(source(&mut bench) == own);
    bench.force = false;
    for (from, to) in [
        ("samples = 4", "samples = 8"),
        ("exposure = 0.0", "exposure = 1.0"),
        ("exposure = 1.0", "exposure = 1.0\ntonemap = \"agx\""),
        ("radius = 0.5", "radius = 0.4"),
    ] {
        let before = source(&mut bench);
        bench.edit(from, to);
        assert!(source(&mut bench) != before, "{to}");
    }
    bench.overrides.view = Some(ViewMode::Normal);
    assert!(source(&mut bench) != own);
}

#[test]
fn time_limited_renders_are_distinct_images() {
    let mut bench = Bench::with(&SCENE.replace("samples = 4", "samples = 1000000"), render_slowly);
    bench.preview = Some(PreviewBounds { width: 12, height: 12, around: None });
    bench.overrides.time_seconds = Some(0.2);
    let mut images = Vec::new();
    for force in [false, false, true] {
        bench.force = force;
        bench.done();
        // Request a preview after the render has ended, because earlier previews may not be final.
        bench.worker.send(Command::Preview(bench.preview));
        while !matches!(bench.next(), Event::Preview { .. }) {}
        let latest = bench.worker.previews.lock().expect("not poisoned").clone().expect("a preview");
        let source = latest.source.expect("a source");
        assert!(source.is_finished);
        images.push(source.image);
    }
    assert!(images[0] == images[1] && images[1] != images[2]);
}

#[test]
fn preview_size_change_does_not_interrupt() {
    let mut bench = Bench::with(&SCENE.replace("samples = 4", "samples = 1000000"), render_slowly);
    bench.preview = Some(PreviewBounds { width: 12, height: 12, around: None });
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { progress, .. } if progress.samples > 0) {}
    let until_wide = |bench: &Bench, wide: u32| {
        loop {
            let event = bench.next();
            assert!(matches!(event, Event::Preview { .. } | Event::Progress { .. }), "{event:?}");
            let latest = bench.worker.previews.lock().expect("not poisoned").clone().expect("a preview");
            if latest.picture.width == wide {
                assert_eq!(latest.generation, of);
                return;
            }
        }
    };
    let order = |width| Command::Preview(Some(PreviewBounds { width, height: 100, around: None }));
    bench.worker.send(order(24));
    until_wide(&bench, 24);
    bench.worker.send(Command::Pause(true));
    bench.worker.send(order(32));
    until_wide(&bench, 32);
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
    bench.worker.send(order(36));
    until_wide(&bench, 36);
}

#[test]
fn preview_and_image_share_the_depth_range() {
    let mut bench = Bench::new(SCENE);
    bench.overrides.view = Some(ViewMode::Depth);
    for (width, around) in [(7, None), (40, None), (6, Some(NormalizedPosition { x: 0.5, y: 0.5 }))] {
        bench.preview = Some(PreviewBounds { width, height: 30, around });
        let (report, _) = bench.done();
        let shown = bench.worker.previews.lock().expect("not poisoned").take().expect("an image");
        assert!(report.image.range.is_some());
        assert_eq!(shown.range, report.image.range, "{width}");
    }
}
