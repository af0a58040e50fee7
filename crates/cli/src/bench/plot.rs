//! SVG plots of error over time with logarithmic axes: one panel per scene, one line per method.

mod axes;
mod panel;

use plotters::prelude::{IntoDrawingArea, SVGBackend, WHITE};

use super::results::Results;
use crate::output::sign_plot;

/// Labels of the x and y axes.
pub const AXES: [&str; 2] = ["seconds of rendering", "relMSE"];
/// Size of a panel in SVG pixels.
const PANEL: (u32, u32) = (640, 480);
/// Panels per row.
const PANELS_PER_ROW: usize = 2;

/// Draws the plots for all scenes as one SVG document.
///
/// # Errors
/// Returns errors from the plotting library.
pub fn draw_svg(results: &Results) -> Result<String, String> {
    let across = results.scenes.len().clamp(1, PANELS_PER_ROW);
    let down = results.scenes.len().div_ceil(PANELS_PER_ROW).max(1);
    let size = (PANEL.0 * across as u32, PANEL.1 * down as u32);
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        let draw = || {
            root.fill(&WHITE)?;
            let places = root.split_evenly((down, across));
            results
                .scenes
                .iter()
                .zip(&places)
                .try_for_each(|(scene, place)| panel::draw_panel(scene, place))?;
            root.present()
        };
        draw().map_err(|error| error.to_string())?;
    }
    Ok(sign_plot(&text))
}

#[cfg(test)]
mod tests {
    use super::super::results::tests::synthetic_results;
    use super::*;

    fn texts(svg: &str) -> Vec<String> {
        let document = roxmltree::Document::parse(svg).expect("XML");
        let texts = document.descendants().filter(|node| node.has_tag_name("text"));
        texts.map(|node| node.text().unwrap_or_default().trim().to_owned()).collect()
    }

    #[test]
    fn plots_contain_all_scenes_methods_and_axes() {
        let svg = draw_svg(&synthetic_results()).expect("a plot");
        let texts = texts(&svg);
        for word in [
            "a.toml, 128×96",
            "b & <c>.toml, 128×96",
            "path, slope −1.00",
            "seconds of rendering",
            "relMSE",
            "10⁻²",
            "0.1",
        ] {
            assert!(texts.iter().any(|text| text == word), "{word} not found in {texts:?}");
        }
        assert!(
            texts.iter().any(|text| text.starts_with("whitted, slope −0.") && text.ends_with("BIAS 1.0e-2")),
            "{texts:?}"
        );
        let document = roxmltree::Document::parse(&svg).expect("XML");
        let lines = |color: &str| {
            document
                .descendants()
                .filter(|node| node.has_tag_name("polyline") && node.attribute("stroke") == Some(color))
                .count()
        };
        assert!(lines("#0072B2") >= 2 && lines("#D55E00") >= 2, "expected one line per method in each panel");
        let root = document.root_element();
        assert_eq!((root.attribute("width"), root.attribute("height")), (Some("1280"), Some("480")));
    }

    #[test]
    fn plots_accept_missing_and_negative_values() {
        let mut some = synthetic_results();
        some.scenes[0].methods.clear();
        for step in &mut some.scenes[1].methods[0].steps {
            (step.relmse, step.spread) = (-1e-9, [-1e-8, 1e-9]);
        }
        some.scenes[1].methods[1].steps.truncate(1);
        some.scenes[1].reference.noise = 0.0;
        texts(&draw_svg(&some).expect("a plot"));
        some.scenes.clear();
        texts(&draw_svg(&some).expect("a plot"));
    }
}
