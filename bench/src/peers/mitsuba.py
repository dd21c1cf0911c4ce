"""Renders a picture by Mitsuba 3, for `peers pictures`.

    mitsuba.py VARIANT                                  succeeds if that variant works here
    mitsuba.py VARIANT THREADS SCENE PICTURE SECONDS    renders, and writes to SECONDS what took how long
"""

import json
import sys
import time

import drjit
import mitsuba

variant = sys.argv[1]
mitsuba.set_variant(variant)
if len(sys.argv) == 2:
    if variant.startswith("llvm"):
        # Some versions of LLVM load but abort when they compile, others only for more than a sum. A render tests that.
        box = mitsuba.cornell_box()
        box["sensor"]["film"] |= {"width": 4, "height": 4}
        drjit.eval(mitsuba.render(mitsuba.load_dict(box), spp=1))
    sys.exit()

threads, scene, picture, seconds = sys.argv[2:]
drjit.set_thread_count(int(threads))
# Each mark has both clocks. The processor's clock counts from the start of the process, imports included.
marks = [(time.perf_counter(), time.process_time())]
parts = {"start": [0.0, marks[0][1]]}


def done(name):
    """Records the time since the last mark as the part `name`."""
    drjit.sync_thread()
    marks.append((time.perf_counter(), time.process_time()))
    parts[name] = [after - before for before, after in zip(*marks[-2:])]


scene = mitsuba.load_file(scene)
done("load")
image = mitsuba.render(scene)
drjit.eval(image)
done("render")
mitsuba.util.write_bitmap(picture, image, write_async=False)
done("write")
with open(seconds, "w") as file:
    json.dump({"version": mitsuba.__version__, "seconds": parts}, file)
