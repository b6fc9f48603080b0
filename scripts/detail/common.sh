# Shared by the scripts; not to be called by itself. Everything prints what it is about to do.
set -euo pipefail
ROOT="$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)"
CACHE="${GSP_CACHE_DIR:-${XDG_CACHE_HOME:-$HOME/.cache}/gsp}"
JOBS="${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}"
START=$SECONDS

say() { printf '\n== [%3d s] %s\n' "$((SECONDS - START))" "$*"; }
fail() { printf '\n%s: %s\n' "$(basename "$0")" "$*" >&2; exit 1; }

# What the build, the tests and the program need, as Debian 12 and Ubuntu 24.04 name it.
PACKAGES=(g++ cmake ninja-build ccache python3 ca-certificates
          libeigen3-dev libpugixml-dev libqhull-dev libstb-dev zlib1g-dev nlohmann-json3-dev libwebp-dev libzstd-dev doctest-dev)

# Installs the packages that are missing, with apt-get as root or through sudo; says which.
need_packages() {
  if ! command -v dpkg-query >/dev/null; then
    echo "This is not Debian or Ubuntu: the packages named in scripts/detail/common.sh are taken as given."
    return
  fi
  local missing=() package
  for package in "${PACKAGES[@]}"; do
    # A command that the user installed in another way will do.
    case $package in
      g++|cmake|ccache|python3) command -v "$package" >/dev/null && continue ;;
      ninja-build) command -v ninja >/dev/null && continue ;;
    esac
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
  done
  if ! command -v python3 >/dev/null || ! python3 -m pip --version >/dev/null 2>&1; then missing+=(python3-pip); fi
  if [ ${#missing[@]} -eq 0 ]; then return; fi
  local apt=(apt-get)
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || fail "packages are missing and this is neither root nor a user with sudo; run as root: apt-get install ${missing[*]}"
    apt=(sudo apt-get)
  fi
  say "installing with ${apt[*]}: ${missing[*]}"
  "${apt[@]}" update -q || echo "apt-get update failed; trying with the package lists at hand."
  if [ "${apt[0]}" = sudo ]; then apt=(sudo env DEBIAN_FRONTEND=noninteractive apt-get); else export DEBIAN_FRONTEND=noninteractive; fi
  "${apt[@]}" install -y -q --no-install-recommends "${missing[@]}" || fail "apt-get could not install: ${missing[*]}"
}

version_at_least() { [ "$(printf '%s\n%s\n' "$2" "$1" | sort -V | head -n 1)" = "$2" ]; }
cmake_version() { "$1" --version 2>/dev/null | sed -n '1s/[^0-9]*\([0-9.]*\).*/\1/p'; }

# Path of a CMake >= 3.28, which CUDA C++20 needs: the system's, else one from PyPI, pinned by hash and kept in the cache.
new_cmake() {
  local cmake place="$CACHE/cmake-3.31.6"
  cmake="$(command -v cmake || true)"
  if [ -n "$cmake" ] && version_at_least "$(cmake_version "$cmake")" 3.28; then echo "$cmake"; return; fi
  cmake="$place/cmake/data/bin/cmake"
  if [ ! -e "$place/installed" ]; then
    echo "== CUDA C++20 needs CMake >= 3.28: installing 3.31.6 from PyPI into $place" >&2
    mkdir -p "$CACHE"
    local requirements="$CACHE/cmake-requirements.txt"
    echo "cmake==3.31.6 --hash=sha256:1c8b05df0602365da91ee6a3336fe57525b137706c4ab5675498f662ae1dbcec" > "$requirements"
    python3 -m pip install --quiet --disable-pip-version-check --no-warn-script-location --only-binary :all: --require-hashes \
      --upgrade --target "$place" -r "$requirements" >&2 || fail "CMake 3.31.6 could not be had from PyPI; install CMake >= 3.28 in another way."
    [ -x "$cmake" ] || fail "the wheel of CMake 3.31.6 holds no $cmake"
    touch "$place/installed"
  fi
  echo "$cmake"
}

# nvcc in PATH, or where the toolkit puts it; empty when there is none.
find_nvcc() {
  if command -v nvcc >/dev/null; then command -v nvcc; return; fi
  local place
  for place in "${CUDA_HOME:-}" "${CUDA_PATH:-}" /usr/local/cuda; do
    if [ -n "$place" ] && [ -x "$place/bin/nvcc" ]; then echo "$place/bin/nvcc"; return; fi
  done
}

# Python of an environment in the cache in which the Python package is built and tested; empty, with the reason on stderr, where it cannot be
# had.
python_env() {
  local place="$CACHE/python-env-2"
  if [ ! -e "$place/installed" ]; then
    echo "== making the environment for the Python package's tests in $place" >&2
    rm -rf "$place"
    if ! python3 -m venv "$place" >&2 || ! "$place/bin/python" -m pip install --quiet --disable-pip-version-check --only-binary :all: \
        "nanobind==3.1.0" "nanobind-backend==1.0.0" "numpy>=1.24" "pytest>=7" "mujoco-core==4.0.1" "gymnasium==1.4.0" >&2; then
      echo "== the Python package is not tested: its environment could not be made (python3-venv, nanobind from PyPI)" >&2
      return
    fi
    touch "$place/installed"
  fi
  echo "$place/bin/python"
}
