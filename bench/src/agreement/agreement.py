"""Compares path tracing with Mitsuba 3 on seven scenes, pixel by pixel and on average.

    python3 agreement.py CANALETTO [--samples N] [--runs N] [--bias B] [SCENE ...]

Needs `pip install mitsuba`. Each scene is described once and written for both renderers. Each renderer makes `--runs`
pictures of independent seeds with `--samples` paths per pixel. The difference of the two means is divided by its
standard error, for single pixels, for blocks of 4, 8 and 16 pixels, and for the whole picture. With so many
comparisons a large value occurs by chance, so the limit is that of the whole set (Bonferroni, 0.1 %). The sum of all
squares of a size must not be too large either. The program fails if any test fails, or if Mitsuba is missing.

`--bias 0.005` makes Canaletto's pictures brighter by 0.5 %, which each scene's tests should find.
"""

import argparse
import sys
import tempfile

try:
    import mitsuba as mi
    import numpy as np
except ImportError as missing:
    sys.exit(f"agreement: {missing}; pip install mitsuba numpy")

from scenes import SCENES, Canaletto, Mitsuba

mi.set_variant("scalar_rgb")
SIZE = 64


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
    arguments.add_argument("scenes", nargs="*", default=[name for name in SCENES if not SCENES[name]().differs])
    options = arguments.parse_intermixed_args()
    passes = True
    for name in options.scenes:
        scene = SCENES[name]()
        with tempfile.TemporaryDirectory() as folder:
            ours = Canaletto(scene, options.program, folder, SIZE)
            a = np.stack([ours.render(options.samples, seed + 1) for seed in range(options.runs)])
        theirs = Mitsuba(scene, SIZE)
        b = np.stack([theirs.render(options.samples, seed + 1) for seed in range(options.runs)])
        relative = [p.var(0, ddof=1).mean() * options.samples / p.mean() ** 2 for p in (a, b)]
        print(f"{name:8} variance of a sample / mean²: Canaletto {relative[0]:.3f}, Mitsuba {relative[1]:.3f}")
        passes &= check(name, a * (1 + options.bias), b)
    sys.exit(0 if passes else 1)


if __name__ == "__main__":
    main()
