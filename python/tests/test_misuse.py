"""What users do that they did not mean: it is refused in a sentence, or it heals."""

import os
import subprocess
import sys
import warnings

import numpy as np
import pytest

import gsp

BOX = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 0.1"/>
    <body name="shelf" pos="2 0 0.5"><geom type="box" size="0.3 0.3 0.02"/></body>
    <body name="box" pos="2 0 0.7"><freejoint/><geom name="g" type="box" size="0.1 0.1 0.1"/><camera name="c" pos="0 -1 0"/></body>
  </worldbody>
</mujoco>
"""
SLIDER = """
<mujoco>
  <option><flag constraint="disable"/></option>
  <worldbody><body><joint name="j" type="slide"/><geom size="0.1" mass="1"/></body></worldbody>
  <actuator><motor joint="j"/></actuator>
</mujoco>
"""


@pytest.fixture
def model():
    return gsp.Model.from_string(BOX)


def by_pointer(array):
    """The array for writing, by whatever means."""
    import ctypes

    n = int(np.prod(array.shape))
    kind = ctypes.c_float * n
    return np.ctypeslib.as_array(kind.from_address(array.pointer)).reshape(array.shape)


def test_outputs_are_for_reading(model):
    data = gsp.Data(model, worlds=2)
    gsp.step(model, data)
    for name in ("xpos", "xquat", "xanchor", "xaxis", "qfrc_constraint"):
        array = getattr(data, name)
        assert array.read_only
        with pytest.raises(gsp.Error, match="computed from the state.*write data"):
            array[...] = 0
        with pytest.raises(gsp.Error, match="computed from the state"):
            array -= 1
        for view in (array.numpy(), np.asarray(array), np.from_dlpack(array)):
            assert not view.flags.writeable
            with pytest.raises(ValueError):
                view -= 1
        assert np.array(array).flags.writeable and array.copy().flags.writeable
    assert not data.qpos.read_only and np.asarray(data.qpos).flags.writeable


def test_torch_takes_outputs(model):
    torch = pytest.importorskip("torch")
    data = gsp.Data(model, worlds=2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert torch.equal(torch.from_dlpack(data.xpos), torch.tensor(data.xpos.numpy().copy()))


# A pose that does not move is written once: where it was spoilt, all that begins anew writes it again.
@pytest.mark.parametrize("heal", ["reset", "masked reset", "restore", "forward"])
def test_spoilt_poses_heal(model, heal):
    data = gsp.Data(model, worlds=2)
    before = {name: getattr(data, name).copy() for name in ("xpos", "xquat")}
    saved = data.save()
    for name in before:
        by_pointer(getattr(data, name))[:] -= 0.5
    if heal == "reset":
        gsp.reset(model, data)
    elif heal == "masked reset":
        gsp.reset(model, data, mask=[True, False])
    elif heal == "restore":
        data.restore(saved)
    gsp.forward(model, data)
    for name, x in before.items():
        assert np.array_equal(getattr(data, name), x)
    fresh = gsp.Data(model, worlds=2)
    for d in (data, fresh):
        gsp.step(model, d, 500)
    assert np.array_equal(data.qpos, fresh.qpos)
    assert abs(data.qpos[0, 2] - 0.62) < 1e-3  # on the shelf, which is where it was


def test_forces_of_no_constraints_heal():
    model = gsp.Model.from_string(SLIDER)
    data = gsp.Data(model)
    gsp.step(model, data)
    by_pointer(data.qfrc_constraint)[:] = 7
    gsp.reset(model, data)
    assert not data.qfrc_constraint.any()


# A thread that is in the library when the interpreter ends: the process ends as it would without. Not where the library is in NumPy's
# Python (lists as masks or values): there Python up to 3.13 unwinds the thread's stack through functions of C++, as it does anybody's.
@pytest.mark.parametrize(
    "call",
    [
        "gsp.step(m, d)",
        "gsp.forward(m, d)",
        "gsp.reset(m, d)",
        "r.render(d, v, k)",
    ],
)
@pytest.mark.parametrize("code", [0, 3])
def test_threads_at_the_end(call, code):
    program = f"""
import sys, threading, time
import gsp
m = gsp.Model.from_string("<mujoco><worldbody><body><joint/><geom size='.1'/></body></worldbody></mujoco>")
d = gsp.Data(m, per_world=["body_mass"])
r, v, k = gsp.Renderer(gsp.Scene(m).add_surface(), 16, 16), gsp.look_at([0, -1, 0], [0, 0, 0]), gsp.pinhole(16, 16, 60)
ready = threading.Event()
def work():
    while True:
        {call}
        ready.set()
threading.Thread(target=work, daemon=True).start()
ready.wait()
time.sleep(0.05)
raise SystemExit({code})
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, env=dict(os.environ))
    assert done.returncode == code, done.stderr
    assert done.stderr == ""


def test_pictures_of_geoms_that_differ(model):
    data = gsp.Data(model, worlds=2, per_world=["geom_size"])
    renderer = gsp.Renderer(gsp.Scene(model).add_surface(), 16, 16)
    cameras = data.cameras(["c"], 16, 16)
    with pytest.warns(UserWarning, match="add_surface keep the model's sizes"):
        renderer.render(data, *cameras)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        renderer.render(data, *cameras)  # said once
        gsp.Renderer(gsp.Scene(model).add_room(), 16, 16).render(data, *cameras)
        plain = gsp.Data(model, worlds=2, per_world=["body_mass"])
        gsp.Renderer(gsp.Scene(model).add_surface(), 16, 16).render(plain, *plain.cameras(["c"], 16, 16))


def test_cameras_that_are_none(model):
    data = gsp.Data(model, worlds=2)
    renderer = gsp.Renderer(gsp.Scene(model).add_surface(), 32, 32)
    V, K = gsp.look_at([2, -2, 0.7], [2, 0, 0.7]), gsp.pinhole(32, 32, 60)
    renderer.render(data, V, K)
    turned = np.eye(4, dtype=np.float32)
    for k in range(300):  # rounding of a chain of float32 products is none of it
        turned = turned @ gsp.look_at([0, 0, 0], [np.cos(k), np.sin(k), 0.3])
    renderer.render(data, turned.astype(np.float32), K)

    def changed(a, at, number):
        a = np.array(a, dtype=np.float32)
        a[at] = number
        return a

    scaled, mirrored = V.copy(), V.copy()
    scaled[:3, :3] *= 2
    mirrored[0, :3] *= -1
    for bad in (2 * V, scaled, mirrored, changed(V, (3, 3), 5), changed(V, (3, 0), 1), changed(V, (0, 0), V[0, 0] + 0.2)):
        with pytest.raises(gsp.Error, match="camera 1 has a viewmat that is no rigid motion"):
            renderer.render(data, np.stack([V, bad]), K)
    for at, number in (((0, 1), 30), ((1, 0), 1), ((2, 0), 1), ((2, 2), 2)):
        with pytest.raises(gsp.Error, match="camera 0 has a K that is not fx 0 cx"):
            renderer.render(data, V, changed(K, at, number))
    mirror = changed(K, (0, 0), -K[0, 0])
    V = gsp.look_at([2.1, -2, 0.7], [2.1, 0, 0.7])
    flipped = renderer.render(data, V, mirror).alpha.copy()
    assert np.allclose(flipped[0], renderer.render(data, V, K).alpha.numpy()[0][:, ::-1], atol=1e-3)


def test_worlds_of_cameras(model):
    data = gsp.Data(model, worlds=2)
    renderer = gsp.Renderer(gsp.Scene(model).add_surface(), 16, 16)
    V, K = gsp.look_at([2, -2, 0.7], [2, 0, 0.7])[None], gsp.pinhole(16, 16, 60)
    for good in ([1], np.array([1], dtype=np.int64), np.array([0], dtype=np.uint8), (1,)):
        renderer.render(data, V, K, world=good)
    for bad, sentence in (
        ([2], "names world 2, and the data have 2"),
        ([-1], "names world -1"),
        ([2**32 + 1], "names world 4294967297"),
        ([1.0], "holds float64: give a whole number"),
        (["1"], "holds <U1"),
        ([True], "holds bool"),
    ):
        with pytest.raises(gsp.Error, match=sentence):
            renderer.render(data, V, K, world=bad)


def test_kinds_of_values(model):
    data = gsp.Data(model, worlds=2, per_world=["body_mass", "body_inertia"])
    for kind in (np.int64, np.uint8, np.int16, np.float16, np.float64, bool):
        data.set("body_mass", np.ones((1, 3), dtype=kind))
        assert (data.values("body_mass").numpy() == 1).all()
    data.set("body_mass", [[0, 2, 3]])
    for bad in (np.ones((1, 3), dtype=complex), np.array([["0", "1", "2"]])):
        with pytest.raises(gsp.Error, match="give real numbers"):
            data.set("body_mass", bad)


@pytest.mark.parametrize("mass", [0, -1, np.nan, np.inf])
def test_inertia_is_not_lost(model, mass):
    data = gsp.Data(model, worlds=2, per_world=["body_mass", "body_inertia"])
    before = data.values("body_inertia").copy(), data.values("body_mass").copy()
    masses = before[1].copy()
    masses[1, 2] = mass
    with pytest.raises(gsp.Error, match="box"):
        data.set("body_mass", masses, scale_inertia=True)
    assert np.array_equal(data.values("body_inertia"), before[0]) and np.array_equal(data.values("body_mass"), before[1])
    data.set("body_mass", masses, mask=[True, False], scale_inertia=True)  # of world 1 nothing is taken
    assert np.array_equal(data.values("body_inertia"), before[0])


def test_options_of_data(model):
    for bad in (float("nan"), -1, float("inf")):
        with pytest.raises(gsp.Error, match="tolerance is .* and must be 0 or more"):
            gsp.Data(model, tolerance=bad)
    gsp.Data(model, tolerance=0)
    assert gsp.Data(model, threads=1).threads == 1
    with pytest.warns(UserWarning, match="threads=4096 were asked for, and there are .*OMP_NUM_THREADS"):
        gsp.Data(model, threads=4096)


# More than addresses there are, so that no machine begins to give it.
def test_memory_that_is_not_there():
    bodies = '<replicate count="1300"><body><freejoint/><geom size="0.1"/></body></replicate>'
    model = gsp.Model.from_string(f'<mujoco><option><flag contact="disable"/></option><worldbody>{bodies}</worldbody></mujoco>')
    with pytest.raises(gsp.Error, match="2147483647 worlds need .* GB, and .* GB are free: make fewer worlds"):
        gsp.Data(model, worlds=2**31 - 1, precision="float64")


# The address space ends before the pictures do.
@pytest.mark.skipif(sys.platform != "linux", reason="limits of address space")
def test_pictures_that_memory_does_not_hold():
    code = f"""
import resource, gsp
model = gsp.Model.from_string({BOX!r})
data, scene = gsp.Data(model), gsp.Scene(model).add_surface()
V, K = gsp.look_at([2, -2, 0.7], [2, 0, 0.7]), gsp.pinhole(16384, 16384, 60)
held = 4096 * int(open("/proc/self/statm").read().split()[0])
resource.setrlimit(resource.RLIMIT_AS, (held + 2**30, resource.RLIM_INFINITY))
try:
    gsp.Renderer(scene, 16384, 16384).render(data, V, K)
except gsp.Error as error:
    print(error)
print(gsp.Renderer(scene, 16, 16).render(data, V, gsp.pinhole(16, 16, 60)).alpha.numpy().max() > 0.5)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    said, goes_on = done.stdout.splitlines()
    assert said.startswith("gsp.Renderer.render: 1 picture needs ") and said.endswith(" GB are free: draw smaller ones, or fewer cameras at a time"), said
    assert goes_on == "True"


def test_bodies_that_are_nowhere(model):
    data = gsp.Data(model, worlds=2)
    renderer, box = gsp.Renderer(gsp.Scene(model).add_surface(), 16, 16, ids=True), model.id("body", "box")
    at = gsp.look_at([[2, -2, 0.7]] * 2, [2, 0, 0.7]), gsp.pinhole(16, 16, 30)
    for place in (2, 5):  # of the position, of the quaternion
        data.qpos[1, place] = np.nan
        with pytest.warns(UserWarning, match="the pose of body 'box' of world 1 is not finite, and no picture shows it: look at data.qpos"):
            ids = renderer.render(data, *at).ids.numpy()
        assert box in ids[0] and box not in ids[1]
        gsp.reset(model, data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert box in renderer.render(data, *at).ids.numpy()[1]


def test_model_is_the_same(model):
    data = gsp.Data(model)
    assert data.model is model
    name = repr(model)
    del model
    assert repr(data.model) == name and data.model is data.model


def test_many_lists_of_cameras(model):
    data = gsp.Data(model, worlds=2)
    first = data.cameras(["c"], 16, 16)
    before = [a.copy() for a in first]
    for k in range(200):
        data.cameras([dict(body="box", pos=(0, 0, k))], 16, 16)
    for a, b in zip(first, before):
        assert np.array_equal(a, b)  # nobody frees what somebody has
    again, same = data.cameras(["c"], 16, 16), data.cameras(["c"], 16, 16)
    assert np.array_equal(again[0], before[0])
    assert again[0].pointer == same[0].pointer


def test_jacobian_of_no_point(model):
    data = gsp.Data(model)
    with pytest.raises(gsp.Error, match="not finite"):
        data.jacobian(body="box", point=(float("nan"), 0, 0))


# Tasks.
class Slide(gsp.Task):
    model = gsp.Model.from_string(SLIDER)
    seconds = 0.1

    def observe(self, data):
        return np.concatenate([data.qpos, self.uniform(0, 1, 1)], axis=1)

    def reward(self, data):
        return data.qpos[:, 0]


def test_sizes_of_actions():
    class Wide(Slide):
        action_size = 3

    with pytest.raises(gsp.Error, match="Wide: actions of 3 numbers are for the model's 1 actuators: write act"):
        Wide()

    class Half(Slide):
        action_size = 1.5

    with pytest.raises(gsp.Error, match="action_size is 1.5"):
        Half()

    class Two(Slide):
        action_size = 2

        def act(self, data, action):
            super().act(data, action)

    with pytest.raises(gsp.Error, match="actions of 2 numbers"):
        Two().step(np.zeros((1, 2)))


def test_kinds_of_actions():
    task = Slide(worlds=2)
    for bad in ([["1"], ["2"]], np.ones((2, 1), dtype=complex), [[None], [1]]):
        with pytest.raises(gsp.Error, match="an action holds .*: give real numbers"):
            task.step(bad)
    task.step(np.ones((2, 1), dtype=np.int64))


def test_environments_without_a_seed():
    gymnasium = pytest.importorskip("gymnasium")
    import gsp.gymnasium

    gsp.gymnasium.register("gsp-test/Slide-v0", Slide)
    one, two = gymnasium.make("gsp-test/Slide-v0"), gymnasium.make("gsp-test/Slide-v0")
    assert not np.array_equal(one.reset()[0], two.reset()[0])
    seed = one.unwrapped.np_random_seed
    again = gsp.gymnasium.Env(Slide())
    one = gsp.gymnasium.Env(Slide())
    first = one.reset()[0]
    assert np.array_equal(again.reset(seed=one.np_random_seed)[0], first) and seed is not None
    assert np.array_equal(*(gymnasium.make("gsp-test/Slide-v0", seed=4).reset()[0] for _ in range(2)))
    assert np.array_equal(*(gymnasium.make("gsp-test/Slide-v0").reset(seed=4)[0] for _ in range(2)))
    envs = gymnasium.make_vec("gsp-test/Slide-v0", num_envs=3, vectorization_mode="sync")
    assert len(np.unique(envs.reset()[0][:, 1])) == 3
    many = [gsp.gymnasium.VectorEnv(Slide(worlds=3)).reset()[0] for _ in range(2)]
    assert np.array_equal(*many) and len(np.unique(many[0][:, 1])) == 3  # many worlds: the task's seed, 0 where there is none


def test_no_pictures_of_environments():
    gymnasium = pytest.importorskip("gymnasium")
    import gsp.gymnasium  # noqa: F401

    for make in (lambda: gymnasium.make("gsp/CartPole-v0", render_mode="rgb_array"),
                 lambda: gymnasium.make_vec("gsp/CartPole-v0", num_envs=2, render_mode="rgb_array")):
        with pytest.raises(gsp.Error, match="draw nothing.*rgb_array.*gsp.Renderer"):
            make()


def test_what_cannot_be_assigned_says_what_to_do(model):
    data = gsp.Data(model)
    for of, name, said in (
        (data, "xfrc_applied", "gsp.Data has no attribute 'xfrc_applied': .*data.qfrc_applied = "),
        (data, "xpos", "gsp.Data.xpos is for reading: it follows from what is written"),
        (data, "time", r"gsp.Data.time is for reading: .*data.steps\[:\] = n"),
        (data, "timestep", r"gsp.Data.timestep is for reading: gsp.Data\(model, timestep=seconds\)"),
        (data, "qposs", r"gsp.Data has no attribute 'qposs': is it qpos\?$"),
        (model, "timestep", r"gsp.Model.timestep is for reading: gsp.Data\(model, timestep=seconds\)"),
        (model, "body_mass", r"gsp.Model.body_mass is for reading: gsp.Data\(model, per_world=\['body_mass'\]\), then data.set"),
        (model, "nq", "gsp.Model.nq is for reading: say it in the MJCF"),
        (data, "steps", r"gsp.Data.steps is for reading: .*data.steps\[:\] = n"),
        (data, "worlds", "gsp.Data.worlds is for reading: say it when you make gsp.Data"),
        (data, "status", "gsp.Data.status is for reading: gsp.reset"),
        (data, "set", "gsp.Data.set is for reading: it is a function"),
    ):
        with pytest.raises(AttributeError, match=said):
            setattr(of, name, 1)

    class Broken:
        def __array__(self, *_, **__):
            raise AttributeError("of its own")

    with pytest.raises(AttributeError, match="^of its own"):
        data.qpos = Broken()
    data.qpos = data.qpos.copy() + 0.25
    assert data.qpos[0, 0] == 0.25 + model.qpos0[0]


def test_names_of_mujocos_say_what_to_take_here(model):
    import re

    from gsp import _mujoco_names as names

    data = gsp.Data(model)
    for of, name, said in (
        (data, "site_xpos", r"gsp.Data has no attribute 'site_xpos': .*model.site_pos"),
        (data, "cam_xpos", r"data.cameras"),
        (data, "xfrc_applied", r"data.qfrc_applied = "),
        (data, "body", r"data.xpos\[:, i\] with i = model.id\('body', name\)"),
        (data, "nq", r"it is of the model: model.nq"),
        (data, "body_mass", r"it is of the model: model.body_mass"),
        (data, "qposs", r"gsp.Data has no attribute 'qposs': is it qpos\?$"),
        (model, "opt", r"gsp.Model has no attribute 'opt': model.timestep"),
        (model, "key_ctrl", r"keyframe"),
        (model, "geom_rgba", r"add_surface"),
        (model, "jnt_limited", r"model.jnt_range"),
        (model, "actuator_gainprm", r"per_world=\['act_gain'\]"),
        (model, "jnt_stiffness", r"gsp.Data\(model, per_world=\['jnt_stiffness'\]\)"),
        (model, "joint", r"model.id\('joint', name\)"),
        (model, "qpos", r"it is of the data: data.qpos"),
        (model, "wings", r"gsp.Model has no attribute 'wings'$"),
        (model, "__wings__", r"gsp.Model has no attribute '__wings__'$"),
        (gsp, "MjModel", r"the module gsp has no attribute 'MjModel': gsp.Model.from_xml"),
        (gsp, "mj_step", r"gsp.step"),
        (gsp, "Modell", r"is it Model\?$"),
    ):
        with pytest.raises(AttributeError, match=said):
            getattr(of, name)
        assert not hasattr(of, name) and getattr(of, name, 5) == 5
    for owner, table in (("Model", names.MODEL), ("Data", names.DATA), ("", names.PACKAGE)):
        for name in table:
            assert not hasattr(getattr(gsp, owner) if owner else gsp, name), name
            said = names.hint(owner, name)
            for of, word in re.findall(r"\b(data|model|gsp)\.(\w+)", said.replace("docs/python.md", "")):
                assert hasattr({"data": gsp.Data, "model": gsp.Model, "gsp": gsp}[of], word), (name, word)
    for words in re.findall(r"per_world=\['(\w+)'\]", " ".join(names.MODEL.values())):
        assert words in gsp.world_fields()


@pytest.mark.parametrize(
    "mounts, said",
    [
        ([dict(body="box", quat=(1, 1, 0))], r"quat of mount 0 is \(1, 1, 0\): give 4 numbers"),
        (["c", dict(body="box", pos=0.5)], "pos of mount 1 is 0.5: give 3 numbers"),
        ([dict(body="box", pos=(0, "up", 1))], "pos of mount 0 is .*up.*: give 3 numbers"),
        ([dict(body="box", fovy=(60, 50))], r"fovy of mount 0 is \(60, 50\): give a number of degrees"),
        ([dict(body=2)], "body of mount 0 is 2: give its name"),
        (dict(body="box"), r"the mounts are a list: give \[dict\("),
        (None, "the mounts are a list"),
        ("c", r"the mounts are a list: give .*\['name'\]"),
        ([{1: 2}], "a mount has body, pos, quat or target, and fovy, and no '1'"),
        ([dict(body="box", quat="abcd")], "quat of mount 0 is 'abcd': give 4 numbers"),
        ([dict(body="box", pos={1, 2, 3})], "pos of mount 0 is .*: give 3 numbers"),
        ([dict(body="box", pos=np.array(1.0))], r"pos of mount 0 is array\(1.?\): give 3 numbers"),
        (np.array(1.0), "the mounts are a list"),
        ([dict(body="box", quat=(1, 0, 0, 0), target=(0, 0, 0))], "mount 0 has quat and target, which both say where it looks: give one"),
        ([dict(body="box", pos=(0, 1, 0), target=(0, 1, 0))], "mount 0: pos and target are one point"),
        ([dict(body="box", target=(0, 1))], r"target of mount 0 is \(0, 1\): give 3 numbers"),
        ([dict(body="box", fovy=float("nan"))], "fovy must lie between 0 and 180"),
    ],
)
def test_mounts_that_cannot_be_read_are_named(model, mounts, said):
    data = gsp.Data(model)
    with pytest.raises(gsp.Error, match="gsp.Data.cameras: " + said):
        data.cameras(mounts)
    assert data.cameras([dict(body="box", pos=np.zeros(3), quat=[1, 0, 0, 0], fovy=60)], 4, height=3)[1].shape == (1, 3, 3)
    assert "mounts" in gsp.Data.cameras.__doc__
