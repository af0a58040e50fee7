//! Reads gKit orbiter files: five lines of text, each with a letter followed by numbers.
//!
//! ```text
//! c 0 1 0          point that the camera looks at
//! p 0 0            offset in the image plane
//! r 18 16          rotation about x and y, degrees
//! s 2.5 3.5        distance to the center, radius of the scene
//! f 45 1024 640    vertical field of view in degrees, width and height in pixels
//! ```
//!
//! As in gKit's `Orbiter` class, world space is mapped to camera space (x right, y up, looking along −z) by
//!
//! `view = T(−p.x, −p.y, −size) · Rx(r.x) · Ry(r.y) · T(−c)`
//!
//! with right-handed rotations. The rightmost transform is applied first. The projection is a perspective
//! with the vertical field of view `fov` and the aspect ratio `width / height`. The radius only affects the
//! near and far planes.

use std::path::Path;

use super::{AssetError, FileHash, GkitOrbiterCamera, read};
use crate::control::{CancelToken, ignore_progress};
use crate::math::limits::{MAX_MAGNITUDE, MIN_LENGTH, is_nonzero_but_too_short};

/// Maximum size of an orbiter file.
const MAX_FILE_BYTES: u64 = 1 << 20;

/// gKit's default field of view and image size, for old files without an `f` line.
const DEFAULT_FIELD: [f64; 3] = [45.0, 1024.0, 640.0];

/// Reads an orbiter file and returns its camera and hash. The lines `c` and `s` are required; `p` and `r`
/// default to 0, and `f` to 45 degrees at 1024 × 640 pixels.
///
/// # Errors
/// [`AssetError::Unreadable`], or [`AssetError::Malformed`] with the line if a letter is unknown, the number
/// of values is wrong, or a value is not finite or out of range.
pub fn load(path: &Path) -> Result<(GkitOrbiterCamera, FileHash), AssetError> {
    let token = CancelToken::new();
    let bytes = read::read_text_bytes(
        path,
        MAX_FILE_BYTES,
        read::Monitor { progress: &ignore_progress, token: &token },
    )?;
    Ok((parse_orbiter_camera(path, &String::from_utf8_lossy(&bytes))?, read::hash_bytes(&bytes)))
}

fn parse_orbiter_camera(path: &Path, text: &str) -> Result<GkitOrbiterCamera, AssetError> {
    let (mut center, mut position, mut rotation, mut size, mut field) = (None, None, None, None, None);
    for (index, line) in text.lines().enumerate() {
        let wrong = |reason: String| AssetError::malformed(path, Some(index + 1), reason);
        let mut words = line.split_whitespace();
        match words.next() {
            None => {}
            Some(comment) if comment.starts_with('#') => {}
            Some("c") => center = Some(parse_numbers("c", words).map_err(wrong)?),
            Some("p") => position = Some(parse_numbers("p", words).map_err(wrong)?),
            Some("r") => rotation = Some(parse_numbers("r", words).map_err(wrong)?),
            Some("s") => size = Some(check_distance(parse_numbers("s", words)).map_err(wrong)?),
            Some("f") => field = Some(check_fov_and_image_size(parse_numbers("f", words)).map_err(wrong)?),
            Some(other) => {
                let shown: String = other.chars().take(20).collect();
                return Err(wrong(unknown_line_message(&shown)));
            }
        }
    }
    let missing = |line| AssetError::malformed(path, None, missing_line_message(line));
    let [size, radius] = size.ok_or_else(|| missing("s size radius"))?;
    let [fov, width, height] = field.unwrap_or(DEFAULT_FIELD);
    Ok(GkitOrbiterCamera {
        center: center.ok_or_else(|| missing("c x y z"))?,
        position: position.unwrap_or_default(),
        rotation: rotation.unwrap_or_default(),
        size,
        radius,
        fov,
        width,
        height,
    })
}

fn missing_line_message(line: &str) -> String {
    format!("missing line `{line}`")
}

fn unknown_line_message(found: &str) -> String {
    format!("expected a line starting with c, p, r, s or f, found {found:?}")
}

fn wrong_number_count_message(letter: &str, count: usize) -> String {
    format!("expected {count} finite numbers after `{letter}`")
}

fn number_too_large_message(letter: &str, number: f64) -> String {
    format!("numbers after `{letter}` must be below {MAX_MAGNITUDE:e} in magnitude, not {number:e}")
}

fn distance_below_minimum_message(size: f64) -> String {
    format!("the distance in `s` must be above {MIN_LENGTH:e}, not {size:e}")
}

fn distance_not_positive_message(size: f64) -> String {
    format!("the distance in `s` must be positive, not {size}")
}

fn invalid_fov_message(fov: f64) -> String {
    format!("the angle in `f` must be between 0 and 180 degrees, not {fov}")
}

fn invalid_size_message(width: f64, height: f64) -> String {
    format!("width and height in `f` must be positive, not {width} × {height}")
}

fn parse_numbers<'a, const N: usize>(
    letter: &str,
    words: impl Iterator<Item = &'a str>,
) -> Result<[f64; N], String> {
    let found: Option<Vec<f64>> =
        words.map(|word| word.parse().ok().filter(|n: &f64| n.is_finite())).collect();
    let exact: Option<[f64; N]> = found.and_then(|found| found.try_into().ok());
    let numbers = exact.ok_or_else(|| wrong_number_count_message(letter, N))?;
    match numbers.iter().find(|number| number.abs() > MAX_MAGNITUDE) {
        Some(number) => Err(number_too_large_message(letter, *number)),
        None => Ok(numbers),
    }
}

/// Checks the distance in `s`. Ignores the radius, which only affects a rasterizer's clip planes.
fn check_distance(numbers: Result<[f64; 2], String>) -> Result<[f64; 2], String> {
    let [size, radius] = numbers?;
    match () {
        () if !(size > 0.0) => Err(distance_not_positive_message(size)),
        () if is_nonzero_but_too_short(size) => Err(distance_below_minimum_message(size)),
        () => Ok([size, radius]),
    }
}

fn check_fov_and_image_size(numbers: Result<[f64; 3], String>) -> Result<[f64; 3], String> {
    let [fov, width, height] = numbers?;
    if !(fov > 0.0 && fov < 180.0) {
        return Err(invalid_fov_message(fov));
    }
    if !(width > 0.0 && height > 0.0) {
        return Err(invalid_size_message(width, height));
    }
    Ok([fov, width, height])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::expect_rejection;

    fn error(text: &str) -> (Option<usize>, String) {
        expect_rejection(parse_orbiter_camera(Path::new("cam.txt"), text))
    }

    #[test]
    fn every_number_is_read() {
        let text = "c -1 2 3\np 0.5 -0.25\nr 18 16\ns 4 5\nf 30 1024 640\n";
        let camera = parse_orbiter_camera(Path::new("cam.txt"), text).expect("whole");
        assert_eq!(camera.center, [-1.0, 2.0, 3.0]);
        assert_eq!(camera.position, [0.5, -0.25]);
        assert_eq!(camera.rotation, [18.0, 16.0]);
        assert_eq!((camera.size, camera.radius), (4.0, 5.0));
        assert_eq!((camera.fov, camera.width, camera.height), (30.0, 1024.0, 640.0));
    }

    #[test]
    fn lines_with_a_default_are_optional() {
        let camera =
            parse_orbiter_camera(Path::new("cam.txt"), "# old\r\ns 4 5\r\n\r\nc 0 0 0\r\n").expect("whole");
        assert_eq!((camera.rotation, camera.fov), ([0.0, 0.0], 45.0));
        assert_eq!(error("c 0 0 0"), (None, missing_line_message("s size radius")));
        assert_eq!(error("s 1 1"), (None, missing_line_message("c x y z")));
    }

    #[test]
    fn errors_include_line_and_reason() {
        for (text, line, reason) in [
            ("c 0 0 0\np 1\n", 2, wrong_number_count_message("p", 2)),
            ("c 0 nan 0", 1, wrong_number_count_message("c", 3)),
            ("r 0 1 2", 1, wrong_number_count_message("r", 2)),
            ("\ns 0 1", 2, distance_not_positive_message(0.0)),
            ("f 180 4 3", 1, invalid_fov_message(180.0)),
            ("f 40 4 0", 1, invalid_size_message(4.0, 0.0)),
            ("x 1", 1, unknown_line_message("x")),
            ("c 0 1e20 0", 1, number_too_large_message("c", 1e20)),
            ("p 1e308 0", 1, number_too_large_message("p", 1e308)),
            ("r 0 -1e19", 1, number_too_large_message("r", -1e19)),
            ("s 1e20 1", 1, number_too_large_message("s", 1e20)),
            ("s 1e-30 1", 1, distance_below_minimum_message(1e-30)),
            ("f 40 1e19 3", 1, number_too_large_message("f", 1e19)),
        ] {
            assert_eq!(error(text), (Some(line), reason), "{text}");
        }
    }
}
