#!/usr/bin/env bash
# The program does what its page says: traces, starts, controls, pictures, JSON; the same bits for any number of threads, any split and any batch.
#   main_job.sh GSP
set -eu
source "$(dirname "$0")/common.bash" "$1"
python3 "$here/make_inputs.py" .

# every name that scripts lean on
"$gsp" sim cart.xml --worlds 3 --steps 200 --keyframe tilted --json > one.json
for name in seconds steps_per_second startup_seconds peak_bytes contacts rows iterations mean_iterations residual residuals state_hash; do key $name < one.json > /dev/null || fail "sim --json lacks $name"; done
hash=$(key state_hash < one.json)
same "$hash" "$("$gsp" sim cart.xml --worlds 3 --steps 200 --keyframe 0 --json | key state_hash)" "two runs"
same "$hash" "$("$gsp" sim cart.xml --worlds 3 --steps 200 --keyframe 0 --threads 1 --json | key state_hash)" "two threads and one"
same "$hash" "$("$gsp" sim cart.xml --worlds 3 --steps 200 --keyframe 0 --trace t.npz --every 7 --time-from 50 --json | key state_hash)" "with and without a trace"
same "$("$gsp" sim cart.xml --worlds 3 --steps 200 --precision double --json | key contacts)" 3 "contacts of three balls that rest on the floor"

# a world that stops is named, with the step, the joint and the number
"$gsp" sim cart.xml --start start_flies.npz --worlds 2 --steps 5 --json > stops.json 2> stops.txt
grep -qF "1 of 2 worlds stopped" stops.txt || fail "how many worlds stopped: $(cat stops.txt)"
grep -qF "world 1 stopped after 1 steps (0.002 s): a position of joint 'ball' is 1.0008e+10, beyond 1e10" stops.txt || fail "why a world stopped: $(cat stops.txt)"
python3 -c 'import json; s, = json.load(open("stops.json"))["stopped"]; assert (s["world"], s["steps"], s["joint"]) == (1, 1, "ball") and "1.0008e+10" in s["text"], s'

# a keyframe is all of the state: activations and bodies that the user moves too
cat > key.xml <<'XML'
<mujoco><worldbody><body name="m" mocap="true"><geom type="sphere" size=".1" contype="0" conaffinity="0"/></body>
  <body><joint name="j" type="slide" axis="1 0 0"/><geom type="sphere" size=".1" mass="1"/></body></worldbody>
  <actuator><general joint="j" dyntype="integrator"/></actuator>
  <keyframe><key name="pushed" act="2"/><key name="rest"/></keyframe></mujoco>
XML
pushed=$("$gsp" sim key.xml --worlds 2 --steps 100 --keyframe pushed --json | key state_hash)
rest=$("$gsp" sim key.xml --worlds 2 --steps 100 --keyframe rest --json | key state_hash)
[ "$pushed" != "$rest" ] || fail "the activations of a keyframe have no effect"

# traces: the start first, one world equal to the others, a start from a trace
"$gsp" sim cart.xml --worlds 2 --steps 100 --start start.npz --every 10 --trace a.npz > /dev/null
"$gsp" info a.npz | grep -qF 'qpos          float64 (11, 2, 9)' || fail "the shape of the trace: $("$gsp" info a.npz)"
"$gsp" info a.npz | grep -qF 'time          float64 (11,)' || fail "the shape of the times"
python3 - <<'PY'
import struct, zipfile
def load(name, key):
    data = zipfile.ZipFile(name).read(key + ".npy")
    at = 10 + struct.unpack("<H", data[8:10])[0]
    return struct.unpack("<%dd" % ((len(data) - at) // 8), data[at:])
q, t = load("a.npz", "qpos"), load("a.npz", "time")
assert q[:9] == (0, 0.3, 1, 0, 0.5, 1, 0, 0, 0) == q[9:18], "the start comes first"
for k in range(11):
    assert q[18 * k:18 * k + 9] == q[18 * k + 9:18 * k + 18], "worlds with one start stay alike"
    assert abs(t[k] - 0.02 * k) < 1e-9, "time"
assert q[-9 + 1] > 0.3, "the pole falls"
assert q[-9 + 4] < 0.5 - 0.5 * 9.81 * 0.2 ** 2 + 0.01, "the ball falls"
PY
"$gsp" sim cart.xml --start a.npz --steps 10 --trace b.npz --json > b.json
same "$(key worlds < b.json)" 2 "worlds of a start file"

# the last step is in the trace whatever --every is; what was left out is in the JSON; activations go through a trace into the next start
"$gsp" sim key.xml --worlds 2 --steps 100 --keyframe pushed --precision double --every 30 --trace first.npz > /dev/null
"$gsp" info first.npz | grep -qF 'time          float64 (5,)' || fail "the end of the trace is missing: $("$gsp" info first.npz)"
"$gsp" info first.npz | grep -qF 'act           float64 (5, 2, 1)' || fail "the activations of the trace: $("$gsp" info first.npz)"
same "$("$gsp" sim key.xml --steps 50 --start first.npz --precision double --json | key state_hash)" \
  "$("$gsp" sim key.xml --worlds 2 --steps 150 --keyframe pushed --precision double --json | key state_hash)" "a start with activations"
"$gsp" sim lift.urdf --steps 10 --approximate --json > report.json 2> said.txt
same "$(cat said.txt)" "--approximate is without effect: what it was given for is computed; leave it out" "the note of --approximate"
python3 -c 'import json; r = json.load(open("report.json")); assert len(r["notes"]) == 1; r = r["report"]; assert [l["kind"] for l in r].count("left out") == 1 and all(l["text"] for l in r), r'

# what one profile takes and the other does without is told where it is left out alone
echo '<mujoco><option cone="elliptic"/><worldbody><body><freejoint/><geom size=".1" hard="true"/></body></worldbody></mujoco>' > hard.xml
"$gsp" info hard.xml | grep -q 'stable only .*<geom> hard, restitution and erp (profile mujoco does without)' || fail "info does not say which profile takes hard"
"$gsp" info hard.xml | grep -q 'mujoco only .*<option> cone (profile stable does without)' || fail "info does not say which profile takes cone"
for profile in stable:mujoco mujoco:stable; do
  "$gsp" sim hard.xml --steps 1 --profile ${profile%:*} 2> said.txt > /dev/null
  same "$(cat said.txt)" "hard.xml: 1 ${profile#*:} only ('gsp info' lists them)" "what is said of the file in profile ${profile%:*}"
  "$gsp" sim hard.xml --steps 1 --profile ${profile%:*} --json > hard.json
  python3 -c 'import json, sys; assert [l["kind"] for l in json.load(open("hard.json"))["report"]] == [sys.argv[1]]' "${profile#*:} only" || fail "the report of profile ${profile%:*}"
done

# contacts and forces of the last step: two boxes and a ball at rest weigh what they weigh, on every world; the same bits with and without
cat > weights.xml <<'XML'
<mujoco><worldbody><geom type="plane" size="5 5 1"/>
  <body pos="0 0 .099"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/></body>
  <body pos="0 0 .298"><freejoint/><geom type="box" size=".1 .1 .1" mass="3"/></body>
  <body pos="1 0 .049"><joint type="slide" axis="0 0 1"/><geom type="sphere" size=".05" mass=".5" gap=".01"/></body>
  <body pos="2 0 .055"><joint type="slide" axis="1 0 0"/><geom type="sphere" size=".05" mass=".5" gap=".01"/></body></worldbody></mujoco>
XML
for profile in stable mujoco; do
  for precision in float double; do
    run="sim weights.xml --worlds 2 --steps 2000 --profile $profile --precision $precision"
    same "$("$gsp" $run --contacts met.npz --forces forces.npz --json | key state_hash)" "$("$gsp" $run --json | key state_hash)" "with and without --contacts"
    python3 - $profile $precision <<'PY'
import struct, sys, zipfile
# profile mujoco solves to rounding; stable stops at 1e-4 of gravity a row, with up to ten rows here
bar = {"mujoco double": 1e-6, "mujoco float": 1e-3}.get(" ".join(sys.argv[1:]), 5e-3)
def load(name, key, code="d"):
    data = zipfile.ZipFile(name).read(key + ".npy")
    at = 10 + struct.unpack("<H", data[8:10])[0]
    return struct.unpack("<%d%s" % ((len(data) - at) // struct.calcsize(code), code), data[at:])
world, geom1, geom2 = (load("met.npz", key, "i") for key in ("world", "geom1", "geom2"))
dist, pos, frame, force = (load("met.npz", key) for key in ("dist", "pos", "frame", "force"))
n = len(world)
assert list(world) == sorted(world) and set(world) == {0, 1} and (len(dist), len(pos), len(frame), len(force)) == (n, 3 * n, 9 * n, 6 * n)
for w in (0, 1):
    def weight(a, b):  # what b feels from a, along z, of all their contacts
        return [sum(force[6 * c + r] * frame[9 * c + 3 * r + 2] for r in range(3)) for c in range(n) if (world[c], geom1[c], geom2[c]) == (w, a, b)]
    for pair, wanted in (((0, 1), 5 * 9.81), ((1, 2), 3 * 9.81), ((0, 3), .5 * 9.81)):
        assert abs(sum(weight(*pair)) - wanted) < bar * wanted, (w, pair, weight(*pair))
    assert weight(0, 4) == [0.0], "within the gap, and on a rail that bears it"
    for c in range(n):
        assert force[6 * c] >= 0 and abs(frame[9 * c + 2] - 1) < 1e-4, "normals from the lower geom to the upper"
        assert abs(pos[3 * c + 2] - (.2 if geom1[c] == 1 else 0)) < 6e-3 and abs(dist[c]) < 6e-3
q = load("forces.npz", "qfrc_constraint")
assert len(q) == 28
for w in (0, 1):
    own = q[14 * w:14 * w + 14]
    for dof, wanted in ((2, 2 * 9.81), (8, 3 * 9.81), (12, .5 * 9.81), (13, 0)):
        assert abs(own[dof] - wanted) < bar * 29, (dof, own)
PY
  done
done
"$gsp" sim weights.xml --steps 10 --disable contact --contacts none.npz > /dev/null
"$gsp" info none.npz | grep -qF 'force         float64 (0, 6)' || fail "no contacts: $("$gsp" info none.npz)"

# what was saved is gone on from to the bit, twice as in one, with sleep and without; a trace's last entry holds no impulses
cat > many.xml <<'XML'
<mujoco><option timestep=".004"/><worldbody><geom type="plane" size="5 5 1"/>
  <body mocap="true" pos="1 1 1"><geom type="box" size=".1 .1 .1"/></body>
  <body pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/></body>
  <body pos="0 .03 .301" euler="0 0 20"><freejoint/><geom type="box" size=".1 .1 .1" mass="3"/></body>
  <body pos=".5 .1 .7"><freejoint/><geom type="capsule" size=".05 .1" mass="1"/></body>
  <body pos="1.3 0 .3"><joint name="j" axis="0 1 0"/><geom type="capsule" size=".03" fromto="0 0 0 .2 0 0" mass="1"/></body></worldbody>
  <actuator><general joint="j" dyntype="filter" dynprm=".1" biastype="affine" gainprm="5" biasprm="0 -5 -.1"/></actuator>
  <keyframe><key name="pressed" ctrl=".4"/></keyframe></mujoco>
XML
for profile in stable mujoco; do
  for precision in float double; do
    for sleep in "" --sleep; do
      run="sim many.xml --profile $profile --precision $precision $sleep --json"
      whole=$("$gsp" $run --worlds 3 --keyframe pressed --steps 200 | key state_hash)
      "$gsp" $run --worlds 3 --keyframe pressed --steps 100 --save half.npz --trace half_trace.npz > /dev/null
      same "$("$gsp" $run --start half.npz --steps 100 | key state_hash)" "$whole" "2 x 100 steps and 200 ($run)"
      [ "$("$gsp" $run --start half_trace.npz --steps 100 | key state_hash)" != "$whole" ] || fail "the state alone is enough: the test says nothing"
    done
  done
done
"$gsp" $run --start half.npz --steps 50 --save later.npz > /dev/null
same "$("$gsp" $run --start later.npz --steps 50 --save end.npz | key state_hash)" "$whole" "a start saved twice"
"$gsp" $run --worlds 3 --keyframe pressed --steps 200 --save whole.npz > /dev/null
python3 - <<'PY'
import zipfile
end, whole = zipfile.ZipFile("end.npz"), zipfile.ZipFile("whole.npz")
assert end.namelist() == whole.namelist() and len(end.namelist()) > 30
for name in end.namelist():  # sums of times are rounded
    assert name == "time.npy" or end.read(name) == whole.read(name), name + ": two ways to one state save other numbers"
PY
"$gsp" $run --start half.npz --steps 5 --timestep 0.001 2>&1 > /dev/null | grep -qF 'half.npz: was saved with another --timestep: it goes on, but not to the bit' ||
  fail "another timestep than that of the saved file goes unsaid"
[ -z "$("$gsp" $run --start half.npz --steps 5 2>&1 > /dev/null | grep another)" ] || fail "the same options are told as others"
# sleepers are woken where what carried them may be gone: in another model, and with other constraints left out
cat > rests.xml <<'XML'
<mujoco><worldbody><geom type="plane" size="5 5 1"/><body pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1"/></body></worldbody></mujoco>
XML
sed 's|<geom type="plane" size="5 5 1"/>||' rests.xml > floorless.xml
"$gsp" sim rests.xml --steps 300 --sleep --save rests.npz --json | key asleep | grep -qx 1 || fail "the box does not sleep"
for other in "rests.xml --disable contact" "floorless.xml"; do
  "$gsp" sim $other --sleep --start rests.npz --steps 100 --trace falls.npz --json > falls.json 2> said.txt || fail "sim $other"
  grep -qF ': it goes on, with all awake, but not to the bit as it would have' said.txt || fail "$other goes on in silence: $(cat said.txt)"
  python3 -c 'import json; assert len(json.load(open("falls.json"))["notes"]) == 1' || fail "the notes of --json"
  python3 - <<'PY' || fail "what slept on a floor floats without it ($other)"
import struct, zipfile
data = zipfile.ZipFile("falls.npz").read("qpos.npy")
assert struct.unpack("<d", data[-40:-32])[0] < 0
PY
done
[ -z "$("$gsp" sim rests.xml --sleep --start rests.npz --steps 5 2>&1 > /dev/null | grep another)" ] || fail "the same model is told as another"
"$gsp" info half.npz | grep -qF 'qpos          float64 (1, 3, 22)' || fail "what is saved is no start: $("$gsp" info half.npz)"
"$gsp" sim many.xml --keyframe pressed --steps 100 --save one.npz > /dev/null
"$gsp" sim many.xml --start one.npz --worlds 2 --steps 100 --trace two.npz > /dev/null  # one world for all
"$gsp" sim many.xml --keyframe pressed --steps 200 --trace one_trace.npz > /dev/null
"$gsp" sim many.xml --start one.npz --sleep --steps 10 > /dev/null || fail "a start without sleep"
python3 - <<'PY'
import struct, zipfile
def last(name, worlds):
    data = zipfile.ZipFile(name).read("qpos.npy")
    return [data[-22 * 8 * (w + 1):][:22 * 8] for w in range(worlds)]
assert last("two.npz", 2) == last("one_trace.npz", 1) * 2
data = zipfile.ZipFile("two.npz").read("time.npy")
assert abs(struct.unpack("<d", data[-8:])[0] - 0.8) < 1e-12, "time goes on"
PY

# controls: half a newton on the cart of one world, minus that on the other
"$gsp" sim cart.xml --worlds 2 --ctrl ctrl_worlds.npy --trace c.npz > /dev/null
python3 - <<'PY'
import struct, zipfile
data = zipfile.ZipFile("c.npz").read("qvel.npy")
at = 10 + struct.unpack("<H", data[8:10])[0]
v = struct.unpack("<%dd" % ((len(data) - at) // 8), data[at:])[-16:]
assert v[0] > 1e-4 and abs(v[0] + v[8]) < 1e-3 * v[0], v
PY

# pictures: shapes, names, the same for any batch and any number of threads, a trace with one camera
"$gsp" render --splat disc.ply --cameras cameras.npz --width 64 --height 48 --channels rgb,depth,alpha --npz p.npz --out pngs --json > p.json
for name in seconds frames_per_second startup_seconds peak_bytes; do key $name < p.json > /dev/null || fail "render --json lacks $name"; done
"$gsp" info p.npz > shapes.txt
for line in 'rgb           float32 (2, 48, 64, 3)' 'depth         float32 (2, 48, 64)' 'alpha         float32 (2, 48, 64)'; do grep -qF "$line" shapes.txt || fail "no '$line' in $(cat shapes.txt)"; done
for name in rgb_0000 rgb_0001 depth_0000 depth_color_0001 alpha_0000; do [ -s pngs/$name.png ] || fail "no pngs/$name.png"; done
"$gsp" info pngs/depth_0000.png | grep -qF '64 x 48, 1 channels of 16 bits' || fail "depth is not 16 bits"
"$gsp" render --splat disc.ply --cameras cameras.npz --width 64 --height 48 --channels rgb,depth,alpha --npz p1.npz --batch 1 --threads 1 > /dev/null
cmp p.npz p1.npz || fail "a batch of one gives other pictures"
# one K is for all cameras
for K in one_K flat_K; do
  "$gsp" render --splat disc.ply --cameras cameras_$K.npz --width 64 --height 48 --channels rgb,depth,alpha --npz p_$K.npz > /dev/null
  cmp p.npz p_$K.npz || fail "one K for all gives other pictures than one a camera ($K)"
done
# lenses: of zeros none, else other pictures; a row for all or one a camera
for lens in plain lens fisheye; do "$gsp" render --splat disc.ply --cameras cameras_$lens.npz --width 64 --height 48 --channels rgb,depth,alpha --npz p_$lens.npz > /dev/null; done
cmp p.npz p_plain.npz || fail "a lens of zeros gives other pictures"
for lens in one_lens row_lens; do "$gsp" render --splat disc.ply --cameras cameras_$lens.npz --width 64 --height 48 --channels rgb,depth,alpha --npz p_$lens.npz > /dev/null; done
"$gsp" render --splat disc.ply --cameras cameras_misnamed.npz --width 64 --height 48 --channels rgb --npz p_misnamed.npz 2>&1 | grep -qF 'cameras_misnamed.npz: arrays that are not of cameras: dist' || fail "an array of another name is not told of"
cmp p_one_lens.npz p_row_lens.npz || fail "coefficients of shape (1, n) give other pictures than those of shape (n)"
if cmp -s p.npz p_lens.npz || cmp -s p.npz p_row_lens.npz || cmp -s p.npz p_fisheye.npz; then fail "a lens gives a pinhole's pictures"; fi
"$gsp" render --splat disc.ply --cameras camera.npz --model cart.xml --trace a.npz --width 64 --height 48 --channels depth --npz d.npz > /dev/null
"$gsp" info d.npz | grep -qF 'depth         float32 (22, 48, 64)' || fail "a trace of 11 entries of 2 worlds gives 22 pictures"
python3 - <<'PY'
import struct, zipfile
data = zipfile.ZipFile("d.npz").read("depth.npy")
at = 10 + struct.unpack("<H", data[8:10])[0]
n = 48 * 64
pictures = [data[at + 4 * n * k:at + 4 * n * (k + 1)] for k in range(22)]
for t in range(11):
    assert pictures[2 * t] == pictures[2 * t + 1], "worlds alike look alike"
assert pictures[0] != pictures[20], "the robot moves in the pictures"
PY

# cameras of the model: the picture of the same camera in a file; one on a body goes with it
"$gsp" render --splat disc.ply --model eye.xml --camera side --width 64 --height 48 --channels depth --npz side.npz > /dev/null
"$gsp" render --splat disc.ply --model eye.xml --cameras side_camera.npz --width 64 --height 48 --channels depth --npz file.npz > /dev/null
"$gsp" render --splat disc.ply --model eye.xml --camera 1 --width 64 --height 48 --channels depth --npz on.npz > /dev/null
# pictures that show no Gaussian are told of, by the camera's name or the pictures' numbers
tells() {  # what it says on stderr, or nothing; options of gsp render
  local what="$1"
  shift
  "$gsp" render --splat disc.ply --width 64 --height 48 "$@" > /dev/null 2> said.txt
  if [ -z "$what" ]; then [ ! -s said.txt ] || fail "it says: $(cat said.txt) ($*)"; else grep -qxF -- "$what" said.txt || fail "it says: $(cat said.txt) ($*)"; fi
}
for channels in rgb depth alpha; do tells 'picture 1 of 2 shows no Gaussian: turn the camera to the scene, or let --splat-pose say where that stands' --cameras cameras_astray.npz --channels $channels --npz astray.npz; done
tells '' --cameras cameras_astray.npz --npz astray.npz --quiet
tells '' --cameras cameras_astray.npz --npz astray.npz --json
tells 'nothing is written; --out, --npz or --video say what to keep' --cameras cameras_astray.npz  # pictures stay on the device, so nobody looks for empty ones
tells '' --cameras cameras.npz --npz astray.npz
sed 's|<worldbody>|<worldbody><camera name="wall" pos="0 -3 .5" xyaxes="-1 0 0 0 0 1"/>|' cart.xml > wall.xml
tells "camera 'wall' sees no Gaussian in 22 of 22 pictures: turn the camera to the scene, or let --splat-pose say where that stands" --model wall.xml --trace a.npz --camera wall --npz astray.npz
tells 'pictures 0, 1, 2, 3, 4, 5, 6, 7 ... of 22 show no Gaussian (22): turn the camera to the scene, or let --splat-pose say where that stands' --model wall.xml --trace a.npz --cameras away.npz --npz astray.npz
# a lens that grows much faster in the corners than in the middle is told of: r = 1.95 comes to 2, where it grows 3.4 times as fast
"$gsp" render --splat disc.ply --cameras cameras_steep.npz --channels alpha 2> said.txt > /dev/null
grep -qF 'cameras_steep.npz[distortion]: the lens of camera 1 grows up to 3.4 times as fast in the corners as in the middle' said.txt || fail "a steep lens is not told of: $(cat said.txt)"
"$gsp" render --splat disc.ply --cameras cameras_mild.npz --channels alpha --npz mild.npz 2> said.txt > /dev/null
[ ! -s said.txt ] || fail "a mild lens is told of: $(cat said.txt)"
tells '' --cameras cameras_steep.npz --quiet
# a keyframe places mocap bodies too: as where the model has them there
cat > mocap.xml <<'XML'
<mujoco><worldbody><camera name="c" pos="0 -3 1" xyaxes="1 0 0 0 0 1"/><body name="mc" mocap="true" pos=".2 0 1"><geom size=".3" rgba="1 0 0 1"/></body>
  <body><joint/><geom size=".01" pos="9 9 9"/></body></worldbody><keyframe><key mpos=".8 0 1"/></keyframe></mujoco>
XML
sed 's/pos=".2 0 1"/pos=".8 0 1"/' mocap.xml > mocap_there.xml
"$gsp" render --splat disc.ply --model mocap.xml --camera c --width 64 --height 48 --channels depth --npz mocap_here.npz > /dev/null
"$gsp" render --splat disc.ply --model mocap.xml --camera c --keyframe 0 --width 64 --height 48 --channels depth --npz mocap_key.npz > /dev/null
"$gsp" render --splat disc.ply --model mocap_there.xml --camera c --width 64 --height 48 --channels depth --npz mocap_there.npz > /dev/null
cmp -s mocap_key.npz mocap_there.npz && ! cmp -s mocap_key.npz mocap_here.npz || fail "the mocap body of a keyframe in a picture"
"$gsp" render --splat disc.ply --model eye.xml --camera side --trace moved.npz --width 64 --height 48 --channels depth --npz side_trace.npz > /dev/null
"$gsp" render --splat disc.ply --model eye.xml --camera on --trace moved.npz --width 64 --height 48 --channels depth --npz on_trace.npz > /dev/null
python3 - <<'PY'
import struct, zipfile
def load(name):
    data = zipfile.ZipFile(name).read("depth.npy")
    at = 10 + struct.unpack("<H", data[8:10])[0]
    v = struct.unpack("<%df" % ((len(data) - at) // 4), data[at:])
    n = 64 * 48
    return [v[n * k:n * (k + 1)] for k in range(len(v) // n)]
def off(a, b):
    return max(abs(x - y) for x, y in zip(a, b))
side, file, on = load("side.npz"), load("file.npz"), load("on.npz")
assert len(side) == 1 and max(side[0]) > 1 and off(side[0], file[0]) < 1e-3, off(side[0], file[0])
assert off(side[0], on[0]) < 1e-3, "the cart stands where the file has it: both cameras at one place"
still, moving = load("side_trace.npz"), load("on_trace.npz")
assert len(still) == len(moving) == 22
assert off(still[20], moving[20]) > 1e-3, "the camera on the cart moves"
PY

# URDF: sizes, the report with file and line, and free fall of all of it: v = -g t, and q = -g h^2 n (n + 1) / 2 after n steps of h
"$gsp" info lift.urdf --json > lift.json
"$gsp" info lift.urdf --json --floating-base > floating.json
"$gsp" info lift.urdf | grep -qF "URDF model 'lift'" || fail "info of a URDF file"
"$gsp" info lift.urdf | grep -q 'left out .*lift.urdf:5: .*blade.obj: line 10: faces from here on (1)' || fail "the load report lacks the faces of the second object"
"$gsp" sim lift.urdf --worlds 2 --steps 100 --timestep 0.002 --precision double --trace lift.npz --json > lift_run.json
same "$(key worlds < lift_run.json)" 2 "worlds of a URDF robot"
python3 - <<'PY'
import json, struct, zipfile
def sizes(name):
    info = json.load(open(name))
    return info, [info[key] for key in ("nq", "nv", "nbody", "ngeom", "nu", "neq", "ntendon", "nsensor", "nkey", "nmesh")]
info, fixed = sizes("lift.json")
assert fixed == [3, 3, 5, 2, 0, 1, 0, 0, 0, 1], fixed
assert info["model"] == "lift" and [line["kind"] for line in info["report"]].count("left out") == 1, info["report"]
assert all(line["file"] == "lift.urdf" and line["line"] > 0 for line in info["report"]), info["report"]
assert sizes("floating.json")[1] == [10, 9, 5, 2, 0, 1, 0, 0, 0, 1], "a free joint more"
def load(key):
    data = zipfile.ZipFile("lift.npz").read(key + ".npy")
    at = 10 + struct.unpack("<H", data[8:10])[0]
    return struct.unpack("<%dd" % ((len(data) - at) // 8), data[at:])
h, n, g = 0.002, 100, 9.81
for world in (0, 1):
    q, v = load("qpos")[-6 + 3 * world:][:3], load("qvel")[-6 + 3 * world:][:3]
    assert abs(v[0] + g * n * h) < 1e-12 and abs(q[0] + g * h * h * n * (n + 1) / 2) < 1e-12, (q, v)
    assert max(abs(x) for x in q[1:] + v[1:]) < 1e-12, "the fingers fall with the carriage"
PY

# what a file holds
"$gsp" info cart.xml | grep -qF "nq 9, nv 8" || fail "info of the model"
# ... and what gsp sim would say to it
"$gsp" info cart.xml | tail -1 | grep -q '^  verdict  *gsp sim takes it as it is$' || fail "verdict on cart.xml: $("$gsp" info cart.xml | tail -1)"
"$gsp" info condim.xml | tail -1 | grep -q '^  verdict  *gsp sim takes it as it is' || fail "verdict on condim.xml: $("$gsp" info condim.xml | tail -1)"
"$gsp" info lift.urdf | tail -1 | grep -q 'gsp sim takes it as it is' || fail "verdict on lift.urdf: $("$gsp" info lift.urdf | tail -1)"
"$gsp" info winch.xml | tail -1 | grep -q "verdict .*gsp sim refuses it: winch.xml: tendon 'winch' has armature and wraps" || fail "verdict on winch.xml: $("$gsp" info winch.xml | tail -1)"
same "$("$gsp" info string.xml --json | key taken)" True "string.xml is taken"
same "$("$gsp" info winch.xml --json | key taken)" False "winch.xml is taken"
for file in cart.xml condim.xml lift.urdf string.xml winch.xml; do  # the verdict is what happens
  flags=$("$gsp" info $file --json | python3 -c 'import json, sys; print(*json.load(sys.stdin)["flags"])')
  taken=$("$gsp" info $file --json | key taken)
  if "$gsp" sim $file --steps 2 $flags > /dev/null 2>&1; then same "$taken" True "$file"; else same "$taken" False "$file"; fi
done
"$gsp" info disc.ply | grep -qF "400 Gaussians" || fail "info of Gaussians"

# the main job on the user's files, and on the library's own
"$gsp" quickstart --model cart.xml --splat disc.ply --splat-pose "0 0 0 1 0 0 0 1" --worlds 3 --seconds 0.1 --width 64 --height 48 --out mine > mine.txt
# a scene that is turned: it is said, and the same can be asked for
"$gsp" quickstart --model cart.xml --splat disc.ply --worlds 2 --seconds 0.1 --width 64 --height 48 --out turned > turned.txt
pose=$(sed -n 's/.*turned upright.*--splat-pose "\(.*\)" does$/\1/p' turned.txt)
[ -n "$pose" ] || fail "quickstart does not say that it turns the scene: $(cat turned.txt)"
"$gsp" quickstart --model cart.xml --splat disc.ply --splat-pose "$pose" --worlds 2 --seconds 0.1 --width 64 --height 48 --out asked > asked.txt
grep -q 'turned upright' asked.txt && fail "quickstart says that it turns a scene that it does not turn"
cmp turned/depth_mm.png asked/depth_mm.png || fail "the pose that quickstart names gives other pictures"
"$gsp" quickstart --worlds 2 --seconds 0.1 --width 64 --height 48 --out own > own.txt
for name in load steps/s frames/s memory; do grep -q "^  $name " own.txt || fail "the table lacks $name"; done
for folder in mine own; do
  for name in worlds depth_color depth_mm animation; do "$gsp" info $folder/$name.png > /dev/null || fail "$folder/$name.png"; done
done
"$gsp" bench stack --worlds 2 --json | key steps_per_second > /dev/null
echo "all is as the page says"
