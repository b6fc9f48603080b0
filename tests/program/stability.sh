#!/usr/bin/env bash
# The figures of docs/stability.md come out again for its shortest scene: Spot, beside MuJoCo. Skipped where numpy, MuJoCo, the models or a GPU
# that the program needs are missing.
#   stability.sh GSP
set -eu
if ldd "$1" | grep -q 'libcuda\.so.*not found' || { ldd "$1" | grep -q libcuda && ! nvidia-smi -L >/dev/null 2>&1; }; then
  echo "skipped: a program for CUDA, and no GPU on this machine"
  exit 77
fi
exec python3 "$(dirname "$0")/../../scripts/stability" --quick --gsp "$1"
