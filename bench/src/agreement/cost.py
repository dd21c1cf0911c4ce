"""What a sample of a path costs: instructions, rays, and nanoseconds of one thread for a sample and for a ray.

    python3 cost.py CANALETTO [CANALETTO ...] [--size N] [--samples A B] [--rounds N] [--scenes NAME ...]

Needs valgrind, `pip install mitsuba` for the scenes' pictures, and a release build with symbols or without. All figures
are slopes between the two numbers of samples, so the start of the program and reading the scene count in none. Programs
take turns. Instructions are those of valgrind's processor, which has AVX2.
"""

import argparse
import json
import os
import re
import statistics
import subprocess
import tempfile

import mitsuba as mi
from scenes import SCENES, Canaletto


def command(scene, program, samples):
    picture = os.path.join(scene.folder, "cost.exr")
    return [program, "render", scene.source, "--samples", str(samples), "--threads", "1", "-o", picture]


def instructions(scene, program, samples):
    tool = ["valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]
    done = subprocess.run(tool + command(scene, program, samples) + ["-q"], capture_output=True, text=True, check=True)
    return int(re.search(r"I\s+refs:\s+([\d,]+)", done.stderr).group(1).replace(",", ""))


def rays(scene, program, samples):
    told = subprocess.run(command(scene, program, samples) + ["--progress", "json"], capture_output=True, text=True)
    events = [json.loads(line) for line in told.stderr.splitlines() if line.startswith("{")]
    return next(event["rays_total"] for event in events if event["event"] == "done")


def seconds(scene, program, samples):
    process = subprocess.Popen(command(scene, program, samples) + ["-q"])
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0
    return usage.ru_utime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="+")
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--samples", type=int, nargs=2, default=[4, 12], help="for instructions; the clock takes 8 times as many")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES))
    options = parser.parse_args()
    mi.set_variant("scalar_rgb")
    few, many = options.samples
    print(f"{'scene':9}{'rays':>7}" + "".join(f"{'instructions':>14}{'ns':>7}{'ns a ray':>10}" for _ in options.programs))
    for name in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            scene = Canaletto(SCENES[name](), options.programs[0], folder, options.size)
            slope = options.size**2 * (many - few)
            traced = (rays(scene, options.programs[0], many) - rays(scene, options.programs[0], few)) / slope
            counted = [
                (instructions(scene, p, many) - instructions(scene, p, few)) / slope for p in options.programs
            ]
            taken = {p: [] for p in options.programs}
            for _ in range(options.rounds):
                for p in options.programs:
                    taken[p].append((seconds(scene, p, 8 * many) - seconds(scene, p, 8 * few)) / (8 * slope))
            line = f"{name:9}{traced:7.2f}"
            for p, count in zip(options.programs, counted):
                nanoseconds = 1e9 * statistics.median(taken[p])
                line += f"{count:14.0f}{nanoseconds:7.0f}{nanoseconds / traced:10.1f}"
            print(line, flush=True)


if __name__ == "__main__":
    main()
