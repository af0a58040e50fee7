//! CSV output with one line per image (RFC 4180).

use super::results::Results;

/// The CSV header line, including the line ending.
pub const HEADER_LINE: &str =
    "scene,width,height,method,step,seed,samples,seconds,setup_seconds,relmse,reference_noise\r\n";

/// Formats the results as CSV.
pub fn format_csv(results: &Results) -> String {
    let mut text = HEADER_LINE.to_owned();
    for scene in &results.scenes {
        let size = format!("{},{}", scene.width, scene.height);
        let noise = scene.reference.noise;
        for method in &scene.methods {
            let of = format!("{},{size},{}", quote_field(&scene.scene), quote_field(&method.name));
            for (number, step) in (1..).zip(&method.steps) {
                for picture in &step.pictures {
                    text += &format!(
                        "{of},{number},{},{},{},{},{},{noise}\r\n",
                        picture.seed, picture.samples, picture.seconds, method.setup_seconds, picture.relmse
                    );
                }
            }
        }
    }
    text
}

/// Quotes a field if necessary.
fn quote_field(text: &str) -> String {
    if text.contains(['"', ',', '\r', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::super::results::tests::synthetic_results;
    use super::*;

    #[test]
    fn each_image_has_a_line_with_all_fields() {
        let mut results = synthetic_results();
        results.scenes[1].scene = "odd, \"name\".toml".to_owned();
        let text = format_csv(&results);
        let lines: Vec<&str> = text.split_terminator("\r\n").collect();
        assert_eq!(lines.len(), 1 + 2 * 2 * 4 * 3);
        let columns = HEADER_LINE.split(',').count();
        assert!(lines[..25].iter().all(|line| line.split(',').count() == columns), "{text}");
        assert!(lines[1].starts_with("a.toml,128,96,path,1,1,1,0.009"), "{}", lines[1]);
        assert!(lines[25].starts_with("\"odd, \"\"name\"\".toml\",128,96,path,1,1,"), "{}", lines[25]);
    }
}
