"""Compares path tracing with Mitsuba 3 on six scenes, pixel by pixel and on average.

    python3 agreement.py CANALETTO [--samples N] [--runs N] [--bias B] [SCENE ...]

Needs `pip install mitsuba`. Each scene is described once and written for both renderers. Each renderer makes `--runs`
pictures of independent seeds with `--samples` paths per pixel. The difference of the two means is divided by its
standard error, for single pixels, for blocks of 4, 8 and 16 pixels, and for the whole picture. With so many
comparisons a large value occurs by chance, so the limit is that of the whole set (Bonferroni, 0.1 %). The sum of all
squares of a size must not be too large either. The program fails if any test fails, or if Mitsuba is missing.

`--bias 0.005` makes Canaletto's pictures brighter by 0.5 %, which each scene's tests should find.
"""

import argparse
import os
import subprocess
import sys
import tempfile

try:
    import mitsuba as mi
    import numpy as np
except ImportError as missing:
    sys.exit(f"agreement: {missing}; pip install mitsuba numpy")

mi.set_variant("scalar_rgb")
T = mi.ScalarTransform4f
SIZE = 64


def rgb(color):
    return {"type": "rgb", "value": [float(c) for c in color]}


def gray(value):
    return [value] * 3


class Scene:
    """A scene for both renderers."""

    def __init__(self, eye, center, fovy, integrator="path"):
        numbers = lambda v: " ".join(map(str, v))
        self.kdl = [
            f'camera {{ eye {numbers(eye)}; center {numbers(center)}; fovy {fovy}; size {SIZE} {SIZE} }}',
            'film { filter "box" }',
            'integrator "path"',
            "background 0",
        ]
        self.mitsuba = {
            "type": "scene",
            "integrator": {"type": integrator, "max_depth": -1, "rr_depth": 8},
            "sensor": {
                "type": "perspective",
                "fov": fovy,
                "fov_axis": "y",
                "to_world": T().look_at(origin=eye, target=center, up=[0, 1, 0]),
                "film": {
                    "type": "hdrfilm",
                    "width": SIZE,
                    "height": SIZE,
                    "rfilter": {"type": "box"},
                    "pixel_format": "rgb",
                    "component_format": "float32",
                },
                "sampler": {"type": "multijitter", "sample_count": 16},
            },
        }
        self.materials = {}

    def material(self, name, kdl, mitsuba, emission=None, interior=None):
        emits = f"; emission {' '.join(map(str, emission))}" if emission else ""
        self.kdl.append(f'material "{name}" {{ {kdl}{emits} }}')
        self.materials[name] = (mitsuba, emission, interior)

    def matte(self, name, color, emission=None):
        bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(color)}}
        self.material(name, f"kd {' '.join(map(str, color))}", bsdf, emission)

    def shape(self, material, kdl, mitsuba):
        bsdf, emission, interior = self.materials[material]
        self.kdl.append(kdl.replace("MATERIAL", f'material="{material}"'))
        if bsdf:
            mitsuba["bsdf"] = bsdf
        if emission:
            mitsuba["emitter"] = {"type": "area", "radiance": rgb(emission)}
        if interior:
            mitsuba["interior"] = interior
        self.mitsuba[f"shape{len(self.mitsuba)}"] = mitsuba

    def sphere(self, material, center, radius):
        numbers = " ".join(map(str, center))
        self.shape(
            material,
            f"sphere MATERIAL {{ center {numbers}; radius {radius} }}",
            {"type": "sphere", "center": list(center), "radius": radius},
        )

    def disk(self, material, center, up, radius):
        """A disk that faces up (1) or down (-1)."""
        numbers = " ".join(map(str, center))
        self.shape(
            material,
            f"disk MATERIAL {{ center {numbers}; normal 0 {up} 0; radius {radius} }}",
            {"type": "disk", "to_world": T().translate(center).rotate([1, 0, 0], -90 * up).scale(radius)},
        )

    def box(self, material, low, high):
        middle = [(a + b) / 2 for a, b in zip(low, high)]
        half = [(b - a) / 2 for a, b in zip(low, high)]
        numbers = lambda v: " ".join(map(str, v))
        self.shape(
            material,
            f"box MATERIAL {{ min {numbers(low)}; max {numbers(high)} }}",
            {"type": "cube", "to_world": T().translate(middle).scale(half)},
        )


def room(scene, front=None):
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


def glass():
    scene = Scene([0, 0, 4.2], [0, 0, 0], 36)
    room(scene)
    scene.matte("lamp", gray(0.0), gray(6.0))
    scene.disk("lamp", [0, 0.98, 0], -1, 0.6)
    scene.material("glass", "dielectric 1.5", {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0})
    rough = {"type": "roughdielectric", "distribution": "ggx", "alpha": 0.3, "int_ior": 1.5, "ext_ior": 1.0}
    scene.material("frost", 'dielectric 1.5; alpha 0.3; masking "separable"; multiple-scattering #false', rough)
    gold = {"type": "roughconductor", "distribution": "ggx", "alpha": 0.2}
    gold |= {"eta": rgb([0.143, 0.375, 1.442]), "k": rgb([3.983, 2.386, 1.603])}
    scene.material("gold", 'conductor "gold"; alpha 0.2; masking "separable"; multiple-scattering #false', gold)
    scene.sphere("glass", [-0.5, -0.65, 0.3], 0.35)
    scene.sphere("frost", [0.5, -0.65, 0.3], 0.35)
    scene.sphere("gold", [0.0, -0.6, -0.5], 0.4)
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
    scene = Scene([0, 1.4, 6], [0, 1, 0], 36, "volpath")
    absorption, scattering, g = np.array([0.1, 0.05, 0.3]), np.array([0.8, 0.5, 0.4]), 0.4
    scene.matte("floor", gray(0.7))
    scene.matte("red", [0.6, 0.1, 0.1])
    scene.matte("lamp", gray(0.0), gray(20.0))
    interior = {
        "type": "homogeneous",
        "albedo": rgb(scattering / (absorption + scattering)),
        "sigma_t": rgb(absorption + scattering),
        "phase": {"type": "hg", "g": g},
    }
    numbers = lambda v: " ".join(map(str, v))
    words = f"medium {{ absorption {numbers(absorption)}; scattering {numbers(scattering)}; anisotropy {g} }}"
    scene.material("fog", words, {"type": "null"}, interior=interior)
    scene.disk("floor", [0, 0, 0], 1, 6)
    scene.disk("lamp", [1, 4, 1], -1, 0.7)
    scene.sphere("red", [0, 1, 0], 0.5)
    scene.sphere("fog", [0, 1.2, 0], 1.1)
    return scene


SCENES = {f.__name__: f for f in (cornell, glass, sky, lights, gap, medium)}


def ours(scene, program, folder, samples, seed):
    text = "\n".join(scene.kdl)
    if hasattr(scene, "image"):
        mi.Bitmap(scene.image).write(os.path.join(folder, "sky.exr"))
        text += '\nenvironment "lat-long" file="sky.exr"'
    source, picture = (os.path.join(folder, name) for name in ("scene.kdl", f"{seed}.exr"))
    with open(source, "w") as file:
        file.write(text + "\n")
    command = [program, "render", source, "--samples", str(samples), "--seed", str(seed), "-q", "-o", picture]
    subprocess.run(command, check=True)
    return np.array(mi.Bitmap(picture))[:, :, :3].astype(float)


def theirs(scene, samples, seed):
    description = dict(scene.mitsuba)
    if hasattr(scene, "image"):
        # Mitsuba's first column lies at +z and goes to +x; ours is chosen by comparing pictures of a lone bright texel.
        description["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(scene.image), "to_world": T().rotate([0, 1, 0], 180)}
    loaded = mi.load_dict(description)
    return np.array(mi.render(loaded, seed=seed, spp=samples)).astype(float)


def blocks(pictures, size):
    if size == 0:
        return pictures.mean((1, 2), keepdims=True)
    n = SIZE // size
    return pictures.reshape(len(pictures), n, size, n, size, 3).mean((2, 4))


def check(name, a, b):
    """Prints a line for each size, and returns whether all tests pass."""
    passes = True
    for size in (1, 4, 8, 16, 0):
        x, y = blocks(a, size), blocks(b, size)
        variance = x.var(0, ddof=1) / len(x) + y.var(0, ddof=1) / len(y)
        floor = 1e-12 + 1e-6 * (x.mean(0) + y.mean(0)) ** 2 / 4
        t = (x.mean(0) - y.mean(0)) / np.sqrt(variance + floor)
        count = t.size
        # Student's t with 2 (runs - 1) degrees of freedom.
        limit = student(1e-3 / count / 2, 2 * (len(x) - 1))
        worst = np.abs(t).max()
        freedom = 2 * (len(x) - 1)
        # The mean of t² is freedom / (freedom - 2). Neighbouring colours go together, so a third of them counts.
        mean = (t**2).mean() / (freedom / (freedom - 2))
        most = 1 + 3.3 * np.sqrt(2 / max(count / 3, 1)) * (1.6 if count > 3 else 3.0)
        ok = worst <= limit and mean <= most
        passes &= ok
        label = f"blocks of {size}" if size > 1 else ("pixels" if size else "picture")
        ratio = x.mean() / y.mean()
        verdict = "" if ok else "  FAILS"
        print(f"{name:8} {label:12} largest t {worst:5.2f} (limit {limit:5.2f})  mean t² {mean:5.2f} (limit {most:4.2f})"
              f"  ratio {ratio:.5f}{verdict}", flush=True)
    return passes


def student(p, n):
    """The quantile 1 - p of Student's t with n degrees of freedom, by bisection of its distribution."""
    from math import lgamma, exp, log, pi

    def tail(t):
        steps = np.linspace(0, 1, 20001)[1:]
        # The integral from t to infinity, with x = t / s.
        x = t / steps
        density = np.exp(lgamma((n + 1) / 2) - lgamma(n / 2) - 0.5 * log(n * pi) - (n + 1) / 2 * np.log1p(x * x / n))
        return float((density * t / steps**2).mean())

    low, high = 0.0, 1e4
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if tail(middle) > p else (low, middle)
    return high


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("--samples", type=int, default=256)
    arguments.add_argument("--runs", type=int, default=8)
    arguments.add_argument("--bias", type=float, default=0.0)
    arguments.add_argument("scenes", nargs="*", default=list(SCENES))
    options = arguments.parse_intermixed_args()
    passes = True
    for name in options.scenes:
        scene = SCENES[name]()
        with tempfile.TemporaryDirectory() as folder:
            a = np.stack([ours(scene, options.program, folder, options.samples, s + 1) for s in range(options.runs)])
        b = np.stack([theirs(scene, options.samples, s + 1) for s in range(options.runs)])
        relative = [p.var(0, ddof=1).mean() * options.samples / p.mean() ** 2 for p in (a, b)]
        print(f"{name:8} variance of a sample / mean²: Canaletto {relative[0]:.3f}, Mitsuba {relative[1]:.3f}")
        passes &= check(name, a * (1 + options.bias), b)
    sys.exit(0 if passes else 1)


if __name__ == "__main__":
    main()
