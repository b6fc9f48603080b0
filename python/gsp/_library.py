"""Which compiled module `gsp._gsp` is: one that was built on this machine, or in a wheel the one for this machine's CPU or GPU."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import pathlib
import sys

# Widest first: a folder of the package, and the flags of /proc/cpuinfo that its module was compiled for.
LEVELS = {
    "x86_64_v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "avx2", "bmi2", "fma"},
    "x86_64_v3": {"avx2", "bmi2", "fma"},
}


def cpu_flags(cpuinfo: str | pathlib.Path = "/proc/cpuinfo") -> set[str]:
    try:
        with open(cpuinfo) as lines:
            return next((set(line.split(":")[1].split()) for line in lines if line.startswith("flags")), set())
    except OSError:
        return set()


def gpu_answers() -> bool:
    """Whether NVIDIA's driver is there, and a GPU behind it."""
    import ctypes

    try:
        driver = ctypes.CDLL("libcuda.so.1")
    except OSError:
        return False
    count = ctypes.c_int(0)
    return driver.cuInit(0) == 0 and driver.cuDeviceGetCount(ctypes.byref(count)) == 0 and count.value > 0


def module_in(folder: pathlib.Path) -> pathlib.Path | None:
    return next((folder / f"_gsp{end}" for end in importlib.machinery.EXTENSION_SUFFIXES if (folder / f"_gsp{end}").exists()), None)


def choose(package: pathlib.Path, flags: set[str], gpu: pathlib.Path | None = None) -> pathlib.Path:
    """The module's file. `package`: folder of gsp; `gpu`: folder of gsp_cuda13 where it is installed and a GPU answers."""
    levels = {level: module for level in LEVELS if (module := module_in(package / level))}
    fit = (module for level, module in levels.items() if LEVELS[level] <= flags)
    module = (module_in(gpu) if gpu else None) or module_in(package) or next(fit, None)
    if module:
        return module
    if levels:
        missing = ", ".join(sorted(LEVELS[list(levels)[-1]] - flags))
        raise ImportError(f"this wheel of gsp needs a CPU with {missing}, which this one has not: build it here, `pip install .` in a clone")
    raise ImportError(f"{package} holds no compiled module _gsp: install the package, `pip install .` in a clone")


def load() -> None:
    # Threads that have nothing to do sleep, as in the program gsp: on a machine that others use too they spin the time of all away.
    # OpenMP reads it once, when the module brings it in.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    found = importlib.util.find_spec("gsp_cuda13")
    gpu = pathlib.Path(found.submodule_search_locations[0]) if found and found.submodule_search_locations else None
    path = choose(pathlib.Path(__file__).parent, cpu_flags(), gpu if gpu and gpu_answers() else None)
    name = "gsp._gsp"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    setattr(sys.modules["gsp"], "_gsp", module)  # as an import does
    spec.loader.exec_module(module)


load()
