#!/usr/bin/env bash
# gsp bench physics: the fields of its JSON on a scene that needs no file, a model of one's own, what it refuses, and MuJoCo beside it where
# its library is there.
#   bench.sh GSP
set -eu
source "$(dirname "$0")/common.bash" "$1"
unset GSP_DATA_DIR GSP_MUJOCO
# refused WORDS... -- ARGUMENTS...: exit code 2 and one line on stderr that holds the words.
refused() {
  local words=() code=0
  while [ "$1" != -- ]; do
    words+=("$1")
    shift
  done
  shift
  "$gsp" "$@" > out.txt 2> error.txt || code=$?
  [ $code = 2 ] || fail "gsp $*: exit code $code"
  [ "$(wc -l < error.txt)" = 1 ] || fail "gsp $*: $(cat error.txt)"
  for word in "${words[@]}"; do grep -qF -- "$word" error.txt || fail "gsp $*: no '$word' in: $(cat error.txt)"; done
}

"$gsp" bench physics --worlds 4 --from 20 --steps 10 --repeats 5 --threads 1 --json > own.json
"$gsp" bench physics --scene quadruped --worlds 4 --from 20 --steps 10 --repeats 1 --threads 1 --json > once.json
python3 - <<'PY' || fail "the JSON of bench physics"
import json, math
own, once = (json.loads(open(name).read()) for name in ("own.json", "once.json"))
assert own["bench"] == "physics" and own["scene"] == "quadruped" and own["peers"] == []
assert (own["worlds"], own["from"], own["steps"], own["repeats"]) == (4, 20, 10, 5)
assert own["slowest"] <= own["steps_per_second"] <= own["fastest"]
assert math.isclose(own["steps_per_second"], 4 * 10 / own["seconds"], rel_tol=1e-9)
stages = own["stages"]  # seconds of a world and step; the window with clocks takes about as long as those without, on a busy machine up to
for name in ("dynamics::smooth_dynamics", "collision::collide", "constraint::assemble", "solver::pgs", "dynamics::integrate", "other"):
    assert stages[name] >= 0, name
assert sum(stages.values()) > 0.1 / own["fastest"]  # ten times
assert own["rows"] > 0 and own["contacts"] > 0 and own["bytes_per_world"] > 1000 and own["residual"] >= 0
assert math.isclose(own["row_sweeps"], own["rows"] / 4 * own["mean_iterations"], rel_tol=1e-9)
assert 0 < own["penetration"]["mean"] <= own["penetration"]["max"] < 0.01 and own["penetration"]["contacts"] <= own["contacts"]
assert 0 < own["drift"]["mean"] <= own["drift"]["max"] < 0.1
assert own["failed_worlds"] == 0 and own["residuals"]["rate"]["max"] >= 0
assert own["state_hash"] == once["state_hash"]  # each window begins where the first began
PY
"$gsp" bench physics --worlds 2 --from 0 --steps 2 --repeats 1 --threads 1 > text.txt
grep -q "2 worlds, 2 steps of 0.002 s after 0" text.txt || fail "$(cat text.txt)"

cat > ball.xml <<'XML'
<mujoco><worldbody><geom type="plane" size="5 5 1"/><body pos="0 0 .099"><freejoint/><geom type="sphere" size=".1"/></body></worldbody></mujoco>
XML
"$gsp" bench physics --model ball.xml --worlds 2 --steps 5 --threads 1 --profile mujoco --precision double --json > ball.json
grep -q '"profile":"mujoco","precision":"double"' ball.json || fail "$(cat ball.json)"

refused "--scene is 'humanoids'" "pyramid" -- bench physics --scene humanoids
refused "names quadruped twice" -- bench physics --scene quadruped,quadruped
refused "--scene and --model contradict" -- bench physics --scene pyramid --model ball.xml
refused "missing.xml" "no such file" -- bench physics --model missing.xml
refused "humanoid.xml" "GSP_DATA_DIR" "--model" -- bench physics --scene humanoid
refused "--repeats is '0'" -- bench physics --repeats 0
refused "--steps is '0'" -- bench physics --steps 0
refused "--peer-solver needs --peers" -- bench physics --peer-solver cg
refused "--peer-solver is 'lcp'" "newton" -- bench physics --peers --peer-solver lcp --mujoco ball.xml
refused "--peers needs MuJoCo's library" "GSP_MUJOCO" -- bench physics --peers
refused "ball.xml" "libmujoco.so.4.0.1" -- bench physics --peers --mujoco "$PWD/ball.xml"
refused "--scene is of bench physics" -- bench stack --scene pyramid
if ! ldd "$gsp" | grep -q libcuda; then
  libc="$(ldd "$gsp" | awk '/libc\.so/ { print $3 }')"
  refused "has no mj_version" -- bench physics --peers --mujoco "$libc"
fi

mujoco="${GSP_CACHE_DIR:-${XDG_CACHE_HOME:-$HOME/.cache}/gsp}/mujoco-core-4.0.1/mujoco/libmujoco.so.4.0.1"
if [ -e "$mujoco" ] && ! ldd "$gsp" | grep -q libcuda; then
  "$gsp" bench physics --worlds 3 --from 20 --steps 10 --threads 2 --peers --peer-solver newton,cg --mujoco "$mujoco" --precision double --profile mujoco --json > both.json
  python3 - <<'PY' || fail "MuJoCo beside gsp"
import json
both = json.loads(open("both.json").read())
assert [p["solver"] for p in both["peers"]] == ["newton", "cg"]
for p in both["peers"]:
    assert p["warning"] == "" and p["threads"] == both["peers"][0]["threads"] and p["slowest"] <= p["steps_per_second"] <= p["fastest"]
    assert p["times_as_fast"]["least"] <= p["times_as_fast"]["median"] <= p["times_as_fast"]["most"]
    # Both solve one problem: after 30 steps the same shapes touch, as deep, and bodies went as far (shares of 1e-3: 30 steps of a robot that
    # settles part by what the solvers leave, 1e-8).
    assert p["penetration"]["contacts"] == both["penetration"]["contacts"], p
    assert abs(p["drift"]["mean"] / both["drift"]["mean"] - 1) < 1e-3, p
PY
fi
