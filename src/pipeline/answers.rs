//! What the worker says when a person asks of the picture at hand.

use std::path::PathBuf;

/// A place in a picture: how far it is from the left and from the top, where the whole picture is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// From the left.
    pub x: f64,
    /// From the top.
    pub y: f64,
}

/// What is at a place of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picked {
    /// Column and row.
    pub pixel: [u32; 2],
    /// What is seen there first; none: nothing is.
    pub thing: Option<Thing>,
    /// The pixel's colour so far, linear; none: it has no sample yet.
    pub color: Option<[f32; 3]>,
}

/// A shape, where a ray meets it.
#[derive(Clone, Debug, PartialEq)]
pub struct Thing {
    /// What the scene file calls it.
    pub shape: &'static str,
    /// Its own name, if it has one.
    pub name: Option<String>,
    /// The scene file.
    pub path: PathBuf,
    /// The line in which it begins there, from 1.
    pub line: usize,
    /// What kind of material it has, and its name.
    pub material: String,
    /// The place on it.
    pub position: [f64; 3],
    /// Its unit normal there, on its front.
    pub normal: [f32; 3],
    /// Whether its front is seen.
    pub is_front: bool,
    /// From the eye.
    pub distance: f64,
    /// From the eye along the view axis.
    pub depth: f64,
}

/// A camera that is in its scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kept {
    /// The scene file.
    pub path: PathBuf,
    /// Whether the file was written; else it had this camera already.
    pub is_new: bool,
    /// Whether the file gives this camera, with what the call sets.
    pub is_own: bool,
}
