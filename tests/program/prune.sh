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
# What it says is what pictures of the two files say: of the second of two entries, to which it was not fitted, with its lens
"$gsp" sim cart.xml --steps 1 --trace two.npz --quiet > /dev/null
for cameras in cameras cameras_lens; do
  "$gsp" prune double.ply --out third.ply --keep 0.3 $few --model cart.xml --trace two.npz --cameras $cameras.npz --jitter "0 0" --json > said.txt
  for name in double third; do "$gsp" render --splat $name.ply --cameras $cameras.npz --width 64 --height 48 --npz $name.npz --quiet > /dev/null; done
  python3 - <<'P' || fail "PSNR is not that of pictures that gsp render draws ($cameras)"
import json
from arrays import psnr
said = json.load(open("said.txt"))["psnr"]
assert abs(said - psnr("double.npz", "third.npz", 1)) < 1e-3, (said, psnr("double.npz", "third.npz", 1))
P
done
# Two blobs, each seen by one camera alone: both are fitted to, and both judge
python3 - <<'P'
import math, struct
from arrays import write_npz
names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
out = ("ply\nformat binary_little_endian 1.0\nelement vertex 800\n" + "".join("property float %s\n" % n for n in names) + "end_header\n").encode()
for i in range(800):
    a, r, side = 2.399963 * (i // 4), 0.05 * math.sqrt(i // 4), 10 * (i % 2) - 5
    out += struct.pack("<14f", side + r * math.cos(a), 0, r * math.sin(a), 0.5, -0.5, 0.2, -0.5, -3, -6, -3, 1, 0, 0, 0)
open("blobs.ply", "wb").write(out)
def view(x):
    return [1, 0, 0, -x, 0, 0, -1, 0, 0, 1, 0, 2, 0, 0, 0, 1]  # along y, from 2 m before it
write_npz("ends.npz", viewmats=((2, 4, 4), view(-5) + view(5)), Ks=((3, 3), [48, 0, 32, 0, 48, 24, 0, 0, 1]))
mount = '<camera name="%s" pos="%d -2 0" xyaxes="1 0 0 0 0 1" fovy="53"/>'
open("ends.xml", "w").write(open("cart.xml").read().replace("<worldbody>", "<worldbody>" + mount % ("left", -5) + mount % ("right", 5), 1))
P
"$gsp" sim ends.xml --worlds 2 --steps 3 --trace ends_t.npz --quiet > /dev/null
stays() {  # more options
  "$gsp" prune blobs.ply --out kept.ply --keep 0.5 $few --json "$@" > said.txt
  for name in blobs kept; do "$gsp" render --splat $name.ply --cameras ends.npz --width 64 --height 48 --npz $name.npz --quiet > /dev/null; done
  python3 - <<'P' || fail "a camera has lost its picture ($*)"
import json
from arrays import psnr
each = [psnr("blobs.npz", "kept.npz", k) for k in range(2)]
assert min(each) > 30 and abs(each[0] - each[1]) < 3, each
assert json.load(open("said.txt"))["psnr"] > 30, open("said.txt").read()
P
}
refuses() {  # what it says, options
  local what="$1"
  shift
  if "$gsp" prune blobs.ply --out never.ply $few "$@" 2> said.txt; then fail "no refusal: $what"; fi
  grep -qF -- "$what" said.txt || fail "$(cat said.txt)"
  [ ! -e never.ply ] || fail "it left a file: $what"
}
stays --cameras ends.npz
stays --model ends.xml
stays --model ends.xml --camera right --camera left
stays --model ends.xml --trace ends_t.npz  # 4 entries of 2 worlds
stays --model ends.xml --trace ends_t.npz --jitter "0 0"
same "$(key views < said.txt) $(key views_held_out < said.txt)" "12 4" "views without jitter: of 8 of each camera 6 are fitted to, 2 judge"
refuses 'makes no further views of the 2 that there are' --cameras ends.npz --jitter "0 0"
all="$few"
few="--width 64 --height 48 --shrink 1 --views 2 --held-out 2"
stays --model ends.xml --trace ends_t.npz
few="--width 64 --height 48 --shrink 1 --views 1"
refuses '--views 1 is less than one for each of 2 cameras; give --views 2' --model ends.xml
few="$all"
# A camera that sees nothing is told of; where none sees anything, nothing is pruned
"$gsp" prune double.ply --out seen.ply $few --cameras cameras_astray.npz 2> said.txt > /dev/null
grep -qF 'camera 1 sees no Gaussian in 6 of 6 views: turn it to the scene' said.txt || fail "$(cat said.txt)"
"$gsp" prune double.ply --out seen.ply $few --cameras cameras_astray.npz --quiet 2> said.txt > /dev/null
[ ! -s said.txt ] || fail "not quiet: $(cat said.txt)"
refuses 'no camera sees any Gaussian in 12 views' --cameras away.npz
# A pose of the scene moves the cameras, so that what is written stays in its file's frame: a turn of whole axes and numbers that floats hold,
# so the bytes are those of cameras that were multiplied by hand
pose="0.5 -1 0.25 1 1 1 1 2"  # x -> 2 (z, x, y) + (0.5, -1, 0.25)
python3 - <<'P'
from arrays import write_npz
R, t, s = [[0, 0, 1], [1, 0, 0], [0, 1, 0]], [0.5, -1, 0.25], 2
V = [[1, 0, 0, 0], [0, 0, -1, 0.5], [0, 1, 0, 3], [0, 0, 0, 1]]  # in the frame of the file
W = [[sum(V[i][k] * R[j][k] for k in range(3)) for j in range(3)] for i in range(3)]  # in the world: V P^-1, lengths s times
W = [row + [s * V[i][3] - sum(row[k] * t[k] for k in range(3))] for i, row in enumerate(W)] + [[0, 0, 0, 1]]
for name, M in (("by_hand", V), ("in_world", W)):
    write_npz(name + ".npz", viewmats=((2, 4, 4), sum(M, []) * 2), Ks=((3, 3), [60, 0, 32, 0, 60, 24, 0, 0, 1]))
P
options="$few --keep 0.3 --model cart.xml --trace two.npz --json"
"$gsp" prune double.ply --out by_hand.ply $options --cameras by_hand.npz --jitter "0 0" > by_hand.txt
"$gsp" prune double.ply --out posed.ply $options --cameras in_world.npz --splat-pose "$pose" --jitter "0 0" > posed.txt
cmp by_hand.ply posed.ply || fail "a pose of the scene prunes otherwise than cameras that were multiplied by hand"
same "$(key psnr < by_hand.txt)" "$(key psnr < posed.txt)" "PSNR by hand and by a pose"
python3 -c "
import json
a, b = (json.load(open(f))['depth_error_median'] for f in ('by_hand.txt', 'posed.txt'))
assert a > 0 and abs(b - 2 * a) < 1e-9, (a, b)  # metres of the world, half a unit of the file" || fail "depth with a pose"
# ... and what is said is what gsp render draws of that pose
for name in double posed; do "$gsp" render --splat $name.ply --splat-pose "$pose" --cameras in_world.npz --width 64 --height 48 --npz $name.npz --quiet > /dev/null; done
python3 -c "
import json
from arrays import psnr
assert abs(json.load(open('posed.txt'))['psnr'] - psnr('double.npz', 'posed.npz', 1)) < 0.01" || fail "pruned with a pose it is not what gsp render draws"
# Jitter is in metres of the world. Sums are rounded elsewhere then, so the bytes may be others
"$gsp" prune double.ply --out by_hand.ply $options --cameras by_hand.npz --jitter "0.02 3" > by_hand.txt
"$gsp" prune double.ply --out posed.ply $options --cameras in_world.npz --splat-pose "$pose" --jitter "0.04 3" > posed.txt
python3 -c "
import json
a, b = (json.load(open(f)) for f in ('by_hand.txt', 'posed.txt'))
assert a['kept'] == b['kept'] and abs(a['psnr'] - b['psnr']) < 0.5, (a, b)" || fail "jitter with a pose"
"$gsp" prune double.ply --out round.ply $few --splat-pose "$pose" > said.txt
grep -q PSNR said.txt || fail "a pose and views from all round: $(cat said.txt)"
refuses "pose '0 0 1': must be eight numbers" --splat-pose "0 0 1"
if "$gsp" prune double.ply --out third.ply $few --cameras camera.npz --jitter "0 0" 2> said.txt; then fail "one view is fitted to, and judges"; fi
grep -q 'some must be left to judge by' said.txt || fail "$(cat said.txt)"
# Links stay, and a model carries them
sed 's/name="cart" pos/name="wheel" pos/' eye.xml > wheel.xml
"$gsp" prune link.ply --out linked.ply --keep 0.5 $few --model wheel.xml > said.txt
grep -q 'PSNR' said.txt || fail "$(cat said.txt)"
"$gsp" info linked.ply | grep -q 'on 1 links (wheel)' || fail "links are lost: $("$gsp" info linked.ply)"
if "$gsp" prune link.ply --out never.ply $few --model wheel.xml --splat-pose "$pose" 2> said.txt; then fail "a pose parts links from the scene"; fi
grep -q 'leave out --splat-pose' said.txt || fail "$(cat said.txt)"
echo "gsp prune: half for the same pictures"
