#!/usr/bin/env bash
# gsp convert: from a PLY to each format and back, links with it, and what a format has no place for is said.
#   convert.sh GSP
set -eu
source "$(dirname "$0")/common.bash" "$1"
python3 "$here/make_inputs.py" .

count="$("$gsp" info disc.ply | sed -n '1s/.*: \([0-9]*\) Gaussians.*/\1/p')"
mkdir out out/pictures
for name in a.ply a2.compressed.ply a3.splat a4.spz a5.glb a6.gltf a7.sog pictures/meta.json a8.usda; do
  if ! "$gsp" convert link.ply "out/$name" > said.txt 2> err.txt; then
    grep -q 'compiled without' err.txt || fail "link.ply -> $name: $(cat err.txt)"
    echo "left out: $(cat err.txt)"
    continue
  fi
  grep -q "$count Gaussians" said.txt || fail "$name: $(cat said.txt)"
  "$gsp" info "out/$name" > info.txt || fail "gsp info $name"
  grep -q "$count Gaussians" info.txt || fail "gsp info $name: $(cat info.txt)"
  grep -q '10 Gaussians on 1 links (wheel)' info.txt || fail "the links of $name: $(cat info.txt)"
  "$gsp" convert "out/$name" "out/back_$(basename "$name").ply" --quiet > said.txt || fail "$name -> back"
  [ ! -s said.txt ] || fail "--quiet speaks"
done
[ -f out/a5.glb.links.json ] || fail "no sidecar beside a5.glb"
[ ! -e out/a.ply.links.json ] || fail "a sidecar beside a.ply"
# A sidecar is of one file: another of its stem has no links, and one without links that takes the file's place has none.
"$gsp" convert disc.ply out/a5.splat > said.txt || fail "beside a sidecar of another file"
"$gsp" convert disc.ply out/a5.glb > said.txt || fail "in place of a file with a sidecar"
for file in out/a5.splat out/a5.glb; do "$gsp" info $file > info.txt; ! grep -q 'on 1 links' info.txt || fail "$file has links: $(cat info.txt)"; done
# A format with no place for it
python3 - <<'P'
import struct
names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"] + ["f_rest_%d" % k for k in range(9)] + ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
head = "ply\nformat binary_little_endian 1.0\ncomment SplatRenderMode: mip\nelement vertex 1\n" + "".join("property float %s\n" % n for n in names) + "end_header\n"
open("sh.ply", "wb").write(head.encode() + struct.pack("<23f", *([1.0] * 23)))
P
"$gsp" convert sh.ply out/sh.splat > said.txt
grep -q "flag 'antialiased' is left out" said.txt || fail "$(cat said.txt)"
grep -q 'SH terms above degree 0 are left out' said.txt || fail "$(cat said.txt)"
"$gsp" convert sh.ply out/sh.glb --sh-degree 0 | grep -q 'SH degree 0' || fail "--sh-degree"
"$gsp" convert sh.ply out/sh3.spz --spz-version 3 > /dev/null
[ "$(head -c 2 out/sh3.spz | od -An -tx1 | tr -d ' ')" = 1f8b ] || fail "--spz-version 3 is no gzip"
# An error names the file, and a file of no Gaussians is one.
python3 - <<'P'
import struct
names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
def ply(name, rows):
    head = "ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(rows) + "".join("property float %s\n" % n for n in names) + "end_header\n"
    open(name, "wb").write(head.encode() + b"".join(struct.pack("<14f", *r) for r in rows))
ply("large.ply", [[0] * 7 + [7] * 3 + [1, 0, 0, 0]])
ply("none.ply", [])
P
if "$gsp" convert large.ply out/large.spz > said.txt 2> err.txt; then fail "a scale of 1097 in a .spz"; fi
grep -q '^gsp: out/large.spz: Gaussian 0: has the scale' err.txt || fail "$(cat err.txt)"
if "$gsp" convert none.ply out/none.glb > said.txt 2> err.txt; then fail "a file of no Gaussians"; fi
grep -q '^gsp: none.ply: holds no Gaussians' err.txt || fail "$(cat err.txt)"
# Names that are no UTF-8
strange="$(printf 'out/\377\376')"
if : > "$strange" 2> /dev/null; then
  rm "$strange"
  for ending in ply compressed.ply gltf usda; do
    "$gsp" convert link.ply "$strange.$ending" > said.txt || fail "a name that is no UTF-8, .$ending"
    "$gsp" info "$strange.$ending" > info.txt || fail "gsp info of a name that is no UTF-8, .$ending"
    grep -aq '10 Gaussians on 1 links (wheel)' info.txt || fail "a name that is no UTF-8, .$ending: $(cat info.txt)"
  done
fi
ls out | grep -q partial && fail "parts of files are left"
echo "gsp convert: all formats there and back"
