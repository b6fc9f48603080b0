"""On a GPU: the CPU's numbers, memory shared with torch, jax and cupy, and the order of streams. Skipped where none answers."""

import os
import subprocess
import sys

import numpy as np
import pytest

import gsp
from gsp.tasks import MODELS

torch = pytest.importorskip("torch")


@pytest.fixture(scope="module", autouse=True)
def gpu():
    try:
        gsp.Data(gsp.Model.from_xml(MODELS / "cartpole.xml"), device="cuda")
    except gsp.Error as e:
        pytest.skip(str(e))


def quadruped(worlds, device, **options):
    model = gsp.Model.from_xml(MODELS / "quadruped.xml")
    data = gsp.Data(model, worlds=worlds, device=device, **options)
    gsp.reset(model, data, keyframe="home")
    return model, data


# The same source on both: float64 differs by how sums are rounded, which contacts of a standing robot do not enlarge.
def test_numbers_are_the_cpus():
    seen = {}
    for device in ("cpu", "cuda"):
        model, data = quadruped(8, device, precision="float64")
        data.qvel = 0.1 * np.random.default_rng(1).normal(size=(8, model.nv))
        gsp.step(model, data, n=100)
        seen[device] = [a.copy() for a in (data.qpos, data.qvel, data.xpos, data.sensordata, data.mass_matrix(), data.jacobian(body=3))]
        assert len(data.contacts) >= 8 and np.all(data.status.copy() == 0)
    for a, b in zip(*seen.values()):
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-9 * max(1, np.abs(a).max()))


def test_torch_jax_and_cupy_see_the_memory():
    model, data = quadruped(4, "cuda:0")
    t = torch.from_dlpack(data.qvel)
    assert t.data_ptr() == data.qvel.pointer and t.is_cuda and t.dtype == torch.float32 and tuple(t.shape) == (4, model.nv)
    t[2, 3] = 5
    assert data.qvel.copy()[2, 3] == 5
    assert torch.as_tensor(data.qvel, device="cuda").data_ptr() == data.qvel.pointer  # __cuda_array_interface__
    data.ctrl = torch.full((4, model.nu), 0.25, device="cuda")
    assert np.all(data.ctrl.copy() == 0.25)
    assert torch.from_dlpack(data.steps).dtype == torch.int64
    with pytest.raises(gsp.Error, match="lies on the GPU"):
        data.qpos.numpy()
    with pytest.raises(BufferError, match="another device"):
        data.qpos.__dlpack__(dl_device=(1, 0))
    with pytest.raises(ValueError, match="ambiguous"):
        data.qpos.__dlpack__(stream=0)
    try:
        import cupy
    except ImportError:
        pass
    else:
        c = cupy.asarray(data.qvel)
        assert c.data.ptr == data.qvel.pointer and float(c[2, 3]) == 5
        assert cupy.from_dlpack(data.qvel).data.ptr == data.qvel.pointer
    try:
        import jax
    except ImportError:
        pass
    else:
        j = jax.dlpack.from_dlpack(data.qvel)
        assert j.shape == (4, model.nv) and float(j[2, 3]) == 5


# Drawn by other kernels, with sums in another order: what a splat at the end of its ellipse adds may be there on one and not on the other.
def test_pictures_are_the_cpus():
    def pictures(device, median):
        model, data = quadruped(3, device)
        scene = gsp.Scene(model).add_room().add_surface()
        renderer = gsp.Renderer(scene, 96, 72, device=device, normals=True, ids=True, rgb8=True, median_depth=median)
        views = gsp.look_at([[0.8, 0, 0.5], [0.3, 0.7, 0.4], [-0.6, -0.5, 0.6]], [0, 0, 0.2])
        Ks = np.stack([gsp.pinhole(96, 72, 60)] * 3)
        background = np.random.default_rng(2).random((72, 96, 3)).astype(np.float32)
        rows = np.arange(3 * len(views)).reshape(-1, 3) + 7
        given = rows if device == "cpu" else torch.as_tensor(rows, device=device)
        if device != "cpu":
            views, Ks, background = (torch.as_tensor(a, device=device) for a in (views, Ks, background))
        calls = [dict(), dict(develop=dict(background=background, exposure=0.2, contrast=0.1, brightness=0.1, noise=0.05, seed=3, step=9)),
                 dict(jitter=dict(position=0.05, rotation=0.1, focal=0.1, principal=3, seed=5)),
                 dict(develop=dict(noise=0.05, exposure=0.3, chance=rows, light_chance=rows[:, [0, 1, 2]] + 1), jitter=dict(rotation=0.1, chance=given)),
                 dict(distortion=[-0.1, 0.02, 0.001, 0.002]),
                 dict(distortion=[0.05, 0.01, 0, 0], fisheye=True)]
        for words in calls:
            frames = renderer.render(data, views, Ks, **words)
            yield {name: getattr(frames, name).copy() for name in ("rgb", "depth", "alpha", "normals", "ids", "rgb8")}
        renderer.show([[0], [1], [1, 0]])
        frames = renderer.render(data, views, Ks)
        shown = torch.from_dlpack(frames.ids), torch.from_dlpack(frames.rgb8)
        assert [t.dtype for t in shown] == [torch.int32, torch.uint8] and all(t.is_cuda == (device != "cpu") for t in shown)
        yield {name: getattr(frames, name).copy() for name in ("rgb", "depth", "alpha", "normals", "ids", "rgb8")}
        if not median:
            fixed = gsp.Renderer(scene, 96, 72, device=device, normals=True, rgb8=True).fixed(data, views, Ks)
            gsp.step(model, data, n=5)
            frames, drawn = fixed.render(data), gsp.Renderer(scene, 96, 72, device=device, normals=True, rgb8=True, ids=True).render(data, views, Ks)
            seen = {name: getattr(frames, name).copy() for name in ("rgb", "depth", "alpha", "normals", "rgb8")}
            assert all(np.array_equal(a, getattr(drawn, name).copy()) for name, a in seen.items())
            yield seen | {"ids": drawn.ids.copy()}

    for median in (False, True):
        for call, (a, b) in enumerate(zip(pictures("cpu", median), pictures("cuda", median), strict=True)):
            # ten times what an H200 was off by (rounding of float; normals take differences of depths), but for a pixel whose splat of
            # alpha 1/255 is cut on one side alone: one of 20,000 numbers there, up to 1/255
            for name, most in (("rgb", 2e-5), ("depth", 3e-4), ("alpha", 3e-5), ("ids", 0), ("rgb8", 1), ("normals", 4e-3)):
                off = np.abs(b[name].astype(np.float64) - a[name].astype(np.float64)) > most
                assert off.mean() <= 5e-4, (median, call, name, off.mean())
                if name in ("rgb", "alpha"):
                    assert np.abs(b[name] - a[name]).max() <= most + 1 / 255, (median, call, name)
            assert a["rgb"].std() > 0.01 and len(np.unique(a["ids"])) >= 2, call


def test_backgrounds_that_are_none():
    model, data = quadruped(1, "cuda")
    renderer = gsp.Renderer(gsp.Scene(model).add_surface(), 32, 24, device="cuda", rgb8=True)
    at = gsp.look_at([0.8, 0, 0.5], [0, 0, 0.2]), gsp.pinhole(32, 24, 60)
    rgb = torch.from_dlpack(renderer.render(data, *at).rgb)
    for background, sentence in ((torch.zeros(24, 32, 3, dtype=torch.uint8, device="cuda"), "holds whole numbers.*255"),
                                 (rgb[0], "lies in the pictures that are to be drawn")):
        with pytest.raises(gsp.Error, match=sentence):
            renderer.render(data, *at, develop=dict(background=background))
    renderer.render(data, *at, develop=dict(background=rgb[0].clone()))


def test_poses_are_of_the_positions_whoever_wrote_them():
    model, data = quadruped(4, "cuda")
    t = torch.from_dlpack(data.qpos)
    for x in (2, 3):
        data.xpos
        t[:, 0] = x
        assert np.all(data.xpos.copy()[:, 1, 0] == x)
    gsp.step(model, data)
    assert np.array_equal(data.xpos.copy()[:, 1], data.qpos.copy()[:, :3])


def test_rows_of_the_worlds_of_a_mask():
    model = gsp.Model.from_xml(MODELS / "quadruped.xml")
    data = gsp.Data(model, worlds=4, device="cuda", per_world=["body_mass"])
    mask = torch.tensor([False, True, False, True], device="cuda")
    mass = data.values("body_mass").copy()
    data.set("body_mass", 2 * torch.as_tensor(mass[:2], device="cuda"), mask)
    mass[[1, 3]] *= 2
    np.testing.assert_allclose(data.values("body_mass").copy(), mass, rtol=1e-6)


def test_arrays_outlive_what_made_them():
    _, data = quadruped(4, "cuda")
    t = torch.from_dlpack(data.qpos)
    before = t.cpu()
    del data
    assert torch.equal(t.cpu(), before)


# forward is launched and not waited for; it takes longer than it takes to come here. Whoever reads on a stream of his own, which CUDA keeps
# in no order with ours, by DLPack reads what it wrote, a thousand times.
def test_who_reads_on_another_stream_reads_what_was_written():
    worlds = 16384
    model, data = quadruped(worlds, "cuda")
    r = np.random.default_rng(3)
    starts = [torch.as_tensor(data.qpos.copy() + 0.1 * np.tile(r.normal(size=(1, model.nq)), (worlds, 1)), dtype=torch.float32, device="cuda") for _ in range(2)]
    expected = []
    for start in starts:
        data.qpos = start
        gsp.forward(model, data)
        expected.append(torch.as_tensor(data.xpos.copy()).cuda())
    assert not torch.equal(*expected)
    alias = torch.from_dlpack(data.xpos)
    torch.cuda.synchronize()
    stream = torch.cuda.Stream()  # not kept in order with the legacy default one
    wrong = unordered = 0
    for i in range(1000):
        data.qpos = starts[i % 2]
        gsp.forward(model, data)
        with torch.cuda.stream(stream):
            if i % 10 == 9:  # nobody says in which order
                early = alias.clone()
            read = torch.from_dlpack(data.xpos).clone()
        stream.synchronize()
        wrong += not torch.equal(read, expected[i % 2])
        unordered += i % 10 == 9 and not torch.equal(early, expected[i % 2])
    print(f"{unordered} of 100 were wrong where nobody said in which order")
    assert wrong == 0


def test_the_library_reads_what_was_written_on_another_stream():
    worlds = 1024
    model, data = quadruped(worlds, "cuda")
    velocity, stream = torch.from_dlpack(data.qvel), torch.cuda.Stream()
    heavy = torch.rand(4096, 4096, device="cuda")
    torch.cuda.synchronize()
    for i in range(100):
        with torch.cuda.stream(stream):
            for _ in range(3):
                heavy = torch.nn.functional.normalize(heavy @ heavy)
            velocity.fill_(float(i))
        gsp.wait_for_stream(stream)
        copy = data.qvel.copy()
        assert np.all(copy == i), i


# A loop of control allocates nothing on the GPU and copies nothing to the host: Kokkos' tools tell (test_gsp.py).
def test_a_loop_stays_on_the_gpu():
    if not os.environ.get("GSP_KOKKOS_COUNTS"):
        pytest.skip("GSP_KOKKOS_COUNTS names no library (python/tests/kokkos_counts.cpp)")
    here = os.path.dirname(__file__)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"{here}/test_gsp.py", "-k", "allocates_and_copies_nothing"],
        capture_output=True, text=True, env={**os.environ, "GSP_TEST_DEVICE": "cuda"},
    )
    assert done.returncode == 0 and "1 passed" in done.stdout, done.stdout


def test_ends_without_a_word():
    code = f"""
import gsp, torch
from gsp.tasks import MODELS
model = gsp.Model.from_xml({str(MODELS / "quadruped.xml")!r})
data = gsp.Data(model, device="cuda")
gsp.step(model, data)
t = torch.from_dlpack(data.qpos)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and "Kokkos" not in done.stderr, done.stderr


def test_tasks_learn_on_the_gpu():
    from gsp.tasks import CartPole

    class OnTorch(CartPole):
        def observe(self, data):
            return torch.cat([data.qpos, data.qvel], dim=1)

        def reward(self, data):
            return torch.cos(data.qpos[:, 1]) - 0.05 * data.qpos[:, 0] ** 2

        def terminated(self, data):
            return data.qpos[:, 1].abs() > 0.5

    both = [CartPole(worlds=16, seed=4), OnTorch(worlds=16, device="cuda", seed=4)]
    for task in both:
        task.reset()
    starts = [task.observations() for task in both]
    np.testing.assert_allclose(starts[1].cpu().numpy(), starts[0], rtol=0, atol=1e-6)
    with torch.cuda.stream(torch.cuda.Stream()):
        for k in range(50):
            action = np.full((16, 1), np.sin(0.3 * k), dtype=np.float32)
            given = [both[0].step(action), both[1].step(torch.as_tensor(action, device="cuda"))]
    np.testing.assert_allclose(given[1][0].cpu().numpy(), given[0][0], rtol=0, atol=1e-3)
    assert np.array_equal(given[1][1].cpu().numpy(), given[0][1])
