//! gKit orbiter files: five lines of text, each a letter and its numbers.
//!
//! ```text
//! c 0 1 0          centre that is looked at
//! p 0 0            offset in the picture's plane
//! r 18 16          rotation about x and y, degrees
//! s 2.5 3.5        distance to the centre, radius of the scene
//! f 45 1024 640    vertical angle in degrees, width and height in pixels
//! ```
//!
//! gKit's `Orbiter` class defines their meaning. A point of the world goes to camera space (x right, y up, looking
//! along −z) by
//!
//! `view = T(−p.x, −p.y, −size) · Rx(r.x) · Ry(r.y) · T(−c)`
//!
//! with right-handed rotations, `T` applied last on the left. The projection is a perspective one with the whole
//! vertical angle `fov` and the aspect `width / height`; the radius only sets its near and far planes.

use std::path::Path;

use super::{AssetError, FileHash, OrbiterCamera, read};
use crate::control::{CancelToken, ignore_progress};
use crate::math::limits::{LARGEST, SHORTEST, is_too_short};

/// Most bytes of an orbiter file, which has five lines: a larger file is something else.
const LIMIT: u64 = 1 << 20;

/// The angle of gKit's viewer, for files from before the `f` line.
const DEFAULT_FIELD: [f64; 3] = [45.0, 1024.0, 640.0];

/// Reads an orbiter file; returns its hash too. `c` and `s` are required; without them, `p` and `r` are 0 and `f` is 45 degrees at
/// 1024 × 640.
///
/// # Errors
/// [`AssetError::Unreadable`], or [`AssetError::Malformed`] with the line: an unknown letter, a wrong count of numbers,
/// a number that is not finite or out of range.
pub fn load(path: &Path) -> Result<(OrbiterCamera, FileHash), AssetError> {
    let token = CancelToken::new();
    let bytes = read::text(path, LIMIT, read::Watch { progress: &ignore_progress, token: &token })?;
    Ok((parse(path, &String::from_utf8_lossy(&bytes))?, read::hash(&bytes)))
}

fn parse(path: &Path, text: &str) -> Result<OrbiterCamera, AssetError> {
    let (mut center, mut position, mut rotation, mut size, mut field) = (None, None, None, None, None);
    for (index, line) in text.lines().enumerate() {
        let wrong = |reason: String| AssetError::malformed(path, Some(index + 1), reason);
        let mut words = line.split_whitespace();
        match words.next() {
            None => {}
            Some(comment) if comment.starts_with('#') => {}
            Some("c") => center = Some(numbers("c", words).map_err(wrong)?),
            Some("p") => position = Some(numbers("p", words).map_err(wrong)?),
            Some("r") => rotation = Some(numbers("r", words).map_err(wrong)?),
            Some("s") => size = Some(positive(numbers("s", words)).map_err(wrong)?),
            Some("f") => field = Some(view_angle(numbers("f", words)).map_err(wrong)?),
            Some(other) => {
                let shown: String = other.chars().take(20).collect();
                return Err(wrong(format!("expected a line c, p, r, s or f, found {shown:?}")));
            }
        }
    }
    let missing =
        |letter| AssetError::malformed(path, None, format!("an orbiter file has a line `{letter}`"));
    let [size, radius] = size.ok_or_else(|| missing("s size radius"))?;
    let [fov, width, height] = field.unwrap_or(DEFAULT_FIELD);
    Ok(OrbiterCamera {
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

fn numbers<'a, const N: usize>(
    letter: &str,
    words: impl Iterator<Item = &'a str>,
) -> Result<[f64; N], String> {
    let found: Option<Vec<f64>> =
        words.map(|word| word.parse().ok().filter(|n: &f64| n.is_finite())).collect();
    let exact: Option<[f64; N]> = found.and_then(|found| found.try_into().ok());
    let numbers = exact.ok_or_else(|| format!("`{letter}` is followed by {N} finite numbers"))?;
    match numbers.iter().find(|number| number.abs() > LARGEST) {
        Some(number) => {
            Err(format!("the numbers of `{letter}` are less than {LARGEST:e} in magnitude, not {number:e}"))
        }
        None => Ok(numbers),
    }
}

/// The distance of `s`; a radius of 0 only moves planes that a ray tracer does not have.
fn positive(numbers: Result<[f64; 2], String>) -> Result<[f64; 2], String> {
    let [size, radius] = numbers?;
    match () {
        () if !(size > 0.0) => Err(format!("the distance in `s` is above 0, not {size}")),
        () if is_too_short(size) => {
            Err(format!("the distance in `s` is more than {SHORTEST:e}, not {size:e}"))
        }
        () => Ok([size, radius]),
    }
}

fn view_angle(numbers: Result<[f64; 3], String>) -> Result<[f64; 3], String> {
    let [fov, width, height] = numbers?;
    if !(fov > 0.0 && fov < 180.0) {
        return Err(format!("the angle in `f` is between 0 and 180 degrees, not {fov}"));
    }
    if !(width > 0.0 && height > 0.0) {
        return Err(format!("width and height in `f` are above 0, not {width} × {height}"));
    }
    Ok([fov, width, height])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn says(text: &str) -> String {
        parse(Path::new("cam.txt"), text).expect_err("refused").to_string()
    }

    #[test]
    fn every_number_finds_its_place() {
        let text = "c -1 2 3\np 0.5 -0.25\nr 18 16\ns 4 5\nf 30 1024 640\n";
        let camera = parse(Path::new("cam.txt"), text).expect("whole");
        assert_eq!(camera.center, [-1.0, 2.0, 3.0]);
        assert_eq!(camera.position, [0.5, -0.25]);
        assert_eq!(camera.rotation, [18.0, 16.0]);
        assert_eq!((camera.size, camera.radius), (4.0, 5.0));
        assert_eq!((camera.fov, camera.width, camera.height), (30.0, 1024.0, 640.0));
    }

    #[test]
    fn lines_may_be_missing_where_a_default_is_sensible() {
        let camera = parse(Path::new("cam.txt"), "# of old\r\ns 4 5\r\n\r\nc 0 0 0\r\n").expect("whole");
        assert_eq!((camera.rotation, camera.fov), ([0.0, 0.0], 45.0));
        assert!(says("c 0 0 0").contains("`s size radius`"));
        assert!(says("s 1 1").contains("`c x y z`"));
    }

    #[test]
    fn errors_name_line_and_rule() {
        assert!(says("c 0 0 0\np 1\n").starts_with("cam.txt:2: `p` is followed by 2 finite numbers"));
        assert!(says("c 0 nan 0").starts_with("cam.txt:1: `c`"));
        assert!(says("r 0 1 2").contains("2 finite numbers"));
        assert!(says("\ns 0 1").starts_with("cam.txt:2: the distance"));
        assert!(says("f 180 4 3").contains("between 0 and 180"));
        assert!(says("f 40 4 0").contains("above 0"));
        assert!(says("x 1").contains("found \"x\""));
        for (line, words) in [
            ("c 0 1e20 0", "`c` are less than 1e18 in magnitude, not 1e20"),
            ("p 1e308 0", "`p` are less than 1e18"),
            ("r 0 -1e19", "`r` are less than 1e18"),
            ("s 1e20 1", "`s` are less than 1e18"),
            ("s 1e-30 1", "the distance in `s` is more than 1e-18, not 1e-30"),
            ("f 40 1e19 3", "`f` are less than 1e18"),
        ] {
            assert!(says(line).starts_with("cam.txt:1: ") && says(line).contains(words), "{}", says(line));
        }
    }
}
