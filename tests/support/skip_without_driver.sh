#!/bin/sh
# Runs a CUDA program; on a machine without the CUDA driver, where it cannot even be loaded, exits with 77, which CTest reports as skipped.
if ldd "$1" | grep -q 'libcuda\.so.*not found'; then
  echo "skipped: no CUDA driver (libcuda.so.1) on this machine"
  exit 77
fi
exec "$@"
