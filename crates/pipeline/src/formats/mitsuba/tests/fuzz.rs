//! Mutated scenes must not cause panics or hangs.

use super::features::ATTRIBUTES;
use super::{Bench, OBJ, SENSOR, scene_from_document};

/// A scene that uses most elements.
const SCENE: &str = r##"<default name="r" value="0.5"/><integrator type="path"><integer name="max_depth" value="5"/></integrator>
<bsdf type="twosided" id="wall"><bsdf type="roughplastic"><rgb name="diffuse_reflectance" value="0.2, 0.3, 0.4"/>
<float name="alpha" value="0.2"/></bsdf></bsdf><bsdf type="mask" id="leaf"><float name="opacity" value="0.5"/><ref id="wall"/></bsdf>
<shape type="sphere" id="ball"><float name="radius" value="$r"/><ref id="wall"/><transform name="to_world"><scale x="2"/>
<rotate y="1" angle="30"/><matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/></transform></shape>
<shape type="obj"><string name="filename" value="a.obj"/><ref id="leaf"/></shape>
<shape type="shapegroup" id="g"><shape type="cube"/></shape><shape type="instance"><ref id="g"/></shape>
<shape type="rectangle"><emitter type="area"><spectrum name="radiance" value="400:1, 700:2"/></emitter></shape>
<shape type="disk"><bsdf type="blendbsdf"><texture type="checkerboard" name="weight"><transform name="to_uv"><scale x="3"/></transform>
</texture><bsdf type="conductor"/><bsdf type="diffuse"/></bsdf></shape>
<emitter type="spot"><transform name="to_world"><lookat origin="0,0,1" target="0,0,0" up="0,1,0"/></transform></emitter>
<emitter type="sunsky"><float name="turbidity" value="3"/></emitter>
<shape type="bsplinecurve"><string name="filename" value="a.txt"/><transform name="to_world"><scale value="2"/></transform></shape>
<shape type="linearcurve"><string name="filename" value="a.txt"/><bsdf type="diffuse"/></shape>
<shape type="ply"><string name="filename" value="a.ply"/><bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance">
<string name="name" value="face_color"/></texture></bsdf></shape>
<shape type="sphere"><bsdf type="dielectric"/><medium name="interior" type="homogeneous"><float name="albedo" value="0"/></medium></shape>
<shape type="sphere"><bsdf type="roughconductor"><string name="material" value="Au"/><texture name="alpha_u" type="checkerboard"/>
<float name="alpha_v" value="0.3"/></bsdf></shape>
<emitter type="projector"><float name="fov" value="40"/><rgb name="irradiance" value="1, 2, 3"/><transform name="to_world">
<lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform></emitter>"##;

/// Replacements for attribute values.
const WORDS: [&str; 18] = [
    "",
    "-1",
    "0",
    "1e30",
    "1e-30",
    "nan",
    "99999999999999999999",
    "$r",
    "wall",
    "ball",
    "g",
    "leaf",
    "scene.xml",
    "diffuse",
    "mask",
    "\u{1F600}",
    "1 2",
    "<",
];

/// Pseudorandom numbers (xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % limit.max(1) as u64) as usize
    }
}

/// Replaces an attribute value, deletes or repeats a range of bytes, or changes a byte.
fn mutate(text: &str, random: &mut Random) -> String {
    let boundary = |at: usize| (at..=text.len()).find(|at| text.is_char_boundary(*at)).unwrap_or(text.len());
    let (a, b) = (boundary(random.below(text.len())), boundary(random.below(text.len())));
    let (a, b) = (a.min(b), a.max(b));
    match random.below(6) {
        0..=2 => {
            let quotes: Vec<usize> = text.match_indices('"').map(|(at, _)| at).collect();
            let pair = 2 * random.below(quotes.len() / 2);
            let (Some(start), Some(end)) = (quotes.get(pair), quotes.get(pair + 1)) else {
                return text.to_owned();
            };
            format!("{}{}{}", &text[..=*start], WORDS[random.below(WORDS.len())], &text[*end..])
        }
        3 => format!("{}{}", &text[..a], &text[b..]),
        4 => format!("{}{}{}", &text[..b], &text[a..b], &text[b..]),
        _ => {
            let mut bytes = text.as_bytes().to_vec();
            if let Some(byte) = bytes.get_mut(a) {
                *byte = b"<>/\"= \n&$0a"[random.below(11)];
            }
            String::from_utf8_lossy(&bytes).into_owned()
        }
    }
}

/// Number of mutations, from `GLIMT_MUTATIONS` if it is set.
fn mutation_count() -> usize {
    std::env::var("GLIMT_MUTATIONS").ok().and_then(|count| count.parse().ok()).unwrap_or(400)
}

#[test]
fn mutated_scenes_do_not_panic() {
    let bench = Bench::new();
    bench.write("a.obj", OBJ).write("a.ply", ATTRIBUTES);
    bench.write("a.txt", "0 0 0 1\n1 0 0 1\n2 1 0 0.5\n3 0 0 1\n");
    let original = format!("<scene version=\"3.0.0\">{SENSOR}{SCENE}</scene>");
    bench.write("scene.xml", &original);
    assert!(bench.read().is_ok());
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut valid = 0;
    for _ in 0..mutation_count() {
        let mut text = original.clone();
        for _ in 0..=random.below(4) {
            text = mutate(&text, &mut random);
        }
        bench.write("scene.xml", &text);
        if let Ok(scene) = bench.read() {
            valid += 1;
            let _ = scene_from_document(scene.document, &bench.path("scene.xml"), &[]);
        }
    }
    assert!(valid > mutation_count() / 50, "{valid}");
}
