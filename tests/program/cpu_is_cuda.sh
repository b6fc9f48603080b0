#!/usr/bin/env bash
# CPU and CUDA agree on quickstart's scene: 100 steps of 16 worlds (float to 1e-4, double to 1e-9, largest error over max(1, largest number)),
# and pictures of where they end (99.9 % of the values within one 8-bit level).
#   cpu_is_cuda.sh GSP
set -eu
gsp="$(cd "$(dirname "$1")" && pwd)/$(basename "$1")"
if ! ldd "$gsp" | grep -q libcuda || ! nvidia-smi -L >/dev/null 2>&1; then
  echo "skipped: it needs a program for CUDA and a GPU"
  exit 77
fi
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
"$gsp" quickstart --device cuda --worlds 16 --seconds 0.2 --out out --files scene > /dev/null
for precision in float double; do
  for device in cpu cuda; do
    "$gsp" sim scene/model.xml --start scene/start.npz --ctrl scene/ctrl.npy --steps 100 --every 100 --precision $precision --device $device --trace $precision.$device.npz --contacts met.$precision.$device.npz --forces forces.$precision.$device.npz > /dev/null
  done
done
cat > npz.py <<'PY'
import array, struct, zipfile
def load(name, key, code):
    data = zipfile.ZipFile(name).read(key + ".npy")
    numbers = array.array(code)
    numbers.frombytes(data[10 + struct.unpack("<H", data[8:10])[0]:])
    return numbers
def save(name, arrays):
    with zipfile.ZipFile(name, "w") as out:
        for key, (shape, numbers) in arrays.items():
            header = "{'descr': '<f8', 'fortran_order': False, 'shape': %r, }" % (shape,)
            header += " " * (63 - (10 + len(header)) % 64) + "\n"
            out.writestr(key + ".npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + numbers.tobytes())
PY
python3 - <<'PY'
from npz import load, save
worst = {}
for precision, bar in (("float", 1e-4), ("double", 1e-9)):
    for key in ("qpos", "qvel"):
        a, b = (load("%s.%s.npz" % (precision, device), key, "d") for device in ("cpu", "cuda"))
        a, b = a[len(a) // 2:], b[len(b) // 2:]  # the start comes first
        error = max(abs(x - y) for x, y in zip(a, b)) / max(1, max(map(abs, a)))
        worst[precision + " " + key] = error
        assert error <= bar, "%s %s: %g" % (precision, key, error)
for key in ("world", "geom1", "geom2", "dist", "pos", "force", "qfrc_constraint"):  # forces are what rates take over a step: 500 times as coarse
    file, code = ("forces" if key == "qfrc_constraint" else "met") + ".double", "i" if key in ("world", "geom1", "geom2") else "d"
    a, b = (load("%s.%s.npz" % (file, device), key, code) for device in ("cpu", "cuda"))
    assert len(a) == len(b) > 0, key
    error = max(abs(x - y) for x, y in zip(a, b)) / max(1, max(map(abs, a)))
    worst["double " + key] = error
    assert error <= (5e-7 if key in ("force", "qfrc_constraint") else 1e-9), "%s: %g" % (key, error)
print("largest errors", {k: "%.1e" % v for k, v in worst.items()})
q, v = load("float.cpu.npz", "qpos", "d"), load("float.cpu.npz", "qvel", "d")
q, v = q[len(q) // 2:], v[len(v) // 2:]
save("end.npz", {"time": ((1,), load("float.cpu.npz", "time", "d")[1:]), "qpos": ((1, 16, len(q) // 16), q), "qvel": ((1, 16, len(v) // 16), v)})
PY
for device in cpu cuda; do
  "$gsp" render --splat scene/scene.ply --model scene/model.xml --trace end.npz --cameras scene/cameras.npz --width 320 --height 240 --channels rgb --device $device --npz $device.npz > /dev/null
done
python3 - <<'PY'
from npz import load
a, b = (load(device + ".npz", "rgb", "f") for device in ("cpu", "cuda"))
level = lambda x: int(min(max(x, 0), 1) * 255 + .5)
off = sum(abs(level(x) - level(y)) > 1 for x, y in zip(a, b) if x != y)
print("%d of %d values of the pictures differ by more than one level, the largest difference is %.1e" % (off, len(a), max(abs(x - y) for x, y in zip(a, b))))
assert len(a) == len(b) == 16 * 240 * 320 * 3 and off <= len(a) // 1000 and sum(a) / len(a) > 0.1
PY
