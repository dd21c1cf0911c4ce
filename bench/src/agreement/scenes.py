"""Scenes, each described once and written for Canaletto, Mitsuba 3 and Blender's Cycles."""

import os
import resource
import subprocess
import tempfile

import numpy as np

GOLD = {"eta": [0.143, 0.375, 1.442], "k": [3.983, 2.386, 1.603]}


def words(values):
    return " ".join(map(str, values))


def gray(value):
    return [value] * 3


def cpu_seconds():
    """The CPU time of this process and of the programs that it has run."""
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in usage)


class Scene:
    """A camera, materials by name, and shapes. Up is +y."""

    def __init__(self, eye, center, fovy):
        self.eye, self.center, self.fovy = eye, center, fovy
        self.materials = {}
        self.shapes = []
        # The sky, and the picture of textured surfaces, as linear values.
        self.image = self.texture = None
        # Whether programs' surfaces differ, so that each one is compared with its own converged picture.
        self.differs = False

    def matte(self, name, color, emission=None):
        self.materials[name] = {"kind": "matte", "color": color, "emission": emission}

    def sphere(self, material, center, radius):
        self.shapes.append(("sphere", material, {"center": center, "radius": radius}))

    def disk(self, material, center, up, radius):
        """A disk that faces up (1) or down (-1)."""
        self.shapes.append(("disk", material, {"center": center, "up": up, "radius": radius}))

    def box(self, material, low, high):
        self.shapes.append(("box", material, {"low": low, "high": high}))

    def mesh(self, material, vertices, faces):
        """A mesh of flat triangles."""
        self.shapes.append(("mesh", material, {"vertices": vertices, "faces": faces}))


def room(scene):
    """Walls of a box of side 2 around the origin, without a front wall."""
    scene.matte("white", gray(0.73))
    scene.matte("red", [0.63, 0.065, 0.05])
    scene.matte("green", [0.14, 0.45, 0.09])
    for material, low, high in [
        ("white", [-1.1, -1.1, -1.1], [1.1, -1, 1]),
        ("white", [-1.1, 1, -1.1], [1.1, 1.1, 1]),
        ("white", [-1.1, -1, -1.1], [1.1, 1, -1]),
        ("red", [-1.1, -1, -1], [-1, 1, 1]),
        ("green", [1, -1, -1], [1.1, 1, 1]),
    ]:
        scene.box(material, low, high)


def cornell():
    scene = Scene([0, 0, 4.2], [0, 0, 0], 36)
    room(scene)
    scene.matte("lamp", gray(0.0), [17, 12, 4])
    scene.disk("lamp", [0, 0.98, 0], -1, 0.3)
    scene.box("white", [-0.6, -1, -0.6], [-0.1, 0.2, -0.1])
    scene.box("white", [0.1, -1, 0.0], [0.6, -0.4, 0.5])
    return scene


def blob(center, radius, around=350, along=140):
    """Vertices and triangles of a ball with bumps."""
    u, v = np.meshgrid(np.arange(around) / around * 2 * np.pi, np.linspace(1e-3, np.pi - 1e-3, along + 1))
    bumps = radius * (1 + 0.12 * np.sin(7 * u) * np.sin(5 * v) ** 3 + 0.03 * np.sin(31 * u + 17 * v) * np.sin(v))
    points = np.stack([np.sin(v) * np.cos(u), np.cos(v), np.sin(v) * np.sin(u)], 2) * bumps[..., None]
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    faces = np.concatenate([np.stack([a, b, b + around], 2), np.stack([a, b + around, a + around], 2)])
    vertices = points.reshape(-1, 3) + np.array(center)
    return vertices.astype(np.float32), faces.reshape(-1, 3).astype(np.int32)


def mesh():
    """The room of `cornell` with a mesh of 98,000 triangles in place of its boxes."""
    scene = Scene([0, 0, 4.2], [0, 0, 0], 36)
    room(scene)
    scene.matte("lamp", gray(0.0), [17, 12, 4])
    scene.disk("lamp", [0, 0.98, 0], -1, 0.3)
    scene.mesh("white", *blob([0, -0.35, 0], 0.55))
    return scene


def standard():
    """The room of `cornell` with textured plastic and metal."""
    scene = cornell()
    scene.differs = True
    u, v = np.meshgrid(np.arange(256) / 256, np.arange(256) / 256)
    waves = 0.5 + 0.5 * np.sin(40 * u + 6 * np.sin(9 * v)) * np.cos(23 * v)
    scene.texture = np.stack([0.15 + 0.7 * waves, 0.2 + 0.4 * waves, 0.5 - 0.3 * waves], 2).astype(np.float32)
    for name in ("white", "red", "green"):
        scene.materials[name] = {"kind": "standard", "metalness": 0.0, "roughness": 0.35}
    scene.materials["metal"] = {"kind": "standard", "metalness": 1.0, "roughness": 0.3}
    scene.shapes = [(kind, "metal" if number == 6 else name, shape) for number, (kind, name, shape) in enumerate(scene.shapes)]
    return scene


def glass():
    """Smooth and rough glass and gold. Rough ones of Canaletto lose no light between facets, those of Mitsuba do."""
    scene = Scene([0, 0, 4.2], [0, 0, 0], 36)
    scene.differs = True
    room(scene)
    scene.matte("lamp", gray(0.0), gray(6.0))
    scene.disk("lamp", [0, 0.98, 0], -1, 0.6)
    scene.materials["glass"] = {"kind": "glass", "ior": 1.5, "alpha": 0.0}
    scene.materials["frost"] = {"kind": "glass", "ior": 1.5, "alpha": 0.3}
    scene.materials["gold"] = {"kind": "gold", "alpha": 0.2}
    scene.sphere("glass", [-0.5, -0.65, 0.3], 0.35)
    scene.sphere("frost", [0.5, -0.65, 0.3], 0.35)
    scene.sphere("gold", [0.0, -0.6, -0.5], 0.4)
    return scene


def smooth():
    """The scene `glass` with smooth surfaces, whose formulas all programs share."""
    scene = glass()
    scene.differs = False
    for name in ("frost", "gold"):
        scene.materials[name]["alpha"] = 0.0
    return scene


def sky():
    scene = Scene([0, 1.5, 6], [0, 0.6, 0], 36)
    image = np.full((64, 128, 3), 0.2, dtype=np.float32)
    rows = np.linspace(0, 1, 64, dtype=np.float32)[:, None]
    image[:, :, 2] += 0.5 * (1 - rows)
    image[10:14, 30:36] = [60, 50, 40]
    scene.image = image
    scene.matte("floor", gray(0.5))
    scene.matte("clay", [0.7, 0.4, 0.2])
    scene.disk("floor", [0, 0, 0], 1, 8)
    for x, z in [(-1.6, 0), (0, 0), (1.6, 0), (-0.8, -1.5), (0.8, -1.5)]:
        scene.sphere("clay", [x, 0.6, z], 0.6)
    return scene


def lights():
    scene = Scene([0, 2.5, 7], [0, 0.5, 0], 36)
    scene.matte("floor", gray(0.6))
    scene.matte("clay", [0.6, 0.5, 0.4])
    scene.disk("floor", [0, 0, 0], 1, 8)
    for x in (-1.5, 0, 1.5):
        scene.sphere("clay", [x, 0.5, 0], 0.5)
    for i in range(64):
        angle, height = 2.4 * i, 0.4 + 0.03 * i
        power = 3.0 + 40.0 * (i % 7 == 0)
        color = [power * (0.4 + 0.6 * (i % 3 == c)) for c in range(3)]
        scene.matte(f"lamp{i}", gray(0.0), color)
        distance = 2.0 + 0.02 * i
        scene.sphere(f"lamp{i}", [distance * np.cos(angle), height, distance * np.sin(angle)], 0.06)
    return scene


def gap():
    scene = Scene([0, 0, 0.95], [0, 0, -1], 80)
    room(scene)
    scene.box("white", [-1.1, -1, 1], [-0.1, 1, 1.1])
    scene.box("white", [0.1, -1, 1], [1.1, 1, 1.1])
    scene.matte("lamp", gray(0.0), gray(60.0))
    scene.sphere("lamp", [0.4, 0.5, 2.5], 0.4)
    return scene


def medium():
    scene = Scene([0, 1.4, 6], [0, 1, 0], 36)
    scene.matte("floor", gray(0.7))
    scene.matte("red", [0.6, 0.1, 0.1])
    scene.matte("lamp", gray(0.0), gray(20.0))
    scattering = {"absorption": [0.1, 0.05, 0.3], "scattering": [0.8, 0.5, 0.4], "anisotropy": 0.4}
    scene.materials["fog"] = {"kind": "fog"} | scattering
    scene.disk("floor", [0, 0, 0], 1, 6)
    scene.disk("lamp", [1, 4, 1], -1, 0.7)
    scene.sphere("red", [0, 1, 0], 0.5)
    scene.sphere("fog", [0, 1.2, 0], 1.1)
    return scene


SCENES = {f.__name__: f for f in (cornell, glass, smooth, sky, lights, gap, mesh, standard, medium)}


def from_pole_to_pole(image):
    """The image in Mitsuba's convention, where the first and the last row are the poles, not half a row beside them.

    Twice as many rows and one more interpolate to the same radiance.
    """
    # Beyond a pole the image goes on half a turn away.
    half_turn = image.shape[1] // 2
    around = np.concatenate([np.roll(image[:1], half_turn, 1), image, np.roll(image[-1:], half_turn, 1)])
    rows = np.empty((2 * len(image) + 1, *image.shape[1:]), dtype=np.float32)
    rows[1::2] = image
    rows[::2] = (around[1:] + around[:-1]) / 2
    return rows


def write_image(image, folder, name):
    """Writes a picture of linear values."""
    import mitsuba as mi

    path = os.path.join(folder, name)
    mi.Bitmap(image).write(path)
    return path


def write_ply(path, shape):
    """Writes a mesh as binary PLY."""
    vertices, faces = shape["vertices"], shape["faces"]
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    with open(path, "wb") as file:
        file.write(
            b"ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
            b"property float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n"
            % (len(vertices), len(faces))
        )
        file.write(vertices.astype("<f4").tobytes() + rows.tobytes())


class Canaletto:
    """A scene in a folder, rendered by the program."""

    def __init__(self, scene, program, folder, size):
        self.program, self.folder = program, folder
        lines = [
            f"camera {{ eye {words(scene.eye)}; center {words(scene.center)}; fovy {scene.fovy}; size {size} {size} }}",
            'film { filter "box" }',
            'integrator "path"',
            "background 0",
        ]
        for name, material in scene.materials.items():
            lines.append(f'material "{name}" {{ {self.material(material)} }}')
        if scene.texture is not None:
            write_image(scene.texture, folder, "texture.exr")
            lines.insert(4, 'texture "paint" file="texture.exr"')
        for number, (kind, material, shape) in enumerate(scene.shapes):
            if kind == "mesh":
                write_ply(os.path.join(folder, f"{number}.ply"), shape)
                lines.append(f'mesh material="{material}" {{ file "{number}.ply" }}')
                continue
            lines.append(f'{kind} material="{material}" {{ {self.shape(kind, shape)} }}')
        if scene.image is not None:
            write_image(scene.image, folder, "sky.exr")
            lines.append('environment "lat-long" file="sky.exr"')
        self.source = os.path.join(folder, "scene.kdl")
        with open(self.source, "w") as file:
            file.write("\n".join(lines) + "\n")

    @staticmethod
    def material(material):
        if material["kind"] == "matte":
            emission = material["emission"]
            return f"kd {words(material['color'])}" + (f"; emission {words(emission)}" if emission else "")
        if material["kind"] == "fog":
            names = ("absorption", "scattering")
            return f"medium {{ {'; '.join(f'{n} {words(material[n])}' for n in names)}; anisotropy {material['anisotropy']} }}"
        if material["kind"] == "standard":
            model = f"base {{ metalness {material['metalness']} }}; specular {{ roughness {material['roughness']} }}"
            return f'standard {{ {model} }}; texture "paint"'
        what = "conductor \"gold\"" if material["kind"] == "gold" else f"dielectric {material['ior']}"
        return what + (f"; alpha {material['alpha']}" if material["alpha"] else "")

    @staticmethod
    def shape(kind, shape):
        if kind == "box":
            return f"min {words(shape['low'])}; max {words(shape['high'])}"
        normal = f"; normal 0 {shape['up']} 0" if kind == "disk" else ""
        return f"center {words(shape['center'])}{normal}; radius {shape['radius']}"

    def render(self, samples, seed):
        import mitsuba as mi

        picture = os.path.join(self.folder, f"{seed}.exr")
        command = [self.program, "render", self.source, "--samples", str(samples), "--seed", str(seed), "-q"]
        subprocess.run(command + ["-o", picture], check=True)
        return np.array(mi.Bitmap(picture))[:, :, :3].astype(float)


class Mitsuba:
    """A scene that the current variant of Mitsuba has loaded."""

    def __init__(self, scene, size, sampler="multijitter"):
        import mitsuba as mi

        self.mi, self.texture = mi, scene.texture
        transform = mi.ScalarTransform4f()
        has_medium = any(material["kind"] == "fog" for material in scene.materials.values())
        film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}}
        film |= {"pixel_format": "rgb", "component_format": "float32"}
        description = {
            "type": "scene",
            "integrator": {"type": "volpath" if has_medium else "path", "max_depth": -1, "rr_depth": 8},
            "sensor": {
                "type": "perspective",
                "fov": scene.fovy,
                "fov_axis": "y",
                "to_world": transform.look_at(origin=scene.eye, target=scene.center, up=[0, 1, 0]),
                "film": film,
                "sampler": {"type": sampler, "sample_count": 16},
            },
        }
        if scene.image is not None:
            # Mitsuba's first column lies at +z and goes to +x; ours was chosen by pictures of a lone bright texel.
            turned = transform.rotate([0, 1, 0], 180)
            description["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(from_pole_to_pole(scene.image)), "to_world": turned}
        with tempfile.TemporaryDirectory() as folder:
            for number, (kind, name, shape) in enumerate(scene.shapes):
                made = self.mesh(shape, folder, number) if kind == "mesh" else self.shape(kind, shape)
                description[f"shape{number}"] = made | self.material(scene.materials[name])
            self.scene = mi.load_dict(description)

    @staticmethod
    def rgb(color):
        return {"type": "rgb", "value": [float(c) for c in color]}

    def material(self, material):
        kind, rgb = material["kind"], self.rgb
        if kind == "matte":
            bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(material["color"])}}
            emission = material["emission"]
            return {"bsdf": bsdf} | ({"emitter": {"type": "area", "radiance": rgb(emission)}} if emission else {})
        if kind == "fog":
            scattering = np.array(material["scattering"])
            extinction = scattering + np.array(material["absorption"])
            interior = {"type": "homogeneous", "albedo": rgb(scattering / extinction), "sigma_t": rgb(extinction)}
            interior["phase"] = {"type": "hg", "g": material["anisotropy"]}
            return {"bsdf": {"type": "null"}, "interior": interior}
        if kind == "standard":
            color = {"type": "bitmap", "bitmap": self.mi.Bitmap(self.texture), "raw": True}
            model = {"type": "principled", "base_color": color, "specular": 0.5}
            return {"bsdf": model | {"metallic": material["metalness"], "roughness": material["roughness"]}}
        rough = {"distribution": "ggx", "alpha": material["alpha"]} if material["alpha"] else {}
        if kind == "gold":
            indices = {name: rgb(value) for name, value in GOLD.items()}
            return {"bsdf": {"type": "roughconductor" if rough else "conductor"} | rough | indices}
        name = "roughdielectric" if rough else "dielectric"
        return {"bsdf": {"type": name, "int_ior": material["ior"], "ext_ior": 1.0} | rough}

    def shape(self, kind, shape):
        transform = self.mi.ScalarTransform4f()
        if kind == "sphere":
            return {"type": "sphere", "center": list(shape["center"]), "radius": shape["radius"]}
        if kind == "disk":
            turned = transform.translate(shape["center"]).rotate([1, 0, 0], -90 * shape["up"])
            return {"type": "disk", "to_world": turned.scale(shape["radius"])}
        middle = [(a + b) / 2 for a, b in zip(shape["low"], shape["high"])]
        half = [(b - a) / 2 for a, b in zip(shape["low"], shape["high"])]
        return {"type": "cube", "to_world": transform.translate(middle).scale(half)}

    @staticmethod
    def mesh(shape, folder, number):
        path = os.path.join(folder, f"{number}.ply")
        write_ply(path, shape)
        return {"type": "ply", "filename": path, "face_normals": True}

    def render(self, samples, seed):
        return np.array(self.mi.render(self.scene, seed=seed, spp=samples)).astype(float)
