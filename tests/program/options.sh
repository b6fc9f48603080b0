#!/usr/bin/env bash
# What --cone, --tolerance and --disable make of a state, and where the bodies go that a keyframe places (mpos, mquat).
#   options.sh GSP
set -eu
source "$(dirname "$0")/common.bash" "$1"
cat > last.py <<'PY'
import struct, zipfile
def last(name, n):
    """The last n numbers of qpos of a trace."""
    return struct.unpack("<%dd" % n, zipfile.ZipFile(name).read("qpos.npy")[-8 * n:])
PY

# --disable: five weights on vertical slides, the first four of which a contact, a limit, an equality and dry friction hold. What is held
# stays within 2 cm; what is not falls as the fifth does, q = -g h^2 n (n + 1) / 2, to rounding of n sums (and of h = 2 ms in the file).
cat > held.xml <<'XML'
<mujoco><worldbody><geom type="plane" size="5 5 1"/>
  <body pos="0 0 .1"><joint type="slide" axis="0 0 1"/><geom type="sphere" size=".1" mass="1"/></body>
  <body pos="1 0 5"><joint type="slide" axis="0 0 1" limited="true" range="0 1"/><geom type="sphere" size=".1" mass="1"/></body>
  <body pos="2 0 5"><joint name="bound" type="slide" axis="0 0 1"/><geom type="sphere" size=".1" mass="1"/></body>
  <body pos="3 0 5"><joint type="slide" axis="0 0 1" frictionloss="20"/><geom type="sphere" size=".1" mass="1"/></body>
  <body pos="4 0 5"><joint type="slide" axis="0 0 1"/><geom type="sphere" size=".1" mass="1"/></body></worldbody>
  <equality><joint joint1="bound" polycoef="0 0 0 0 0"/></equality></mujoco>
XML
for profile in stable mujoco; do
  for left_out in none contact limit equality friction constraint limit,friction; do
    flag="--disable $left_out"
    [ $left_out != none ] || flag=
    "$gsp" sim held.xml --profile $profile --precision double --steps 200 $flag --trace held.npz > /dev/null
    python3 - $left_out <<'PY' || fail "--disable $left_out, profile $profile"
import sys
from last import last
n, h, g = 200, 0.002, 9.81
fall = -g * h * h * n * (n + 1) / 2
names = sys.argv[1].split(",")
for kind, q in zip(("contact", "limit", "equality", "friction", "nothing"), last("held.npz", 5)):
    free = kind == "nothing" or kind in names or "constraint" in names
    assert abs(q - (fall if free else 0)) < (1e-12 if free else 0.02), (kind, q, fall)
PY
  done
done

# --cone: a box of friction mu, pushed along the diagonal of the tangents by `share` of mu m g. Its edge there: mu m g of the disc, the root of 2
# of that of the box, that by the root of 2 of the pyramid. What it does not hold slides by a quarter of a metre and more in a second,
# (share - 1 / 1.41) mu g / 2 = 0.35 m at 0.85, (1.2 - 1) mu g / 2 = 0.49 m at 1.2; what it holds, at most by what a soft pyramid creeps.
for share in 0.85 1.2; do
  tangent=$(python3 -c "print($share * 0.5 * 9.81 / 2 ** .5)")
  cat > pushed.xml <<XML
<mujoco><option gravity="$tangent $tangent -9.81"/><worldbody><geom type="plane" size="5 5 1" friction=".5"/>
  <body pos="0 0 .05"><freejoint/><geom type="box" size=".2 .2 .05" mass="1" friction=".5"/></body></worldbody></mujoco>
XML
  for cone in elliptic pyramidal box default; do
    flag="--cone $cone"
    [ $cone != default ] || flag=
    "$gsp" sim pushed.xml --precision double --steps 500 $flag --trace pushed.npz > /dev/null
    python3 - $share $cone <<'PY' || fail "--cone $cone at $share"
import math, sys
from last import last
share, cone = float(sys.argv[1]), sys.argv[2]
edge = {"elliptic": 1, "default": 1, "pyramidal": 0.5 ** .5, "box": 2 ** .5}[cone]
x, y = last("pushed.npz", 7)[:2]
slid = math.hypot(x, y)
if share > edge:
    expected = (share - edge) * 0.5 * 9.81 / 2
    assert abs(slid / expected - 1) < 0.1, (slid, expected)
else:
    assert slid < 1e-3, slid
PY
  done
done

# --tolerance: a heavy box on a light one takes more sweeps to solve for further, and ends in another state; the same tolerance gives the same
cat > heavy.xml <<'XML'
<mujoco><worldbody><geom type="plane" size="5 5 1"/><body pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/></body>
  <body pos=".02 .01 .3"><freejoint/><geom type="box" size=".1 .1 .1" mass="20"/></body></worldbody></mujoco>
XML
run() { "$gsp" sim heavy.xml --precision double --steps 100 --json "$@"; }
few=$(run --tolerance 0.1 | key mean_iterations) default=$(run | key mean_iterations) many=$(run --tolerance 1e-9 | key mean_iterations)
python3 -c "assert $few <= $default < $many, ($few, $default, $many)" || fail "sweeps of --tolerance 0.1, the default and 1e-9: $few, $default, $many"
[ "$(run --iterations 2 | key unfinished_worlds) $(run | key unfinished_worlds)" = "1 0" ] || fail "unfinished_worlds of 2 and of 100 sweeps"
"$gsp" sim heavy.xml --steps 100 --iterations 2 | grep -q "in 1 of 1 worlds the solver made all" || fail "sim does not say that the solver ended early"
[ "$(run --tolerance 1e-9 | key state_hash)" != "$(run | key state_hash)" ] || fail "--tolerance does not change the state"
[ "$(run --tolerance 1e-4 | key state_hash)" = "$(run | key state_hash)" ] || fail "the default tolerance is not 1e-4"

# a keyframe's mpos and mquat: what is welded to the mocap body goes where the keyframe has it, and turns with it
cat > mocap.xml <<'XML'
<mujoco><option gravity="0 0 0"/><worldbody><body name="hand" mocap="true"/>
  <body name="held"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/></body></worldbody>
  <equality><weld body1="hand" body2="held"/></equality>
  <keyframe><key name="there" mpos=".3 -.2 .5" mquat=".8 0 .6 0"/><key name="here"/></keyframe></mujoco>
XML
for profile in stable mujoco; do
  "$gsp" sim mocap.xml --profile $profile --precision double --steps 2000 --keyframe there --trace there.npz > /dev/null
  "$gsp" sim mocap.xml --profile $profile --precision double --steps 2000 --keyframe here --trace here.npz > /dev/null
  python3 - <<'PY' || fail "the mocap pose of a keyframe, profile $profile"
from last import last
# time constants of a weld are 20 ms: e^-200 after 4 s
for name, wanted in (("there.npz", (.3, -.2, .5, .8, 0, .6, 0)), ("here.npz", (0, 0, 0, 1, 0, 0, 0))):
    q = last(name, 7)
    assert max(abs(a - b) for a, b in zip(q, wanted)) < 1e-9, (name, q)
PY
done
echo "all is as the page says"
