#!/usr/bin/env bash
# What the program writes, and what it leaves alone: pipes, devices and symbolic links stay what they are; a program that is stopped says so and leaves no part of a file; ps calls it gsp.
#   files.sh GSP
set -eu
source "$(dirname "$0")/common.bash" "$1"
python3 "$here/make_inputs.py" .

"$gsp" sim cart.xml --steps 10 --trace plain.npz > /dev/null
# stdout as the output: the same bytes as a file, and the text goes to stderr
"$gsp" sim cart.xml --steps 10 --trace /dev/stdout 2> said.txt | cmp - plain.npz || fail "a trace through a pipe is another"
grep -q '1 worlds x 10 steps' said.txt || fail "the text went elsewhere"
"$gsp" sim cart.xml --steps 10 --trace /dev/stdout > whole.npz 2> /dev/null
cmp whole.npz plain.npz || fail "a trace to stdout that is a file is another"
# a named pipe, a device (root alone makes one: a copy of /dev/null), a symbolic link
mkfifo pipe
cat pipe > read.npz & reader=$!
"$gsp" sim cart.xml --steps 10 --trace pipe > /dev/null
wait $reader
[ -p pipe ] || fail "the pipe was replaced"
cmp read.npz plain.npz || fail "a trace through a named pipe is another"
if mknod null c 1 3 2> /dev/null; then
  "$gsp" sim cart.xml --steps 10 --trace null > /dev/null
  [ -c null ] || fail "the device was replaced"
fi
mkdir far
ln -s far/behind.npz link.npz
"$gsp" sim cart.xml --steps 10 --trace link.npz > /dev/null
[ -L link.npz ] || fail "the link was replaced"
cmp far/behind.npz plain.npz || fail "the file behind the link is another"
"$gsp" sim cart.xml --steps 10 --trace /dev/full > /dev/null 2> full.txt && fail "/dev/full took a trace"
grep -q 'disk full' full.txt || fail "a full disk: $(cat full.txt)"

# a world that stops, and one that does not: who it was stands beside what they met
"$gsp" sim cart.xml --start start_flies.npz --worlds 2 --steps 3 --contacts met.npz --forces forces.npz > /dev/null 2>&1 || true
python3 - <<'PY'
import struct, zipfile
for name in ("met.npz", "forces.npz"):
    data = zipfile.ZipFile(name).read("status.npy")
    assert b"'<i4'" in data and struct.unpack("<II", data[-8:]) == (0, 1 << 4), (name, data)
PY

# stopped: in the middle of the steps, and in the middle of a file (a pipe that nobody reads to its end)
python3 - "$gsp" <<'PY'
import os, signal, subprocess, sys, time
gsp = sys.argv[1]
os.mkdir("stopped")
for name, code in (("SIGINT", 130), ("SIGTERM", 143)):
    command = [gsp, "sim", "cart.xml", "--steps", "1000000000", "--trace", "stopped/result.npz", "--every", "1000000000"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    time.sleep(1.5)
    with open("/proc/%d/comm" % process.pid) as file:
        assert file.read() == "gsp\n", "ps calls it by another name"
    process.send_signal(getattr(signal, name))
    out, err = process.communicate(timeout=20)
    assert process.returncode == code, (name, process.returncode, err)
    assert out == "" and err.count("\n") == 1 and "stopped by" in err, (out, err)
    assert os.listdir("stopped") == [], os.listdir("stopped")
# pictures: those that are complete stay, no other file is there
process = subprocess.Popen([gsp, "render", "--splat", "disc.ply", "--cameras", "cameras.npz", "--width", "2000", "--height", "2000", "--out", "stopped"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
for _ in range(2000):
    if any(".partial-" in name for name in os.listdir("stopped")):
        break
    if process.poll() is not None:
        break
    time.sleep(0.001)
process.send_signal(signal.SIGINT)
process.communicate(timeout=20)
assert not any(".partial-" in name for name in os.listdir("stopped")), os.listdir("stopped")
# started with the signal ignored, as nohup does: it goes on
process = subprocess.Popen([gsp, "sim", "cart.xml", "--steps", "2000", "--worlds", "50", "--trace", "kept.npz", "--every", "2000"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
time.sleep(0.2)
process.send_signal(signal.SIGHUP)
process.communicate(timeout=60)
assert process.returncode == 0 and os.path.exists("kept.npz"), process.returncode
PY
# progress: on a terminal alone, and not with --quiet or --json
python3 - "$gsp" <<'PY'
import os, pty, subprocess, sys
def on_terminal(*words):
    master, slave = pty.openpty()
    process = subprocess.Popen([sys.argv[1], *words], stdout=subprocess.PIPE, stderr=slave)
    os.close(slave)
    text = b""
    while True:
        try:
            part = os.read(master, 4096)
        except OSError:
            break
        if not part:
            break
        text += part
    process.communicate()
    assert process.returncode == 0, (words, text)
    return text
commands = (["sim", "cart.xml", "--steps", "3000"], ["render", "--splat", "disc.ply", "--cameras", "cameras.npz", "--width", "64", "--height", "48", "--out", "bars"],
            ["bench", "pendulum", "--worlds", "8"], ["quickstart", "--worlds", "2", "--seconds", "0.1", "--width", "64", "--height", "48", "--out", "bars"])
for command in commands:
    assert b"\r" in on_terminal(*command) and b"%" in on_terminal(*command), (command, on_terminal(*command))
    assert on_terminal(*command, "--quiet") == b"", (command, on_terminal(*command, "--quiet"))
    assert b"[#" not in on_terminal(*command, "--json") and b"\033" not in on_terminal(*command, "--json"), command
PY
[ "$("$gsp" sim cart.xml --steps 500 2>&1 > /dev/null | wc -c)" = 0 ] || fail "progress on what is no terminal"
echo "all is as the page says"
