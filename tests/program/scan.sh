#!/usr/bin/env bash
# What gsp scan measures: a room by the closed form, along a trace each ray once, a file of rays as the pattern that it holds; and bad input.
#   scan.sh GSP
set -eu
source "$(dirname "$0")/common.bash" "$1"
# A room of 4 x 6 x 3 m (walls as planes that look inward), a ball that falls along its middle, and a cart on which a unit rides.
cat > room.xml <<'XML'
<mujoco><option timestep=".01" gravity="0 0 0"/><worldbody>
  <geom name="floor" type="plane" size="0 0 1"/><geom name="ceiling" type="plane" size="0 0 1" pos="0 0 3" euler="180 0 0"/>
  <geom name="east" type="plane" size="0 0 1" pos="2 0 0" euler="0 -90 0"/><geom name="west" type="plane" size="0 0 1" pos="-2 0 0" euler="0 90 0"/>
  <geom name="north" type="plane" size="0 0 1" pos="0 3 0" euler="90 0 0"/><geom name="south" type="plane" size="0 0 1" pos="0 -3 0" euler="-90 0 0"/>
  <body name="cart" pos="0 0 1"><freejoint/><geom name="cart" size=".1" mass="1"/><site name="unit" pos="0 0 .2"/></body>
</worldbody><keyframe><key name="rides" qpos="0 0 1 1 0 0 0" qvel="1 0 0 0 0 0"/><key name="leans" qpos="0 0 1 .9659258 0 .2588190 0"/></keyframe></mujoco>
XML
# All round from the room's middle: to the nearest of the planes that a ray goes towards. float32 in the file.
"$gsp" scan room.xml --pattern sphere --mount unit --npz still.npz --ply still.ply --png still.png > /dev/null
python3 - <<'PY' || fail "a room by the closed form"
from arrays import array
(t, n, r), range_ = array("still.npz", "range")
_, point = array("still.npz", "point")
_, geom = array("still.npz", "geom")
assert (t, n, r) == (1, 1, 720 * 360)
eye, half = (0, 0, 1.2), ((-2, 2), (-3, 3), (0, 3))
own = worst = 0
for k in range(r):
    assert range_[k] > 0, k
    if geom[k] == 6: own += 1
    p = point[3 * k:3 * k + 3]
    d = [(a - b) / range_[k] for a, b in zip(p, eye)]
    wall = min((h[1 if x > 0 else 0] - e) / x for x, e, h in zip(d, eye, half) if abs(x) > 1e-6)
    worst = max(worst, abs(wall - range_[k]))
# the direction is taken from the point, so an error of 1e-7 of it counts as often as the wall is slanted
assert own == 0 and worst < 1e-4, (own, worst)
PY
[ "$(head -c 3 still.ply)" = ply ] && grep -aq "^element vertex $((720 * 360))$" still.ply || fail "the cloud's points"
"$gsp" info still.png > /dev/null || fail "the picture"
"$gsp" info still.ply > said || fail "the cloud"
grep -q "a cloud of $((720 * 360)) points, no Gaussians" said && grep -q "properties *x y z red green blue range geom" said &&
  grep -q "box *x -2 .. 2, y -3 .. 3, z [-0-9.e]* .. 3$" said && grep -q "range *1.2 .. " said || fail "what the cloud holds: $(cat said)"
"$gsp" info room.xml --json | python3 -c '
import json, sys
m = json.load(sys.stdin)
assert dict(zip(m["geoms"], (m["bodies"][b] for b in m["geom_bodies"])))["cart"] == "cart" and m["geom_bodies"][:6] == [0] * 6' || fail "bodies of geoms"
# Heights: 2 m below a unit 1 m above the cart, straight down although the cart leans by 30 degrees.
"$gsp" scan room.xml --keyframe leans --pattern height --mount "cart 0 0 1 1 0 0 0" --npz height.npz > /dev/null
python3 -c '
from arrays import array
(t, n, r), d = array("height.npz", "range"); assert r == 187 and max(abs(x - 2) for x in d) < 1e-6, d
_, p = array("height.npz", "point"); assert abs(p[0] + .8) < 1e-6 and abs(p[1] + .5) < 1e-6, p[:3]' || fail "heights"
# With its own body: the cart's ball is 0.1 m below and fills 30 degrees about straight down, 60 rows of half a degree.
"$gsp" scan room.xml --pattern sphere --mount unit --self-filter none --npz own.npz > /dev/null
python3 -c '
from arrays import array
_, geom = array("own.npz", "geom"); _, r = array("own.npz", "range")
own = [x for x, g in zip(r, geom) if g == 6]
assert len(own) == 720 * 60 and abs(min(own) - .1) < 1e-3, (len(own), min(own))' || fail "the unit's own body"

# Along a trace: 1 m/s to +x, 100 entries of 10 ms, a unit of 10 turns a second. A ray that leaves at t begins at x = t, and meets the east
# or west wall as far ahead as that says; each of the last 10 entries holds a whole turn of 28,800 rays, a tenth of which is new.
"$gsp" sim room.xml --keyframe rides --steps 100 --every 1 --precision double --trace rides.npz > /dev/null
"$gsp" scan room.xml --pattern vlp16 --mount unit --trace rides.npz --hz 10 --npz moving.npz --json > said.json
python3 - <<'PY' || fail "rays of a unit that rides"
import json
from arrays import array
(t, n, r), range_ = array("moving.npz", "range")
_, point = array("moving.npz", "point")
_, geom = array("moving.npz", "geom")
_, left = array("moving.npz", "ray_time")
assert (t, n, r) == (100, 1, 28800), (t, n, r)
last = (t - 1) * r
assert sum(x < 0 for x in left[:r]) == r - 2880 and max(range_[2880:r]) == -1, "nothing has left yet"
for e in range(15, t):  # times of an entry: all different columns of one turn, the latest in the last 10 ms
    now = left[e * r:(e + 1) * r]
    assert .01 * (e + 1) - .1 - 1e-9 <= min(now) and max(now) < .01 * (e + 1), (e, min(now), max(now))
    assert sum(x >= .01 * e - 1e-9 for x in now) in (2864, 2880, 2896), e
said = json.load(open("said.json"))  # a tenth of a turn at each entry was cast, no whole one
assert abs(said["rays_per_second"] * said["seconds"] / (t * 2880) - 1) < 1e-3, said
worst = 0
for k in range(r):
    if geom[last + k] not in (2, 3): continue
    x = left[last + k]
    p = point[3 * (last + k):3 * (last + k) + 3]
    away = ((p[0] - x) ** 2 + p[1] ** 2 + (p[2] - 1.2) ** 2) ** .5
    worst = max(worst, abs(away - range_[last + k]), abs(abs(p[0]) - 2))
assert worst < 1e-5, worst
PY
# Noise: the same twice, another with another seed.
for seed in 1 1 2; do "$gsp" scan room.xml --pattern grid --mount unit --range-noise .02 --dropout .1 --seed $seed --npz noise.npz > /dev/null; sha256sum < noise.npz >> hashes; done
[ "$(sort -u hashes | wc -l)" = 2 ] && [ "$(sed -n 1p hashes)" = "$(sed -n 2p hashes)" ] || fail "noise by its seed"
# A table of rays: ahead, left, up.
printf 'time,azimuth,zenith\n0,0,90\n0.001,90,90\n0.002,0,0\n' > rays.csv
"$gsp" scan room.xml --pattern rays.csv --mount unit --npz table.npz > /dev/null
python3 -c '
from arrays import array
_, r = array("table.npz", "range"); assert max(abs(a - b) for a, b in zip(r, (2, 3, 1.8))) < 1e-6, r' || fail "a table of rays"

# A keyframe places mocap bodies too; names may hold spaces.
cat > mocap.xml <<'XML'
<mujoco><worldbody><body name="my cart" pos="0 0 1"><joint type="slide" axis="1 0 0"/><geom size=".1" mass="1"/><site name="my unit"/></body>
<body name="mc" mocap="true" pos="1 0 1"><geom type="box" size=".1 .2 .3"/></body></worldbody>
<keyframe><key name="far" mpos="1.5 0 1"/><key name="turned" mpos="1.5 0 1" mquat="2 0 0 2"/></keyframe></mujoco>
XML
sed 's/<joint[^>]*>//' mocap.xml > fixed.xml
for scene in mocap fixed; do
  "$gsp" scan $scene.xml --pattern rays.csv --mount "my unit" --npz near.npz > /dev/null
  "$gsp" scan $scene.xml --pattern rays.csv --mount "my cart" --keyframe far --npz far.npz > /dev/null
  "$gsp" scan $scene.xml --pattern rays.csv --mount "my cart 0 0 0 1 0 0 0" --keyframe turned --npz turned.npz > /dev/null
  python3 -c '
from arrays import array
for file, want in (("near", .9), ("far", 1.4), ("turned", 1.3)):
    _, r = array(file + ".npz", "range"); assert abs(r[0] - want) < 1e-6, (file, r)' || fail "mocap bodies of $scene.xml"
done
# Gaussians: a screen of thin discs 1.5 m ahead of the unit, half a metre before the east wall, which --splat-pose puts at its height, and a
# disc 1 m to the left that the cart carries, which its own unit does not see unless it is told to. Ranges to a disc's thickness, 1 mm.
python3 - <<'PY'
import json, struct
def disc(x, y, z, sx, sy, sz):
    return struct.pack("<6f8B", x, y, z, sx, sy, sz, 200, 100, 50, 255, 255, 128, 128, 128)
with open("screen.splat", "wb") as f:
    for i in range(-10, 11):
        for j in range(-10, 11):
            f.write(disc(1.5, .02 * i, .02 * j, .001, .02, .02))
with open("carried.splat", "wb") as f:
    f.write(disc(0, 1, .2, .05, .001, .05))
json.dump({"links": [{"name": "cart", "first": 0, "count": 1}]}, open("carried.splat.links.json", "w"))
PY
[ -z "$("$gsp" scan room.xml --pattern rays.csv --mount unit --splat screen.splat --quiet --npz quiet.npz 2>&1 > /dev/null)" ] || fail "--quiet says something"
splats=(--splat screen.splat --splat-pose "0 0 1.2 1 0 0 0 1" --splat carried.splat)
"$gsp" scan room.xml --pattern rays.csv --mount unit "${splats[@]}" --npz hidden.npz > /dev/null
"$gsp" scan room.xml --pattern rays.csv --mount unit "${splats[@]}" --self-filter none --npz seen.npz --ply seen.ply > /dev/null
"$gsp" scan room.xml --pattern rays.csv --mount unit "${splats[@]}" --self-filter none --trace rides.npz --npz carried.npz > /dev/null
python3 - <<'PY' || fail "Gaussians"
from arrays import array
for name, wanted, splat in (("hidden", (1.5, 3, 1.8), -1), ("seen", (1.5, 1, 1.8), 441)):
    _, r = array(name + ".npz", "range")
    _, s = array(name + ".npz", "splat")
    _, g = array(name + ".npz", "geom")
    assert max(abs(a - b) for a, b in zip(r, wanted)) < 1e-3, (name, r)
    assert 0 <= s[0] < 441 and s[1:] == (splat, -1) and all((a < 0) == (b >= 0) for a, b in zip(g, s)), (name, s, g)
(t, n, r), _ = array("carried.npz", "range")
_, p = array("carried.npz", "point")
left = p[3 * (3 * (t - 1) + 1):][:3]
assert abs(left[0] - .01 * (t - 1)) < 1e-3 and abs(left[1] - 1) < 1e-3, left
PY
echo "<mujoco/>" > empty.xml  # a scene of Gaussians alone
"$gsp" scan empty.xml --pattern rays.csv --mount "0 0 1.2 1 0 0 0" "${splats[@]:0:4}" --npz alone.npz > /dev/null
python3 -c '
from arrays import array
_, r = array("alone.npz", "range"); assert abs(r[0] - 1.5) < 1e-3 and r[1:] == (-1, -1), r' || fail "Gaussians alone"
grep -aq "^element vertex 3$" seen.ply || fail "points on Gaussians in the cloud"

# Bad input: one sentence, exit code 2, no file.
bad() {
  local want="$1"
  shift
  local code=0
  "$gsp" scan "$@" --npz bad.npz > out.txt 2>&1 || code=$?
  [ $code = 2 ] || fail "$*: exit code $code"
  grep -q -- "$want" out.txt || fail "$*: $(cat out.txt)"
  [ "$(wc -l < out.txt)" = 1 ] || fail "$*: more than a line: $(cat out.txt)"
  [ ! -e bad.npz ] || fail "$*: leaves a file"
}
bad "needs --pattern" room.xml --mount unit
bad "needs --mount" room.xml --pattern vlp16
bad "did you mean vlp16" room.xml --pattern vlp61 --mount unit
bad "no site or body 'unit2'" room.xml --pattern vlp16 --mount unit2
bad "no body 'crat'" room.xml --pattern vlp16 --mount "crat 0 0 0 1 0 0 0"
bad "'one' is no number" room.xml --pattern vlp16 --mount "one 0 0 1 0 0 0"
bad "the quaternion is 0" room.xml --pattern vlp16 --mount "0 0 0 0 0 0 0"
bad "needs --trace" room.xml --pattern vlp16 --mount unit --hz 10
bad "there are 1 worlds" room.xml --pattern vlp16 --mount unit --world 1
bad "is not below" room.xml --pattern vlp16 --mount unit --min-range 2 --max-range 1
bad "no such file" room.xml --pattern none.csv --mount unit
bad "no such file" room.xml --pattern grid --mount unit --splat none.ply
bad "--splat-pose is given 1 times" room.xml --pattern grid --mount unit --splat-pose "0 0 0 1 0 0 0 1"
bad "no body 'my crat'" room.xml --pattern vlp16 --mount "my crat 0 0 0 1 0 0 0"
printf 'time,azimuth,zenith\n0,0,90\n0.0000000000001,90,90\n' > close.csv
printf 'time,azimuth,zenith\n0,0,90\n900000,90,90\n' > long.csv
printf 'time,azimuth,zenith\n0,0,90\n0.001,90,90\n' > short.csv
bad "close.csv: its rays repeat every .e-13 s, and --hz takes tables of 1e-6 to 1e6 s" room.xml --pattern close.csv --mount unit --trace rides.npz --hz 10
bad "long.csv: its rays repeat every 1.8e+06 s, and --hz takes tables of 1e-6 to 1e6 s" room.xml --pattern long.csv --mount unit --trace rides.npz --hz 10
bad "repeats every 0.002 s; give at least 500" room.xml --pattern short.csv --mount unit --trace rides.npz --hz 10
printf 'time,azimuth,zenith\n0,0,nan\n' > nan.csv
bad "nan.csv" room.xml --pattern nan.csv --mount unit
echo "scan: all as it should be"
