"""What long work costs: checkpoints, taking up, parts and merging, and what follows for 10,000 machines.

    python3 bench/src/long_work.py target/release/canaletto [--rounds 3] [--parts 64] [--machines 10000]

Run it in the root of the repository. Each row is the median of its rounds. Ratios are of the processor's time in user
and system mode, and their commands alternate. The last table is computed from the constants that were measured before
it.
"""

import argparse
import json
import math
import os
import statistics
import struct
import subprocess
import tempfile
import time

# A ball on a floor, cheap to render, for files whose contents don't matter.
CHEAP = """
camera { eye 0 1 5; center 0 0.8 0; fovy 40 }
material "wall" { kd 0.7 0.6 0.5 }
sphere material="wall" { center 0 0.7 0; radius 0.7 }
light "omni" { position 2 3 2; intensity 9 }
"""
FULL_HD = ["--size", "1920x1080"]


def run(command):
    """The seconds of the processor, the peak memory in bytes, and the seconds of the clock."""
    start = time.monotonic()
    with open(os.devnull, "w") as nothing:
        process = subprocess.Popen(command, stdout=nothing, stderr=nothing)
        _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command)}: {status}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024, time.monotonic() - start


def events(command, until, cut=None):
    """The seconds until an event of --progress json, and how often it came. `cut`: the program is ended by it."""
    start = time.monotonic()
    process = subprocess.Popen([*command, "--progress", "json"], stderr=subprocess.PIPE, text=True)
    first, count = math.inf, 0
    for line in process.stderr:
        if line.startswith("{") and json.loads(line)["event"] == until:
            first = min(first, time.monotonic() - start)
            count += 1
            if cut:
                process.send_signal(cut)
                break
    process.stderr.read()
    process.wait()
    return first, count


def write_mesh(path, side=710):
    """Writes a binary PLY of about a million triangles."""
    with open(path, "wb") as file:
        file.write(
            b"ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
            b"property float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n"
            % (side * side, 2 * (side - 1) ** 2)
        )
        for i in range(side):
            for j in range(side):
                x, z = 4 * i / side - 2, 4 * j / side - 2
                file.write(struct.pack("<3f", x, 0.2 * math.sin(9 * x) * math.cos(7 * z), z))
        for i in range(side - 1):
            for j in range(side - 1):
                a = i * side + j
                file.write(struct.pack("<B3iB3i", 3, a, a + 1, a + side, 3, a + 1, a + side + 1, a + side))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("canaletto")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--parts", type=int, default=64)
    parser.add_argument("--machines", type=int, default=10_000)
    parser.add_argument("--cores", type=int, default=16, help="of each machine")
    flags = parser.parse_args()
    canaletto = os.path.abspath(flags.canaletto)
    scenes = os.path.abspath("scenes")
    room = os.path.join(scenes, "path.kdl")
    rounds = range(flags.rounds)
    median = statistics.median

    def render(scene, *more):
        return [canaletto, "render", scene, "-q", *more]

    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        with open("cheap.kdl", "w") as file:
            file.write(CHEAP)
        hd_pixels = 1920 * 1080

        # 1. Checkpoints.
        base = render(room, *FULL_HD, "--samples", "4", "-o", "room.exr", "--force")
        kept = [*base, "--checkpoint", "c.exr", "--checkpoint-every", "1s"]
        written = events([part for part in kept if part != "-q"], "checkpoint")[1]
        plain, with_checkpoints = zip(*[(run([*base, "--checkpoint", "off"]), run(kept)) for _ in rounds])
        each = (median(r[0] for r in with_checkpoints) - median(r[0] for r in plain)) / max(written, 1)
        more = median(r[1] for r in with_checkpoints) - median(r[1] for r in plain)
        told = [part for part in base if part != "-q"]
        plan = subprocess.run([*told, "--dry-run", "--progress", "json"], capture_output=True, text=True)
        lines = (plan.stdout + plan.stderr).splitlines()
        picture = next(json.loads(line) for line in lines if '"plan"' in line)["memory"]["picture"]
        print("checkpoints of 1920 x 1080 pixels, written each second")
        print(f"  one takes                        {each:.2f} s of a processor")
        # Without --checkpoint-every the pause is at least 200 times as long as a checkpoint takes.
        share = each / (max(30, 200 * each) * os.cpu_count())
        print(f"  as often as without the flag     {100 * share:.2f} % of the time")
        print(f"  memory on top                    {more / picture:.2f} of the render's pictures")

        # 2. Taking up.
        write_mesh("mesh.ply")
        with open("mesh.kdl", "w") as file:
            file.write('camera { eye 0 3 5; center 0 0 0; fovy 40 }\nintegrator "path"\nbackground 1\n')
            file.write('material "wall" { kd 0.7 0.6 0.5 }\nmesh material="wall" { file "mesh.ply" }\n')
        base = render("mesh.kdl", *FULL_HD, "--samples", "64", "-o", "mesh.exr", "--checkpoint", "m.exr")
        base.remove("-q")
        fresh, again = [], []
        for _ in rounds:
            if os.path.exists("m.exr"):
                os.remove("m.exr")
            fresh.append(events(base, "progress", 9)[0])
            events([*base, "--checkpoint-every", "1s"], "checkpoint", 9)
            again.append(events(base, "resumed", 9)[0])
        print("taking up a picture of 1920 x 1080 pixels of a mesh of a million triangles")
        print(f"  until a fresh render begins      {median(fresh):.2f} s")
        print(f"  until it is taken up             {median(again):.2f} s, ratio {median(again) / median(fresh):.2f}")

        # 3. Parts.
        print("8 parts of samples, one after the other, beside one render (400 x 300, 256 samples)")
        for name, scene, own in [
            ("path.kdl", room, []),
            ("path.kdl, guided", room, ["--set", "integrator.guiding=on"]),
        ]:
            own = [*own, "--size", "400x300", "--samples", "256"]
            ratios = {False: [], True: []}
            for _ in rounds:
                whole = run(render(scene, *own, "-o", "whole.exr"))[0]
                state = 0.0
                for is_prepared in ratios:
                    more = []
                    if is_prepared and "guided" in name:
                        state = run([canaletto, "prepare", scene, *own, "-o", "s.state", "-q"])[0]
                        more = ["--prepared", "s.state"]
                    elif is_prepared:
                        continue
                    parts = [
                        run(render(scene, *own, *more, "--part", f"{k}/8", "-o", f"p{k}.exr", "--force"))[0]
                        for k in range(1, 9)
                    ]
                    ratios[is_prepared].append((sum(parts) + state) / whole)
            words = [f"{median(r):.3f}{' with a prepared state' if p else ''}" for p, r in ratios.items() if r]
            print(f"  {name:<33}{', '.join(words)}")

        # 4. Merging.
        os.mkdir("parts")
        cheap = ["--integrator", "whitted", "--samples", str(flags.parts)]
        for k in range(1, flags.parts + 1):
            run(render("cheap.kdl", *FULL_HD, *cheap, "--part", f"{k}/{flags.parts}", "-o", f"parts/p{k:05}.exr"))
        size = os.path.getsize("parts/p00001.exr")
        merged = [run([canaletto, "merge", "-q", "parts", "-o", "m.exr"]) for _ in rounds]
        one = [run([canaletto, "merge", "-q", "parts", "-o", "m.exr", "--threads", "1"]) for _ in rounds]
        print(f"merging {flags.parts} parts of 1920 x 1080 pixels")
        print(f"  seconds of the clock             {median(m[2] for m in merged):.2f} on {os.cpu_count()} processors")
        print(f"  memory                           {median(m[1] for m in merged) / 2**20:.0f} MiB,")
        print(f"                                   {median(m[1] for m in merged) / (12 * hd_pixels):.1f} pictures of three floats")
        per_pixel = median(m[0] for m in one) / (flags.parts * hd_pixels)
        print(f"  a pixel of a part                {1e9 * per_pixel:.0f} ns, {size / hd_pixels:.1f} bytes")

        # 5. Many machines.
        seconds = run(render(room, *FULL_HD, "--samples", "2", "-o", "r.exr", "--checkpoint", "off", "--threads", "1"))[0]
        rate = 2 * hd_pixels / seconds
        start = median(run(render(room, "--size", "16x8", "--samples", "1", "-o", "t.exr", "--force"))[2] for _ in rounds)
        width, height, samples = 15360, 8640, 4096
        pixels = width * height
        work = pixels * samples / rate
        print(f"{width} x {height} pixels of {samples} samples at {rate / 1e6:.2f} M samples/s of a core, {flags.cores} cores")
        print("  in --split tiles; a merge of all parts of the whole, on one machine of as many cores")
        print("  machines    render        merge         bytes moved   a part of tiles   of samples")
        machines = 1
        while machines <= flags.machines:
            parts = max(machines, 1)
            depth = max(1, math.ceil(parts / (height / 8)))
            rendering = work / (machines * flags.cores) + start
            merging = depth * pixels * per_pixel / flags.cores
            moved = depth * pixels * 12
            part = moved / parts
            print(
                f"  {machines:>8}{rendering:>10.0f} s{merging:>11.1f} s{moved / 1e9:>13.2f} GB"
                f"{part / 1e6:>14.1f} MB{pixels * 12 / 1e9:>11.2f} GB"
            )
            machines *= 10


main()
