//! Malformed mesh and material files.

/// The fault, the file, and the expected error message, which is empty if the valid part of the file can be
/// read.
pub(super) type Case = (&'static str, Vec<u8>, &'static str);

/// A facet in a binary STL file.
const FACET: [u8; 50] = {
    let mut facet = [0; 50];
    // The second vertex is at (1, 0, 0), the third at (0, 1, 0).
    (facet[26], facet[27]) = (0x80, 0x3f);
    (facet[42], facet[43]) = (0x80, 0x3f);
    facet
};

/// Every byte value, repeated four times.
pub(super) fn every_byte() -> Vec<u8> {
    (0..1024_u32).map(|index| index as u8).collect()
}

/// A binary STL file that claims to have `claimed` facets.
fn stl_of(claimed: u32, facets: &[u8]) -> Vec<u8> {
    [&[0; 80][..], &claimed.to_le_bytes(), facets].concat()
}

pub(super) fn obj() -> Vec<Case> {
    vec![
        (
            "a face with a nonexistent vertex",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n".to_vec(),
            "a.obj:4: vertex 4 is out of range: there are 3, numbered from 1",
        ),
        (
            "vertex 0",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n".to_vec(),
            "a.obj:4: vertex 0 is out of range: there are 3, numbered from 1",
        ),
        (
            "a negative index out of range",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 1 2\n".to_vec(),
            "a.obj:4: vertex -4 is out of range: there are 3, numbered from 1",
        ),
        (
            "no vertices",
            b"f 1 2 3\n".to_vec(),
            "a.obj:1: vertex 1 is out of range: none are defined before this line",
        ),
        ("no faces", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_vec(), "a.obj: no usable face: the file has no faces"),
        (
            "text instead of coordinates",
            b"v 0 0 zero\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec(),
            "a.obj:1: expected 3 coordinates, found \"zero\"",
        ),
        (
            "a vertex with two coordinates",
            b"v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec(),
            "a.obj:1: expected 3 coordinates, found 2",
        ),
        (
            "non-finite vertices",
            b"v nan 0 0\nv inf 0 0\nv 0 1e999 0\nf 1 2 3\n".to_vec(),
            "a.obj: no usable face: 1 of 1 have a non-finite corner, 0 have zero area",
        ),
        (
            "a face with two vertices",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n".to_vec(),
            "a.obj: no usable face: 0 of 1 have a non-finite corner, 1 have zero area",
        ),
        (
            "a face without vertices",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf\n".to_vec(),
            "a.obj: no usable face: 0 of 1 have a non-finite corner, 1 have zero area",
        ),
        (
            "a face with three equal vertices",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 1\n".to_vec(),
            "a.obj: no usable face: 0 of 1 have a non-finite corner, 1 have zero area",
        ),
        ("missing texture coordinates", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/2 3/3\n".to_vec(), ""),
        ("missing normals", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1//1 2//2 3//9\n".to_vec(), ""),
        (
            "text in a face",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf one two three\n".to_vec(),
            "a.obj:4: expected a corner like 1/2/3, found \"one\"",
        ),
        (
            "an index that overflows 64 bits",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999999\n".to_vec(),
            "a.obj:4: expected a corner like 1/2/3, found \"99999999999999999999\"",
        ),
        (
            "too many slashes",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/2/3/4 2 3\n".to_vec(),
            "a.obj:4: expected a corner like 1/2/3, found \"1/2/3/4\"",
        ),
        (
            "a fraction as an index",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1.5 2 3\n".to_vec(),
            "a.obj:4: expected a corner like 1/2/3, found \"1.5\"",
        ),
        (
            "text in texture coordinates",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt a b\nf 1/1 2/1 3/1\n".to_vec(),
            "a.obj:4: expected 2 texture coordinates, found \"a\"",
        ),
        (
            "text in a normal",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn a b c\nf 1//1 2//1 3//1\n".to_vec(),
            "a.obj:4: expected 3 normal coordinates, found \"a\"",
        ),
        (
            "a different format",
            b"ply\nformat ascii 1.0\nend_header\n".to_vec(),
            "a.obj: no usable face: the file has no faces",
        ),
        ("bytes", every_byte(), "a.obj:1: this is a binary file in another format"),
    ]
}

pub(super) fn off() -> Vec<Case> {
    vec![
        ("only the keyword", b"OFF\n".to_vec(), "a.off:1: the file ends before the number of vertices"),
        (
            "text instead of a count",
            b"OFF\nmany 1 0\n".to_vec(),
            "a.off:2: expected the number of vertices, found \"many\"",
        ),
        ("a negative count", b"OFF\n-3 1 0\n".to_vec(), "a.off:2: the number of vertices is -3"),
        (
            "four billion vertices",
            b"OFF\n4000000000 1 0\n0 0 0\n".to_vec(),
            "a.off:2: the header claims 4000000000 vertices and 1 face, but only 6 bytes follow",
        ),
        (
            "four billion faces",
            b"OFF\n3 4000000000 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(),
            "a.off:2: the header claims 3 vertices and 4000000000 faces, but only 26 bytes follow",
        ),
        (
            "the file ends within the vertices",
            b"OFF\n3 1 0\n0 0 0\n1 0 0\n".to_vec(),
            "a.off:2: the header claims 3 vertices and 1 face, but only 12 bytes follow",
        ),
        (
            "the file ends within the faces",
            b"OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(),
            "a.off:7: the file ends after 1 of 2 faces",
        ),
        (
            "a nonexistent vertex",
            b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n".to_vec(),
            "a.off:6: vertex 3 is out of range: there are 3, numbered from 0",
        ),
        (
            "a negative index out of range",
            b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n".to_vec(),
            "a.off:6: vertex -1 is out of range: there are 3, numbered from 0",
        ),
        (
            "a face with fewer vertices than declared",
            b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n".to_vec(),
            "a.off:6: a face claims 4 corners, more than the file can hold",
        ),
        (
            "a face with a billion vertices",
            b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n1000000000 0 1 2\n".to_vec(),
            "a.off:6: a face claims 1000000000 corners, more than the file can hold",
        ),
        (
            "a face with two vertices",
            b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n".to_vec(),
            "a.off: no usable face: 0 of 1 have a non-finite corner, 1 have zero area",
        ),
        (
            "text in a vertex",
            b"OFF\n3 1 0\n0 0 x\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(),
            "a.off:3: expected a coordinate, found \"x\"",
        ),
        (
            "a vertex with two coordinates",
            b"OFF\n3 1 0\n0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(),
            "a.off:3: expected a coordinate, found the end of the line",
        ),
        (
            "text in a face",
            b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\nthree 0 1 2\n".to_vec(),
            "a.off:6: expected the number of corners, found \"three\"",
        ),
        (
            "no faces",
            b"OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n".to_vec(),
            "a.off: no usable face: the file has no faces",
        ),
        (
            "binary",
            b"OFF BINARY\n\0\0\0\x03".to_vec(),
            "a.off:1: binary OFF is not supported; convert it to text or PLY",
        ),
        (
            "four dimensions",
            b"4OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(),
            "a.off:3: expected a coordinate, found the end of the line",
        ),
        (
            "non-finite values",
            b"OFF\n3 1 0\nnan nan nan\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(),
            "a.off: no usable face: 1 of 1 have a non-finite corner, 0 have zero area",
        ),
        ("a different format", b"solid a\nendsolid a\n".to_vec(), "a.off:1: expected OFF, found \"solid\""),
        ("bytes", every_byte(), "a.off:1: this is a binary file in another format"),
    ]
}

pub(super) fn ply() -> Vec<Case> {
    vec![
        ("only the magic line", b"ply\n".to_vec(), "a.ply: the header has no end_header"),
        ("a header without end_header", b"ply\nformat ascii 1.0\nelement vertex 3\n".to_vec(), "a.ply: the header has no end_header"),
        ("an unknown format", b"ply\nformat morse 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(), "a.ply:2: the format must be ascii, binary_little_endian or binary_big_endian, not \"morse\""),
        ("version 2", b"ply\nformat ascii 2.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(), ""),
        ("an unknown type", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty quad x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(), "a.ply:4: \"quad\" is not a PLY type"),
        ("no x coordinate", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(), "a.ply: the vertices need properties x, y and z"),
        ("a negative count", b"ply\nformat ascii 1.0\nelement vertex -3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(), "a.ply:3: \"-3\" is not a valid count for element `vertex`"),
        ("four billion vertices", b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(), "a.ply: the header claims 4000000000 `vertex` elements, but only 26 bytes follow"),
        ("four billion faces", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 4000000000\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(), "a.ply: the header claims 4000000000 `face` elements, but only 9 bytes follow"),
        ("the file ends within the vertices", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n".to_vec(), "a.ply: the header claims 3 `vertex` elements, but only 12 bytes follow"),
        ("the file ends within the faces", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(), "a.ply:14: face 2: unexpected end of file"),
        ("a nonexistent vertex", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n".to_vec(), "a.ply:13: face 1: vertex 3 is out of range: there are 3, numbered from 0"),
        ("a negative index out of range", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n".to_vec(), "a.ply:13: face 1: vertex -1 is out of range: there are 3, numbered from 0"),
        ("a list with a negative length", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n-1\n".to_vec(), "a.ply:13: face 1: negative list length -1"),
        ("a list with four billion entries", [&b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uint int vertex_indices\nend_header\n"[..], &[0; 36], &[0xff; 4]].concat(), "a.ply: face 1: a list claims 4294967295 items, more than the file can hold"),
        ("faces without vertex indices", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty float q\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(), "a.ply: the element `face` needs an integer list `vertex_indices`"),
        ("text in a vertex", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 x\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(), "a.ply:10: vertex 1: expected a number, found \"x\""),
        ("colors out of range", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty float green\nproperty int blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 300 nan -1\n1 0 0 -1 inf 1e99\n0 1 0 0.5 0 0\n3 0 1 2\n".to_vec(), ""),
        ("no faces", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n".to_vec(), "a.ply: no usable face: the file has no faces"),
        ("a property before any element", b"ply\nformat ascii 1.0\nproperty float x\nend_header\n".to_vec(), "a.ply:3: a property before the first element"),
        ("an element without a count", b"ply\nformat ascii 1.0\nelement vertex\nend_header\n".to_vec(), "a.ply:3: incomplete or unknown statement \"element\""),
        ("a list length of type float", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list float int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(), "a.ply:8: the length of a list must have an integer type"),
        ("bytes", every_byte(), "a.ply:1: this is a binary file in another format"),
    ]
}

pub(super) fn stl() -> Vec<Case> {
    vec![
        ("only the first keyword", b"solid\n".to_vec(), "a.stl: no usable face: the file has no faces"),
        ("no facets", b"solid a\nendsolid a\n".to_vec(), "a.stl: no usable face: the file has no faces"),
        ("no count", vec![0; 82], "a.stl:1: this is a binary file in another format"),
        ("no facets", stl_of(0, &[]), "a.stl:1: this is a binary file in another format"),
        ("four billion facets", stl_of(4000000000, &FACET), "a.stl: the header claims 4000000000 facets, but the file ends after 1"),
        ("the file ends within a facet", stl_of(1, &FACET[..30]), "a.stl: the header claims 1 facet, but the file ends after 0"),
        ("one facet fewer than declared", stl_of(2, &FACET), "a.stl: the header claims 2 facets, but the file ends after 1"),
        ("a facet with three equal vertices", stl_of(1, &[0; 50]), "a.stl: no usable face: 0 of 1 have a non-finite corner, 1 have zero area"),
        ("non-finite values", stl_of(1, &[0xff; 50]), "a.stl: no usable face: 1 of 1 have a non-finite corner, 0 have zero area"),
        ("text in a vertex", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 zero 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n".to_vec(), "a.stl:5: expected a coordinate, found \"zero\""),
        ("a vertex with two coordinates", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n".to_vec(), "a.stl:6: expected a coordinate, found \"vertex\""),
        ("two corners", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n".to_vec(), "a.stl:6: a loop with only 2 corners"),
        ("four corners", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n".to_vec(), ""),
        ("no loop", b"solid a\nfacet normal 0 0 1\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n".to_vec(), "a.stl:3: a vertex is not between \"outer loop\" and \"endloop\""),
        ("the file ends within a loop", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n".to_vec(), "a.stl:6: the file ends inside a facet"),
        ("the file ends within a vertex", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0".to_vec(), "a.stl:4: the file ends inside a vertex"),
        ("an unknown keyword", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendlop\nendfacet\nendsolid a\n".to_vec(), "a.stl:7: expected an STL keyword, found \"endlop\""),
        ("a vertex outside a facet", b"solid a\nvertex 0 0 0\nendsolid a\n".to_vec(), "a.stl:2: a vertex is not between \"outer loop\" and \"endloop\""),
        ("a facet within a facet", b"solid a\nfacet normal 0 0 1\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n".to_vec(), ""),
        ("a coordinate that overflows", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1e999 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n".to_vec(), "a.stl: no usable face: 1 of 1 have a non-finite corner, 0 have zero area"),
        ("bytes", every_byte(), "a.stl: the header claims 1397903696 facets, but the file ends after 18"),
    ]
}

pub(super) fn mtl() -> Vec<Case> {
    vec![
        ("Kd before a material", b"Kd 1 1 1\nnewmtl m\n".to_vec(), ""),
        (
            "a material without a name",
            b"newmtl\nKd 1 1 1\n".to_vec(),
            "a.mtl:1: expected a name after `newmtl`",
        ),
        (
            "text in a color",
            b"newmtl m\nKd red green blue\n".to_vec(),
            "a.mtl:2: expected three finite numbers after `Kd`",
        ),
        (
            "a color with two components",
            b"newmtl m\nKd 1 1\n".to_vec(),
            "a.mtl:2: expected three finite numbers after `Kd`",
        ),
        (
            "a color without components",
            b"newmtl m\nKd\n".to_vec(),
            "a.mtl:2: expected three finite numbers after `Kd`",
        ),
        (
            "non-finite values",
            b"newmtl m\nKd nan 1 1\n".to_vec(),
            "a.mtl:2: expected three finite numbers after `Kd`",
        ),
        ("a negative color", b"newmtl m\nKd -1 1 1\n".to_vec(), ""),
        ("numbers out of range", b"newmtl m\nPr 7\nPm -3\nd 7\nKe 1e30\nillum 300\n".to_vec(), ""),
        ("too many numbers", b"newmtl m\nKd 1 1 1 1\nNs 5 6\n".to_vec(), ""),
        ("useless map options", b"newmtl m\nmap_Kd -s 0 0 -o nan -bm -unknown 3 h.png\n".to_vec(), ""),
        (
            "text as an exponent",
            b"newmtl m\nNs shiny\n".to_vec(),
            "a.mtl:2: expected a finite number after `Ns`",
        ),
        ("a negative exponent", b"newmtl m\nKd 1 1 1\nNs -5\n".to_vec(), ""),
        ("index of refraction 0", b"newmtl m\nNi 0\nillum 7\n".to_vec(), ""),
        ("an unknown illumination model", b"newmtl m\nillum 99\n".to_vec(), ""),
        (
            "text as an illumination model",
            b"newmtl m\nillum glass\n".to_vec(),
            "a.mtl:2: expected an integer after `illum`",
        ),
        (
            "an image without a name",
            b"newmtl m\nmap_Kd\n".to_vec(),
            "a.mtl:2: expected a file name after `map_Kd`",
        ),
        ("a nonexistent material", b"newmtl other\nKd 1 1 1\n".to_vec(), ""),
        (
            "text as an opacity",
            b"newmtl m\nd opaque\n".to_vec(),
            "a.mtl:2: expected a finite number after `d`",
        ),
        (
            "text as a roughness",
            b"newmtl m\nPr smooth\n".to_vec(),
            "a.mtl:2: expected a finite number after `Pr`",
        ),
        ("bytes", every_byte(), "a.mtl:1: this is a binary file in another format"),
    ]
}
