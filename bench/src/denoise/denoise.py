"""Compares Canaletto's denoisers with Intel's Open Image Denoise on six scenes.

    OIDN_DIR=FOLDER python3 denoise.py CANALETTO [--folder FOLDER] [--size N] [--converged N] [SCENE ...]
    OIDN_DIR=FOLDER python3 denoise.py CANALETTO --speed

Needs `pip install mitsuba`, which reads OpenEXR here. Each scene is rendered with 4, 16, 64 and 256 samples per pixel,
and twice with `--converged` samples and other seeds. The error is the root of the mean of d² / (c² + 0.01 m²): d is the
difference from the converged picture, c that picture's colour, m its mean. For d² the product of the differences from
both converged pictures is taken, whose own noise has no part in it then. The gain is the error of the noisy picture
divided by that of the denoised one. The ratio is our gain divided by Open Image Denoise's. It should be 0.8 at least,
or 0.4 where fireflies rule: where 1 % of the noisy picture's pixels have half of the square error. No gain may be less
than 1. The program fails if a goal is missed. Pictures in `--folder` are made once and read again.

`--speed` denoises a picture of 512 x 512 pixels, and prints the seconds.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time

try:
    import mitsuba as mi
    import numpy as np
except ImportError as missing:
    sys.exit(f"denoise: {missing}; pip install mitsuba numpy")

mi.set_variant("scalar_rgb")
ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../..")
SCENES = {
    "cornell": "scenes/cornell-box.kdl",
    "gap": "tests/scenes/noise/gap.kdl",
    "sky": "scenes/sky.kdl",
    "glass": "scenes/glass-and-metal.kdl",
    "sunlit": "scenes/sunlit-room.kdl",
    "lamps": "scenes/lamps.kdl",
}
SAMPLES = (4, 16, 64, 256)
DENOISERS = ("fast", "good", "oidn")
LAYERS = "half-a,half-b,denoising-albedo,denoising-normal,denoising-depth"


class Bench:
    """Pictures in a folder."""

    def __init__(self, options, folder):
        self.program, self.size, self.converged, self.folder = options.program, options.size, options.converged, folder

    def run(self, *words):
        """The seconds of the processors and of the clock."""
        start, before = time.time(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        subprocess.run([self.program, *map(str, words), "-q"], check=True, stderr=subprocess.DEVNULL)
        return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before, time.time() - start

    def rendered(self, scene, samples, seed, size=None, layers=None):
        """A picture's file."""
        size = size or self.size
        file = os.path.join(self.folder, f"{scene}-{size}-{samples}-{seed}.exr")
        if not os.path.exists(file):
            more = ["--aov", layers] if layers else []
            # Guiding would change the noise in one of the scenes.
            words = ["--integrator", "path", "--set", "integrator.guiding=off", "--samples", samples, "--seed", seed, "--size", f"{size}x{size}", *more]
            self.run("render", os.path.join(ROOT, SCENES[scene]), *words, "-o", file + ".part.exr")
            os.rename(file + ".part.exr", file)
        return file

    def denoised(self, file, denoiser):
        out = os.path.join(self.folder, f"denoised-{denoiser}.exr")
        seconds = self.run("denoise", file, "-o", out, "--denoiser", denoiser)
        return colors(out), seconds

    def scene(self, scene):
        """A line for each number of samples. Returns how many goals are missed."""
        a, b = (colors(self.rendered(scene, self.converged, seed)) for seed in (101, 102))
        mean = (a + b) / 2
        weight = 1 / (np.maximum(mean, 0) ** 2 + 0.01 * mean.mean() ** 2)
        squares = lambda picture: ((picture - a) * (picture - b) * weight).mean(2)
        missed = 0
        for samples in SAMPLES:
            file = self.rendered(scene, samples, 1, layers=LAYERS)
            noise = squares(colors(file))
            error = lambda s: np.sqrt(max(s.mean(), 1e-12))
            errors = {denoiser: error(squares(self.denoised(file, denoiser)[0])) for denoiser in DENOISERS}
            gains = {denoiser: error(noise) / errors[denoiser] for denoiser in DENOISERS}
            worst = np.sort(noise.ravel())[-noise.size // 100 :].sum() / noise.sum()
            goal = 0.4 if worst > 0.5 else 0.8
            ratio = gains["good"] / gains["oidn"]
            misses = [f"ratio < {goal}"] if ratio < goal else []
            misses += [f"{denoiser} is worse than noisy" for denoiser in ("fast", "good") if gains[denoiser] < 1]
            missed += len(misses)
            shown = " | ".join(f"{errors[denoiser]:.3f} · {gains[denoiser]:.1f}" for denoiser in DENOISERS)
            told = ", ".join(misses)
            print(f"| {scene} | {samples} | {error(noise):.3f} | {worst * 100:.0f} % | {shown} | {ratio:.2f} | {goal} | {told} |",
                  flush=True)
        return missed

    def speed(self):
        file = self.rendered("sunlit", 4, 1, 512, LAYERS)
        print("| 512 x 512 pixels | of processors | of the clock |\n|---|---|---|")
        for denoiser in DENOISERS:
            best = min(self.denoised(file, denoiser)[1] for _ in range(3))
            print(f"| {denoiser} | {best[0]:.1f} s | {best[1]:.1f} s |")


def colors(file):
    bitmap = mi.Bitmap(file)
    channels = np.array(bitmap, dtype=np.float64)
    names = [bitmap.struct_()[i].name for i in range(channels.shape[2])]
    return channels[:, :, [names.index(name) for name in "RGB"]]


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("--folder")
    arguments.add_argument("--size", type=int, default=128)
    arguments.add_argument("--converged", type=int, default=1024)
    arguments.add_argument("--speed", action="store_true")
    arguments.add_argument("scenes", nargs="*", default=list(SCENES))
    options = arguments.parse_intermixed_args()
    with tempfile.TemporaryDirectory() as temporary:
        bench = Bench(options, options.folder or temporary)
        if options.speed:
            return bench.speed()
        print("| scene | samples | noisy | in 1 % of pixels | fast | good | OIDN | ratio | goal | missed |")
        print("|---|---|---|---|---|---|---|---|---|---|")
        missed = sum(bench.scene(scene) for scene in options.scenes)
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
