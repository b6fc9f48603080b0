#!/usr/bin/env bash
# gsp sim --sensors: of the states of the trace, and steps are what they are without it; weights at rest by the closed form; bad input.
#   sensors.sh GSP
set -eu
source "$(dirname "$0")/common.bash" "$1"
# A box of 2 kg that falls onto the floor, and a rod on a hinge that swings; a distance of a body with a height
# field, which nobody computes.
cat > model.xml <<'XML'
<mujoco><option timestep=".002"/><asset><hfield name="hills" nrow="2" ncol="2" size="1 1 1 1" elevation="0 1 0 0"/></asset><worldbody><geom type="plane" size="5 5 1"/>
  <body name="box" pos="0 0 .11"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/><site name="box" type="box" size=".12 .12 .12"/></body>
  <body name="ground" pos="20 0 -5"><geom type="hfield" hfield="hills"/></body>
  <body name="rod" pos="3 0 2"><joint name="hinge" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .5 0 0" size=".02" mass="1"/><site name="tip" pos=".5 0 0"/></body>
</worldbody>
<sensor>
  <touch name="weight" site="box"/><jointpos name="angle" joint="hinge"/><jointvel name="rate" joint="hinge"/>
  <distance name="range" body1="box" body2="ground" cutoff="9"/><accelerometer name="acc" site="box"/><contact name="found" body1="box" num="1" data="found"/>
</sensor>
</mujoco>
XML
for profile in stable mujoco; do
  "$gsp" sim model.xml --profile $profile --precision double --steps 1001 --every 100 --trace with.npz --sensors s.npz --json > with.json
  "$gsp" sim model.xml --profile $profile --precision double --steps 1001 --every 100 --trace without.npz --json > without.json 2> /dev/null
  cmp with.npz without.npz || fail "the steps, profile $profile"
  python3 - <<'PY' || fail "contacts and counts of the last step, profile $profile"
import json
a, b = (json.load(open(f)) for f in ("with.json", "without.json"))
assert all(a[k] == b[k] for k in ("state_hash", "contacts", "rows", "iterations")), (a, b)
PY
  grep -q "range.*has NaN there" with.json || fail "nothing is said of the distance: $(cat with.json)"
  python3 - <<'PY' || fail "what sensors say, profile $profile"
from arrays import array
(t, n, k), s = array("s.npz", "sensordata")
_, time = array("s.npz", "time")
_, when = array("with.npz", "time")
_, qpos = array("with.npz", "qpos")
_, qvel = array("with.npz", "qvel")
_, adr = array("s.npz", "adr")
_, dim = array("s.npz", "dim")
names = bytes(array("s.npz", "names")[1]).decode().split("\n")
assert names == ["weight", "angle", "rate", "range", "acc", "found"] and (t, n, k) == (12, 1, 8) and time == when
assert adr == (0, 1, 2, 3, 4, 7) and dim == (1, 1, 1, 1, 3, 1)
row = lambda e: s[8 * e:8 * e + 8]
for e in range(t):  # of the very states of the trace
    assert row(e)[1] == qpos[8 * e + 7] and row(e)[2] == qvel[7 * e + 6], e
    assert row(e)[3] != row(e)[3]  # NaN: nobody evaluates it
rest = row(t - 1)
# 2 kg at rest: its weight within a thousandth, an accelerometer that feels it, four corners that touch
assert abs(rest[0] - 2 * 9.81) < .02 and abs(rest[6] - 9.81) < .01 and rest[7] == 4, rest
assert row(0)[0] == 0 and abs(row(0)[6]) < 1e-9 and row(0)[7] == 0, row(0)  # it falls freely
PY
done
# Sensors that speak late, in steps of 10 ms; a file of --save has what they have measured.
cat > late.xml <<'XML'
<mujoco><option timestep=".01"/><worldbody><body><joint axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></body></worldbody>
<sensor><clock delay=".02" nsample="4"/><clock delay=".015" nsample="4" interp="linear"/><clock interval=".03 -.01" nsample="2"/></sensor></mujoco>
XML
"$gsp" sim late.xml --precision double --steps 9 --sensors all.npz > /dev/null
"$gsp" sim late.xml --precision double --steps 4 --sensors first.npz --save save.npz > /dev/null
"$gsp" sim late.xml --precision double --steps 5 --start save.npz --sensors second.npz > /dev/null
python3 - <<'PY' || fail "what late sensors say"
from arrays import array
s, first, second = (array(f, "sensordata")[1] for f in ("all.npz", "first.npz", "second.npz"))
want = (0, 0, 0, 0, 0, 0, 0, .005, .02, .01, .015, .02, .02, .025, .02, .03, .035, .05)
assert all(abs(a - b) < 1e-15 for a, b in zip(s, want)), s
assert s[:15] == first and s[12:] == second, (first, second)
PY
# The clock is the state's time: of a keyframe, of the entry of a trace, and of a file of --save.
cat > clock.xml <<'XML'
<mujoco><option timestep=".01"/><worldbody><body pos="0 0 1"><freejoint/><geom size=".1"/></body></worldbody>
<sensor><clock/><clock cutoff="2.015"/><clock delay=".01" nsample="3"/></sensor><keyframe><key name="k" time="2"/></keyframe></mujoco>
XML
"$gsp" sim clock.xml --precision double --worlds 2 --keyframe k --steps 3 --trace t.npz --sensors key.npz --save k.npz > said.txt
grep -q "sensordata of 4 states of 2 worlds" said.txt || fail "the states of --sensors: $(cat said.txt)"
"$gsp" sim clock.xml --precision double --start t.npz --steps 2 --sensors on.npz > said.txt
grep -q "sensordata of 3 states of 2 worlds" said.txt || fail "the states of --sensors without a trace: $(cat said.txt)"
"$gsp" sim clock.xml --precision double --start k.npz --steps 2 --sensors saved.npz > /dev/null
python3 - <<'PY' || fail "clocks"
from arrays import array
for file, first in (("key.npz", 2), ("on.npz", 2.03), ("saved.npz", 2.03)):
    (t, n, k), s = array(file, "sensordata")
    _, time = array(file, "time")
    assert abs(time[0] - first) < 1e-14, time
    for e in range(t):
        for w in range(n):
            clock, cut, late = s[(e * n + w) * k:(e * n + w + 1) * k]
            assert abs(clock - time[e]) < 1e-14 and abs(cut - min(time[e], 2.015)) < 1e-14, (file, e, clock, cut)
            assert e == 0 or abs(late - time[e] + .01) < 1e-14, (file, e, late)
PY
bad() {
  local want="$1" code=0
  shift
  "$gsp" sim "$@" > out.txt 2>&1 || code=$?
  [ $code = 2 ] && grep -q -- "$want" out.txt || fail "$*: exit code $code, $(cat out.txt)"
}
sed '/<sensor>/,/<\/sensor>/d' model.xml > none.xml
bad "has no sensors" none.xml --steps 2 --sensors s2.npz
[ ! -e s2.npz ] || fail "a file for no sensors"
bad "needs --trace or --sensors" model.xml --steps 2 --every 2
bad "does not exist" model.xml --steps 2 --sensors nowhere/s.npz
echo "sensors: all as it should be"
