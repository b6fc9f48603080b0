#!/usr/bin/env bash
# gsp render --video and the video of gsp quickstart: what ffmpeg (a script in its place, which writes down what it gets) is given, its frames beside the PNGs of --out; without it, where it fails, and stopped; and a real one, where there is one.
#   video.sh GSP
set -eu
source "$(dirname "$0")/common.bash" "$1"
python3 "$here/make_inputs.py" .

# an ffmpeg in PATH that does what is in fake/does, with the file that it shall write in $out; and a PATH without
real=$(command -v ffmpeg || true)
mkdir fake none films
cat > fake/ffmpeg <<'SH'
#!/bin/sh
PATH=/usr/bin:/bin
here=$(dirname "$0")
for a; do echo "$a"; done > "$here/arguments"
for out; do :; done
out=${out#file:}
. "$here/does"
SH
chmod +x fake/ffmpeg
echo 'cat > "$here/stdin"; echo film > "$out"' > fake/does
with() { local path=$1; shift; PATH=$path "$gsp" "$@"; }
given() { grep -qx -e "$1" fake/arguments || fail "ffmpeg was not given $1: $(tr '\n' ' ' < fake/arguments)"; }

"$gsp" sim cart.xml --start start3.npz --worlds 3 --steps 50 --every 20 --trace t.npz > /dev/null  # 0, 40, 80 and 100 ms
large="render --splat disc.ply --model eye.xml --camera side --trace t.npz --width 400 --height 300"
render="${large% --width*} --width 33 --height 25"

# three worlds side by side, 2 and 1 in a row: 2 * 35 + 2 and 2 * 27 + 2 pixels; 25 frames a second; each world's tile is its PNG
with fake $render --video "films/a b's.mp4" --out pngs --channels rgb --json > film.json
given 72x56
given 25/1
same "$(cat "films/a b's.mp4")" film "what ffmpeg wrote"
same "$(key video_frames < film.json) $(key video_frames_per_second < film.json) $(key images < film.json)" "4 25.0 12" "frames of the video"
python3 - <<'PY'
import struct, zlib
def png(name):
    data, at, packed = open(name, "rb").read(), 8, b""
    while at < len(data):
        n, kind = struct.unpack(">I4s", data[at:at + 8])
        packed += data[at + 8:at + 8 + n] if kind == b"IDAT" else b""
        at += 12 + n
    raw, w, h = zlib.decompress(packed), 33, 25
    rows, last = [], bytes(3 * w)
    for y in range(h):
        kind, line = raw[y * (3 * w + 1)], bytearray(raw[y * (3 * w + 1) + 1:(y + 1) * (3 * w + 1)])
        for i in range(3 * w):
            a, b, c = (line[i - 3] if i > 2 else 0), last[i], (last[i - 3] if i > 2 else 0)
            p = a + b - c
            paeth = min(((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c)))[2]
            line[i] = (line[i] + (0, a, b, (a + b) // 2, paeth)[kind]) % 256
        last = bytes(line)
        rows.append(last)
    return rows
film = open("fake/stdin", "rb").read()
w, h = 72, 56
assert len(film) == 4 * w * h * 3, len(film)
for t in range(4):
    for world in range(3):
        x, y = 2 + 35 * (world % 2), 2 + 27 * (world // 2)
        tile = [film[((t * h + y + r) * w + x) * 3:((t * h + y + r) * w + x + 33) * 3] for r in range(25)]
        assert tile == png("pngs/rgb_%04d.png" % (3 * t + world)), (t, world)
assert film[:w * h * 3] != film[-w * h * 3:], "the ball falls"
PY

# one world, odd sizes padded; a rate of one's own; portions and batches change nothing
cp fake/stdin whole
with fake $render --video films/b.mp4 --batch 1 --threads 1 > /dev/null
cmp whole fake/stdin || fail "a batch of one gives another video"
with fake $render --video films/b.mp4 --world 1 --fps 12.5 --out one > said.txt
given 34x26
given 25/2
same "$(wc -c < fake/stdin)" $((4 * 34 * 26 * 3)) "bytes of one world's frames"
grep -qx 'films/b.mp4: 4 frames, 12.5 a second' said.txt || fail "what is said: $(cat said.txt)"
for t in 0 1 2 3; do cmp one/rgb_000$t.png pngs/$(printf 'rgb_%04d.png' $((3 * t + 1))) || fail "--world 1 is another world"; done
# cameras without a trace: a frame each, 25 a second
with fake render --splat disc.ply --cameras cameras.npz --width 32 --height 24 --video films/c.mp4 > /dev/null
given 25/1
same "$(wc -c < fake/stdin)" $((2 * 32 * 24 * 3)) "bytes of two cameras' frames"
rm -r films/*

# without ffmpeg: an animated PNG beside the name, and a sentence, with --quiet too; asked for, no sentence, the same file
with none $render --world 0 --video films/d.mp4 --quiet > /dev/null 2> said.txt
same "$(wc -l < said.txt)" 1 "lines that say that there is no ffmpeg"
for part in "films/d.mp4: there is no ffmpeg in PATH" "films/d.apng" "apt-get install ffmpeg"; do grep -qF "$part" said.txt || fail "the sentence lacks '$part': $(cat said.txt)"; done
same "$(ls films)" d.apng "files without ffmpeg"
"$gsp" info films/d.apng | grep -qF 'PNG, 33 x 25' || fail "the animated PNG"
same "$(grep -ao fcTL films/d.apng | wc -l)" 4 "frames of the animated PNG"
with fake $render --world 0 --video films/e.png > /dev/null 2> said.txt
[ ! -s said.txt ] || fail "an animated PNG that was asked for is told: $(cat said.txt)"
cmp films/d.apng films/e.png || fail "another animated PNG"

# an ffmpeg that fails: exit code 2, one sentence, nothing left, what was there stays
rm -r films/*
echo old > films/f.mp4
for does in "echo \"Unknown encoder 'libx264'\" >&2; exit 1" "head -c 100 > \"\$out\"; echo \"Unknown encoder 'libx264'\" >&2; exit 1"; do
  echo "$does" > fake/does
  code=0
  with fake $render --video films/f.mp4 > out.txt 2> said.txt || code=$?
  same "$code $(wc -l < said.txt) $(wc -c < out.txt)" "2 1 0" "exit code, lines and text of a video that fails"
  grep -qF "gsp: films/f.mp4: fake/ffmpeg ended with exit status 1: Unknown encoder 'libx264'; " said.txt || fail "the sentence: $(cat said.txt)"
  same "$(ls -A films) $(cat films/f.mp4)" "f.mp4 old" "files of a video that failed"
done

# stopped while ffmpeg makes its file: by Ctrl-C, which goes to the whole group of a terminal, and by SIGTERM
echo 'echo $$ > "$here/pid"; trap "" INT TERM; while :; do echo more >> "$out"; sleep 0.01; done' > fake/does
python3 - "$gsp" $large --video films/f.mp4 <<'PY'
import os, signal, subprocess, sys, time
for name, code in (("SIGINT", 130), ("SIGTERM", 143)):
    if os.path.exists("fake/pid"):
        os.remove("fake/pid")
    process = subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=dict(os.environ, PATH="fake"), start_new_session=True)
    for _ in range(2000):
        if os.path.exists("fake/pid") and any(".partial-" in n for n in os.listdir("films")):
            break
        time.sleep(0.01)
    os.killpg(process.pid, getattr(signal, name))
    out, err = process.communicate(timeout=20)
    assert process.returncode == code and err.count("\n") == 1 and "stopped by" in err, (process.returncode, out, err)
    time.sleep(0.2)
    assert os.listdir("films") == ["f.mp4"], os.listdir("films")
PY
same "$(cat films/f.mp4)" old "what was there before"

# quickstart makes one where it can, and says where it cannot
echo 'cat > "$here/stdin"; echo film > "$out"' > fake/does
quickstart="quickstart --worlds 2 --seconds 0.2 --width 64 --height 48"
with fake $quickstart --out own > said.txt
same "$(cat own/animation.mp4)" film "the video of quickstart"
grep -q '^  own/animation.mp4  the same$' said.txt || fail "quickstart does not name its video: $(cat said.txt)"
same "$(wc -c < fake/stdin)" $(($(grep -ao fcTL own/animation.png | wc -l) * 64 * 48 * 3)) "bytes of quickstart's frames, and its animated PNG's"
with none $quickstart --out without > said.txt
grep -q '^  no animation.mp4, since there is no ffmpeg in PATH' said.txt || fail "quickstart does not say that there is no ffmpeg: $(cat said.txt)"
echo 'echo broken >&2; exit 1' > fake/does
with fake $quickstart --out broken > said.txt || fail "quickstart ends where ffmpeg fails"
grep -qF 'broken/animation.mp4: fake/ffmpeg ended with exit status 1: broken; ' said.txt || fail "quickstart does not say that ffmpeg failed: $(cat said.txt)"
same "$(ls without | sort | tr '\n' ' ')" "$(ls broken | sort | tr '\n' ' ')" "files without a video"

# the real one
if [ -n "$real" ] && "$real" -hide_banner -encoders 2> /dev/null | grep -q libx264; then
  "$gsp" $render --video films/real.mp4 > /dev/null
  same "$(ls films | tr '\n' ' ')" "f.mp4 real.mp4 " "files of a real video"
  same "$("$real" -v error -i films/real.mp4 -f rawvideo -pix_fmt rgb24 - | wc -c)" $((4 * 72 * 56 * 3)) "bytes of what a real ffmpeg reads again"
else
  echo "no ffmpeg with libx264 here: what a real one makes was not tried"
fi
echo "all is as the page says"
