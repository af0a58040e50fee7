//! Randomly mutates a scene. Reading the result must neither panic nor hang.

use super::*;

/// A scene that uses most features.
const SCENE: &str = r#"LookAt 0 0 -5  0 0 0  0 1 0
Camera "perspective" "float fov" [40] "float lensradius" 0.1 "float focaldistance" 5
Film "rgb" "integer xresolution" [32] "integer yresolution" [16] "float iso" 150 "float cropwindow" [0 0.5 0 1]
Sampler "stratified" "integer xsamples" 2
PixelFilter "mitchell" "float B" 0.5
Integrator "bdpt" "integer maxdepth" 7
WorldBegin
Attribute "shape" "float alpha" 0.5
Texture "c" "spectrum" "checkerboard" "float uscale" 4 "rgb tex1" [1 0 0]
Texture "m" "float" "mix" "float tex1" 0.1 "float tex2" 0.9 "float amount" 0.25
Texture "b" "float" "bilerp" "float v00" 0.1
MakeNamedMaterial "a" "string type" "coateddiffuse" "texture reflectance" "c" "float roughness" 0.1
MakeNamedMaterial "d" "string type" "conductor" "spectrum eta" "metal-Au-eta" "texture roughness" "b"
MakeNamedMaterial "x" "string type" "mix" "string materials" ["a" "d"] "texture amount" "m"
AttributeBegin
  ColorSpace "rec2020"
  AreaLightSource "diffuse" "blackbody L" 5000 "float power" 10 "bool twosided" true
  Translate 0 2 0 Rotate 90 1 0 0 Scale 1 -1 1
  ReverseOrientation
  Shape "disk" "float radius" 0.5
AttributeEnd
NamedMaterial "x"
Shape "sphere" "float radius" 1 "float zmax" 0.5
Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2] "normal N" [0 0 1 0 0 1 0 0 1]
Shape "bilinearmesh" "point3 P" [0 0 0 1 0 0 0 1 0 1 1 1]
Shape "loopsubdiv" "integer levels" 2 "point3 P" [0 0 0 1 0 0 0 1 0 0 0 1] "integer indices" [0 1 2 0 3 1]
ObjectBegin "o" Shape "cylinder" ObjectEnd
ConcatTransform [1 0 0 0  0 1 0 0  0 0 1 0  2 0 0 1]
ObjectInstance "o"
MakeNamedMedium "f" "string type" "homogeneous" "rgb sigma_a" [1 1 1] "rgb sigma_s" [0 0 0]
MediumInterface "f" ""
Material "dielectric" "spectrum eta" "glass-BK7"
Shape "sphere"
LightSource "spot" "point3 from" [0 3 0] "point3 to" [0 0 0] "spectrum I" [400 1 700 2]
LightSource "distant" "float illuminance" 3
LightSource "infinite" "rgb L" [0.1 0.2 0.3]
"#;

/// A pseudorandom number generator (Marsaglia's xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % count as u64) as usize
    }
}

/// Returns [`SCENE`] after one to three random mutations, which replace, remove, duplicate or swap words.
fn mutated(random: &mut Random) -> String {
    const WORDS: [&str; 24] = [
        "[",
        "]",
        "\"",
        "0",
        "-1",
        "1e300",
        "1e-300",
        "nan",
        "true",
        "\"a\"",
        "WorldBegin",
        "AttributeEnd",
        "AttributeBegin",
        "\"float radius\"",
        "\"texture x\" \"c\"",
        "Shape \"disk\"",
        "Identity",
        "#",
        "\\",
        "Scale 0 0 0",
        "4294967296",
        "ObjectEnd",
        "\"rgb L\"",
        "é",
    ];
    let mut words: Vec<&str> = SCENE.split_inclusive([' ', '\n']).collect();
    for _ in 0..1 + random.below(3) {
        let at = random.below(words.len());
        match random.below(4) {
            0 => words[at] = WORDS[random.below(WORDS.len())],
            1 => drop(words.remove(at)),
            2 => words.insert(at, words[random.below(words.len())]),
            _ => {
                let other = random.below(words.len());
                words.swap(at, other);
            }
        }
    }
    words.join(" ")
}

#[test]
fn unmutated_scene_is_valid() {
    let folder = SceneFolder::new(SCENE);
    let scene = folder.read().unwrap_or_else(|errors| panic!("{errors:?}"));
    folder.scene_from_document().unwrap_or_else(|errors| panic!("{errors:?}\n{}", scene.document.to_toml()));
}

#[test]
fn mutated_scenes_do_not_panic() {
    let count = std::env::var("GLIMT_MUTATIONS").ok().and_then(|count| count.parse().ok()).unwrap_or(300);
    let (mut random, folder) = (Random(0x9e37_79b9_7f4a_7c15), SceneFolder::new(""));
    let mut refused = 0;
    for _ in 0..count {
        folder.write("scene.pbrt", mutated(&mut random).as_bytes());
        refused += u32::from(folder.scene_from_document().is_err());
    }
    // Most mutations make the scene invalid, but not all.
    assert!((count / 10..count).contains(&refused), "{refused} of {count}");
}
