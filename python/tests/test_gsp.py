"""The Python package beside MuJoCo's own, and what it promises of memory. `pytest python/tests`."""

import gc
import os
import pathlib
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import gsp

DATA = pathlib.Path(os.environ.get("GSP_DATA_DIR", ""))

ARM = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 0.1"/>
    <body name="base" pos="0 0 0.4">
      <freejoint/>
      <geom name="trunk" type="box" size="0.2 0.1 0.05" mass="5"/>
      <site name="imu" pos="0.05 0 0.02"/>
      <camera name="head" pos="0.25 0 0.1" quat="0.5 0.5 -0.5 -0.5" fovy="50"/>
      <body name="link" pos="0.2 0 0">
        <joint name="hip" type="hinge" axis="0 1 0" damping="0.5" range="-1 1" limited="true"/>
        <geom type="capsule" size="0.03 0.1" pos="0 0 -0.1" mass="1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="hip" joint="hip" gear="2"/></actuator>
  <sensor>
    <accelerometer name="acc" site="imu"/>
    <gyro name="gyro" site="imu"/>
    <jointpos name="angle" joint="hip"/>
    <framepos name="where" objtype="body" objname="link"/>
  </sensor>
  <keyframe><key name="high" qpos="0 0 1.5 1 0 0 0 0.3" ctrl="0.5"/></keyframe>
</mujoco>
"""


@pytest.fixture
def model():
    return gsp.Model.from_string(ARM)


# What the library says of C++ is said of Python here.
def test_remedies_are_python(tmp_path):
    seen = ARM.replace("<worldbody>", '<asset><mesh name="shell" file="shell.stl"/></asset><worldbody>').replace(
        '<site name="imu"', '<geom type="mesh" mesh="shell" contype="0" conaffinity="0" group="2" mass="0"/><site name="imu"'
    )
    name = str(tmp_path / "model.xml")
    with pytest.raises(gsp.Error, match=r"skip_visuals=True") as said:
        gsp.Model.from_string(seen, name)
    assert "Options" not in str(said.value) and "--" not in str(said.value)
    model = gsp.Model.from_string(seen, name, skip_visuals=True)
    assert any("skip_visuals=True" in line.text and "skip_visuals=True" in repr(line) for line in model.report)
    model = gsp.Model.from_string(ARM.replace("<sensor>", '<sensor><user name="mine" dim="2"/>'))
    data = gsp.Data(model)
    (sentence,) = data.sensors_left_out
    assert "'mine' (user) is yours to compute: data.sensordata has NaN in its place" in sentence and "gsp::" not in sentence
    assert np.isnan(data.sensordata.numpy()[0, :2]).all() and np.isfinite(data.sensordata.numpy()[0, 2:]).all()


def test_sizes_and_names(model):
    assert (model.nq, model.nv, model.nu, model.nbody, model.nsensordata) == (8, 7, 1, 3, 10)
    assert model.names("body") == ["world", "base", "link"]
    assert model.id("joint", "hip") == 1
    assert model.body_mass[1] == 5
    with pytest.raises(gsp.Error, match="no joint 'hop'.*hip"):
        model.id("joint", "hop")
    with pytest.raises(gsp.Error, match=r"^the model has no body 'lin'; nearest: 'link', 'base', 'world'$"):
        model.id("body", "lin")
    with pytest.raises(gsp.Error, match="kind of object"):
        model.names("bone")


def test_errors_name_the_place(tmp_path):
    bad = tmp_path / "bad.xml"
    bad.write_text("<mujoco>\n<worldbody>\n<geom type='ball'/>\n</worldbody>\n</mujoco>")
    with pytest.raises(gsp.Error, match="bad.xml:3"):
        gsp.Model.from_xml(bad)
    with pytest.raises(ValueError):  # gsp.Error is one
        gsp.Model.from_xml(tmp_path / "none.xml")


def test_arrays_are_the_memory_of_the_kernels(model):
    data = gsp.Data(model, worlds=3)
    a = np.asarray(data.qpos)
    assert a.shape == (3, 8) and a.dtype == np.float32
    assert a.__array_interface__["data"][0] == data.qpos.pointer == data.qpos.pointer
    b = np.from_dlpack(data.qvel)
    b[1, 0] = 2
    assert data.qvel[1, 0] == 2
    before = a.copy()
    gsp.step(model, data)
    assert a[1, 0] == pytest.approx(before[1, 0] + 0.004, rel=1e-5)  # 2 m/s for 2 ms, seen without a call
    data.ctrl[:] = [[1], [2], [3]]
    assert data.ctrl.numpy()[2, 0] == 3


def test_arrays_outlive_what_made_them(model):
    data = gsp.Data(model, worlds=4)
    q, x = np.asarray(data.qpos), np.from_dlpack(data.xpos)
    expected = q.copy()
    del data
    gc.collect()
    q += 1
    assert np.array_equal(q, expected + 1) and x.shape == (4, 3, 3)


def test_beside_mujoco(model):
    mujoco = pytest.importorskip("mujoco")
    m = mujoco.MjModel.from_xml_string(ARM)
    d = mujoco.MjData(m)
    data = gsp.Data(model, worlds=2, profile="mujoco", precision="float64")
    rng = np.random.default_rng(1)
    for _ in range(10):
        d.qpos[:] = m.qpos0
        d.qpos[:3] = rng.normal(size=3) + [0, 0, 3]
        q = rng.normal(size=4)
        d.qpos[3:7] = q / np.linalg.norm(q)
        d.qpos[7] = rng.uniform(-0.9, 0.9)
        d.qvel[:] = rng.normal(size=m.nv)
        d.ctrl[:] = rng.normal(size=m.nu)
        d.time = 0
        data.qpos = d.qpos
        data.qvel = d.qvel
        data.ctrl = d.ctrl
        mujoco.mj_forward(m, d)
        # all in float64, by the same formulas: rounding alone
        assert np.allclose(data.xpos[1], d.xpos, rtol=0, atol=1e-12)
        assert np.allclose(data.xquat[1], d.xquat, rtol=0, atol=1e-12)
        assert np.allclose(data.sensordata[1], d.sensordata, rtol=1e-10, atol=1e-10)
        mujoco.mj_step(m, d)
        gsp.step(model, data)
        assert np.allclose(data.qpos[1], d.qpos, rtol=0, atol=1e-11)
        assert np.allclose(data.qvel[1], d.qvel, rtol=0, atol=1e-9)


def test_flags_can_be_switched_off(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    flags = {
        "gravity": mujoco.mjtDisableBit.mjDSBL_GRAVITY,
        "actuation": mujoco.mjtDisableBit.mjDSBL_ACTUATION,
        "damper": mujoco.mjtDisableBit.mjDSBL_DAMPER,
        "limit": mujoco.mjtDisableBit.mjDSBL_LIMIT,
    }
    for off in [[], *([name] for name in flags), ["gravity", "damper"]]:
        m = mujoco.MjModel.from_xml_string(ARM)
        for name in off:
            m.opt.disableflags |= flags[name]
        d = mujoco.MjData(m)
        d.qpos[2], d.qpos[7], d.qvel[6], d.ctrl[0] = 3, 1.1, 1, 0.7
        for model in (gsp.Model.from_xml(path, disable=off), gsp.Model.from_string(ARM, disable=tuple(off))):
            data = gsp.Data(model, profile="mujoco", precision="float64")
            data.qpos, data.qvel, data.ctrl = d.qpos, d.qvel, d.ctrl
            gsp.step(model, data)
            stepped = mujoco.MjData(m)
            stepped.qpos[:], stepped.qvel[:], stepped.ctrl[:] = d.qpos, d.qvel, d.ctrl
            mujoco.mj_step(m, stepped)
            assert np.allclose(data.qvel[0], stepped.qvel, rtol=0, atol=1e-9), off
    falls = gsp.Model.from_string(ARM, disable=["contact"])
    data = gsp.Data(falls)
    gsp.step(falls, data, n=500)
    assert data.qpos[0, 2] < -3  # through the floor: 0.4 - 9.81 / 2
    with pytest.raises(gsp.Error, match="no flag 'contacts'.*contact, damper"):
        gsp.Model.from_string(ARM, disable=["contacts"])
    with pytest.raises(TypeError):
        gsp.Model.from_string(ARM, disable="contact")


def test_reset_by_mask_and_keyframe(model):
    data = gsp.Data(model, worlds=4)
    gsp.step(model, data, n=20)
    mask = np.array([True, False, True, False])
    moved = data.qpos.numpy().copy()
    gsp.reset(model, data, mask=mask)
    assert np.array_equal(data.qpos[0], model.qpos0.astype(np.float32))
    assert np.array_equal(data.qpos[1], moved[1])
    assert list(data.steps) == [0, 20, 0, 20]
    gsp.reset(model, data, mask=[0, 1, 0, 0], keyframe="high")
    assert data.qpos[1, 2] == 1.5 and data.ctrl[1, 0] == 0.5 and data.qpos[3, 2] == moved[3, 2]
    gsp.reset(model, data)
    assert np.all(data.steps.numpy() == 0)
    with pytest.raises(gsp.Error, match="shape"):
        gsp.reset(model, data, mask=[True])
    with pytest.raises(gsp.Error, match="keyframe"):
        gsp.reset(model, data, keyframe="low")


def test_contacts_are_of_the_step_whatever_was_read_since(model):
    data = gsp.Data(model, worlds=2)
    data.sensordata
    assert len(data.contacts) == 0
    gsp.step(model, data, n=400)
    before = data.contacts
    assert len(before) > 0 and before.force.copy()[:, 0].max() > 1
    data.qpos[:, 2] += 1  # sensors see the state as it is: nothing touches there
    data.sensordata
    after = data.contacts
    for name in ("world", "geom1", "geom2", "dist", "pos", "frame", "force"):
        assert np.array_equal(getattr(before, name).copy(), getattr(after, name).copy()), name
    gsp.step(model, data)
    assert len(data.contacts) == 0


def test_contacts_and_saved_states(model):
    data = gsp.Data(model, worlds=2)
    gsp.step(model, data, n=600)
    c = data.contacts
    assert len(c) == data.counts.contacts > 0
    floor = model.id("geom", "floor")
    mine = np.asarray(c.world) == 0
    weight = np.asarray(c.force)[mine, 0].sum()
    assert abs(weight - 6 * 9.81) < 0.05 * 6 * 9.81  # it lies still: the floor bears what it weighs
    assert np.all(np.asarray(c.geom1)[mine] == floor)
    saved = data.save()
    gsp.step(model, data, n=50)
    once = data.qpos.numpy().copy()
    data.restore(saved)
    gsp.step(model, data, n=50)
    assert np.array_equal(data.qpos, once)
    before = np.asarray(c.force).copy()
    gsp.step(model, data, n=10)
    assert np.array_equal(before, c.force)  # copies


def test_more_worlds_than_memory_holds_are_refused(model):
    with pytest.raises(gsp.Error, match="2000000000 worlds need .* GB, and .* GB are free: make fewer worlds"):
        gsp.Data(model, worlds=2_000_000_000)


def test_wrong_arguments_are_one_sentence(model):
    data = gsp.Data(model, worlds=2)
    with pytest.raises(gsp.Error, match="profile 'fast'"):
        gsp.Data(model, profile="fast")
    with pytest.raises(gsp.Error, match="device 'tpu'"):
        gsp.Data(model, device="tpu")
    with pytest.raises(gsp.Error, match="worlds must be positive"):
        gsp.Data(model, worlds=0)
    with pytest.raises(gsp.Error, match=r"qpos has shape \(2, 7\) and must have \(2, 8\)"):
        data.qpos = np.zeros((2, 7))
    with pytest.raises(gsp.Error, match="complex128"):
        data.qpos = np.zeros((2, 8), dtype=complex)
    with pytest.raises(ValueError):
        data.qvel = np.zeros((3, 7))


def test_other_threads_run_and_ctrl_c_is_heard(model):
    data = gsp.Data(model, worlds=64)
    ticks = []
    stop = threading.Event()

    def tick():
        while not stop.wait(0.001):
            ticks.append(1)

    t = threading.Thread(target=tick)
    t.start()
    gsp.step(model, data, n=2000)
    stop.set()
    t.join()
    assert len(ticks) > 10
    code = f"""
import os, signal, threading, time, gsp
model = gsp.Model.from_string('''{ARM}''')
data = gsp.Data(model, worlds=256)
begin = []
def stop():
    begin.append(time.time())
    os.kill(os.getpid(), signal.SIGINT)
threading.Timer(0.5, stop).start()
try:
    gsp.step(model, data, n=10**9)
except KeyboardInterrupt:
    print("heard", time.time() - begin[0])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    word, seconds = done.stdout.split()
    assert word == "heard" and float(seconds) < 1


@pytest.mark.parametrize("order", ["data", "array", "renderer", "none", "exception"])
def test_ends_in_any_order(order):
    code = f"""
import numpy as np, gsp
model = gsp.Model.from_string('''{ARM}''')
data = gsp.Data(model)
a = np.from_dlpack(data.qpos)
scene = gsp.Scene(model).add_surface()
renderer = gsp.Renderer(scene, 32, 24)
frames = renderer.render(data, gsp.look_at([[2, 0, 1]], [0, 0, 0.4]), [gsp.pinhole(32, 24, 45)])
rgb = np.asarray(frames.rgb)
order = "{order}"
if order == "data": del data
if order == "array": del a, rgb, frames
if order == "renderer": del renderer, scene
if order == "exception": raise SystemExit(0)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "Kokkos" not in done.stderr


def test_pictures(model):
    data = gsp.Data(model, worlds=2)
    scene = gsp.Scene(model).add_room().add_surface()
    renderer = gsp.Renderer(scene, width=64, height=48)
    views = gsp.look_at([[1.5, 0, 0.8]] * 2, [0, 0, 0.4])
    frames = renderer.render(data, views, [gsp.pinhole(64, 48, 60)] * 2)
    rgb = np.asarray(frames.rgb)
    assert rgb.shape == (2, 48, 64, 3) and rgb.max() > 0.1 and np.array_equal(rgb[0], rgb[1])
    address = frames.rgb.pointer
    data.qpos[1, 2] += 0.5
    gsp.forward(model, data)
    again = renderer.render(data, views, [gsp.pinhole(64, 48, 60)] * 2)
    assert again.rgb.pointer == address and not np.array_equal(rgb[0], rgb[1])  # the same memory
    K = [gsp.pinhole(64, 48, 60)] * 2
    straight = np.array(renderer.render(data, views, K).rgb)
    assert np.array_equal(straight, np.array(renderer.render(data, views, K, distortion=[0, 0, 0, 0]).rgb))
    bent = np.array(renderer.render(data, views, K, distortion=[[0, 0, 0, 0], [-0.2, 0.02, 0, 0]]).rgb)
    assert np.array_equal(bent[0], straight[0]) and not np.array_equal(bent[1], straight[1])
    assert not np.array_equal(straight, np.array(renderer.render(data, views, K, distortion=[0, 0, 0, 0], fisheye=True).rgb))
    for bad, match in (([0.1], "give 4, 5 or 8"), ([0, 0, 0, np.nan], "not finite"), ([[0, 0, 0, 0]] * 3, "3 rows for 2 cameras")):
        with pytest.raises((ValueError, gsp.Error), match=match):
            renderer.render(data, views, K, distortion=bad)
    with pytest.raises(gsp.Error, match=r"render: fisheye=True needs distortion=\[k1, k2, k3, k4\]; zeros are the ideal fisheye"):
        renderer.render(data, views, K, fisheye=True)
    assert np.array_equal(straight, renderer.render(data, views, K[:1]).rgb)
    both = renderer.render(data, views, K, distortion=[-0.2, 0.02, 0, 0]).rgb.copy()
    assert np.array_equal(both, renderer.render(data, views, K[0], distortion=[[-0.2, 0.02, 0, 0]]).rgb)
    with pytest.raises(gsp.Error, match="3 Ks for 2 cameras: give one a camera, or one for all"):
        renderer.render(data, views, K[:1] * 3)
    with pytest.raises(gsp.Error, match="fovy"):
        gsp.pinhole(64, 48, 0)


def test_lenses_are_kept(model):
    data = gsp.Data(model, worlds=2)
    scene = gsp.Scene(model).add_surface()
    views, K = gsp.look_at([[1.5, 0, 0.8]] * 2, [0, 0, 0.4]), gsp.pinhole(32, 24, 60)

    def picture(renderer, distortion, fisheye):
        return renderer.render(data, views, K, distortion=distortion, fisheye=fisheye).rgb.copy()

    renderer = gsp.Renderer(scene, 32, 24)
    a, b, c = [-0.2, 0.02, 0, 0], [0.1, 0, 0.01, 0], [0, 0, 0, 0]
    for distortion, fisheye in (
        (a, False), (a, False), (a, True), (a, False), ([a, b], False), ([b, a], False), ([b, c], False), ([c, c], True), (b, False),
    ):  # fmt: skip
        assert np.array_equal(picture(renderer, distortion, fisheye), picture(gsp.Renderer(scene, 32, 24), distortion, fisheye))
    for bad in ([0.1, 0, 0.01, np.nan], [np.nan] * 4, [b, [np.nan, 0, 0, 0]]):
        with pytest.raises((ValueError, gsp.Error), match="not finite"):
            picture(renderer, bad, False)
    assert np.array_equal(picture(renderer, b, False), picture(gsp.Renderer(scene, 32, 24), b, False))

    # a lens for each of 100 cameras takes 15 to 40 ms to make, pictures that look aside 2
    data, renderer = gsp.Data(model), gsp.Renderer(scene, 8, 8)
    views, K = gsp.look_at([[1.5, 0, 0.8]] * 100, [3, 0, 0.8]), gsp.pinhole(8, 8, 60)

    def seconds(change):
        rows = np.zeros((100, 4))
        rows[:, 0] = np.linspace(-0.1, 0.1, 100) + change
        begin = time.perf_counter()
        renderer.render(data, views, K, distortion=rows)
        return time.perf_counter() - begin

    new = min(seconds(1e-4 * k) for k in range(1, 6))
    assert min(seconds(5e-4) for _ in range(5)) < 0.5 * new


def test_equalities_are_switched():
    text = '<mujoco><worldbody><body name="a"><freejoint/><geom size=".1"/></body></worldbody><equality><connect body1="a" anchor="0 0 0"/></equality></mujoco>'
    data = gsp.Data(gsp.Model.from_string(text), worlds=3)
    for value in (np.zeros((3, 1), np.int32), np.ones((3, 1), bool), np.zeros((3, 1), np.int64), 1, [[0], [1], [0]]):
        data.eq_active = value
        assert np.array_equal(np.asarray(data.eq_active), np.broadcast_to(value, (3, 1)))
    with pytest.raises(ValueError):
        data.eq_active = np.zeros((2, 1), bool)


# Through Kokkos' own tools interface: what a loop of steps, sensors and pictures allocates and copies once buffers have their size.
def test_a_loop_allocates_and_copies_nothing():
    tool = os.environ.get("GSP_KOKKOS_COUNTS")
    if not tool:
        pytest.skip("GSP_KOKKOS_COUNTS names no library (python/tests/kokkos_counts.cpp); ctest does")
    code = f"""
import ctypes, os, numpy as np, gsp
count = ctypes.CDLL(os.environ["KOKKOS_TOOLS_LIBS"]).gsp_count
device = os.environ.get("GSP_TEST_DEVICE", "cpu")
model = gsp.Model.from_string('''{ARM}''')
data = gsp.Data(model, worlds=1024, device=device)
renderer = gsp.Renderer(gsp.Scene(model).add_room().add_surface(), 64, 48, device=device, normals=True, ids=True, rgb8=True)
views, Ks = gsp.look_at([[1.5, 0, 0.8]] * 4, [0, 0, 0.4]), np.stack([gsp.pinhole(64, 48, 60)] * 4)
if device != "cpu":
    import torch
    views, Ks = torch.as_tensor(views, device=device), torch.as_tensor(Ks, device=device)
def loop():
    gsp.step(model, data, 5)
    data.sensordata
    renderer.render(data, views, Ks, develop=dict(noise=0.02, background=(0.5, 0.5, 0.5)), jitter=dict(position=0.01))
for _ in range(40):  # until the arms lie: the worlds of each thread have pools of their own, which grow while they fall
    loop()
before = [count(k) for k in range(3)]
assert before[0] > 0
for _ in range(20):
    loop()
print([count(k) - b for k, b in zip(range(3), before)])
copy = data.contacts.pos
assert count(0) > before[0]  # contacts are copies: that it counts
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, env={**os.environ, "KOKKOS_TOOLS_LIBS": tool})
    assert done.returncode == 0, done.stderr
    allocations, _, between = eval(done.stdout)
    assert allocations == 0, done.stdout
    # flags of pools, and where sensors are read a count of each world: its qpos alone would be 32 kB
    assert between <= 20 * (4 * 1024 + 100), done.stdout


def test_import_is_quick():
    code = "import time; t = time.perf_counter(); import gsp; print(time.perf_counter() - t)"
    runs = (float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout) for _ in range(5))
    assert any(seconds < 0.3 for seconds in runs)  # the least of five: others may be at work on the machine


def test_rows_of_all_worlds_of_one_and_of_one_for_all():
    text = ARM.replace("<worldbody>", '<worldbody><body name="hand" mocap="true" pos="1 0 0"><geom size="0.01" contype="0" conaffinity="0"/></body>')
    data = gsp.Data(gsp.Model.from_string(text), worlds=3)
    data.qvel = np.arange(21.0).reshape(3, 7)
    assert np.array_equal(data.qvel.numpy(), np.arange(21).reshape(3, 7))
    for given in (np.arange(7.0), np.arange(7.0).reshape(1, 7)):
        data.qvel = given
        assert np.array_equal(data.qvel.numpy(), np.tile(np.arange(7), (3, 1)))
    data.mocap_pos = np.arange(9.0).reshape(3, 1, 3)
    assert data.mocap_pos.numpy()[2, 0, 1] == 7
    data.qvel = [1, 2, 3, 4, 5, 6, 7]  # whole numbers too
    assert data.qvel[2, 6] == 7
    data.mocap_pos = [[0.5, 0.25, 0.125]]
    assert np.array_equal(data.mocap_pos.numpy(), np.tile([[[0.5, 0.25, 0.125]]], (3, 1, 1)))
    with pytest.raises(gsp.Error, match=r"qvel has shape \(3, 6\)"):
        data.qvel = np.zeros((3, 6))


def test_arrays_compare_and_calculate_as_numpys(model):
    data = gsp.Data(model, worlds=4)
    data.qpos[2, 0] = 3
    assert (data.qpos != model.qpos0.astype(np.float32)).sum() == 1 and not (data.status != 0).any()
    assert list(data.qpos[:, 0] > 1) == [False, False, True, False]
    fallen = (data.qpos.numpy()[:, 0] > 1) | (data.status != 0)
    assert list(fallen) == [False, False, True, False]
    assert data.qpos.dtype == np.float32 and data.qpos.dtype == "float32" and data.qpos.size == 32
    with pytest.raises(ValueError, match="ambiguous"):
        bool(data.qpos)
    assert np.array_equal(1 - data.qpos, 1 - data.qpos.numpy()) and np.array_equal(-data.qvel, -data.qvel.numpy())
    assert np.array_equal(data.qpos == data.qpos, np.ones((4, 8), bool))
    view = data.qvel
    view += 2  # into the memory
    assert view is not None and np.all(data.qvel.numpy() == 2)
    data.qvel += 1
    data.qpos -= [1, 0, 0, 0, 0, 0, 0, 0]
    assert np.all(data.qvel.numpy() == 3) and data.qpos[2, 0] == 2 and data.xpos[2, 1, 0] == 2
    with pytest.raises(TypeError):
        hash(data.qpos)


def test_whole_numbers_and_halves_are_numbers(model):
    data = gsp.Data(model, worlds=4)
    for value in (np.ones((4, 1), int), np.ones((4, 1), np.int32), np.ones((4, 1), bool), np.ones((4, 1), np.float16), [[1]] * 4, [1]):
        data.ctrl = 0 * np.asarray(value)
        data.ctrl = value
        assert np.all(data.ctrl.numpy() == 1), value
    data.qvel = np.ones(7, np.uint8)
    assert np.all(data.qvel.numpy() == 1)
    with pytest.raises(gsp.Error, match="complex128"):
        data.ctrl = np.ones((4, 1), complex)


def test_another_model_is_refused(model):
    data, other = gsp.Data(model), gsp.Model.from_string(ARM)
    for call in (lambda: gsp.step(other, data), lambda: gsp.forward(other, data), lambda: gsp.reset(other, data)):
        with pytest.raises(gsp.Error, match="of another model"):
            call()
    gsp.step(data.model, data)
    renderer = gsp.Renderer(gsp.Scene(other).add_surface(), 16, 16)
    with pytest.raises(gsp.Error, match="another model than the scene"):
        renderer.render(data, *data.cameras(["head"], 16, 16))


def test_masks_name_no_worlds(model):
    data = gsp.Data(model, worlds=4)
    with pytest.raises(gsp.Error, match="other numbers than 0 and 1"):
        gsp.reset(model, data, mask=[0, 2, 3, 3])
    gsp.step(model, data)
    gsp.reset(model, data, mask=np.array([1, 0, 0, 1], np.uint8))
    assert list(data.steps) == [0, 1, 1, 0] and np.allclose(data.time, [0, 0.002, 0.002, 0])


def test_contacts_before_there_are_any(model):
    for profile in ("stable", "mujoco"):
        data = gsp.Data(model, worlds=2, profile=profile)
        assert len(data.contacts) == 0 and data.contacts.frame.shape == (0, 9)
        saved = data.save()
        gsp.step(model, data, n=400)
        assert len(data.contacts) > 0
        data.restore(saved)
        assert len(data.contacts) == 0 and data.contacts.force.numpy().shape == (0, 6)


def test_snapshots_from_a_file(model, tmp_path):
    data = gsp.Data(model, worlds=2)
    gsp.step(model, data, n=10)
    np.savez(tmp_path / "s.npz", **data.save())
    at = data.qpos.copy()
    gsp.step(model, data, n=10)
    data.restore(np.load(tmp_path / "s.npz"))
    assert np.array_equal(data.qpos, at)


def test_cameras_are_mujocos(model):
    mujoco = pytest.importorskip("mujoco")
    m = mujoco.MjModel.from_xml_string(ARM)
    d = mujoco.MjData(m)
    d.qpos[:8] = [0.3, -0.2, 1, 0.6, 0.4, -0.3, 0.6, 0.2]
    d.qpos[3:7] /= np.linalg.norm(d.qpos[3:7])
    data = gsp.Data(model, worlds=3, precision="float64")
    data.qpos = d.qpos
    mujoco.mj_forward(m, d)
    on_body = dict(body="base", pos=(0.25, 0, 0.1), quat=(0.5, 0.5, -0.5, -0.5), fovy=50)
    views, Ks, world = data.cameras(["head", on_body], 64, 48)
    assert list(world) == [0, 0, 1, 1, 2, 2]
    turn = np.diag([1, -1, -1]) @ d.cam_xmat[0].reshape(3, 3).T  # MuJoCo's camera looks along -z, y up
    expected = np.eye(4)
    expected[:3, :3], expected[:3, 3] = turn, -turn @ d.cam_xpos[0]
    assert np.allclose(views.numpy(), expected, rtol=0, atol=1e-6)
    assert np.allclose(Ks.numpy(), gsp.pinhole(64, 48, 50), rtol=1e-6)
    # target: as look_at has it, and straight down and up; of a body in its frame
    for eye, at in (((2, -1, 1.5), (0, 0, 0.5)), ((0, 0, 2), (0, 0, 0)), ((0, 0, 0), (0, 0, 1)), ((1, 1, 1), (-2, 1, 1))):
        aimed = data.cameras([dict(body="world", pos=eye, target=at)], 64, 48)[0].numpy()
        up = (0, 0, 1) if eye[:2] != at[:2] else (0, 1, 0) if eye[2] > at[2] else (0, -1, 0)
        assert np.allclose(aimed, gsp.look_at(eye, at, up), rtol=0, atol=1e-6)
    aimed = data.cameras([dict(body="base", pos=(0.25, 0, 0.1), target=(2, 0.5, 0))], 64, 48)[0].numpy()[0]
    base = mujoco.mj_name2id(m, mujoco.mjtObj.mjOBJ_BODY, "base")
    seen = aimed @ [*(d.xpos[base] + d.xmat[base].reshape(3, 3) @ [2, 0.5, 0]), 1]
    assert np.allclose(seen[:2], 0, atol=1e-6) and np.isclose(seen[2], np.linalg.norm([1.75, 0.5, 0.1]), rtol=1e-6)
    with pytest.raises(gsp.Error, match="gsp.Data.cameras: .*foot"):
        data.cameras(["foot"])
    with pytest.raises(gsp.Error, match="no 'fov'"):
        data.cameras([dict(body="base", fov=3)])
    frames = gsp.Renderer(gsp.Scene(model).add_room().add_surface(), 64, 48).render(data, *data.cameras(["head"], 64, 48))
    assert frames.rgb.shape == (3, 48, 64, 3) and np.array_equal(frames.rgb[0], frames.rgb[2])


def test_one_camera_and_channels_that_were_not_asked_for(model):
    data = gsp.Data(model, worlds=2)
    scene = gsp.Scene(model).add_room()
    eyes = gsp.look_at([[0, -2, 1.5], [0, 2, 1.5]], [0, 0, 1])
    one = gsp.Renderer(scene, 32, 24, depth=False).render(data, eyes[0], gsp.pinhole(32, 24, 60))
    assert one.rgb.shape == (1, 24, 32, 3)
    with pytest.raises(gsp.Error, match="no depth.*depth=True"):
        one.depth
    two = gsp.Renderer(scene, 32, 24).render(data, eyes, gsp.pinhole(32, 24, 60))
    assert np.array_equal(two.rgb[0], one.rgb[0])
    colours = gsp.depth_to_rgb(two.depth[0])
    for near, far in ((3, 1), (float("nan"), 2), (0, float("inf")), (-1, 2)):
        with pytest.raises(gsp.Error, match="depth_to_rgb: near is"):
            gsp.depth_to_rgb(two.depth[0], near, far)
    assert colours.shape == (24, 32, 3) and colours.dtype == np.uint8 and len(np.unique(colours)) > 10
    with pytest.raises(gsp.Error, match="positive"):
        gsp.Renderer(scene, 0, 24)


def box_on_a_hinge():
    """A box on a hinge, 1 m above the origin, and a scene of its Gaussians alone."""
    model = gsp.Model.from_string(
        '<mujoco><worldbody><body name="base"><body name="box" pos="0 0 1"><joint/><geom type="box" size="0.5 0.5 0.2"/></body></body></worldbody></mujoco>'
    )
    return model, gsp.Scene(model).add_surface()


def test_normals():
    model, scene = box_on_a_hinge()
    data = gsp.Data(model, worlds=2)
    at = gsp.look_at([[0, 0, 3], [3, 0, 1]], [0, 0, 1], up=[0, 1, 0]), gsp.pinhole(64, 48, 40)
    for median in (False, True):
        renderer = gsp.Renderer(scene, 64, 48, depth=False, normals=True, median_depth=median)
        frames = renderer.render(data, *at)
        normals = frames.normals.numpy()
        assert normals.shape == (2, 48, 64, 3) and normals.dtype == np.float32
        assert np.all(normals[:, 0] == 0) and np.all(normals[:, :, -1] == 0)
        length = np.linalg.norm(normals, axis=-1)
        assert np.all((length == 0) | (np.abs(length - 1) < 1e-5))
        for c, axis in ((0, [0, 0, 1]), (1, [1, 0, 0])):  # the box's top and its side, in the middle of the pictures
            assert np.median(normals[c, 20:28, 28:36] @ axis) > 0.9
        address = frames.normals.pointer
        assert renderer.render(data, *at).normals.pointer == address
        assert "normals (2, 48, 64, 3)" in repr(frames)
        with pytest.raises(gsp.Error, match="no depth"):
            frames.depth
    with pytest.raises(gsp.Error, match="no normals.*normals=True"):
        gsp.Renderer(scene, 64, 48).render(data, *at).normals


def test_ids():
    model, scene = box_on_a_hinge()
    data = gsp.Data(model)
    at = gsp.look_at([0, 0, 3], [0, 0, 1], up=[0, 1, 0]), gsp.pinhole(64, 48, 40)
    box = model.id("body", "box")
    for median in (False, True):
        frames = gsp.Renderer(scene, 64, 48, ids=True, median_depth=median).render(data, *at)
        ids, alpha = frames.ids.numpy(), frames.alpha.numpy()
        assert ids.shape == (1, 48, 64) and ids.dtype == np.int32 and "ids (1, 48, 64)" in repr(frames)
        assert np.array_equal(ids, np.where(alpha >= 0.5, box, -1)) and ids[0, 24, 32] == box and ids[0, 0, 0] == -1
        assert np.array_equal(frames.rgb, gsp.Renderer(scene, 64, 48).render(data, *at).rgb)
    scene.add_room()
    at = gsp.look_at([1.5, 0, 1], [0, 0, 1]), gsp.pinhole(64, 48, 60)
    ids = gsp.Renderer(scene, 64, 48, rgb=False, ids=True).render(data, *at).ids.numpy()
    assert set(np.unique(ids)) <= {-1, 0, box} and np.sum(ids == 0) > 100 and ids[0, 24, 32] == box


def test_developed_pictures():
    model, scene = box_on_a_hinge()
    data = gsp.Data(model, worlds=2)
    at = gsp.look_at([[0, 0, 3], [0, 0.5, 3]], [0, 0, 1], up=[0, 1, 0]), gsp.pinhole(64, 48, 40)
    alone = gsp.Renderer(scene, 64, 48, rgb=False, depth=False, alpha=False, rgb8=True)
    renderer = gsp.Renderer(scene, 64, 48, rgb8=True)

    def develop(**words):
        return renderer.render(data, *at, develop=words).rgb8.copy()

    def bits(light):
        return np.floor(np.clip(light, 0, 1) * 255 + 0.5)

    frames = renderer.render(data, *at)
    rgb, alpha = frames.rgb.copy(), frames.alpha.numpy()[..., None].copy()
    assert frames.rgb8.shape == (2, 48, 64, 3) and frames.rgb8.dtype == np.uint8 and frames.rgb8.nbytes == 2 * 48 * 64 * 3
    assert np.abs(frames.rgb8.numpy() - bits(rgb)).max() <= 1 and np.array_equal(frames.rgb8.copy(), frames.rgb8.numpy())
    assert np.array_equal(np.from_dlpack(frames.rgb8), frames.rgb8) and "rgb8 (2, 48, 64, 3)" in repr(frames)
    assert np.array_equal(alone.render(data, *at).rgb8, frames.rgb8)
    rng = np.random.default_rng(0)
    for background in ((0.2, 1, 0), rng.random((48, 64, 3)), rng.random((2, 48, 64, 3)).astype(np.float32)):
        assert np.abs(develop(background=background) - bits(rgb + (1 - alpha) * np.asarray(background))).max() <= 1
    brighter = develop(background=(0.5, 0.5, 0.5), exposure=0.5, seed=3)
    change = brighter[:, 0, 0, 0] / 127.5
    assert np.all((change > 2**-0.5 - 0.01) & (change < 2**0.5 + 0.01)) and change[0] != change[1]
    noise = develop(background=(0.5, 0.5, 0.5), noise=0.05, seed=3, step=7)
    nothing = alpha[..., 0] == 0
    assert abs(noise[nothing].std() / 255 - 0.05) < 0.005 and abs(noise[nothing].mean() - 127.5) < 1
    assert np.array_equal(noise, develop(background=[0.5] * 3, noise=np.float32(0.05), seed=np.uint64(3), step=np.int32(7)))
    for other in (dict(seed=4, step=7), dict(seed=3, step=8), dict(seed=3, step=7, first_image=2)):
        assert not np.array_equal(noise, develop(background=[0.5] * 3, noise=0.05, **other))
    second = renderer.render(data, at[0][1], at[1], world=[1], develop=dict(background=[0.5] * 3, noise=0.05, seed=3, step=7, first_image=1))
    assert np.array_equal(second.rgb8[0], noise[1])
    renderer.render(data, *at)
    address = renderer.render(data, *at).rgb8.pointer
    assert renderer.render(data, *at, develop=dict(noise=0.1)).rgb8.pointer == address
    with pytest.raises(gsp.Error, match="contrast"):  # of another number of cameras, and refused: these pictures stay where they are
        renderer.render(data, at[0][0], at[1], world=[0], develop=dict(contrast=2))
    assert renderer.render(data, *at).rgb8.pointer == address
    for words, match in (
        (dict(exposre=1), "develop has no 'exposre': give exposure, contrast"),
        (dict(exposure=-1), "develop: exposure is -1: give a number of 0 or more, below 1e[+]06"),
        (dict(contrast=1.5), "contrast is 1.5: give a number of 0 or more, at most 1"),
        (dict(noise=np.nan), "noise is nan"),
        (dict(brightness="much"), "brightness is 'much'"),
        (dict(step=1.5), "develop: step is 1.5: give a whole number"),
        (dict(step=-1), "step is -1: give a whole number from 0 to 72057594037927935"),
        (dict(step=2**64), "step is 18446744073709551616: give a whole number"),
        (dict(seed=-1), "seed is -1: give a whole number"),
        (dict(background=(1, 1)), "background has 2 numbers: give a colour of 3"),
        (dict(background=np.zeros((48, 64, 3), np.uint8)), "background holds whole numbers.*255"),
        (dict(background=np.zeros((24, 32, 3))), "background has shape"),
        (dict(background=np.zeros((3, 48, 64, 3))), r"develop: the background is \(3, 48, 64, 3\) and must be \(1 or 2, 48, 64, 3\)"),
        (dict(background=(0, -1, 0)), "develop: background is -1"),
    ):
        with pytest.raises(gsp.Error, match=match):
            develop(**words)
    # chance of each picture: that of a picture of another number, of a batch of one, in a call of its own
    rows = np.array([[3, 5, 1], [3, 5, 0]])
    words = dict(exposure=0.3, noise=0.05)
    both, crossed = develop(**words, seed=3, step=5), develop(**words, chance=rows[::-1])
    assert np.array_equal(both, crossed)
    assert not np.array_equal(both, develop(**words, chance=rows))
    assert not np.array_equal(both, develop(**words, seed=3, step=5, light_chance=rows))
    assert np.array_equal(develop(noise=0.05, seed=3, step=5), develop(noise=0.05, seed=3, step=5, light_chance=rows))
    for words, match in (
        (dict(chance=rows, step=1), "develop: chance says seed, step and number of each picture: leave seed, step and first_image out"),
        (dict(chance=rows[:1]), "develop: chance has 1 rows for 2 images: give each a seed"),
        (dict(chance=rows[:, :2]), "develop: chance has shape"),
        (dict(chance=rows / 2), r"chance is float64 of shape \(2, 3\): give \(C, 3\) whole numbers"),
        (dict(light_chance=-rows), "light_chance: the step of picture 0 is -5: give a whole number from 0 to"),
        (dict(chance=rows << 32), "the number of picture 0 is 4294967296: give a whole number from 0 to 4294967295"),
    ):
        with pytest.raises(gsp.Error, match=match):
            develop(**words)
    for background, said in (
        ((255, 128, 0), r"background is 255.*give numbers of 0 to 1"),
        (np.full((48, 64, 3), np.nan), "background holds nan: give numbers of 0 and above"),
        (np.full((48, 64, 3), -5.0), "background holds -5"),
        (np.full((48, 64, 3), np.inf), "background holds inf"),
    ):
        with pytest.raises(gsp.Error, match=said):
            develop(background=background)
    with pytest.raises(gsp.Error, match="^gsp.Renderer.render: distortion: .*coefficient 0 is not finite"):
        renderer.render(data, *at, distortion=[np.nan, 0, 0, 0])
    with pytest.raises(gsp.Error, match="jitter: chance says seed"):
        renderer.render(data, *at, jitter=dict(seed=1, chance=rows))
    jitter = dict(position=0.1, rotation=0.1)
    assert np.array_equal(
        renderer.render(data, *at, jitter=dict(**jitter, seed=3, step=5)).rgb.copy(), renderer.render(data, *at, jitter=dict(**jitter, chance=rows[::-1])).rgb.copy()
    )
    # a call that is refused has drawn nothing
    frames = renderer.render(data, *at)
    before = [a.copy() for a in (frames.rgb, frames.depth, frames.rgb8)]
    for words in (dict(develop=dict(contrast=2)), dict(jitter=dict(rotation=4)), dict(develop=dict(background=np.zeros((3, 48, 64, 3))))):
        with pytest.raises(gsp.Error, match="render: (develop|jitter): "):
            renderer.render(data, at[0][::-1], at[1], **words)
        for a, b in zip(before, (frames.rgb, frames.depth, frames.rgb8)):
            assert np.array_equal(a, b)
    # nor is a background read that is drawn over meanwhile
    both = gsp.Renderer(scene, 64, 48, rgb8=True, normals=True)
    frames = both.render(data, *at)
    for background in (frames.rgb[0], frames.rgb, frames.rgb.numpy()[1:]):
        with pytest.raises(gsp.Error, match=r"gsp.Renderer.render: the background lies in the pictures that are to be drawn: copy\(\) it first"):
            both.render(data, *at, develop=dict(background=background))
    background = frames.rgb.copy()
    assert np.array_equal(both.render(data, *at, develop=dict(background=background)).rgb8, develop(background=background))
    with pytest.raises(gsp.Error, match="develop is 0.5: give a dict"):
        renderer.render(data, *at, develop=0.5)
    with pytest.raises(gsp.Error, match="develop is of rgb8.*rgb8=True"):
        gsp.Renderer(scene, 64, 48).render(data, *at, develop=dict(noise=0.1))


def test_jittered_cameras():
    model, scene = box_on_a_hinge()
    data = gsp.Data(model)
    at = gsp.look_at([[0, 0, 3]] * 3, [0, 0, 1], up=[0, 1, 0]), gsp.pinhole(64, 48, 40)
    views = at[0].copy()
    renderer = gsp.Renderer(scene, 64, 48, normals=True)

    def pictures(**jitter):
        return renderer.render(data, *at, jitter=jitter).depth.copy()

    straight = renderer.render(data, *at).depth.copy()
    assert np.array_equal(pictures(seed=1, step=2), straight)
    # depth of the box's top tells how far each camera went along its axis
    moved = pictures(position=0.2, seed=1)
    far = moved[:, 24, 32] - straight[:, 24, 32]
    assert np.all(np.abs(far) < 0.2) and len(set(far.round(4))) == 3 and np.abs(far).max() > 0.01
    assert np.array_equal(pictures(position=0.2, seed=1), moved)
    second = renderer.render(data, at[0][1], at[1], jitter=dict(position=0.2, seed=1, first_image=1)).depth[0]
    assert np.array_equal(second, moved[1])
    for other in (dict(position=0.2, seed=2), dict(position=0.2, seed=1, step=1), dict(rotation=0.1), dict(focal=0.2), dict(principal=5)):
        changed = pictures(**other)
        assert not np.array_equal(changed, moved) and not np.array_equal(changed[0], changed[1])
    assert np.array_equal(at[0], views) and np.array_equal(renderer.render(data, *at).depth, straight)
    # normals are of the cameras that drew the depth, in world axes: however much they turn, the top looks up
    normals = renderer.render(data, *at, jitter=dict(rotation=0.2, seed=5)).normals.numpy()
    assert np.all(np.median(normals[:, 20:28, 28:36, 2], axis=(1, 2)) > 0.9)
    for words, match in (
        (dict(positon=1), "jitter has no 'positon': give position, rotation, focal, principal, chance, seed, step, first_image"),
        (dict(rotation=4), "jitter: rotation is 4: give a number of 0 or more, at most 3.14159"),
        (dict(focal=1), "focal is 1: give a number of 0 or more, below 1"),
        (dict(step=2**56), "step is 72057594037927936: give a whole number"),
        (dict(first_image=2**32 - 2), "first_image is 4294967294: give a whole number from 0 to 4294967293"),
    ):
        with pytest.raises(gsp.Error, match=match):
            pictures(**words)


def test_cameras_that_stand_still_have_the_pictures_of_render(model):
    data = gsp.Data(model, worlds=3)
    renderer = gsp.Renderer(gsp.Scene(model).add_room().add_surface(), 48, 36, normals=True, rgb8=True)
    renderer.show([[0, 1], [1], [0, 1]])
    at = gsp.look_at([[1, -1, 1], [1, -1, 1], [0.5, 1, 0.8]], [0, 0, 0.3]), gsp.pinhole(48, 36, 60)
    lens = dict(distortion=[-0.1, 0.02, 0, 0])
    for words in (dict(), lens, dict(world=[2, 0, 1])):
        fixed = renderer.fixed(data, *at, **words)
        assert repr(fixed) == "gsp.FixedRenderer(48 x 36, 3 worlds)"
        before = None
        for k in range(4):
            data.qvel = np.random.default_rng(k).normal(size=(3, model.nv))
            gsp.step(model, data, n=20)
            develop = dict(noise=0.02, background=(0.5, 0.6, 0.7), step=k)
            still, drawn = fixed.render(data, develop=develop), renderer.render(data, *at, **words, develop=develop)
            for name in ("rgb", "depth", "alpha", "normals", "rgb8"):
                assert np.array_equal(getattr(still, name), getattr(drawn, name)), (words, k, name)
            assert before is None or not np.array_equal(before, still.rgb)
            before = still.rgb.copy()
    address = still.rgb.pointer
    del renderer
    assert fixed.render(data).rgb.pointer == address
    kept = fixed.render(data).rgb
    before = kept.copy()
    with pytest.raises(gsp.Error, match="for reading.*drawn once.*copy()"):
        kept[0] = 0
    assert kept.read_only and not fixed.render(data).rgb8.read_only
    del fixed, still
    another = gsp.Renderer(gsp.Scene(model).add_surface(), 48, 36).render(data, *at).rgb.copy()
    assert np.array_equal(kept, before) and not np.array_equal(before, another)
    with pytest.raises(gsp.Error, match="no median_depth and no ids"):
        gsp.Renderer(gsp.Scene(model).add_room(), 48, 36, ids=True).fixed(data, *at)
    fixed = gsp.Renderer(gsp.Scene(model).add_room(), 48, 36).fixed(data, *at)
    with pytest.raises(gsp.Error, match="not of the model and the 3 worlds"):
        fixed.render(gsp.Data(model, worlds=2))
    assert (fixed.width, fixed.height) == (48, 36)
    with pytest.raises(gsp.Error, match="^gsp.FixedRenderer.render: develop is of rgb8"):
        fixed.render(data, develop=dict(noise=0.1))
    # who was called is named
    renderer = gsp.Renderer(gsp.Scene(model).add_room(), 48, 36, rgb8=True)
    for r, arguments, of in ((renderer, at, "gsp.Renderer.render"), (renderer.fixed(data, *at), (), "gsp.FixedRenderer.render")):
        for develop, said in ((dict(contrast=2), "develop: contrast is 2"), (dict(background=np.zeros((9, 36, 48, 3))), "develop: the background is")):
            with pytest.raises(gsp.Error, match=f"^{of}: {said}"):
                r.render(data, *arguments, develop=develop)
    with pytest.raises(gsp.Error, match="^gsp.Renderer.render: jitter: rotation is 4"):
        renderer.render(data, *at, jitter=dict(rotation=4))


def test_pictures_that_fit_in_no_memory_are_refused(model):
    data = gsp.Data(model)
    at = gsp.look_at([2, 0, 1], [0, 0, 0]), gsp.pinhole(40000, 40000, 60)
    renderer = gsp.Renderer(gsp.Scene(model).add_room(), 40000, 40000)
    with pytest.raises(gsp.Error, match=r"^gsp.Renderer.render: 64 pictures need [0-9.e+]+ GB, and .* GB are free: draw smaller ones"):
        renderer.render(data, np.tile(at[0], (64, 1, 1)), at[1])
    renderer.show([[0]])  # whose renderer holds no picture yet
    with pytest.raises(gsp.Error, match="^gsp.Renderer.render: 64 pictures need"):
        renderer.render(data, np.tile(at[0], (64, 1, 1)), at[1])
    # what nobody holds is let go, what is held stays
    small = gsp.Renderer(gsp.Scene(model).add_room(), 48, 36)
    at = gsp.look_at([2, 0, 1], [0, 0, 0]), gsp.pinhole(48, 36, 60)
    expected = small.render(data, *at).rgb.copy()
    assert np.array_equal(small.render(data, np.tile(at[0], (3, 1, 1)), at[1]).rgb[2], expected[0])
    view = small.render(data, *at).rgb.numpy()
    turned = small.render(data, gsp.look_at([[0, 2, 1], [1, 2, 1]], [0, 0, 0]), at[1])
    assert np.array_equal(view, expected) and not np.array_equal(turned.rgb[0], expected[0])
    with pytest.raises(gsp.Error, match=r"^gsp.Renderer.fixed: 64 pictures need [0-9.e+]+ GB"):
        renderer.fixed(data, np.tile(at[0], (64, 1, 1)), at[1])
    with pytest.raises(gsp.Error, match="width and height must be positive, 65536 at most, and are 70000 and 20"):
        gsp.Renderer(gsp.Scene(model).add_room(), 70000, 20)


def test_each_world_shows_its_own_sets(model):
    data = gsp.Data(model, worlds=3)
    room, robot = gsp.Scene(model).add_room(), gsp.Scene(model).add_surface()
    view, K = gsp.look_at([1, -1, 1], [0, 0, 0.3]), gsp.pinhole(32, 24, 60)
    views = np.stack([view] * 3)
    both = gsp.Renderer(gsp.Scene(model).add_room().add_surface(), 32, 24)
    frames = both.render(data, views, K)
    view_of_memory, everything = frames.rgb.numpy(), frames.rgb.copy()
    both.show([[0], [1], [1, 0]])
    shown = both.render(data, views, K)
    assert shown.rgb.pointer == frames.rgb.pointer and np.array_equal(view_of_memory, shown.rgb)  # views that are held see it too
    assert np.array_equal(shown.rgb[2], everything[0])
    assert np.array_equal(shown.rgb[0], gsp.Renderer(room, 32, 24).render(data, view, K).rgb[0])
    assert np.array_equal(shown.rgb[1], gsp.Renderer(robot, 32, 24).render(data, view, K).rgb[0])
    assert not np.array_equal(shown.rgb[0], shown.rgb[1])
    both.show([])
    assert np.array_equal(both.render(data, views, K).rgb, everything)
    assert np.array_equal(view_of_memory, everything)
    few = gsp.Renderer(gsp.Scene(model).add_room().add_surface(), 32, 24)
    few.show([[1], [1], [1]])  # from a small set to all: buffers grow, and the pictures stay where they are
    small = few.render(data, views, K)
    view_of_memory = small.rgb.numpy()
    few.show([])
    assert few.render(data, views, K).rgb.pointer == small.rgb.pointer and np.array_equal(view_of_memory, everything)
    with pytest.raises(ValueError, match="^gsp.Renderer.show: world 1 names set 2, and there are 2, numbered from 0"):
        both.show([[0], [2], [1]])
    assert np.array_equal(both.render(data, views, K).rgb, everything)  # a show that was refused changes nothing


def test_splats_are_put_where_they_are_said_to_stand(model, tmp_path):
    path = DATA / "splats" / "biker.compressed.ply"
    if not path.exists():
        pytest.skip(f"{path} is missing")
    data = gsp.Data(model)
    K = gsp.pinhole(48, 36, 60)
    half = 0.5**0.5
    as_it_is = gsp.Renderer(gsp.Scene(model).add_splats(path), 48, 36)
    turned = gsp.Renderer(gsp.Scene(model).add_splats(path, pos=(1, 2, 3), quat=(half, -half, 0, 0), scale=2), 48, 36)
    turn = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)  # by -90 degrees about x
    view = gsp.look_at([0.5, -3, -4], [0, 0, 0]).astype(float)
    moved = np.eye(4)
    moved[:3, :3] = view[:3, :3] @ turn.T
    moved[:3, 3] = 2 * view[:3, 3] - moved[:3, :3] @ [1, 2, 3]
    a, b = as_it_is.render(data, view, K), turned.render(data, moved, K)
    assert a.alpha.numpy().max() > 0.5
    assert np.abs(a.rgb.numpy() - b.rgb.numpy()).mean() < 1e-3 and np.allclose(2 * a.depth.numpy(), b.depth, rtol=0.02, atol=0.02)


def in_threads(*calls):
    """Each in a thread; the errors that they gave."""
    errors = [None] * len(calls)

    def run(k):
        try:
            calls[k]()
        except gsp.Error as error:
            errors[k] = str(error)

    threads = [threading.Thread(target=run, args=(k,)) for k in range(len(calls))]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    return errors


def test_two_threads_at_one_data(model):
    data = gsp.Data(model, worlds=256)
    errors = in_threads(*[lambda: gsp.step(model, data, n=2000)] * 3)
    done = errors.count(None)
    assert done >= 1 and all("another thread" in e for e in errors if e)
    assert set(data.steps) == {2000 * done} and set(data.status) == {0}  # who was refused did nothing, who was not did all
    own = [gsp.Data(model, worlds=256) for _ in range(3)]
    assert in_threads(*[lambda d=d: gsp.step(model, d, n=2000) for d in own]) == [None] * 3
    assert all(np.array_equal(d.qpos, own[0].qpos) for d in own)
    renderer = gsp.Renderer(gsp.Scene(model).add_room(), 64, 48)
    eye, K = gsp.look_at([0, -2, 1.5], [0, 0, 1]), gsp.pinhole(64, 48, 60)
    alone = renderer.render(own[0], eye, K).rgb.copy()
    errors = in_threads(*[lambda d=d, n=n: renderer.render(d, np.repeat(eye[None], n, 0), K) for n, d in enumerate(own, 1)])
    assert all(e is None or "this renderer" in e for e in errors) and None in errors
    assert np.array_equal(renderer.render(own[0], eye, K).rgb, alone)


def test_setters_broadcast_and_know_their_own_memory(model):
    data = gsp.Data(model, worlds=3)
    data.qvel = np.arange(21).reshape(3, 7)
    data.qvel = data.qvel[1]  # one row of it for all
    assert np.array_equal(data.qvel, [np.arange(7, 14)] * 3)
    data.qvel = np.arange(21).reshape(3, 7)
    data.qvel = data.qvel.numpy()[::-1]
    assert np.array_equal(data.qvel, np.arange(21).reshape(3, 7)[::-1])
    data.qvel = 0
    assert not np.any(data.qvel.numpy())
    data.ctrl = 0.3
    data.ctrl = [[0.1], [0.2], [0.3]]
    assert np.allclose(data.ctrl[:, 0], [0.1, 0.2, 0.3])
    view = data.qvel
    view **= 2
    view += np.ones(7)
    assert np.all(data.qvel.numpy() == 1)
    at = model.qpos0 + np.array([1000.00003, 0, 0, 0, 0, 0, 0, 0])
    data.qpos = at
    low = data.qpos_low.copy()
    data.qpos = data.qpos  # nothing is lost
    assert np.array_equal(data.qpos_low, low) and low[0, 0] != 0
    data.qpos = data.qpos[0]
    assert not np.any(data.qpos_low.numpy())
    record = np.zeros(3, dtype=[("a", "i4"), ("q", "f8", 8)])
    record["q"] = at
    data.qpos = record["q"]
    assert np.allclose(data.qpos.numpy() + data.qpos_low.numpy().astype(float), [at] * 3, rtol=0, atol=1e-10)
    data.qpos = at.astype(">f8")
    assert data.qpos[1, 0] == np.float32(1000.00003)
    with pytest.raises(gsp.Error, match=r"qvel has shape \(4,\) and must have \(3, 7\)"):
        data.qvel = np.zeros(4)


def test_cameras_stay_where_they_are(model):
    data = gsp.Data(model, worlds=2)
    first = data.cameras(["head"], 64, 48)[0].numpy()
    before = first.copy()
    for n in range(20):
        data.cameras(["head"] * (n + 2), 32 + n, 24)
    assert np.array_equal(first, before)
    data.qpos[:, 0] += 1
    gsp.forward(model, data)
    assert data.cameras(["head"], 64, 48)[0].pointer == first.ctypes.data and not np.array_equal(first, before)


def test_other_kinds_of_arguments(model):
    with pytest.raises(gsp.Error, match=r"models come of files: gsp.Model.from_xml\(path\)"):
        gsp.Model("robot.xml")
    data = gsp.Data(model)
    for call in (
        lambda: gsp.reset(model, data, keyframe=1.5),
        lambda: data.jacobian(body=[1]),
    ):
        with pytest.raises(TypeError):
            call()
    saved = data.save()
    assert int(saved["version"]) == 1
    with pytest.raises(gsp.Error, match="another version"):
        data.restore({**saved, "version": 99})


def test_a_forked_process_says_what_it_misses():
    program = (
        "import os, gsp\n"
        "m = gsp.Model.from_string('<mujoco><worldbody><body><freejoint/><geom size=\".1\"/></body></worldbody></mujoco>')\n"
        "d = gsp.Data(m, worlds=4096); gsp.step(m, d)\n"
        "pid = os.fork()\n"
        "if pid == 0:\n"
        "    try: gsp.step(m, d); os._exit(1)\n"
        "    except gsp.Error as e: os._exit(0 if 'spawn' in str(e) else 2)\n"
        "raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))\n"
    )
    threads = {**os.environ, "OMP_NUM_THREADS": "2"}
    assert subprocess.run([sys.executable, "-c", program], env=threads, timeout=60).returncode == 0


def test_what_the_library_refuses_is_one_kind_of_error(model):
    data = gsp.Data(model)
    with pytest.raises(gsp.Error, match="body"):
        data.jacobian(body=99)
    with pytest.raises(gsp.Error, match="nearest: .link."):
        data.jacobian(body="lnk")
    assert np.array_equal(data.jacobian(body="link"), data.jacobian(body=2))
    with pytest.raises(gsp.Error, match="threads"):
        gsp.Data(model, threads=-1)


def test_late_sensors_do_not_hang_on_who_asks():
    mujoco = pytest.importorskip("mujoco")
    xml = """<mujoco><worldbody><body><joint name="j" axis="0 1 0"/><geom size="0.1" pos="0.3 0 0"/></body></worldbody>
      <sensor><jointpos joint="j" delay="0.01" nsample="6"/></sensor></mujoco>"""
    m = mujoco.MjModel.from_xml_string(xml)
    d = mujoco.MjData(m)
    model = gsp.Model.from_string(xml)
    asked, silent = (gsp.Data(model, profile="mujoco", precision="float64") for _ in range(2))
    asked.sensordata
    for _ in range(100):
        mujoco.mj_step(m, d)
        gsp.step(model, asked)
        asked.sensordata
    gsp.step(model, silent, n=100)
    mujoco.mj_forward(m, d)
    assert silent.sensordata[0, 0] == asked.sensordata[0, 0] == pytest.approx(d.sensordata[0], abs=1e-10) and d.sensordata[0] > 0.1
    other = gsp.Data(model, profile="mujoco", precision="float64")
    other.restore(silent.save())
    assert other.sensordata[0, 0] == silent.sensordata[0, 0]


def test_another_number_of_cameras_shares_the_scene(model):
    data = gsp.Data(model)
    renderer = gsp.Renderer(gsp.Scene(model).add_room().add_surface(), 32, 24)
    eyes = gsp.look_at([[0, -2, 1.5], [0, 2, 1.5], [2, 0, 1.5]], [0, 0, 1])
    K = gsp.pinhole(32, 24, 60)
    three = renderer.render(data, eyes, K)
    kept = three.rgb.copy()
    for n in (1, 2, 1, 3):
        assert np.array_equal(renderer.render(data, eyes[:n], K).rgb, kept[:n])
    assert np.array_equal(three.rgb, kept)
    for bad in (np.full((4, 4), np.nan), np.zeros((4, 4))):
        with pytest.raises(gsp.Error, match="camera 0 has a viewmat"):
            renderer.render(data, bad, K)


def test_nothing_is_equal_to_none(model):
    data = gsp.Data(model)
    assert not np.any(data.qpos == None) and np.all(data.qpos != None)  # noqa: E711


def test_text_in_place_of_a_path():
    with pytest.raises(gsp.Error, match="from_string"):
        gsp.Model.from_xml(ARM)


# Whoever wrote the positions, by whatever way, what is asked for next is of them; who holds a view has it when the array is asked for again.
def test_what_is_asked_for_is_of_the_state_as_it_is(model):
    data, fresh = gsp.Data(model, worlds=2), gsp.Data(model, worlds=2)
    renderer = gsp.Renderer(gsp.Scene(model).add_surface(), 32, 24)
    at = gsp.look_at([1.5, 1.5, 1], [0, 0, 0.4]), gsp.pinhole(32, 24, 60)
    view, places = data.qpos.numpy(), data.xpos.numpy()

    def by_setter(x):
        data.qpos = x

    def by_array(x):
        data.qpos[:] = x

    def by_view(x):
        view[:] = x

    def by_view_and_back(x):  # what else makes poses leaves none behind
        view[:] = 0.5
        view[:, 3] = 1
        data.mass_matrix()
        gsp.forward(model, data)
        view[:] = x

    for k, write in enumerate((by_setter, by_array, by_view, by_view_and_back)):
        x = model.qpos0.astype(np.float32) + np.float32([0.1 * k, 0.05, 0.3, 0, 0, 0, 0, 0.1 * k])
        fresh.qpos = x
        gsp.forward(model, fresh)
        for ask in ("render", "cameras", "xpos"):
            write(model.qpos0)
            data.xpos
            write(x)
            if ask == "render":
                assert np.array_equal(renderer.render(data, *at).rgb.copy(), renderer.render(fresh, *at).rgb), write
            elif ask == "cameras":
                assert np.array_equal(data.cameras(["head"], 32, 24)[0].copy(), fresh.cameras(["head"], 32, 24)[0]), write
            else:
                assert np.array_equal(data.xpos.copy(), fresh.xpos), write
                assert np.array_equal(places, fresh.xpos)  # the same memory
    view[:] = model.qpos0
    gsp.step(model, data)
    gsp.step(model, data, n=3)
    assert np.array_equal(data.xpos[:, 1], data.qpos[:, :3])
    gsp.reset(model, data, mask=[1, 0], keyframe="high")
    assert data.xpos[0, 1, 2] == 1.5


def test_mocap_bodies_are_where_they_are_put():
    text = ARM.replace("<worldbody>", '<worldbody><body name="hand" mocap="true" pos="1 0 0"><geom size="0.01" contype="0" conaffinity="0"/></body>')
    data = gsp.Data(gsp.Model.from_string(text), worlds=2)
    data.xpos
    data.mocap_pos[1, 0] = [3, 2, 1]
    assert list(data.xpos[1, 1]) == [3, 2, 1] and list(data.xpos[0, 1]) == [1, 0, 0]


def test_computed_arrays_are_for_reading(model):
    data = gsp.Data(model)
    for name in ("xpos", "xquat", "xanchor", "xaxis", "sensordata", "qfrc_constraint"):
        with pytest.raises(gsp.Error, match="computed from the state.*write"):
            getattr(data, name)[:] = 1
        with pytest.raises(gsp.Error, match="computed"):
            getattr(data, name).fill(1)
        with pytest.raises(ValueError, match="read-only"):
            getattr(data, name).numpy()[:] = 1
    with pytest.raises(gsp.Error, match="computed"):
        data.xpos += 1
    with pytest.raises(ValueError, match="read-only"):
        data.time[:] = 5
    data.qvel.fill(2)
    assert np.all(data.qvel.numpy() == 2)


def test_cameras_of_another_size_are_refused(model):
    data = gsp.Data(model, worlds=2)
    renderer = gsp.Renderer(gsp.Scene(model).add_room(), 32, 24)
    assert (renderer.width, renderer.height) == (32, 24) and "32 x 24" in repr(renderer)
    with pytest.raises(gsp.Error, match="cameras are for pictures of 640 x 480, and the renderer makes 32 x 24"):
        renderer.render(data, *data.cameras(["head"]))
    views, Ks, world = data.cameras(["head"], 32, 24)
    renderer.render(data, views, Ks, world)
    with pytest.warns(UserWarning, match=r"centre at \(320, 240\)"):
        renderer.render(data, views, gsp.pinhole(640, 480, 60), world)


def test_scenes_may_grow_and_are_never_empty(model):
    data, scene = gsp.Data(model), gsp.Scene(model)
    renderer = gsp.Renderer(scene, 32, 24)
    at = gsp.look_at([0.5, -2, 1.5], [0, 0, 0.6]), gsp.pinhole(32, 24, 60)
    with pytest.raises(gsp.Error, match=r"scene is empty: add_room\(\)"):
        renderer.render(data, *at)
    with pytest.raises(gsp.Error, match="no Gaussians that stand"):
        scene.bounds()
    scene.add_surface()
    few = renderer.render(data, *at)
    kept = few.rgb.copy()
    scene.add_room()  # after the renderer was made
    more = renderer.render(data, *at)
    assert np.array_equal(few.rgb, kept) and not np.array_equal(more.rgb, kept)
    assert np.array_equal(more.rgb, gsp.Renderer(gsp.Scene(model).add_surface().add_room(), 32, 24).render(data, *at).rgb)
    assert "rgb (1, 24, 32, 3)" in repr(more)
    renderer.show([[0]])
    scene.add_surface()  # what is shown stays so
    assert np.array_equal(renderer.render(data, *at).rgb, kept)


def test_a_scene_says_where_it_is_and_moves_with_a_body(model, tmp_path):
    room = gsp.Scene(model).add_room()
    low, high = room.bounds()
    inner = room.bounds(0.9)
    assert np.all(low <= inner[0]) and np.all(inner[1] <= high) and (low < inner[0]).any() and len(room) > 1000
    assert f"{len(room)} Gaussians" in repr(room) and "98 %" in repr(room)
    with pytest.raises(gsp.Error, match="share is above 0"):
        room.bounds(2)
    path = DATA / "splats" / "biker.compressed.ply"
    if not path.exists():
        pytest.skip(f"{path} is missing")
    standing = gsp.Scene(model).add_splats(path)
    moved = gsp.Scene(model).add_splats(path, pos=(1, 2, 3), scale=2)
    assert np.allclose(moved.bounds(), 2 * standing.bounds() + [1, 2, 3], rtol=1e-5, atol=1e-5)
    bound = gsp.Scene(model).add_splats(path, body="base", pos=(0, 0, 0.1), scale=0.2)
    assert len(bound) == len(standing)
    data = gsp.Data(model)
    data.qpos[0, :3] = [0.5, 0.25, 1]
    K = gsp.pinhole(48, 36, 60)
    there = gsp.Scene(model).add_splats(path, pos=(0.5, 0.25, 1.1), scale=0.2)
    view = gsp.look_at([0.5, -0.6, 1.3], [0.5, 0.25, 1.1])
    a, b = (gsp.Renderer(s, 48, 36).render(data, view, K).rgb.numpy() for s in (bound, there))
    assert a.max() > 0.1 and np.abs(a - b).mean() < 1e-3
    with pytest.raises(gsp.Error, match="nearest: 'base'"):
        gsp.Scene(model).add_splats(path, body="bas")


def test_worlds_go_on_from_what_one_was(model):
    data = gsp.Data(model, worlds=3)
    data.qvel[:, 6] = [0, 1, 2]
    gsp.step(model, data, n=150)
    all_of, one = data.save(), data.save(world=2)
    assert one["state.qpos"].shape == (1, 8) and len(one["impulses.p"]) == one["impulses.count"][0] + one["impulses.kept"][0] > 0
    gsp.step(model, data, n=50)
    after, steps = data.qpos.copy(), list(data.steps)
    data.restore(one, mask=[1, 0, 0])
    assert list(data.steps) == [150, steps[1], steps[2]]
    assert np.array_equal(data.qpos[0], all_of["state.qpos"][2]) and np.array_equal(data.qpos[1:], after[1:])
    gsp.step(model, data, n=50)
    assert np.array_equal(data.qpos[0], after[2])  # what followed there, to the bit
    data.restore(all_of, mask=[0, 1, 0])
    assert np.array_equal(data.qpos[1], all_of["state.qpos"][1]) and not np.array_equal(data.qpos[2], all_of["state.qpos"][2])
    data.restore(one)
    gsp.step(model, data, n=50)
    assert np.array_equal(data.qpos, [after[2]] * 3)
    new = gsp.Data(model, worlds=2)
    new.restore(one, mask=[0, 1])
    gsp.step(model, new, n=50)
    assert np.array_equal(new.qpos[1], after[2]) and list(new.steps) == [50, 200]
    with pytest.raises(gsp.Error, match="no world 3: there are 3"):
        data.save(world=3)
    with pytest.raises(gsp.Error, match="array 'state.qpos'") as said:
        data.restore({k: v for k, v in one.items() if k != "state.qpos"})
    assert "Stepper" not in str(said.value)


def test_equalities_are_switched_off():
    model = gsp.Model.from_string("""<mujoco><worldbody>
      <body name="a" pos="0 0 1"><freejoint/><geom size="0.1"/></body></worldbody>
      <equality><weld body1="a"/></equality></mujoco>""")
    data = gsp.Data(model, worlds=2)
    assert data.eq_active.shape == (2, 1) and np.all(data.eq_active.numpy() == 1)
    data.eq_active[1] = 0
    gsp.step(model, data, n=200)
    assert abs(data.qpos[0, 2] - 1) < 0.01 and data.qpos[1, 2] < 0.5
    gsp.reset(model, data)
    assert np.all(data.eq_active.numpy() == 1)


def test_the_model_has_mujocos_arrays():
    mujoco = pytest.importorskip("mujoco")
    m, model = mujoco.MjModel.from_xml_string(ARM), gsp.Model.from_string(ARM)
    for name in (
        "body_parentid body_pos body_quat body_ipos body_mass body_inertia jnt_type jnt_bodyid jnt_qposadr jnt_dofadr jnt_axis jnt_range "
        "dof_bodyid dof_jntid dof_damping dof_armature geom_bodyid geom_type geom_size geom_pos geom_quat geom_friction site_bodyid site_pos "
        "site_quat actuator_ctrlrange actuator_gear key_qpos sensor_adr sensor_dim qpos0"
    ).split():
        ours, theirs = getattr(model, name), getattr(m, name)
        assert ours.shape == theirs.shape and np.allclose(ours, theirs, rtol=0, atol=1e-12), name
        with pytest.raises(ValueError, match="read-only"):
            ours[...] = 0
    assert gsp.Model.from_string(ARM.replace("keyframe", "custom").replace('<key name="high" qpos="0 0 1.5 1 0 0 0 0.3" ctrl="0.5"/>', "")).key_qpos.shape == (0, 8)


def test_arrays_have_what_numpys_have(model):
    a = gsp.Data(model, worlds=2).qpos
    n = a.numpy()
    assert a.tobytes() == n.tobytes() and a.nbytes == n.nbytes and a.itemsize == n.itemsize
    for got, expected in ((a.ravel(), n.ravel()), (a.flatten(), n.flatten()), (a.transpose(), n.T), (a.round(1), n.round(1)), (a.take(2), n.take(2))):
        assert np.array_equal(got, expected)


def test_sentences_are_of_python(model):
    data = gsp.Data(model, worlds=2, per_world=["body_mass"])
    for call, words in (
        (lambda: data.jacobian(body=99), "model.id"),
        (lambda: data.cameras(["haed"]), "the model has no camera 'haed'"),
        (lambda: data.cameras([dict(body="bas")]), "the model has no body 'bas'"),
        (lambda: data.set("body_mass", np.ones((2, 3)), scale_inertia=True), "name it in per_world too"),
        (lambda: gsp.Data(model, per_world="body_mass"), r"per_world is a list of names: give \['body_mass'\]"),
        (lambda: gsp.Data(model, per_world=["actuator_gainprm"]), "act_gain"),
    ):
        with pytest.raises(gsp.Error, match=words) as said:
            call()
        assert "::" not in str(said.value) and "(compiled" not in str(said.value)
    assert "state.status" not in gsp.status_text(4) and "data.status" in gsp.status_text(4)
    gsp.step(model, data, n=300)
    assert repr(data.counts).startswith("gsp.StepCounts(contacts=") and repr(data.contacts) == f"gsp.Contacts({len(data.contacts)})"
