"""The code of docs/python.md runs as it stands there."""

import pathlib
import re

import gsp
from test_gsp import ARM

HERE = pathlib.Path(__file__).parent
PAGE = HERE.parent.parent / "docs" / "python.md"


def test_page(tmp_path, capsys):
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), flags=re.S)
    assert blocks
    names = {"path": path}  # blocks go on from each other
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names)
    assert "[" in capsys.readouterr().out


def test_every_name_is_on_the_page_or_has_a_docstring():
    for name in gsp.__all__:
        assert getattr(gsp, name).__doc__, name
