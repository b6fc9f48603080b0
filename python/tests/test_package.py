"""What lies in the package beside the kernels: the choice of the compiled module, stubs, examples, pictures."""

import os
import pathlib
import re
import runpy
import sys

import numpy as np
import pytest

import gsp
from gsp import _library
from gsp.tasks import MODELS

EXAMPLES = pathlib.Path(__file__).parent.parent.parent / "examples" / "python"
V3 = {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe", "sse2"}
V4 = V3 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}


def folder_of(root, *modules):
    for module in modules:
        (root / module).parent.mkdir(parents=True, exist_ok=True)
        (root / module).touch()
    return root


def test_the_widest_module_that_the_cpu_runs(tmp_path):
    wheel = folder_of(tmp_path / "gsp", "x86_64_v3/_gsp.abi3.so", "x86_64_v4/_gsp.abi3.so")
    assert _library.choose(wheel, V4).parent.name == "x86_64_v4"
    assert _library.choose(wheel, V3).parent.name == "x86_64_v3"
    with pytest.raises(ImportError, match="needs a CPU with avx2, which"):
        _library.choose(wheel, V3 - {"avx2"})
    gpu = folder_of(tmp_path / "gsp_cuda13", "_gsp.abi3.so")
    assert _library.choose(wheel, V4, gpu) == gpu / "_gsp.abi3.so"
    assert _library.choose(wheel, V4, tmp_path).parent.name == "x86_64_v4"  # installed without a module
    here = folder_of(wheel, "_gsp.abi3.so")  # built on this machine
    assert _library.choose(here, set()).parent == here
    with pytest.raises(ImportError, match="no compiled module"):
        _library.choose(tmp_path / "nothing", V4)


def test_flags_of_the_cpu(tmp_path):
    text = tmp_path / "cpuinfo"
    text.write_text("processor\t: 0\nflags\t\t: fpu avx2 fma bmi2\nbogomips\t: 1\n")
    assert _library.cpu_flags(text) == {"fpu", "avx2", "fma", "bmi2"}
    assert _library.cpu_flags(tmp_path / "none") == set()


def test_stubs_know_every_name():
    stub = (pathlib.Path(gsp.__file__).parent / "_gsp.pyi").read_text()
    names = set(re.findall(r"^(?:class|def) (\w+)", stub, flags=re.M))
    assert {n for n in dir(gsp._gsp) if not n.startswith("_")} <= names
    assert "def qpos(self, arg: ArrayLike, /) -> None" in stub


def test_copies_and_numpys_own_protocol():
    data = gsp.Data(gsp.Model.from_xml(MODELS / "cartpole.xml"), worlds=3)
    copy = data.qpos.copy()
    data.qpos[:] = 7
    assert isinstance(copy, np.ndarray) and not np.any(copy == 7)
    assert np.all(data.qpos.copy() == 7)
    assert data.qpos.__array__().ctypes.data == data.qpos.pointer
    assert data.qpos.__array__(dtype="float64").dtype == np.float64
    assert data.steps.copy().dtype == np.int64 and data.status.copy().dtype == np.uint32


def test_pictures_are_written(tmp_path):
    zlib = pytest.importorskip("zlib")
    gsp.write_png(tmp_path / "a.png", [[[0, 0.5, 1], [np.nan, -1, 2]]])
    data = (tmp_path / "a.png").read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n" and data[16:26] == bytes([0, 0, 0, 2, 0, 0, 0, 1, 8, 2])
    start = data.index(b"IDAT")
    length = int.from_bytes(data[start - 4 : start], "big")
    assert zlib.decompress(data[start + 4 : start + 4 + length])[-6:] in (bytes([0, 128, 255, 0, 0, 255]), bytes([0, 128, 255, 0, 128, 0]))
    with pytest.raises(gsp.Error, match="shape"):
        gsp.write_png(tmp_path / "b.png", np.zeros((2, 2, 2)))
    with pytest.raises(gsp.Error, match="b.jpg' does not end in .png"):
        gsp.write_png(tmp_path / "b.jpg", np.zeros((2, 2, 3)))
    assert not (tmp_path / "b.png").exists()


@pytest.mark.parametrize(
    "arguments, says",
    [
        (["pendulum.py"], r"closed form: \d\.\de-0[5-9]\n"),
        (["randomise.py", "--worlds", "32"], r"world 7 alone: the same bits\n"),
        (["pictures.py", "--worlds", "2"], r"2 worlds, nearest [01]\.\d\d m, mean brightness 0\.[2-8]"),
        (  # upright: lower than wide, its floor near z = 0
            ["pictures.py", "--splats", "kitchen.spz", "--quat", "0.7071", "-0.7071", "0", "0", "--worlds", "1", "--distance", "1"],
            r"98 % from \(-1\.67, -0\.92, -0\.03\) to \(1\.91, 1\.09, 2\.32\) m",
        ),
    ],
)
def test_examples(arguments, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    kitchen = pathlib.Path(os.environ.get("GSP_DATA_DIR", "")) / "splats" / "kitchen.spz"
    if "kitchen.spz" in arguments:
        if not kitchen.exists():
            pytest.skip(f"{kitchen} is missing")
        arguments = [str(kitchen) if one == "kitchen.spz" else one for one in arguments]
    monkeypatch.setattr(sys, "argv", arguments)
    runpy.run_path(str(EXAMPLES / arguments[0]), run_name="__main__")
    out = capsys.readouterr().out
    assert re.search(says, out), out
