"""The code of docs/python.md, docs/python_tasks.md and of how_to's Python runs as it stands there, and their tables are the package's."""

import importlib.util
import pathlib
import re

import numpy as np
import pytest

import gsp
from test_gsp import ARM

DOCS = pathlib.Path(__file__).parent.parent.parent / "docs"
OPTIONAL = {"gymnasium": "gymnasium", "sb3": "stable_baselines3", "rsl_rl": "rsl_rl", "torch": "torch"}


def run_page(page):
    """Blocks go on from each other, from nothing; those of packages that are not here are left out."""
    blocks = re.findall(r"^```python\n(.*?)^```", (DOCS / page).read_text(), flags=re.S | re.M)
    assert blocks
    names = {}
    for block in blocks:
        asked = re.findall(r"^(?:import|from) (?:gsp\.)?(\w+)", block, flags=re.M)
        if all(importlib.util.find_spec(OPTIONAL.get(name, name)) or name == "tasks" for name in asked):
            exec(compile(block, page, "exec"), names)
    return names


def test_page(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = run_page("python.md")
    out = capsys.readouterr().out
    assert "[" in out and "gsp.Scene(" in out
    assert (tmp_path / "head.png").exists()
    assert names["frames"].rgb.numpy().std() > 0.05
    with np.load(tmp_path / "eyes.npz") as eyes:
        assert eyes["viewmats"].shape == (100, 4, 4) and eyes["Ks"].shape == (100, 3, 3)


def test_points_and_velocities_are_mujocos(tmp_path, monkeypatch):
    mujoco = pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    block = re.search(r"## Points and velocities\n```python\n(.*?)```", (DOCS / "python.md").read_text(), flags=re.S)[1]
    m, model = mujoco.MjModel.from_xml_string(ARM), gsp.Model.from_string(ARM)
    d, data = mujoco.MjData(m), gsp.Data(model, worlds=2, precision="float64")
    d.qpos[:] = [0.3, -0.2, 1, 0.6, 0.4, -0.3, 0.6, 0.2]
    d.qpos[3:7] /= np.linalg.norm(d.qpos[3:7])
    d.qvel[:] = np.arange(1, 8)
    data.qpos, data.qvel = d.qpos, d.qvel
    mujoco.mj_forward(m, d)
    names = {"np": np, "gsp": gsp, "model": model, "data": data}
    exec(block, names)
    position, rotation, velocity = np.zeros((3, 7)), np.zeros((3, 7)), np.zeros(6)
    assert np.allclose(names["site_xpos"], d.site_xpos[0], rtol=0, atol=1e-12)
    mujoco.mj_objectVelocity(m, d, mujoco.mjtObj.mjOBJ_SITE, 0, velocity, 0)
    assert np.allclose(names["velocity"], np.r_[velocity[3:], velocity[:3]], rtol=0, atol=1e-11)
    mujoco.mj_jac(m, d, position, rotation, names["x"], names["body"])
    assert np.allclose(names["J_x"], position, rtol=0, atol=1e-12)


def test_inverse_kinematics_are_mujocos():
    """The page's hands are where MuJoCo says that they should be; rows of the Jacobian are MuJoCo's, position first."""
    mujoco = pytest.importorskip("mujoco")
    turn = re.search(r"## Points and velocities\n```python\n(def turn.*?)\n\n", (DOCS / "python.md").read_text(), flags=re.S)
    block = re.search(r"## Inverse kinematics\n.*?```python\n(.*?)```", (DOCS / "python.md").read_text(), flags=re.S)[1]
    names = {"np": np, "gsp": gsp}
    exec(turn[1], names)
    exec(block, names)
    m = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{names['links']}{'</body>' * 6}</worldbody></mujoco>")
    d = mujoco.MjData(m)
    hand, tip = names["hand"], names["tip"]
    wanted = names["start"] + np.random.default_rng(0).uniform(-1, 1, (16, 6))
    J = names["poses"].jacobian(body=hand, point=tip).numpy()
    for k in range(16):
        frames = []
        for qpos in (wanted[k], names["poses"].qpos[k]):
            d.qpos[:] = qpos
            mujoco.mj_forward(m, d)
            frames.append((d.xpos[hand] + d.xmat[hand].reshape(3, 3) @ tip, d.xmat[hand].copy()))
        # after 60 rounds the slowest, near a singular pose, is within 1 mm; frames that are turned by angle differ by less than twice it
        assert np.allclose(frames[0][0], frames[1][0], rtol=0, atol=1e-3) and np.allclose(frames[0][1], frames[1][1], rtol=0, atol=2e-3)
        position, rotation = np.zeros((3, 6)), np.zeros((3, 6))
        mujoco.mj_jac(m, d, position, rotation, frames[1][0], hand)
        assert np.allclose(J[k], np.concatenate([position, rotation]), rtol=0, atol=1e-12)


def test_page_of_tasks(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = run_page("python_tasks.md")
    assert capsys.readouterr().out.startswith("(64, 4) [1 1 1 1]\n")
    assert (tmp_path / "task.png").exists()
    if "envs" in names:
        assert names["seen"] in names["envs"].observation_space
        seen = names["observations"]
        assert seen in names["looking"].observation_space and seen["picture"].dtype == np.uint8 and seen["picture"].std() > 5
        check_env = importlib.import_module("gymnasium.utils.env_checker").check_env
        check_env(gsp.gymnasium.Env(names["Look"]()))  # the same seed, the same pictures
    if "seeing" in names:
        assert type(names["seeing"].policy.features_extractor.extractors["picture"]).__name__ == "NatureCNN"


def test_recipes():
    names = run_page("how_to.md")
    model, weight = names["model"], names["model"].body_mass.sum() * 9.81
    assert np.allclose(names["normal"].sum(axis=1), weight, rtol=0.02)  # it stands still: feet bear what it weighs
    assert np.allclose(names["data"].values("geom_friction")[:, model.id("geom", "floor"), 0], np.linspace(0.1, 1.6, 16))
    assert np.abs(names["arm"].xpos[:, names["knee"]] - names["goal"]).max() < 2e-3 and not names["arm"].status.numpy().any()


def test_forces_on_bodies_are_mujocos():
    mujoco = pytest.importorskip("mujoco")
    m, model = mujoco.MjModel.from_xml_string(ARM), gsp.Model.from_string(ARM)
    d, data = mujoco.MjData(m), gsp.Data(model, profile="mujoco", precision="float64")
    d.qpos[2] = 3
    data.qpos = d.qpos
    link, wrench = model.id("body", "link"), np.array([[2.0, -1, 5, 0.1, 0.2, -0.3]])
    d.xfrc_applied[link] = wrench
    for _ in range(20):
        data.qfrc_applied = np.einsum("wij,wi->wj", data.jacobian(body=link, point=model.body_ipos[link]), wrench)
        gsp.step(model, data)
        mujoco.mj_step(m, d)
    assert np.allclose(data.qpos[0], d.qpos, rtol=0, atol=1e-10) and abs(d.qvel[3:6]).max() > 0.1


def table_after(page, head):
    """Rows below the line that begins with `head`: lists of cells."""
    lines = (DOCS / page).read_text().splitlines()
    rows = []
    for line in lines[next(k for k, line in enumerate(lines) if line.startswith(head)) + 2 :]:
        if not line.startswith("|"):
            return rows
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return rows


@pytest.mark.parametrize("kind", ["model", "data"])
def test_tables_of_attributes(kind):
    text = ARM.replace("<worldbody>", '<worldbody><body name="hand" mocap="true" pos="1 0 0"><geom size="0.01" contype="0" conaffinity="0"/></body>')
    text = text.replace("</mujoco>", '<equality><joint joint1="hip"/></equality></mujoco>').replace(
        "ctrl=", 'mpos="1 0 0" mquat="1 0 0 0" ctrl='
    )
    model = gsp.Model.from_string(text)
    sizes = {name: getattr(model, name) for name in dir(model) if re.fullmatch("n[a-z]+", name) and name != "names"}
    of = model if kind == "model" else gsp.Data(model, worlds=3)
    seen = set()
    for first, shapes, _ in table_after("python.md", f"| `{kind}.`"):
        names = re.findall(r"`(\w+)", first)
        seen.update(names)
        if not shapes:
            continue
        shapes = shapes.split(";")
        for name, shape in zip(names, shapes if len(shapes) > 1 else shapes * len(names), strict=True):
            expected = tuple(int(n) if n.isdigit() else {**sizes, "worlds": 3}[n] for n in shape.strip().split(", "))
            assert getattr(of, name).shape == expected, name
    assert seen == {name for name in dir(of) if not name.startswith("_")}


def test_table_of_world_fields():
    model = gsp.Model.from_string(ARM)
    data = gsp.Data(model, worlds=2, per_world=gsp.world_fields())
    seen = []
    for items, fields in table_after("python.md", "| (worlds, ... , numbers)"):
        for name, count in re.findall(r"`(\w+)`(?: (\d+))?", fields):
            seen.append(name)
            size = {1 if n == "1" else getattr(model, n) for n in items.split(", ")}
            _, rows, numbers = data.values(name).shape
            assert rows in size and numbers == int(count or 1), name
    assert sorted(seen) == sorted(gsp.world_fields())


def test_names_of_the_table_of_mujocos_are_told():
    """What the left column has is an attribute here too, or a missing one says what to take."""
    from gsp import _mujoco_names

    left = " ".join(row[0] for row in table_after("python.md", "| From MuJoCo"))
    names = re.findall(r"`(?:mujoco\.|[md]\.)?(\w+)", left)
    assert len(names) >= 50
    for name in names:
        owners = ("Data", "Model", "")
        known = any(hasattr(getattr(gsp, owner), name) for owner in owners[:2])
        assert known or any(_mujoco_names.hint(owner, name) for owner in owners), name


def test_every_name_is_on_the_page_or_has_a_docstring():
    for name in gsp.__all__:
        assert getattr(gsp, name).__doc__, name
