"""Compares the error of few and of many small lamps of the same total power, at equal time.

    python3 many_lights.py CANALETTO [--samples N] [--seeds N] [--lamps N ...] [--mitsuba]

Needs `pip install mitsuba numpy`. Lamps are balls at random places over a floor with some clay on it. The variance is
that of pictures of different seeds, over the squared reference with a hundredth of the squared mean added. The error at
equal time is the root of variance times CPU seconds, and counts that of the first line as 1. `--mitsuba` adds Mitsuba's
`scalar_rgb`, which chooses all lamps equally often.
"""

import argparse
import sys
import tempfile

try:
    import mitsuba as mi
    import numpy as np
except ImportError as missing:
    sys.exit(f"many_lights: {missing}; pip install mitsuba numpy")

from scenes import Canaletto, Mitsuba, Scene, cpu_seconds, gray

mi.set_variant("scalar_rgb")
SIZE = 64


def lamps(count):
    # The camera sees no lamp, since the edges of lamps that are smaller than pixels are noise of another kind.
    scene = Scene([0, 1.5, 9], [0, 0.6, 0], 20)
    scene.matte("floor", gray(0.6))
    scene.matte("clay", [0.6, 0.5, 0.4])
    scene.disk("floor", [0, 0, 0], 1, 12)
    for x in range(-3, 4):
        for z in range(-3, 3):
            scene.sphere("clay", [x * 1.3, 0.35, z * 1.3], 0.35)
    random = np.random.default_rng(7)
    places = random.uniform([-5, 3.0, -5], [5, 4.4, 4], (count, 3))
    colors = random.uniform(0.2, 1.0, (count, 3))
    # Lamps keep their radiance. Their areas share the power.
    radius = 0.12 / np.sqrt(count)
    for i in range(count):
        color = [float(c) for c in 400 * colors[i] ** 2]
        scene.matte(f"lamp{i}", gray(0.0), color)
        scene.sphere(f"lamp{i}", [float(v) for v in places[i]], float(radius))
    return scene


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("--samples", type=int, default=256)
    arguments.add_argument("--seeds", type=int, default=4)
    arguments.add_argument("--lamps", type=int, nargs="+", default=[10, 100, 1000, 10000])
    arguments.add_argument("--mitsuba", action="store_true")
    options = arguments.parse_args()
    print(f"{'lamps':>6} {'renderer':10} {'samples/s':>10} {'variance':>9} {'error at equal time':>20}")
    first = {}
    for count in options.lamps:
        scene = lamps(count)
        with tempfile.TemporaryDirectory() as folder:
            renderers = {"Canaletto": Canaletto(scene, options.program, folder, SIZE)}
            if options.mitsuba:
                renderers["Mitsuba"] = Mitsuba(scene, SIZE)
            for name, renderer in renderers.items():
                renderer.render(1, 0)
                start = cpu_seconds()
                renderer.render(1, 0)
                begun = cpu_seconds()
                pictures = np.stack([renderer.render(options.samples, seed) for seed in range(1, options.seeds + 1)])
                # What one sample takes is nearly all preparation.
                seconds = (cpu_seconds() - begun) / options.seeds - (begun - start)
                mean = pictures.mean(0)
                scale = mean**2 + 0.01 * mean.mean() ** 2
                variance = (pictures.var(0, ddof=1) / scale).mean() * options.samples
                rate = SIZE * SIZE * (options.samples - 1) / seconds
                error = np.sqrt(variance / rate)
                relative = error / first.setdefault(name, error)
                print(f"{count:6} {name:10} {rate:10.0f} {variance:9.3f} {relative:20.2f}", flush=True)


if __name__ == "__main__":
    main()
