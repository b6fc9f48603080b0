"""Ten robots of other people beside MuJoCo's own Python: positions, sensors, mass matrices and Jacobians, through the arrays."""

import os
import pathlib

import numpy as np
import pytest

import gsp

mujoco = pytest.importorskip("mujoco")
DATA = pathlib.Path(os.environ.get("GSP_DATA_DIR", "/nowhere")) / "models"
MODELS = [
    "dm_control/suite/cheetah.xml",
    "dm_control/suite/fish.xml",
    "dm_control/suite/hopper.xml",
    "dm_control/suite/humanoid.xml",
    "dm_control/suite/humanoid_CMU.xml",
    "dm_control/suite/quadruped.xml",
    "dm_control/suite/swimmer.xml",
    "gym_robotics/hand/reach.xml",
    "mjlab/unitree_g1/g1.xml",
    "mujoco/shadow_hand/scene_right.xml",
]


# Without contacts and limits, whose forces hang on a solver's tolerance: what is left is arithmetic.
def text_of(path):
    return f"""<mujoco><include file="{path.name}"/>
      <option><flag contact="disable" limit="disable" equality="disable" frictionloss="disable"/></option></mujoco>"""


@pytest.mark.parametrize("name", MODELS)
def test_beside_mujoco(name, monkeypatch):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is not there")
    whole = text_of(path)
    model = gsp.Model.from_string(whole, str(path.parent / "beside.xml"))
    monkeypatch.chdir(path.parent)
    theirs = mujoco.MjModel.from_xml_string(whole)
    assert (model.nq, model.nv, model.nbody, model.nsensordata) == (theirs.nq, theirs.nv, theirs.nbody, theirs.nsensordata)
    worlds = 3
    data = gsp.Data(model, worlds=worlds, profile="mujoco", precision="float64")
    d = mujoco.MjData(theirs)
    r = np.random.default_rng(5)
    qpos = np.empty((worlds, model.nq))
    for w in range(worlds):
        qpos[w] = theirs.qpos0
        mujoco.mj_integratePos(theirs, qpos[w], 0.2 * r.normal(size=model.nv), 1)
    qvel, ctrl = r.normal(size=(worlds, model.nv)), 0.3 * r.normal(size=(worlds, model.nu))
    data.qpos, data.qvel, data.ctrl = qpos, qvel, ctrl
    body = model.nbody - 1
    ours = {
        "xpos": data.xpos.copy(),
        "sensordata": data.sensordata.copy(),
        "M": data.mass_matrix().copy(),
        "jacobian": data.jacobian(body=body).copy(),
    }
    gsp.step(model, data)
    ours["qpos"], ours["qvel"] = data.qpos.copy(), data.qvel.copy()
    assert not data.sensors_left_out
    for w in range(worlds):
        mujoco.mj_resetData(theirs, d)
        d.qpos, d.qvel, d.ctrl = qpos[w], qvel[w], ctrl[w]
        mujoco.mj_forward(theirs, d)
        other = {"xpos": d.xpos.copy(), "sensordata": d.sensordata.copy()}
        other["M"] = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(theirs, d, other["M"])
        other["jacobian"] = np.zeros((6, model.nv))
        mujoco.mj_jacBody(theirs, d, other["jacobian"][:3], other["jacobian"][3:], body)
        mujoco.mj_step(theirs, d)
        other["qpos"], other["qvel"] = d.qpos, d.qvel
        for what, expected in other.items():
            mine = ours[what][w]
            # relative to the largest number of its kind: sums of such numbers are rounded by that
            np.testing.assert_allclose(mine, expected, rtol=0, atol=1e-10 * max(1, np.abs(expected).max(initial=0)), err_msg=f"{name}: {what}")
