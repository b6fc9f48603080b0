"""1,000 single steps from Python beside the same from C++ (bench_step_loop), in turns, float: what a call from Python costs.

usage: loop.py BENCH_STEP_LOOP SCENE.xml [WORLDS [STEPS [cpu|cuda [REPEATS]]]]
Prints the medians, their ratio, and whether both ended in the same bits.
"""
import json
import statistics
import subprocess
import sys
import time

import numpy as np

import gsp

given = sys.argv[1:] + [None] * 6
bench, scene = given[0], given[1]
worlds, steps, device, repeats = int(given[2] or 1024), int(given[3] or 1000), given[4] or "cpu", int(given[5] or 5)


def state_hash(a):  # bench/support/bench.hpp
    h = 14695981039346656037
    for byte in np.ascontiguousarray(a).tobytes():
        h = ((h ^ byte) * 1099511628211) % 2**64
    return h


def from_python():
    model = gsp.Model.from_xml(scene, skip_visuals=True)
    data = gsp.Data(model, worlds=worlds, device=device)
    gsp.reset(model, data, keyframe=0 if model.nkey else None)
    gsp.step(model, data, n=100)
    data.qpos.copy()
    begin = time.perf_counter()
    for _ in range(steps):
        gsp.step(model, data)
    qpos = data.qpos.copy()  # waits
    return time.perf_counter() - begin, qpos


def from_cpp():
    done = subprocess.run([bench, scene, str(worlds), str(steps), device], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


python, cpp, same = [], [], True
for _ in range(repeats):
    line = from_cpp()
    cpp.append(line["seconds"])
    seconds, qpos = from_python()
    python.append(seconds)
    same = same and f"{state_hash(qpos):016x}" == line["state_hash"]
a, b = statistics.median(python), statistics.median(cpp)
print(f"{device}, {worlds} worlds, {steps} steps: Python {a:.3f} s, C++ {b:.3f} s, ratio {a / b:.3f}; {'the same bits' if same else 'OTHER BITS'}")
