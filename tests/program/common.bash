# Sourced by the scripts here, with the path of the program gsp: $gsp, $here (this folder), an empty folder $work that they are in. Ends as
# skipped where the program is for CUDA and there is no GPU.
gsp="$(cd "$(dirname "$1")" && pwd)/$(basename "$1")"
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
if ldd "$gsp" | grep -q 'libcuda\.so.*not found' || { ldd "$gsp" | grep -q libcuda && ! nvidia-smi -L >/dev/null 2>&1; }; then
  echo "skipped: a program for CUDA, and no GPU on this machine"
  exit 77
fi
export PYTHONPATH="$here" PYTHONDONTWRITEBYTECODE=1
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1

fail() { echo "failed: $*" >&2; exit 1; }
# A number of the JSON on stdin.
key() { python3 -c 'import json, sys; print(json.loads(sys.stdin.read())[sys.argv[1]])' "$1"; }
same() { [ "$1" = "$2" ] || fail "$3: $1 and $2"; }
