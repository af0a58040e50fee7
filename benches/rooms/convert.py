"""Translates a glimt scene file to a scene dictionary for Mitsuba: diffuse, mirror, glass, panes, metal with `eta` and `k`, plastic, lights,
textures, an environment, quads, boxes, spheres, disks, cylinders and meshes. Features without an equivalent, or not supported yet, end
the translation with an error that names them."""

import numpy as np

# Mitsuba's names for glimt's.
WRAP = {"repeat": "repeat", "clamp": "clamp", "mirror": "mirror"}
FILTER = {"bilinear": "bilinear", "nearest": "nearest"}


class Unknown(Exception):
    """The scene uses a feature that the translation does not support."""


def known(table, where, *keys):
    """Returns the table if it has only these keys. Otherwise raises `Unknown`."""
    more = sorted(set(table) - set(keys) - {"name"})
    if more:
        raise Unknown(f"{where}: {', '.join(more)}")
    return table


def color(value):
    """Converts a number, three numbers or "#rrggbb" to linear RGB."""
    if isinstance(value, str):
        if not value.startswith("#"):
            raise Unknown(f"the color {value}")
        codes = np.array([int(value[at : at + 2], 16) for at in (1, 3, 5)]) / 255
        return [float(x) for x in np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)]
    return [float(x) for x in (value if isinstance(value, list) else [value] * 3)]


def across(axis):
    """A right-handed orthonormal frame whose third vector is the direction of `axis`."""
    axis = axis / np.linalg.norm(axis)
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first), axis


def frame(x, y, z, origin):
    """The matrix with the given columns."""
    matrix = np.eye(4)
    for column, vector in enumerate((x, y, z, origin)):
        matrix[:3, column] = vector
    return matrix


class Conversion:
    """Converts a scene file whose paths are relative to `folder`. Files for Mitsuba are written to `made`."""

    def __init__(self, mi, content, folder, size, made):
        known(content, "the scene", "render", "camera", "photons", "textures", "materials", "environment", "light", *SHAPES)
        self.mi, self.content, self.folder, self.size, self.made = mi, content, folder, size, made
        self.t = mi.ScalarTransform4f
        self.render = content.get("render", {})
        self.parts = {}

    def scene(self):
        """The dictionary of the scene for Mitsuba."""
        if any(color(self.render.get("background", 0))) and "environment" not in self.content:
            raise Unknown("[render] background, which lights nothing")
        # Mitsuba's depth counts path edges, including the one at the camera.
        depth = self.render.get("max_depth", 8) + 1
        self.parts = {"type": "scene", "integrator": {"type": "path", "max_depth": depth}, "sensor": self.sensor()}
        for kind, add in SHAPES.items():
            for number, table in enumerate(self.content.get(kind, []), 1):
                add(self, f"{kind}{number}", table)
        for number, table in enumerate(self.content.get("light", []), 1):
            self.parts[f"light{number}"] = self.light(table)
        if "environment" in self.content:
            self.parts["environment"] = self.environment(self.content["environment"])
        return self.parts

    def sensor(self):
        camera = known(self.content["camera"], "[camera]", "position", "look_at", "up", "fov", "aperture", "focus")
        if self.render.get("filter", "box") != "box":
            raise Unknown(f"the filter {self.render['filter']}")
        lens = {"type": "perspective"}
        if camera.get("aperture", 0) > 0:
            distance = np.linalg.norm(np.array(camera["look_at"]) - np.array(camera["position"]))
            focus = camera.get("focus", float(distance))
            lens = {"type": "thinlens", "aperture_radius": camera["aperture"], "focus_distance": focus}
        up = camera.get("up", [0, 1, 0])
        return {
            **lens,
            "fov": camera.get("fov", 40.0),
            "fov_axis": "y",
            "near_clip": 1e-4,
            "far_clip": 1e7,
            "to_world": self.t().look_at(origin=camera["position"], target=camera["look_at"], up=up),
            "film": {
                "type": "hdrfilm",
                "width": self.size[0],
                "height": self.size[1],
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
                "component_format": "float32",
            },
            "sampler": {"type": "multijitter", "sample_count": 64},
        }

    def rgb(self, value):
        return {"type": "rgb", "value": color(value)}

    def texture(self, name):
        """An image texture. In Mitsuba, v = 0 is the top row."""
        table = known(self.content["textures"][name], f"[textures.{name}]", "file", "filter", "wrap", "repeat", "encoding")
        u, v = table.get("repeat", [1, 1])
        return {
            "type": "bitmap",
            "filename": str(self.folder / table["file"]),
            "filter_type": FILTER[table.get("filter", "bilinear")],
            "wrap_mode": WRAP[table.get("wrap", "repeat")],
            "raw": table.get("encoding", "auto") == "linear",
            "to_uv": self.t().scale([1, -1, 1]) @ self.t().scale([u, v, 1]),
        }

    def material(self, name):
        """The BSDF and the emitter of a material."""
        table = self.content["materials"][name]
        where = f"[materials.{name}]"
        kind = table.get("type", "phong")
        # α of the microfacet distribution.
        alpha = table.get("roughness", {"plastic": 0.1, "metal": 0.2}.get(kind, 0.0)) ** 2
        rough = {"distribution": "ggx", "alpha": max(alpha, 1e-3)} if alpha > 0 else {}
        outside = {"int_ior": table.get("ior", 1.5), "ext_ior": 1.0}
        if kind == "glass" and table.get("thin"):
            known(table, where, "type", "ior", "thin", "tint")
            return {"type": "thindielectric", **outside, "specular_transmittance": self.rgb(table.get("tint", 1))}, None
        if kind == "glass":
            known(table, where, "type", "ior", "roughness")
            return {"type": "roughdielectric" if rough else "dielectric", **outside, **rough}, None
        if kind == "metal":
            known(table, where, "type", "eta", "k", "roughness")
            index = {"eta": self.rgb(table["eta"]), "k": self.rgb(table["k"])}
            return {"type": "twosided", "b": {"type": "roughconductor" if rough else "conductor", **index, **rough}}, None
        if kind == "plastic":
            known(table, where, "type", "diffuse", "ior", "roughness")
            base = {"diffuse_reflectance": self.rgb(table.get("diffuse", 0.7)), "nonlinear": True}
            coat = {"type": "roughplastic" if rough else "plastic", **outside, **rough, **base}
            return {"type": "twosided", "b": coat}, None
        if kind == "mirror":
            known(table, where, "type", "reflectance")
            reflectance = self.rgb(table.get("reflectance", 0.9))
            conductor = {"type": "conductor", "material": "none", "specular_reflectance": reflectance}
            return {"type": "twosided", "b": conductor}, None
        known(table, where, "type", "diffuse", "ambient", "emission")
        diffuse = table.get("diffuse", 0.7)
        reflectance = self.texture(diffuse["texture"]) if isinstance(diffuse, dict) else self.rgb(diffuse)
        emission = color(table.get("emission", 0))
        emitter = {"type": "area", "radiance": self.rgb(emission)} if any(emission) else None
        return {"type": "twosided", "b": {"type": "diffuse", "reflectance": reflectance}}, emitter

    def add(self, key, shape, table):
        """A shape with its material."""
        bsdf, emitter = self.material(table["material"])
        self.parts[key] = {**shape, "bsdf": bsdf, **({"emitter": emitter} if emitter else {})}

    def is_textured(self, table):
        return isinstance(self.content["materials"][table["material"]].get("diffuse"), dict)

    def quad(self, key, table):
        known(table, key, "corner", "u", "v", "material")
        given = (table.get("corner", [-1, 0, 1]), table.get("u", [2, 0, 0]), table.get("v", [0, 0, -2]))
        corner, u, v = (np.array(x, dtype=float) for x in given)
        normal = np.cross(u, v)
        matrix = frame(u / 2, v / 2, normal / np.linalg.norm(normal), corner + (u + v) / 2)
        self.add(key, {"type": "rectangle", "to_world": self.t(matrix)}, table)

    def box(self, key, table):
        known(table, key, "center", "size", "rotate", "material")
        if self.is_textured(table):
            raise Unknown(f"{key}: a texture")
        half = [x / 2 for x in table.get("size", [1, 1, 1])]
        to_world = self.placed(table.get("center", [0, 0.5, 0]), table.get("rotate", [0, 0, 0]), half)
        self.add(key, {"type": "cube", "to_world": to_world}, table)

    def sphere(self, key, table):
        known(table, key, "center", "radius", "material")
        if self.is_textured(table):
            raise Unknown(f"{key}: a texture")
        self.add(key, {"type": "sphere", "center": table["center"], "radius": table["radius"]}, table)

    def disk(self, key, table):
        known(table, key, "center", "normal", "radius", "material")
        if self.is_textured(table):
            raise Unknown(f"{key}: a texture")
        self.cap(key, table.get("center", [0, 0, 0]), table.get("normal", [0, 1, 0]), table.get("radius", 0.5), table)

    def cap(self, key, center, normal, radius, table):
        x, y, z = across(np.array(normal, dtype=float))
        matrix = frame(radius * x, radius * y, z, center)
        self.add(key, {"type": "disk", "to_world": self.t(matrix)}, table)

    def cylinder(self, key, table):
        known(table, key, "a", "b", "radius", "caps", "material")
        if self.is_textured(table):
            raise Unknown(f"{key}: a texture")
        a, b, radius = table.get("a", [0, 0, 0]), table.get("b", [0, 1, 0]), table.get("radius", 0.5)
        self.add(key, {"type": "cylinder", "p0": a, "p1": b, "radius": radius}, table)
        if table.get("caps", True):
            axis = np.array(b, dtype=float) - np.array(a, dtype=float)
            self.cap(f"{key}a", a, -axis, radius, table)
            self.cap(f"{key}b", b, axis, radius, table)

    def mesh(self, key, table):
        known(table, key, "file", "material", "scale", "rotate", "translate", "smooth")
        if "material" not in table:
            raise Unknown(f"{key}: the materials of {table['file']}")
        file = self.folder / table["file"]
        # An emitter's smooth normal determines the emitting side in Mitsuba; in glimt, the triangle's normal does.
        is_lamp = self.material(table["material"])[1] is not None
        scale = table.get("scale", 1)
        scale = scale if isinstance(scale, list) else [scale] * 3
        shape = {
            "type": file.suffix[1:].lower(),
            "filename": str(file),
            "face_normals": is_lamp or not table.get("smooth", True),
            "flip_tex_coords": False,
            "to_world": self.placed(table.get("translate", [0, 0, 0]), table.get("rotate", [0, 0, 0]), scale),
        }
        if shape["type"] not in ("obj", "ply"):
            raise Unknown(f"{key}: {table['file']}")
        self.add(key, shape, table)

    def placed(self, translation, turns, scale):
        """Scales, rotates about x, then y, then z, and translates."""
        matrix = self.t().translate(translation)
        for axis in (2, 1, 0):
            matrix = matrix @ self.t().rotate([float(x) for x in np.eye(3)[axis]], turns[axis])
        return matrix @ self.t().scale(scale)

    def light(self, table):
        known(table, "[[light]]", "type", "position", "intensity")
        if table.get("type", "point") != "point":
            raise Unknown(f"[[light]] of type {table['type']}")
        position, intensity = table.get("position", [0, 3, 0]), table.get("intensity", 10)
        return {"type": "point", "position": position, "intensity": self.rgb(intensity)}

    def environment(self, table):
        known(table, "[environment]", "color", "file", "rotate")
        if "file" not in table:
            return {"type": "constant", "radiance": self.rgb(table.get("color", 0))}
        factor = color(table.get("color", 1))
        if len(set(factor)) > 1:
            raise Unknown("[environment]: a factor with a hue")
        # The center of Mitsuba's map is at +z.
        to_world = self.t().rotate([0, 1, 0], table.get("rotate", 0) + 180)
        return {"type": "envmap", "filename": str(self.sky(table["file"])), "scale": factor[0], "to_world": to_world}

    def sky(self, name):
        """Resamples the map at Mitsuba's texels: its rows run from pole to pole, whereas glimt's texels are centered in their cells.

        The resolution is higher, so that each glimt texel coincides with a Mitsuba texel and the interpolation between them is the same.
        """
        given = np.array(self.mi.Bitmap(str(self.folder / name)).convert(self.mi.Bitmap.PixelFormat.RGB, self.mi.Struct.Type.Float32, False))
        height, width = given.shape[:2]
        rows, columns = 2 * height + 1, 3 * width
        y = np.clip(np.arange(rows) / (rows - 1) * height - 0.5, 0, height - 1)
        x = (np.arange(columns) + 0.5) / columns * width - 0.5
        top, left = np.floor(y).astype(int), np.floor(x).astype(int)
        down, right = (y - top)[:, None, None], (x - left)[None, :, None]
        at = lambda row, column: given[np.minimum(row, height - 1)][:, column % width]
        upper = at(top, left) * (1 - right) + at(top, left + 1) * right
        lower = at(top + 1, left) * (1 - right) + at(top + 1, left + 1) * right
        file = self.made / f"{(self.folder / name).stem}-mitsuba.exr"
        self.mi.Bitmap((upper * (1 - down) + lower * down).astype(np.float32)).write(str(file))
        return file


SHAPES = {
    "quad": Conversion.quad,
    "box": Conversion.box,
    "sphere": Conversion.sphere,
    "disk": Conversion.disk,
    "cylinder": Conversion.cylinder,
    "mesh": Conversion.mesh,
}
