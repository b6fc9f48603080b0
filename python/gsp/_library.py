"""Which compiled module `gsp._gsp` is: one that was built on this machine, or in a wheel the one for this machine's CPU or GPU."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import pathlib
import sys

# Widest first: a folder of the package, and the flags of /proc/cpuinfo that its module was compiled for.
V3 = {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"}
LEVELS = {"x86_64_v4": V3 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}, "x86_64_v3": V3}


def cpu_flags(cpuinfo: str | pathlib.Path = "/proc/cpuinfo") -> set[str]:
    try:
        with open(cpuinfo) as lines:
            return next((set(line.split(":")[1].split()) for line in lines if line.startswith("flags")), set())
    except OSError:
        return set()


def gpu_is_there(devices: str | pathlib.Path = "/dev") -> bool:
    """Whether NVIDIA's driver shows a GPU. The driver itself is not asked: a process that has begun with CUDA cannot be forked."""
    return any(pathlib.Path(devices).glob("nvidia[0-9]*")) or (pathlib.Path(devices) / "dxg").exists()


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


def fits(distribution: str) -> bool:
    """Whether a wheel beside this one is of the same version; says so where it is not, and the CPU's module is taken."""
    import importlib.metadata
    import warnings

    try:
        own, other = importlib.metadata.version("gsp"), importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return True  # not installed as wheels
    if own != other:
        warnings.warn(f"{distribution} {other} is for another version of gsp than {own}, and is left out: install both of one", stacklevel=2)
    return own == other


def load() -> None:
    # Threads that have nothing to do sleep, as in the program gsp: on a machine that others use too they spin the time of all away.
    # OpenMP reads it once, when the module brings it in.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    found = importlib.util.find_spec("gsp_cuda13")
    gpu = pathlib.Path(found.submodule_search_locations[0]) if found and found.submodule_search_locations else None
    path = choose(pathlib.Path(__file__).parent, cpu_flags(), gpu if gpu and gpu_is_there() and fits("gsp-cuda13") else None)
    name = "gsp._gsp"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    setattr(sys.modules["gsp"], "_gsp", module)  # as an import does
    spec.loader.exec_module(module)


load()
