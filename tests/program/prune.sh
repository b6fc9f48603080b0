#!/usr/bin/env bash
# gsp prune: half of a disc that can be spared is left out, from all round, for a file's cameras and for a robot's along a trace; the same bits
# for any number of threads and any batch; what it says of the pictures is what gsp render draws.
#   prune.sh GSP
set -eu
source "$(dirname "$0")/common.bash" "$1"
python3 "$here/make_inputs.py" .
few="--views 12 --held-out 4 --width 64 --height 48 --shrink 1"

# Each Gaussian of the disc twice: 800, of which 400 can stand for all
python3 - <<'P'
import math, struct
names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
head = "ply\nformat binary_little_endian 1.0\nelement vertex 800\n" + "".join("property float %s\n" % n for n in names) + "end_header\n"
out = head.encode()
for i in range(800):
    a, r = 2.399963 * (i // 2), 0.05 * math.sqrt(i // 2)
    out += struct.pack("<14f", r * math.cos(a), r * math.sin(a), 0, 0.5, -0.5, 0.2, -0.5, -3, -3, -6, 1, 0, 0, 0)
open("double.ply", "wb").write(out)
P
"$gsp" sim eye.xml --steps 40 --every 4 --trace t.npz --quiet > /dev/null
prune() {  # more options
  "$gsp" prune double.ply --out half.ply --keep 0.5 $few --json "$@" > said.txt
  same "$(key kept < said.txt) $(key gaussians < said.txt)" "400 800" "kept of all ($*)"
  python3 -c "
import json
said = json.load(open('said.txt'))
assert said['psnr'] > 30, said  # 3 % of the light
assert said['ssim'] > 0.85, said  # of a disc whose rim is half of its 30 pixels
assert said['depth_error_median'] < 0.06, said  # 3 % of the 2 m that it is deep, seen along its plane" || fail "quality ($*)"
  "$gsp" info half.ply | grep -q ' 400 Gaussians' || fail "gsp info of what was written ($*)"
}
prune
prune --cameras cameras.npz
prune --model eye.xml
prune --model eye.xml --trace t.npz
prune --model eye.xml --trace t.npz --camera on --jitter "0 0"
# Bits
for options in "--threads 1" "--threads 2" "--batch 1"; do
  "$gsp" prune double.ply --out "$(echo $options | tr -d ' -').ply" --keep 0.3 $few $options > /dev/null
done
cmp threads1.ply threads2.ply || fail "other bits with another number of threads"
cmp threads1.ply batch1.ply || fail "other bits with another batch"
# What it says is what pictures of the two files say: of the second of two cameras, to which it was not fitted, with its lens
for cameras in cameras cameras_lens; do
  "$gsp" prune double.ply --out third.ply --keep 0.3 $few --cameras $cameras.npz --jitter "0 0" --json > said.txt
  for name in double third; do "$gsp" render --splat $name.ply --cameras $cameras.npz --width 64 --height 48 --npz $name.npz --quiet > /dev/null; done
  python3 - <<'P' || fail "PSNR is not that of pictures that gsp render draws ($cameras)"
import json, math, struct, zipfile
def rgb(name):
    data = zipfile.ZipFile(name).read("rgb.npy")
    n = 64 * 48 * 3
    return struct.unpack("<%df" % n, data[-4 * n:])
a, b = rgb("double.npz"), rgb("third.npz")
mean = sum((min(x, 1) - min(y, 1)) ** 2 for x, y in zip(a, b)) / len(a)
said = json.load(open("said.txt"))["psnr"]
assert abs(said + 10 * math.log10(mean)) < 1e-3, (said, -10 * math.log10(mean))
P
done
if "$gsp" prune double.ply --out third.ply $few --cameras camera.npz --jitter "0 0" 2> said.txt; then fail "one view is fitted to, and judges"; fi
grep -q 'none is left to judge by' said.txt || fail "$(cat said.txt)"
# Links stay, and a model carries them
sed 's/name="cart" pos/name="wheel" pos/' eye.xml > wheel.xml
"$gsp" prune link.ply --out linked.ply --keep 0.5 $few --model wheel.xml > said.txt
grep -q 'PSNR' said.txt || fail "$(cat said.txt)"
"$gsp" info linked.ply | grep -q 'on 1 links (wheel)' || fail "links are lost: $("$gsp" info linked.ply)"
echo "gsp prune: half for the same pictures"
