"""Values that differ from world to world, and the smooth dynamics beside MuJoCo's own Python."""

import warnings

import numpy as np
import pytest

import gsp

from test_gsp import ARM

mujoco = pytest.importorskip("mujoco")

SITE = ARM.replace('<joint name="hip"', '<site name="tip" pos="0.01 0.02 -0.2" euler="10 20 30"/><joint name="hip"')


def random_state(model, worlds, seed=0):
    r = np.random.default_rng(seed)
    qpos = np.tile(model.qpos0, (worlds, 1)) + 0.3 * r.normal(size=(worlds, model.nq))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    return qpos, r.normal(size=(worlds, model.nv)), r.normal(size=(worlds, model.nu)), r.normal(size=(worlds, model.nv))


# A dozen operations a degree of freedom on numbers below 100: 1e-12 of the largest. The inverse sums three such of both: 1e-11.
def test_smooth_dynamics_are_mujocos():
    model = gsp.Model.from_string(SITE)
    theirs = mujoco.MjModel.from_xml_string(SITE)
    worlds = 5
    data = gsp.Data(model, worlds=worlds, profile="mujoco", precision="float64")
    qpos, qvel, ctrl, qacc = random_state(model, worlds)
    data.qpos, data.qvel, data.ctrl = qpos, qvel, ctrl
    M, passive, actuator, bias = data.mass_matrix(), data.qfrc_passive, data.qfrc_actuator, data.qfrc_bias
    smooth, inverse = data.qacc_smooth, data.inverse(qacc)
    link, tip = model.id("body", "link"), model.id("site", "tip")
    of_point, of_site = data.jacobian(body=link, point=(0.1, -0.2, 0.3)), data.jacobian(site=tip)
    for w in range(worlds):
        d = mujoco.MjData(theirs)
        d.qpos, d.qvel, d.ctrl = qpos[w], qvel[w], ctrl[w]
        theirs.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        mujoco.mj_forward(theirs, d)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(theirs, d, full)
        jacobian = np.zeros((6, model.nv))
        point = d.xpos[link] + d.xmat[link].reshape(3, 3) @ [0.1, -0.2, 0.3]
        mujoco.mj_jac(theirs, d, jacobian[:3], jacobian[3:], point, link)
        site = np.zeros((6, model.nv))
        mujoco.mj_jacSite(theirs, d, site[:3], site[3:], tip)
        for ours, other in (
            (M, full),
            (passive, d.qfrc_passive),
            (actuator, d.qfrc_actuator),
            (bias, d.qfrc_bias),
            (smooth, d.qacc_smooth),
            (of_point, jacobian),
            (of_site, site),
        ):
            np.testing.assert_allclose(ours.numpy()[w], other, rtol=0, atol=1e-12 * max(1, np.abs(other).max()))
        d.qacc = qacc[w]
        mujoco.mj_inverse(theirs, d)
        np.testing.assert_allclose(inverse.numpy()[w], d.qfrc_inverse, rtol=0, atol=1e-11)
    with pytest.raises(gsp.Error, match="a body or a site"):
        data.jacobian()
    with pytest.raises(ValueError, match="there is no body 77"):
        data.jacobian(body=77)
    with pytest.raises(gsp.Error, match="qacc"):
        data.inverse(np.zeros((worlds, 3)))


def test_dynamics_leave_the_steps_alone():
    model = gsp.Model.from_string(ARM)
    alone, asked = gsp.Data(model, worlds=2), gsp.Data(model, worlds=2)
    for _ in range(20):
        for data in (alone, asked):
            gsp.step(model, data, n=10)
        asked.mass_matrix()
        asked.qacc_smooth
    assert np.array_equal(alone.qpos.numpy(), asked.qpos.numpy())


# One world with values of its own moves as a model that has them; the others as before. Constants that follow from masses differ by rounding
# of the model's precision, 1e-13, which contacts of stiffness 1e4 and 300 steps of a slide may make 1e-10.
def test_a_world_with_values_of_its_own_is_a_model_that_has_them():
    heavy_text = ARM.replace('mass="5"', 'mass="7.5"').replace('damping="0.5"', 'damping="0.9"').replace(
        'size="0.2 0.1 0.05"', 'size="0.2 0.1 0.05" friction="0.3 0.005 0.0001"'
    ).replace('size="5 5 0.1"', 'size="5 5 0.1" friction="0.3 0.005 0.0001"')
    model, heavy = gsp.Model.from_string(ARM), gsp.Model.from_string(heavy_text)
    fields = ["body_mass", "body_inertia", "dof_damping", "geom_friction"]
    options = dict(profile="mujoco", precision="float64")
    data = gsp.Data(model, worlds=3, per_world=fields, **options)
    plain, own = gsp.Data(model, worlds=1, **options), gsp.Data(heavy, worlds=1, **options)
    mask = [False, True, False]
    mass = data.values("body_mass").numpy().copy()
    assert mass.shape == (3, 3, 1)
    mass[:, 1] *= 1.5
    data.set("body_mass", mass, mask, scale_inertia=True)
    damping = data.values("dof_damping").numpy().copy()
    damping[:, 6] = 0.9
    data.set("dof_damping", damping[:, :, 0], mask)
    friction = data.values("geom_friction").numpy().copy()
    friction[:, :2, 0] = 0.3
    data.set("geom_friction", friction, np.array(mask))
    push = np.zeros((1, model.nv))
    push[0, :2] = 1.0, 0.5
    for d in (data, plain, own):
        d.qvel = push
        gsp.step(d.model, d, n=300)
    qpos = data.qpos.numpy()
    np.testing.assert_allclose(qpos[1], own.qpos.numpy()[0], rtol=0, atol=1e-10)
    np.testing.assert_allclose(qpos[0], plain.qpos.numpy()[0], rtol=0, atol=1e-10)
    assert np.array_equal(qpos[0], qpos[2])
    assert np.abs(qpos[1] - qpos[0]).max() > 1e-3


def test_values_say_what_is_wrong():
    model = gsp.Model.from_string(ARM)
    names = gsp.world_fields()
    assert "body_mass" in names and "geom_friction" in names and len(set(names)) == len(names) and "dof_invweight0" not in names
    with pytest.raises(gsp.Error, match="no field 'mass'"):
        gsp.Data(model, per_world=["mass"])
    data = gsp.Data(model, worlds=2, per_world=["body_mass", "gravity"])
    with pytest.raises(gsp.Error, match="'dof_damping' is the same for all worlds: name it in per_world"):
        data.set("dof_damping", np.zeros((2, 7)))
    with pytest.raises(gsp.Error, match=r"'body_mass' are \(2, 4\).*must be \(2, 3, 1\)"):
        data.set("body_mass", np.ones((2, 4)))
    with pytest.raises(gsp.Error, match="1 dimensions"):
        data.set("body_mass", np.ones(3))
    with pytest.raises(gsp.Error, match="mask"):
        data.set("body_mass", np.ones((2, 3)), mask=[True])
    data.set("gravity", [[[0, 0, -9.81]], [[0, 0, 0]]])  # world 1 falls nowhere
    gsp.step(model, data, n=10)
    assert data.qvel[0, 2] < -0.1 and data.qvel[1, 2] == 0


def test_sizes_that_rays_do_not_see_are_told():
    xml = ARM.replace("<worldbody>", '<worldbody><site name="eye"/>', 1)
    sensors = {"<rangefinder site='eye'/>": True, "<distance body1='world' body2='arm' cutoff='9'/>": True, "<clock/>": False}
    body = gsp.Model.from_string(ARM).names("body")[1]
    for sensor, warns in sensors.items():
        sensor = sensor.replace("arm", body)
        model = gsp.Model.from_string(xml.replace("</mujoco>", f"<sensor>{sensor}</sensor></mujoco>"))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            gsp.Data(model, per_world=["geom_pos"])
            if not warns:
                gsp.Data(model, per_world=["geom_size"])
        if warns:
            with pytest.warns(UserWarning, match="keep the model's sizes"):
                gsp.Data(model, per_world=["geom_size"])


def test_every_field_can_be_set_to_what_it_is():
    model = gsp.Model.from_string(ARM)
    data = gsp.Data(model, worlds=2, per_world=gsp.world_fields(), precision="float64")
    plain = gsp.Data(model, worlds=2, precision="float64")
    for name in gsp.world_fields():
        data.set(name, data.values(name))
    for d in (data, plain):
        d.qvel = np.full((1, model.nv), 0.3)
        gsp.step(model, d, n=100)
    np.testing.assert_allclose(data.qpos.numpy(), plain.qpos.numpy(), rtol=0, atol=1e-9)


def test_rows_of_the_worlds_of_a_mask():
    model = gsp.Model.from_string(ARM)
    data = gsp.Data(model, worlds=4, per_world=["body_mass", "gravity"])
    mask = np.array([False, True, False, True])
    mass = data.values("body_mass").numpy().copy()
    data.set("body_mass", [[0, 2, 3], [0, 4, 5]], mask)  # two rows, two worlds
    mass[1, :, 0], mass[3, :, 0] = [0, 2, 3], [0, 4, 5]
    assert np.array_equal(data.values("body_mass"), mass)
    for value in ([-1.0] * 3, [[-1.0] * 3] * 2, np.full((4, 3), -1.0), np.full((1, 1, 3), -1.0)):
        data.set("gravity", [0, 0, 0])
        data.set("gravity", value, mask)
        assert np.array_equal(data.values("gravity")[:, 0], -1.0 * np.outer(mask, [1, 1, 1]))
    assert list(data.values("gravity")[:, 0, 0]) == [0, -1, 0, -1]
    gsp.reset(model, data)
    assert np.array_equal(data.values("body_mass"), mass)  # a reset leaves them
    with pytest.raises(gsp.Error, match="3 rows and must have 4, one for each world, or 2, one for each world of the mask"):
        data.set("body_mass", np.ones((3, 3)), mask)


def test_values_of_no_body_are_refused():
    model = gsp.Model.from_string(ARM)
    data = gsp.Data(model, worlds=3, per_world=gsp.world_fields())
    before = {name: data.values(name).copy() for name in gsp.world_fields()}
    for name, item, value, sentence in (
        ("body_mass", 1, -1, "'body_mass' of world 1, body 'base', is -1.0 and must be positive"),
        ("body_mass", 1, 0, "must be positive"),
        ("body_mass", 0, -1, "0 or more"),
        ("body_inertia", 2, -1, "body 'link'.*positive"),
        ("geom_size", 1, 0, "geom 'trunk'.*positive"),
        ("geom_friction", 0, -0.1, "geom 'floor'.*0 or more"),
        ("dof_armature", 3, -1, "dof 3.*0 or more"),
        ("dof_damping", 3, np.nan, "dof 3, is nan and must be finite"),
        ("gravity", 0, np.inf, "finite"),
    ):
        values = before[name].copy()
        values[1, item] = value
        with pytest.raises(gsp.Error, match=sentence):
            data.set(name, values)
        assert np.array_equal(data.values(name), before[name], equal_nan=True)
        data.set(name, values, mask=[True, False, True])  # nobody reads that row
