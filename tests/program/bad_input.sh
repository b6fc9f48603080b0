#!/usr/bin/env bash
# Every bad input: exit code 2, one sentence on stderr that names file, place and remedy, nothing on stdout, nothing under the name of an output.
#   bad_input.sh GSP
set -u
source "$(dirname "$0")/common.bash" "$1"
python3 "$here/make_inputs.py" . || exit 1
failures=0 cases=0

# refused "part" ["part" ...] -- words of the command
refused() {
  local parts=()
  while [ "$1" != -- ]; do parts+=("$1"); shift; done
  shift
  cases=$((cases + 1))
  "$gsp" "$@" >out.txt 2>err.txt </dev/null
  local code=$? problem=
  [ $code = 2 ] || problem="exit code $code instead of 2"
  [ "$(wc -l <err.txt)" = 1 ] || problem="$problem; $(wc -l <err.txt) lines on stderr instead of one"
  [ ! -s out.txt ] || problem="$problem; it wrote to stdout"
  for part in "${parts[@]}"; do grep -qF -- "$part" err.txt || problem="$problem; the sentence lacks '$part'"; done
  for left in result.npz result.mp4 result.apng result.ply result.spz result.xyz pictures *.partial-*; do [ ! -e "$left" ] || problem="$problem; it left $left"; done
  if [ -n "$problem" ]; then
    failures=$((failures + 1))
    printf 'gsp %s: %s\n  %s\n' "$*" "${problem#; }" "$(head -c 600 err.txt)"
    rm -rf result.npz pictures ./*.partial-*
  else
    printf 'ok: %s\n' "$(cat err.txt)"
  fi
}

# command line
refused "'smi'" "did you mean sim" -- smi cart.xml
refused "MODEL.xml" "--help" -- sim
refused "'extra'" -- sim cart.xml extra
refused "'--wrlds'" "did you mean --worlds" -- sim cart.xml --wrlds 3
refused "'--zzzzzzzz'" "--help" -- sim cart.xml --zzzzzzzz
refused "--worlds needs a value" -- sim cart.xml --worlds
refused "--worlds needs a value" -- sim cart.xml --worlds --json
refused "--worlds is '0'" "whole number" -- sim cart.xml --worlds 0
refused "--worlds is 'many'" -- sim cart.xml --worlds many
refused "--worlds is '-3'" -- sim cart.xml --worlds -3
refused "--worlds is '99999999999999999999'" -- sim cart.xml --worlds 99999999999999999999
refused "--worlds is given twice" -- sim cart.xml --worlds 2 --worlds 3
refused "--timestep is 'nan'" -- sim cart.xml --timestep nan
refused "--timestep is '-0.1'" -- sim cart.xml --timestep -0.1
refused "--timestep is '0.1s'" -- sim cart.xml --timestep 0.1s
refused "--profile is 'fast'" "mujoco or stable" -- sim cart.xml --profile fast
refused "--precision is 'half'" "float or double" -- sim cart.xml --precision half
refused "--device is 'tpu'" "cpu or cuda" -- sim cart.xml --device tpu
refused "--json takes no value" -- sim cart.xml --json=yes
refused "--trace has an empty value" -- sim cart.xml --trace=
refused "--keyframe and --start contradict" -- sim cart.xml --keyframe tilted --start start.npz
refused "--sleep and --disable sleep contradict each other" -- sim cart.xml --sleep --disable limit,sleep
refused "--every needs --trace" -- sim cart.xml --every 5
refused "--contacts has an empty value" -- sim cart.xml --contacts=
refused "no/such/folder" "--forces" -- sim cart.xml --forces no/such/folder/f.npz --trace result.npz
refused "--time-from 100" "less than --steps" -- sim cart.xml --steps 100 --time-from 100
refused "--keyframe and --trace contradict" -- render --splat disc.ply --cameras cameras.npz --model cart.xml --keyframe 0 --trace start.npz
refused "--trace needs --model" -- render --splat disc.ply --cameras cameras.npz --trace start.npz
refused "needs --splat" -- render --cameras cameras.npz
refused "eye.xml: has no camera 'sid'" "(side, on)" "or an index from 0" -- render --splat disc.ply --model eye.xml --camera sid
refused "has no camera '2'; it has 2" -- render --splat disc.ply --model eye.xml --camera 2
refused "has no camera '0' (it has none); leave out --camera" -- render --splat disc.ply --model cart.xml --camera 0
refused "--camera needs --model" -- render --splat disc.ply --camera side
refused "--cameras and --camera contradict" -- render --splat disc.ply --model eye.xml --camera side --cameras cameras.npz
refused "needs --cameras" -- render --splat disc.ply
refused "--channels is 'colour'" -- render --splat disc.ply --cameras cameras.npz --channels rgb,colour
refused "names rgb twice" -- render --splat disc.ply --cameras cameras.npz --channels rgb,rgb
refused "--alpha-max is '2'" -- render --splat disc.ply --cameras cameras.npz --alpha-max 2
refused "eight numbers" -- render --splat disc.ply --splat-pose "0 0 0" --cameras cameras.npz
refused "no bench 'fast'" "quadruped" -- bench fast
refused "needs FROM TO" -- convert disc.ply
refused "'extra' is one word too many" -- convert disc.ply result.ply extra
refused "its ending names no format" "end it in .ply" -- convert disc.ply result.xyz
refused "TO would replace what FROM names" -- convert disc.ply disc.ply
refused "missing.ply" "no such file" -- convert missing.ply result.ply
refused "cut.spz" -- convert cut.spz result.ply
refused "--spz-version is for .spz files" -- convert disc.ply result.ply --spz-version 3
refused "--spz-version is '1'" -- convert disc.ply result.spz --spz-version 1
refused "--sh-degree is '4'" -- convert disc.ply result.ply --sh-degree 4
refused "needs SPLAT" -- prune --out result.ply
refused "needs --out P" -- prune disc.ply
refused "--keep is '0'" "above 0 and up to 1" -- prune disc.ply --out result.ply --keep 0
refused "--keep is '1.5'" -- prune disc.ply --out result.ply --keep 1.5
refused "its ending names no format" -- prune disc.ply --out result.xyz
refused "--out would replace what SPLAT names" -- prune disc.ply --out disc.ply
refused "missing.ply" "no such file" -- prune missing.ply --out result.ply
refused "--trace needs --model" -- prune disc.ply --out result.ply --trace start.npz
refused "--cameras and --camera contradict" -- prune disc.ply --out result.ply --model eye.xml --camera side --cameras cameras.npz
refused "cart.xml: has no camera" "--cameras" -- prune disc.ply --out result.ply --model cart.xml
refused "eye.xml: has no camera 'sid'" -- prune disc.ply --out result.ply --model eye.xml --camera sid
refused "link.ply: has Gaussians on links" "give --model" -- prune link.ply --out result.ply
refused "link 'wheel'" "no body of that name" -- prune link.ply --out result.ply --model eye.xml --views 2 --held-out 2
refused "holds 2 cameras, but the trace has 11 entries of 2 worlds" -- prune disc.ply --out result.ply --model cart.xml --trace moved.npz --cameras cameras.npz
refused "--jitter is 'much'" "metres" -- prune disc.ply --out result.ply --jitter much
refused "no camera sees any Gaussian" -- prune disc.ply --out result.ply --cameras away.npz --views 2 --held-out 2
refused "--splat needs --model" -- quickstart --splat disc.ply --out pictures
refused "--model needs --splat" -- quickstart --model cart.xml --out pictures
if ! ldd "$gsp" | grep -q libcuda; then
  refused "--device cuda" "without CUDA" -- sim cart.xml --device cuda
fi

# more threads than Kokkos has room for (it would crash or hang), by whomever
refused "--threads is '513'" "1 to 512" -- sim cart.xml --threads 513
export OMP_NUM_THREADS=600
refused "OMP_NUM_THREADS asks for 600" "512" -- sim cart.xml --trace result.npz
export KOKKOS_NUM_THREADS=700 OMP_NUM_THREADS=2
refused "KOKKOS_NUM_THREADS asks for 700" "512" -- sim cart.xml --trace result.npz
unset KOKKOS_NUM_THREADS

# more memory than there is: one sentence before it is asked for. (A GPU's driver maps more than any such limit.)
if ! ldd "$gsp" | grep -q libcuda; then
  limited() { (ulimit -v 6000000 && exec "$real" "$@"); }
  real="$gsp" gsp=limited
  refused "16777216 worlds of cart.xml" "GB of memory" "free" "fewer --worlds" -- sim cart.xml --worlds 16777216
  refused "GB of memory" "--every" -- sim cart.xml --worlds 1000 --steps 40000 --trace result.npz
  refused "16777216 worlds of stack" "fewer --worlds" -- bench stack --worlds 16777216
  refused "1048576 worlds" "fewer --worlds" -- quickstart --worlds 1048576 --out pictures
  refused "pictures of 16384 x 16384" "GB of memory" -- render --splat disc.ply --cameras cameras.npz --width 16384 --height 16384 --out pictures
  gsp="$real"
fi

# models
for command in "sim" "info"; do
  refused "missing.xml" "no such file" -- $command missing.xml
  refused "broken.xml:" -- $command broken.xml
  refused "element.xml:13" "freejiont" -- $command element.xml
  refused "attribute.xml:8" "dampnig" -- $command attribute.xml
  refused "value.xml:9" "thin" -- $command value.xml
  refused "nan.xml:9" -- $command nan.xml
  refused "massless.xml" "ball" -- $command massless.xml
  refused "friction.xml:9" "negative friction" -- $command friction.xml
  refused "row.xml:3" "'strip'" "has 1 rows of 4" "2 or more" -- $command row.xml
  refused "recursive.xml" -- $command recursive.xml
  refused "deep.xml" -- $command deep.xml
  refused "empty.xml" -- $command empty.xml
done
refused "mesh.xml" -- sim mesh.xml
refused "is not a regular file" -- sim .
refused "no keyframe 'upright'" "tilted" -- sim cart.xml --keyframe upright
refused "--tolerance is '-1'" "from 0 to 1" -- sim cart.xml --tolerance -1
refused "no keyframe '1'" -- sim cart.xml --keyframe 1
refused "--cone box is of profile stable" -- sim cart.xml --profile mujoco --cone box
refused "--friction-time is of profile stable" -- sim cart.xml --profile mujoco --friction-time 0.001
for command in sim info; do
  refused "lift_attribute.urdf:10: " "xzy" -- $command lift_attribute.urdf
  refused "lift_massless.urdf" "carriage" -- $command lift_massless.urdf
  refused "lift_loop.urdf:3: " "circle" -- $command lift_loop.urdf
done
refused "lift_mesh.urdf:5: " "nowhere" "--package" -- sim lift_mesh.urdf
refused "--package is '=here'" "NAME=FOLDER" -- sim lift.urdf --package =here

# states and controls
refused "missing.npz" "no such file" -- sim cart.xml --start missing.npz --trace result.npz
refused "start_shape.npz: was saved from another model (nq 8 instead of 9); give the model that it was saved from" -- sim cart.xml --start start_shape.npz --trace result.npz
refused "start_nan.npz[qpos]" "not finite" -- sim cart.xml --start start_nan.npz --trace result.npz
refused "start_far.npz[qpos]" "1e+300" "beyond 1e10" -- sim cart.xml --start start_far.npz --trace result.npz
refused "start_quat.npz[qpos]" "number 6 of world 0" "1e+30" -- sim cart.xml --start start_quat.npz --trace result.npz
refused "start_act.npz: was saved from another model (na 2 instead of 0)" -- sim cart.xml --start start_act.npz --trace result.npz
refused "far_key.xml: keyframe 'tilted': qpos" "beyond 1e10" -- sim far_key.xml --keyframe tilted --trace result.npz
refused "cameras.npz" "no array 'time'" -- sim cart.xml --start cameras.npz --trace result.npz
refused "start3.npz" "3 worlds" "--worlds 3" -- sim cart.xml --start start3.npz --worlds 2 --trace result.npz
refused "ctrl_shape.npy" "(50, 2)" "reshape" -- sim cart.xml --ctrl ctrl_shape.npy --trace result.npz
refused "ctrl_worlds.npy" "(50, 2, 1)" -- sim cart.xml --ctrl ctrl_worlds.npy --worlds 3 --trace result.npz
refused "ctrl.npy" "the model has no actuators" "leave out --ctrl" -- sim lift.urdf --ctrl ctrl.npy --trace result.npz
refused "ctrl_nan.npy: step 7: " "actuator 0 ('push') is NaN" -- sim cart.xml --ctrl ctrl_nan.npy --trace result.npz
refused "ctrl_far.npy: step 7: " "actuator 0 ('push') is 1e+11, beyond 1e10" -- sim cart.xml --ctrl ctrl_far.npy --trace result.npz
refused "--disable has a comma too many" -- sim cart.xml --disable contact, --trace result.npz
refused "ctrl_worlds_nan.npy: step 7: " "world 1" "is infinite" -- sim cart.xml --worlds 2 --ctrl ctrl_worlds_nan.npy --trace result.npz
refused "ctrl.npy" "50 steps" "--steps 51" -- sim cart.xml --ctrl ctrl.npy --steps 51 --trace result.npz
refused "cart.xml" -- sim cart.xml --ctrl cart.xml --trace result.npz
refused "nowhere/result.npz" "create it first" -- sim cart.xml --trace nowhere/result.npz
refused "names a folder" -- sim cart.xml --trace .

# what --save wrote, and somebody has changed
"$gsp" sim cart.xml --worlds 2 --steps 5 --sleep --quiet --save saved.npz > /dev/null || exit 1
python3 - <<'PY' || exit 1
import math, struct, zipfile
arrays = {name: data for name in [*zipfile.ZipFile("saved.npz").namelist()] for data in [zipfile.ZipFile("saved.npz").read(name)]}
def write(name, **changes):  # None: left out; else f(bytes)
    with zipfile.ZipFile(name, "w") as out:
        for key, data in arrays.items():
            f = changes.get(key[:-4].replace(".", "_"), lambda d: d)
            if f: out.writestr(key, f(data))
def last_int(value): return lambda d: d[:-4] + struct.pack("<i", value)
write("saved_version.npz", snapshot=last_int(99))
write("saved_short.npz", state_qvel=None)
write("saved_first.npz", impulses_first=last_int(1 << 30))
write("saved_count.npz", impulses_count=last_int(1 << 30))
write("saved_nan.npz", state_qvel=lambda d: d[:-4] + struct.pack("<f", math.nan))
write("saved_force.npz", sleep_force=lambda d: d[:-4] + struct.pack("<f", math.inf))
write("saved_qpos.npz", qpos=lambda d: d[:-8] + struct.pack("<d", 0.125))
write("saved_calm.npz", sleep_calm=last_int(-1000))
write("saved_kind.npz", state_steps=lambda d: arrays["state.status.npy"])
PY
go_on() { refused "$@" --sleep --trace result.npz; }
go_on "saved_version.npz[snapshot]" "another version" "--save" -- sim cart.xml --start saved_version.npz
go_on "saved_short.npz: there is no array 'state.qvel'" "--save" -- sim cart.xml --start saved_short.npz
go_on "saved_first.npz: array 'impulses.first'" "does not fit" -- sim cart.xml --start saved_first.npz
go_on "saved_count.npz: array 'impulses.first'" "does not fit" -- sim cart.xml --start saved_count.npz
go_on "saved_nan.npz: array 'state.qvel' holds nan of world 1" "at most 1e10" -- sim cart.xml --start saved_nan.npz
go_on "saved_force.npz: array 'sleep.force' holds inf of world 1" -- sim cart.xml --start saved_force.npz
go_on "saved_qpos.npz: 'qpos' is not that of 'state.qpos'" "keep time, qpos" -- sim cart.xml --start saved_qpos.npz
go_on "saved_calm.npz: array 'sleep.calm' holds -1000" -- sim cart.xml --start saved_calm.npz
go_on "saved_kind.npz: array 'state.steps' is (2) int32 and must be (2) int64" -- sim cart.xml --start saved_kind.npz
go_on "saved.npz: was saved in float" "--precision float" -- sim cart.xml --start saved.npz --precision double
go_on "saved.npz: holds 2 worlds" "--worlds 2" -- sim cart.xml --start saved.npz --worlds 3
refused "saved.npz: was saved with islands that may sleep" "--sleep" -- sim cart.xml --start saved.npz --trace result.npz
refused "--save would replace what --start names" -- sim cart.xml --start saved.npz --sleep --save saved.npz

# an output that is an input, or another output, by any name
cp cart.xml whole.xml
cp start.npz whole.npz
ln -s cart.xml to_cart.xml
ln cart.xml also_cart.xml
ln -s result.npz to_result.npz
for name in cart.xml ./cart.xml "$PWD/cart.xml" to_cart.xml also_cart.xml; do
  refused "--trace would replace what MODEL names (cart.xml)" -- sim cart.xml --trace $name
done
refused "--contacts would replace what --start names" -- sim cart.xml --start start.npz --contacts ./start.npz
refused "--forces would replace what --ctrl names" -- sim cart.xml --ctrl ctrl.npy --forces ctrl.npy
refused "--contacts would replace what --trace writes" -- sim cart.xml --trace result.npz --contacts result.npz
refused "--forces would replace what --trace writes" -- sim cart.xml --trace ./result.npz --forces to_result.npz
refused "--npz would replace what --trace names" -- render --splat disc.ply --cameras cameras.npz --model cart.xml --trace start.npz --npz start.npz
refused "--npz would replace what --splat names" -- render --splat disc.ply --cameras cameras.npz --npz disc.ply
mkdir scene
cp cart.xml scene/model.xml
refused "--files would replace what --model names" -- quickstart --model scene/model.xml --splat disc.ply --files scene --out pictures
cmp cart.xml whole.xml && cmp start.npz whole.npz && cmp cart.xml scene/model.xml || failures=$((failures + 1))

# Gaussians and cameras
render() { refused "$@" --out pictures --npz result.npz; }
render "missing.ply" "no such file" -- render --splat missing.ply --cameras cameras.npz
render "cut.ply" -- render --splat cut.ply --cameras cameras.npz
render "nan.ply" "Gaussian 7" -- render --splat nan.ply --cameras cameras.npz
render "absurd.ply" -- render --splat absurd.ply --cameras cameras.npz
render "text.ply" -- render --splat text.ply --cameras cameras.npz
render "cut.spz" -- render --splat cut.spz --cameras cameras.npz
render "link.ply" "wheel" -- render --splat link.ply --cameras cameras.npz
render "link.ply" "wheel" "cart" -- render --splat link.ply --cameras cameras.npz --model cart.xml
render "missing.npz" "no such file" -- render --splat disc.ply --cameras missing.npz
render "cameras_shape.npz[viewmats]" "(2, 3, 4)" "(A, 4, 4)" -- render --splat disc.ply --cameras cameras_shape.npz
render "cameras_two_lenses.npz" "leave one out" -- render --splat disc.ply --cameras cameras_two_lenses.npz
render "cameras_prism.npz[distortion]" "shape (12,), expected (2, n), or (n) or (1, n) for all, with n = 4, 5 or 8" -- render --splat disc.ply --cameras cameras_prism.npz
render "cameras_few_lenses.npz[distortion]" "(3, 4)" -- render --splat disc.ply --cameras cameras_few_lenses.npz
render "cameras_fisheye5.npz[fisheye]" "shape (1, 5)" "with n = 4 coefficients" -- render --splat disc.ply --cameras cameras_fisheye5.npz
refused "leads back in the middle of the picture" "calibration" -- render --splat disc.ply --cameras cameras_folds.npz
render "cameras_count.npz[Ks]" "shape (3, 3, 3), expected (2, 3, 3), or (3, 3) or (1, 3, 3) for all" -- render --splat disc.ply --cameras cameras_count.npz
render "cameras_numbers_K.npz[Ks]" "shape (9,)" -- render --splat disc.ply --cameras cameras_numbers_K.npz
render "cameras_nan.npz[viewmats]" "not finite" -- render --splat disc.ply --cameras cameras_nan.npz
render "cameras_mirror.npz[viewmats]" "camera 0" "rotation" -- render --splat disc.ply --cameras cameras_mirror.npz
render "cameras_missing.npz" "viewmats" -- render --splat disc.ply --cameras cameras_missing.npz
render "cameras_cut.npz" "cut short" -- render --splat disc.ply --cameras cameras_cut.npz
render "disc.ply" -- render --splat disc.ply --cameras disc.ply
render "cameras.npz" "holds 2 cameras" "3 worlds" -- render --splat disc.ply --cameras cameras.npz --model cart.xml --trace start3.npz
render "attribute.xml:8" -- render --splat disc.ply --cameras cameras.npz --model attribute.xml
refused "nowhere/result.npz" "create it first" -- render --splat disc.ply --cameras cameras.npz --npz nowhere/result.npz
: > file
refused "result.avi: is a video by no ending" "let it end in .mp4" -- render --splat disc.ply --cameras cameras.npz --video result.avi
refused "nowhere" "create it first" -- render --splat disc.ply --cameras cameras.npz --video nowhere/result.mp4
refused "--video shows rgb" "add rgb" -- render --splat disc.ply --cameras cameras.npz --video result.mp4 --channels depth
refused "--fps needs --video" -- render --splat disc.ply --cameras cameras.npz --fps 30
refused "--fps is '0'" -- render --splat disc.ply --cameras cameras.npz --video result.mp4 --fps 0
refused "--world needs --trace" -- render --splat disc.ply --cameras cameras.npz --world 0
refused "--world 3: there are 3 worlds" -- render --splat disc.ply --cameras camera.npz --model cart.xml --trace start3.npz --world 3
refused "missing.ply" -- render --splat missing.ply --cameras cameras.npz --video result.mp4
refused "3 worlds of 16000 x 12000 on one sheet pass 16384 pixels" "--world" -- render --splat disc.ply --cameras camera.npz --model cart.xml --trace start3.npz --width 16000 --height 12000 --video result.mp4
refused "file/pictures" "cannot be made" -- render --splat disc.ply --cameras cameras.npz --out file/pictures

echo "$cases cases, $failures failures"
[ $failures = 0 ]
