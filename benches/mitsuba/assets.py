"""Generates the files that both renderers read: a mesh, textures, environment maps."""

import numpy as np

KNOT = (2048, 32)  # vertices along the strand and around it: 131,072 triangles
SKY = (1024, 512)


def directory(home):
    """Returns the folder of the files, which are generated if they do not exist. Environment maps end in the name of their renderer."""
    folder = home / "assets"
    if not folder.exists():
        unfinished = home / "assets.unfinished"
        unfinished.mkdir(exist_ok=True)
        knot(unfinished / "knot.ply")
        board(unfinished / "board.png")
        marble(unfinished / "marble.png")
        sky(unfinished / "sky-mitsuba.exr", unfinished / "sky-glimt.exr")
        unfinished.rename(folder)
    return folder


def knot(file):
    """A tube along a (2, 3) torus knot within about 0.45 of the origin, with normals."""
    along, about = KNOT
    s, t = np.meshgrid(np.arange(along) * 2 * np.pi / along, np.arange(about) * 2 * np.pi / about, indexing="ij")

    def strand(s):
        around = 0.30 + 0.11 * np.cos(3 * s)
        return np.stack([around * np.cos(2 * s), 0.11 * np.sin(3 * s), around * np.sin(2 * s)], axis=-1)

    def unit(v):
        return v / np.linalg.norm(v, axis=-1, keepdims=True)

    step = 1e-4
    tangent = unit(strand(s + step) - strand(s - step))
    side = unit(np.cross(tangent, np.array([0.0, 1.0, 0.0])))
    normals = side * np.cos(t)[..., None] + np.cross(side, tangent) * np.sin(t)[..., None]
    points = strand(s) + 0.055 * normals
    vertices = np.concatenate([points, normals], axis=-1).reshape(-1, 6).astype("<f4")
    i, j = np.meshgrid(np.arange(along), np.arange(about), indexing="ij")
    at = lambda i, j: (i % along) * about + j % about
    corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)]
    triangles = np.stack(corners, axis=-1).reshape(-1, 3)
    # Make the triangles face outward, like the normals.
    a, b, c = (vertices[triangles[:, k], :3] for k in range(3))
    if np.sum(np.cross(b - a, c - a) * vertices[triangles[:, 0], 3:]) < 0:
        triangles = triangles[:, ::-1]
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{names}"
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    file.write_bytes(header.encode() + vertices.tobytes() + faces.tobytes())


def write(file, values):
    """Writes an image of sRGB bytes or linear floats."""
    import mitsuba as mi

    mi.Bitmap(np.ascontiguousarray(values)).write(str(file))


def board(file):
    """A checkerboard of two colors, symmetric in both directions."""
    y, x = np.mgrid[0:256, 0:256] // 32
    is_dark = (x + y) % 2 == 1
    write(file, np.where(is_dark[..., None], [70, 52, 40], [226, 214, 190]).astype(np.uint8))


def marble(file):
    """A tileable pattern of waves with several wavelengths."""
    y, x = np.mgrid[0:512, 0:512] / 512 * 2 * np.pi
    bent = np.sin(3 * x + 2 * np.sin(2 * y)) + 0.5 * np.sin(7 * y + np.sin(5 * x)) + 0.25 * np.sin(19 * x + 13 * y)
    share = (0.5 + bent / 3.5)[..., None]
    write(file, (share * [210, 190, 160] + (1 - share) * [60, 80, 120]).round().astype(np.uint8))


def radiance(direction):
    """Radiance of a sky with a hazy sun and a faintly glowing ground."""
    sun = np.array([0.55, 0.5, 0.67])
    sun /= np.linalg.norm(sun)
    height = direction[..., 1:2]
    above = 1 / (1 + np.exp(-40 * height))
    blue = np.array([0.25, 0.45, 0.9]) * np.clip(height, 0, 1) ** 0.5 + np.array([0.9, 0.8, 0.65]) * np.exp(-6 * np.abs(height))
    cosine = direction @ sun
    disk = np.exp((cosine - 1) / (1 - np.cos(np.radians(2.0))))[..., None] * np.array([400.0, 340.0, 250.0])
    return above * (blue + disk) + (1 - above) * np.array([0.10, 0.09, 0.07])


def sky(for_mitsuba, for_glimt):
    """One sky, sampled at the texels of each renderer. Mitsuba's rows run from pole to pole and its first column is at
    −z; glimt's texels are centered in their cells, and the center of its map is at −z."""
    width, height = SKY
    for file, u, v in [
        (for_mitsuba, np.arange(width) / width, np.arange(height) / (height - 1)),
        (for_glimt, (np.arange(width) + 0.5) / width + 0.5, (np.arange(height) + 0.5) / height),
    ]:
        around, down = np.meshgrid(u * 2 * np.pi, v * np.pi)
        across = np.sin(down)
        # Columns start at −z and turn toward +x.
        direction = np.stack([across * np.sin(around), np.cos(down), -across * np.cos(around)], axis=-1)
        write(file, radiance(direction).astype(np.float32))
