"""The code of docs/python.md and docs/python_tasks.md runs as it stands there."""

import pathlib
import re

import pytest

import gsp
from test_gsp import ARM

DOCS = pathlib.Path(__file__).parent.parent.parent / "docs"


def blocks_of(page):
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(), flags=re.S)
    assert blocks
    return [compile(block, page, "exec") for block in blocks]


def test_page(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    names = {"path": path}  # blocks go on from each other
    for block in blocks_of("python.md"):
        exec(block, names)
    assert "[" in capsys.readouterr().out
    assert (tmp_path / "head.png").exists()


def test_page_of_tasks(capsys):
    task, environment = blocks_of("python_tasks.md")
    names = {}
    exec(task, names)
    assert capsys.readouterr().out == "(64, 4) [1 1 1 1]\n"
    pytest.importorskip("gymnasium")
    exec(environment, names)
    assert names["seen"] in names["envs"].observation_space


def test_every_name_is_on_the_page_or_has_a_docstring():
    for name in gsp.__all__:
        assert getattr(gsp, name).__doc__, name
