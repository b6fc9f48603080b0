"""Tasks and their environments: beside hand-written tables, Gymnasium's own SyncVectorEnv, and themselves in other batches."""

import re
import subprocess
import sys

import numpy as np
import pytest

import gsp
from gsp.task import philox
from gsp.tasks import MODELS, CartPole, Stand

gymnasium = pytest.importorskip("gymnasium", "1.0")

import gsp.gymnasium  # noqa: E402
from gymnasium.utils.env_checker import check_env, data_equivalence  # noqa: E402
from gymnasium.vector import AutoresetMode, SyncVectorEnv  # noqa: E402

SLIDER = gsp.Model.from_string("""
<mujoco>
  <option timestep="0.01" gravity="0 0 0"/>
  <worldbody><body><joint name="slide" type="slide"/><geom size="0.1" mass="1"/></body></worldbody>
  <actuator><motor joint="slide" ctrlrange="-3 1" ctrllimited="true"/></actuator>
</mujoco>
""")


class Counting(gsp.Task):
    """Sees how old its episode is, is rewarded with its action, and ends when `ends` says."""

    model = SLIDER
    ends = (2, 3, 3)

    def observe(self, data):
        return self.age[:, None]

    def reward(self, data):
        return self.action[:, 0]

    def terminated(self, data):
        return self.age == np.array(self.ends)


class Short(CartPole):
    """Episodes of 0.3 s that mostly end before, with noise in all that is seen."""

    seconds = 0.3

    def observe(self, data):
        return super().observe(data) + self.normal(0.01, 4)

    def terminated(self, data):
        return abs(data.qpos[:, 1]) > 0.15

    def info(self, data):
        return {"angle": data.qpos[:, 1], "twice": self.uniform(0, 1, 2)}


def counting(mode):
    envs = gsp.gymnasium.VectorEnv(Counting(worlds=3), mode)
    assert envs.metadata["autoreset_mode"] == AutoresetMode(mode)
    return envs


def follow(envs, table):
    """The rows of Gymnasium's tests/vector/test_autoreset_mode.py: actions are 1, 2, 3 each step."""
    for seen, rewards, terminated, infos in table:
        got = envs.step(np.array([[1], [2], [3]]))
        assert np.array_equal(got[0][:, 0], seen)
        assert np.array_equal(got[1], rewards)
        assert np.array_equal(got[2], terminated)
        assert not got[3].any()
        assert data_equivalence(got[4], infos)


def test_next_step_as_gymnasium_has_it():
    envs = counting("NextStep")
    seen, infos = envs.reset()
    assert not seen.any() and infos == {}
    follow(
        envs,
        [
            ([1, 1, 1], [1, 2, 3], [False, False, False], {}),
            ([2, 2, 2], [1, 2, 3], [True, False, False], {}),
            ([0, 3, 3], [0, 2, 3], [False, True, True], {}),
            ([1, 0, 0], [1, 0, 0], [False, False, False], {}),
        ],
    )


def test_same_step_as_gymnasium_has_it():
    envs = gsp.gymnasium.VectorEnv(Counting(worlds=3))
    assert envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    envs.reset()

    def final(*last):
        objects = np.full(3, None, dtype=object)
        for k, value in enumerate(last):
            objects[k] = None if value is None else np.array([value], dtype=np.float32)
        ended = np.array([value is not None for value in last])
        return {"final_obs": objects, "final_info": {}, "_final_obs": ended, "_final_info": ended.copy()}

    follow(
        envs,
        [
            ([1, 1, 1], [1, 2, 3], [False, False, False], {}),
            ([0, 2, 2], [1, 2, 3], [True, False, False], final(2, None, None)),
            ([1, 0, 0], [1, 2, 3], [False, True, True], final(None, 3, 3)),
            ([0, 1, 1], [1, 2, 3], [True, False, False], final(2, None, None)),
        ],
    )


def test_disabled_as_gymnasium_has_it():
    envs = counting("Disabled")
    envs.reset()
    follow(envs, [([1, 1, 1], [1, 2, 3], [False, False, False], {}), ([2, 2, 2], [1, 2, 3], [True, False, False], {})])
    with pytest.raises(gsp.Error, match="world 0 has ended.*reset_mask"):
        envs.step(np.zeros((3, 1)))
    seen, infos = envs.reset(options={"reset_mask": np.array([True, False, False])})
    assert np.array_equal(seen[:, 0], [0, 2, 2]) and infos == {}
    follow(envs, [([1, 3, 3], [1, 2, 3], [False, True, True], {})])
    seen, _ = envs.reset(options={"reset_mask": np.array([False, True, True])})
    assert np.array_equal(seen[:, 0], [1, 0, 0])
    follow(envs, [([2, 1, 1], [1, 2, 3], [True, False, False], {})])


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_beside_sync_vector_env(mode):
    """A batch and as many single worlds in Gymnasium's own vectors give the same bits, infos and final_info included."""
    ours = gsp.gymnasium.VectorEnv(Short(worlds=5), mode)
    theirs = SyncVectorEnv([lambda: gsp.gymnasium.Env(Short())] * 5, autoreset_mode=mode)
    assert ours.observation_space == theirs.observation_space and ours.action_space == theirs.action_space
    a, b = ours.reset(seed=[7, 8, 9, 10, 11]), theirs.reset(seed=[7, 8, 9, 10, 11])
    assert data_equivalence(a[0], b[0], exact=True) and data_equivalence(a[1], b[1], exact=True)
    rng = np.random.default_rng(0)
    kinds = np.zeros(2, dtype=int)
    for _ in range(60):
        action = rng.uniform(-1, 1, (5, 1)).astype(np.float32)
        a, b = ours.step(action), theirs.step(action)
        assert np.array_equal(a[0], b[0])
        assert np.array_equal(a[1], b[1].astype(np.float32))
        assert np.array_equal(a[2], b[2]) and np.array_equal(a[3], b[3])
        assert a[4].keys() == b[4].keys() and all(data_equivalence(a[4][k], b[4][k], exact=True) for k in a[4])
        assert a[0] in ours.observation_space
        kinds += [a[2].sum(), a[3].sum()]
        if mode is AutoresetMode.DISABLED and (a[2] | a[3]).any():
            mask = a[2] | a[3]
            a, b = ours.reset(options={"reset_mask": mask}), theirs.reset(options={"reset_mask": mask.copy()})
            assert np.array_equal(a[0], b[0]) and a[1].keys() == b[1].keys()
            assert all(np.array_equal(a[1][k], b[1][k]) for k in a[1])
    assert kinds.min() > 3  # of both ends there were some


def test_final_obs_is_what_was_before_the_reset():
    task = Short(worlds=4)
    envs = gsp.gymnasium.VectorEnv(task)
    envs.reset(seed=3)
    ends = 0
    for _ in range(40):
        alone = Short(worlds=4)  # goes through the same step without a reset
        alone.data.restore(task.data.save())
        for name in ("_key", "_world", "_episode", "age"):
            getattr(alone, name)[:] = getattr(task, name)
        action = np.full((4, 1), 0.3, dtype=np.float32)
        seen, rewards, terminated, truncated, infos = envs.step(action)
        alone_rewards, *_ = alone.step(action)
        assert np.array_equal(rewards, alone_rewards)
        before, ended = alone.observations(), terminated | truncated
        assert np.array_equal(seen[~ended], before[~ended])
        assert ended.any() == ("final_obs" in infos)
        for k in np.flatnonzero(ended):
            assert np.array_equal(infos["final_obs"][k], before[k]) and not np.array_equal(seen[k], before[k])
            assert infos["final_info"]["angle"][k] == alone.data.qpos[k, 1]
            ends += 1
    assert ends > 3


def run(worlds, seed=5, steps=40):
    envs = gsp.gymnasium.VectorEnv(Short(worlds=worlds))
    out = [envs.reset(seed=seed)[0]]
    for k in range(steps):
        action = np.sin(0.7 * k + np.arange(worlds, dtype=np.float32))[:, None]
        seen, rewards, terminated, *_ = envs.step(action)
        out.append(np.concatenate([seen, rewards[:, None], terminated[:, None]], axis=1))
    return out


def test_seeds_and_batches():
    three, again, eight, other = run(3), run(3), run(8), run(3, seed=6)
    for a, b, c in zip(three, again, eight):
        assert np.array_equal(a, b) and np.array_equal(a, c[:3])
    assert not np.array_equal(three[0], other[0])
    assert len(np.unique(eight[0], axis=0)) == 8
    envs = gsp.gymnasium.VectorEnv(Short(worlds=3))
    first, second, third = envs.reset(seed=5)[0], envs.reset()[0], envs.reset(seed=5)[0]
    assert np.array_equal(first, third) and not np.array_equal(first, second) and np.array_equal(first, three[0])
    assert np.array_equal(envs.reset(seed=2**100)[0], envs.reset(seed=2**100)[0])
    fresh = gsp.gymnasium.VectorEnv(Short(worlds=3, seed=5))
    assert np.array_equal(fresh.reset()[0], first)  # the task's seed, where none is given


def test_what_one_world_draws_knows_nothing_of_others():
    """World 1 sees the same noise whether or not world 0 is reset beside it."""
    seen = []
    for mask in ([False, False], [True, False]):
        task = Short(worlds=2, seed=4)
        task.reset()
        task.step(np.zeros((2, 1)))
        task.reset(np.array(mask))
        task.step(np.zeros((2, 1)))
        seen.append(task.observations()[1])
    assert np.array_equal(*seen)


def test_random_numbers():
    # Random123's known answers (kat_vectors, philox4x32 10)
    for counter, key, words in (
        ([0, 0, 0, 0], [0, 0], [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]),
        ([0xFFFFFFFF] * 4, [0xFFFFFFFF] * 2, [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD]),
        (
            [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344],
            [0xA4093822, 0x299F31D0],
            [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
        ),
    ):
        whole = np.array([key[1] << 32 | key[0]], dtype=np.uint64).view(np.int64)
        assert [int(w[0]) for w in philox(whole, [np.array([c]) for c in counter])] == words
    many = CartPole(worlds=2000)
    u, n = many.uniform(-1, [1, 3, 1, 1, 1], 5), many.normal(2, 5)
    assert u.dtype == n.dtype == np.float32 and u.shape == n.shape == (2000, 5)
    assert u.min() > -1 and u[:, 0].max() < 1 and 2.9 < u[:, 1].max() < 3
    # of 2,000 numbers: means within five of their own deviations
    assert np.all(abs(u.mean(axis=0) - [0, 1, 0, 0, 0]) < 5 * np.array([2, 4, 2, 2, 2]) / np.sqrt(12 * 2000))
    assert np.all(abs(n.mean(axis=0)) < 5 * 2 / np.sqrt(2000)) and np.all(abs(n.std(axis=0) - 2) < 5 * 2 / np.sqrt(2 * 2000))
    assert not np.array_equal(u[:, 2], u[:, 3])
    mask = np.arange(2000) % 3 == 0
    twin = CartPole(worlds=2000)
    assert np.array_equal(twin.uniform(-1, 1, 5)[mask], CartPole(worlds=2000).uniform(-1, 1, 5, mask))


def test_actions_reach_from_end_to_end():
    task = Counting(worlds=3)
    task.reset()
    task.step(np.array([[-1], [0], [1]]))
    assert np.array_equal(task.data.ctrl[:, 0], [-3, -1, 1])
    task.step(np.array([[1], [1], [1]]))
    assert np.array_equal(task.last_action[:, 0], [-1, 0, 1])

    def fails(data, action):
        raise RuntimeError("no")

    works, task.act = task.act, fails
    with pytest.raises(RuntimeError):
        task.step(np.array([[0.5], [0.5], [0.5]]))  # never done
    task.act = works
    assert np.array_equal(task.last_action[:, 0], [-1, 0, 1]) and np.array_equal(task.action[:, 0], [1, 1, 1])
    task.reset(np.array([True, False, False]))
    assert np.array_equal(task.last_action[:, 0], [0, 0, 1]) and np.array_equal(task.action[:, 0], [0, 1, 1])


def test_time_is_truncation_and_so_is_physics_that_stopped():
    class Slow(Counting):
        seconds = 0.04

        def terminated(self, data):
            return np.zeros(self.worlds, dtype=bool)

    task = Slow(worlds=3)
    task.reset()
    for k in range(4):
        _, terminated, truncated = task.step(np.zeros((3, 1)))
        assert not terminated.any() and truncated.all() == (k == 3)
    task.reset()
    task.data.qvel[1] = np.nan
    _, terminated, truncated = task.step(np.zeros((3, 1)))
    assert not terminated.any() and list(truncated) == [False, True, False]
    task.reset(truncated)
    assert list(task.stops) == [0, 1, 0]
    _, terminated, truncated = task.step(np.zeros((3, 1)))
    assert not truncated.any() and np.isfinite(task.data.qpos).all()


def test_poses_follow_what_randomise_wrote():
    class Reads(CartPole):
        def randomise(self, data, mask):
            assert np.array_equal(data.xpos[mask, 1, 0], data.qpos[mask, 0])  # brings the poses up to date before it writes
            super().randomise(data, mask)

    task = Reads(worlds=4)
    task.reset()
    assert len(np.unique(task.data.qpos[:, 0])) == 4 and np.array_equal(task.data.xpos[:, 1, 0], task.data.qpos[:, 0])


@pytest.mark.parametrize("name", ["CartPole", "Stand"])
def test_gymnasium_finds_no_fault(name):
    env = gymnasium.make(f"gsp/{name}-v0")
    check_env(env.unwrapped)
    assert env.spec.id == f"gsp/{name}-v0"
    envs = gymnasium.make_vec(f"gsp/{name}-v0", num_envs=3)
    assert envs.num_envs == 3 and envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    seen, _ = envs.reset(seed=1)
    assert seen in envs.observation_space
    envs = gymnasium.make_vec(f"gsp/{name}-v0", num_envs=2, autoreset_mode="NextStep", profile="mujoco")
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    envs.close()


def test_gymnasium_wrappers():
    envs = gymnasium.wrappers.vector.RecordEpisodeStatistics(gsp.gymnasium.VectorEnv(Counting(worlds=3)))
    envs.reset()
    lengths = []
    for _ in range(6):
        *_, infos = envs.step(np.ones((3, 1)))
        if "episode" in infos:
            lengths += list(infos["episode"]["l"][infos["_episode"]])
    assert sorted(lengths) == [2, 2, 2, 3, 3, 3, 3]


def test_partial_reset_as_gymnasium_has_it():
    envs = gsp.gymnasium.VectorEnv(CartPole(worlds=3), AutoresetMode.DISABLED)
    first, _ = envs.reset(seed=[0, 1, 2])
    for _ in range(3):
        seen, *_ = envs.step(np.zeros((3, 1)))
    again, _ = envs.reset(seed=[0, 1, 0], options={"reset_mask": np.array([True, True, False])})
    assert np.array_equal(again[:2], first[:2]) and np.array_equal(again[2], seen[2])
    for mask, kind, sentence in (
        (np.array([True]), ValueError, "must have shape `(3,)`, got (1,)"),
        (np.array([[True] * 3]), ValueError, "must have shape `(3,)`, got (1, 3)"),
        (np.array([False] * 3), ValueError, "at least one True value, got reset_mask=[False False False]"),
        (np.array([1, 1, 0]), TypeError, "must have `dtype=np.bool_`, got int64"),
        ([True] * 3, TypeError, "must be a numpy array"),
    ):
        with pytest.raises(kind, match=re.escape(sentence)):
            envs.reset(options={"reset_mask": mask})
    for action in (np.zeros((2, 1)), np.zeros((4, 1)), 0.0):
        with pytest.raises(ValueError, match="actions have shape"):
            envs.step(action)


def test_observations_by_name():
    class Two(Counting):
        def observe(self, data):
            return {"actor": data.qpos, "critic": np.concatenate([data.qpos, data.qvel], axis=1)}

    envs = gsp.gymnasium.VectorEnv(Two(worlds=3))
    seen, _ = envs.reset()
    assert seen in envs.observation_space and seen["critic"].shape == (3, 2)
    for _ in range(2):
        *_, infos = envs.step(np.ones((3, 1)))
    assert infos["final_obs"][0] in envs.single_observation_space
    check_env(gsp.gymnasium.Env(type("One", (Two,), {"ends": (50,)})()))


def test_wrong_tasks_are_one_sentence():
    with pytest.raises(gsp.Error, match="Task has no model"):
        gsp.Task()
    with pytest.raises(NotImplementedError, match="no observe"):
        type("Blind", (gsp.Task,), {"model": SLIDER})().observations()
    with pytest.raises(gsp.Error, match="array 'jax'"):
        CartPole(array="jax")
    with pytest.raises(gsp.Error, match="array='torch'"):
        CartPole(device="cuda", array="numpy")
    with pytest.raises(gsp.Error, match="a seed is a whole number.*0.5"):
        CartPole(seed=0.5)
    with pytest.raises(gsp.Error, match="shorter than a step"):
        type("Brief", (CartPole,), {"seconds": 0.001})()
    with pytest.raises(gsp.Error, match="one world, and the task has 2"):
        gsp.gymnasium.Env(CartPole(2))
    for name, wrong, sentence in (
        ("reward", lambda self, data: data.qpos, r"reward gives shape \(2, 1\)"),
        ("terminated", lambda self, data: data.qpos[:, 0], "terminated gives must be .* bool .* float32"),
        ("observe", lambda self, data: data.qpos[0], r"observe gives shape \(1,\)"),
        ("info", lambda self, data: {"mean": data.qpos.mean()}, r"info\['mean'\] has shape \(\)"),
    ):
        task = type("Wrong", (Counting,), {"ends": (2, 3), name: wrong})(worlds=2)
        with pytest.raises(gsp.Error, match=sentence):
            task.reset()
            task.step(np.zeros((2, 1)))
            task.observations()
            task.infos()
    envs = gsp.gymnasium.VectorEnv(CartPole(2))
    with pytest.raises(gsp.Error, match="reset comes before"):
        envs.step(np.zeros((2, 1)))


@pytest.mark.parametrize(
    "module, missing, sentence",
    [
        ("gymnasium", "gymnasium", "pip install gymnasium"),
        ("rsl_rl", "torch", "pip install rsl-rl-lib"),
        ("sb3", "stable_baselines3", "pip install stable-baselines3"),
    ],
)
def test_missing_packages_are_one_sentence(module, missing, sentence):
    code = f"import sys; sys.modules['{missing}'] = None; import gsp; import gsp.{module}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert sentence in done.stderr.splitlines()[-1]


def test_the_quadruped_rises_from_its_crouch():
    """With servos that hold the home pose it stands at its height; at action 0 it goes on crouching."""
    task = Stand(worlds=8)
    home = np.tile([0, 0.75, -1.5], 4)
    for action, height in ((0 * home, 0.148), ((home - task.crouch) / 0.5, 0.3)):
        task.reset(seed=1)
        for k in range(150):  # in the first second the target rises
            _, terminated, _ = task.step(np.tile(min(1, (k + 1) / 50) * action, (8, 1)))
            assert not terminated.any()
        # servos give under the weight: a knee bears 3 kg at a lever of 0.14 m with 80 N m/rad, 0.05 rad, which is 1 cm of height
        assert np.all(abs(task.data.qpos[:, 2] - height) < 0.03) and np.all(task.up(task.data)[:, 2] > 0.98)


def test_torch():
    torch = pytest.importorskip("torch")

    class Twin(Short):
        def observe(self, data):
            return torch.cat([data.qpos, data.qvel], dim=1) + self.normal(0.01, 4)

        def reward(self, data):
            return torch.cos(data.qpos[:, 1]) - 0.05 * data.qpos[:, 0] ** 2

    a, b = gsp.gymnasium.VectorEnv(Short(worlds=4)), gsp.gymnasium.VectorEnv(Twin(worlds=4, array="torch"))
    assert np.allclose(a.reset(seed=1)[0], b.reset(seed=1)[0], rtol=0, atol=1e-6)
    ends = 0
    for _ in range(20):
        x, y = a.step(np.full((4, 1), 0.2, dtype=np.float32)), b.step(torch.full((4, 1), 0.2))
        assert torch.is_tensor(y[0]) and torch.is_tensor(y[1]) and y[2].dtype == torch.bool
        # the same steps; log and cos of two libraries differ in the last digit of the noise
        assert np.allclose(x[0], y[0], rtol=0, atol=1e-5) and np.allclose(x[1], y[1], rtol=0, atol=1e-5)
        assert np.array_equal(x[2], y[2]) and np.array_equal(x[3], y[3])
        ends += x[2].sum() + x[3].sum()
    assert ends > 0


@pytest.mark.parametrize("array", ["numpy", "torch"])
def test_rsl_rl(array):
    torch = pytest.importorskip("torch")
    pytest.importorskip("rsl_rl")
    import gsp.rsl_rl
    from rsl_rl.runners import OnPolicyRunner

    class Any(Short):
        def observe(self, data):
            return self.xp.concatenate([data.qpos, data.qvel], axis=1)

        def reward(self, data):
            return self.xp.cos(data.qpos[:, 1])

    env = gsp.rsl_rl.VecEnv(Any(worlds=6, array=array))
    assert env.get_observations()["policy"].shape == (6, 4)
    before = env.get_observations()
    time_outs = dones = 0
    for _ in range(20):
        seen, rewards, done, extras = env.step(torch.zeros(6, 1))
        assert rewards.shape == done.shape == extras["time_outs"].shape == (6,)
        assert not (extras["time_outs"] & ~done).any()
        time_outs, dones = time_outs + int(extras["time_outs"].sum()), dones + int(done.sum())
        assert not torch.equal(seen["policy"], before["policy"])
    assert 0 < time_outs < dones
    assert torch.equal(env.episode_length_buf, torch.as_tensor(env.task.age))
    env.episode_length_buf = torch.full_like(env.episode_length_buf, 7)
    assert (env.task.age == 7).all()
    cfg = {
        "num_steps_per_env": 8,
        "save_interval": 10,
        "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
        "actor": {"class_name": "MLPModel", "hidden_dims": [8], "distribution_cfg": {"class_name": "GaussianDistribution"}},
        "critic": {"class_name": "MLPModel", "hidden_dims": [8]},
        "algorithm": {"class_name": "PPO", "rnd_cfg": None, "symmetry_cfg": None},
    }
    OnPolicyRunner(env, cfg, log_dir=None, device="cpu").learn(2, init_at_random_ep_len=True)


def test_stable_baselines3():
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_checker import check_env as check

    env = gsp.gymnasium.Env(CartPole())
    check(env)
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=1, device="cpu").learn(128)
    action, _ = model.predict(env.reset(seed=0)[0], deterministic=True)
    assert action in env.action_space


def test_rewards_are_those_of_the_step_whatever_is_reset():
    class Far(gsp.Task):
        model = MODELS / "cartpole.xml"

        def observe(self, data):
            return data.qpos

        def reward(self, data):
            return data.qpos[:, 0]  # a view of the state

    task = Far(worlds=2)
    task.reset()
    task.data.qpos[:, 0] = 1
    reward, _, _ = task.step(np.zeros((2, 1)))
    was = np.array(reward)
    task.reset(np.array([True, True]))
    assert np.array_equal(reward, was) and np.all(reward > 0.9)


class Remembers(Counting):
    """Gives an array of its own for who has fallen and what that costs, and clears both where an episode begins."""

    def __init__(self, worlds=1, **options):
        super().__init__(worlds, **options)
        self.fallen, self.cost = self.age > 10**6, self.age * 0.0

    def observe(self, data):
        return self.xp.stack([self.age, self.age], 1)

    def reward(self, data):
        self.cost[:] = self.age
        return self.cost

    def terminated(self, data):
        self.fallen[:] = self.age == self.xp.arange(2, 2 + self.worlds)
        return self.fallen

    def randomise(self, data, mask):
        self.fallen[mask] = False
        self.cost[mask] = 0


@pytest.mark.parametrize("array", ["numpy", "torch"])
def test_ends_are_those_of_the_step_whatever_a_task_clears(array):
    xp = pytest.importorskip("torch") if array == "torch" else np
    for mode in AutoresetMode:
        envs = gsp.gymnasium.VectorEnv(Remembers(worlds=3, array=array), mode)
        envs.reset()
        envs.step(xp.zeros((3, 1)))
        _, rewards, terminated, truncated, infos = envs.step(xp.zeros((3, 1)))
        if mode is AutoresetMode.SAME_STEP:
            assert infos["_final_obs"].tolist() == [True, False, False]
        elif mode is AutoresetMode.NEXT_STEP:
            envs.step(xp.zeros((3, 1)))
        else:
            envs.reset(options={"reset_mask": terminated})
        assert terminated.tolist() == [True, False, False] and rewards.tolist() == [2, 2, 2] and not truncated.any()


@pytest.mark.parametrize("array", ["numpy", "torch"])
def test_ends_of_rsl_rl_whatever_a_task_clears(array):
    torch = pytest.importorskip("torch")
    pytest.importorskip("rsl_rl")
    import gsp.rsl_rl

    class Both(Remembers):
        seconds = 0.02  # world 0 falls as its time ends, which is no time-out

    env = gsp.rsl_rl.VecEnv(Both(worlds=3, array=array))
    assert env.max_episode_length == 2
    env.step(torch.zeros(3, 1))
    _, rewards, done, extras = env.step(torch.zeros(3, 1))
    assert done.tolist() == [True] * 3 and extras["time_outs"].tolist() == [False, True, True] and rewards.tolist() == [2, 2, 2]


def test_ends_of_stable_baselines3_whatever_a_task_clears():
    pytest.importorskip("stable_baselines3")
    import gsp.sb3

    env = gsp.sb3.VecEnv(Remembers(worlds=3))
    env.reset()
    env.step(np.zeros((3, 1)))
    _, rewards, done, infos = env.step(np.zeros((3, 1)))
    assert list(done) == [True, False, False] and list(rewards) == [2, 2, 2]
    assert [info.get("TimeLimit.truncated") for info in infos] == [False, None, None]


def test_stable_baselines3_asks_for_infos_once():
    pytest.importorskip("stable_baselines3")
    import gsp.sb3

    class Asked(Remembers):
        asked = 0

        def info(self, data):
            self.asked += 1
            return {"old": self.age, "_twice": 2 * self.age}

    env = gsp.sb3.VecEnv(Asked(worlds=3))
    env.reset()
    task = env.envs.task
    for old, asked in (([1, 1, 1], 1), ([2, 2, 2], 2), ([1, 3, 3], 2)):  # again where worlds are reset
        task.asked = 0
        _, _, done, infos = env.step(np.zeros((3, 1)))
        assert task.asked == asked and [info["old"] for info in infos] == old and [info["_twice"] for info in infos] == [2 * k for k in old]
        for info, end in zip(infos, done):
            assert set(info) == {"old", "_twice"} | ({"terminal_observation", "TimeLimit.truncated"} if end else set())
    for nothing in (None, {}, [{}] * 3):
        env.set_options(nothing)
    for options in ({"a": 0}, [{}, {"a": 0}, {}]):
        with pytest.raises(gsp.Error, match="a reset of a task has no options"):
            env.set_options(options)


def test_episodes_have_steps():
    class None_(gsp.Task):
        model = MODELS / "cartpole.xml"
        substeps = 0

    with pytest.raises(gsp.Error, match="substeps is 0"):
        None_()


@pytest.mark.parametrize("array", ["numpy", "torch"])
def test_the_data_of_a_task_are_gsps(array):
    kind = pytest.importorskip("torch").Tensor if array == "torch" else np.ndarray
    task = CartPole(worlds=2, array=array)
    data = task.data
    assert isinstance(data, gsp.Data) and isinstance(data.qpos, kind) and isinstance(data.xpos, kind)
    assert isinstance(data.model, gsp.Model) and data.model is not None and data.worlds == 2
    data.ctrl[:] = 1
    gsp.step(task.model, data, n=3)
    assert list(data.steps) == [3, 3] and (data.qvel[:, 0] > 0).all()
    data.qpos[:, 0] = 0.5
    renderer = gsp.Renderer(gsp.Scene(task.model).add_surface(), 32, 24)
    views = data.cameras([dict(body="world", pos=(0, -3, 1), quat=(0.5**0.5, 0.5**0.5, 0, 0))], 32, 24)
    picture = renderer.render(data, *views).rgb.copy()
    data.qpos[:, 0] = -0.5
    assert picture.shape == (2, 24, 32, 3) and not np.array_equal(picture, renderer.render(data, *views).rgb)
    saved = data.save()
    gsp.reset(task.model, data)
    assert not data.qpos.any()
    data.restore(saved)
    assert data.qpos[0, 0] == -0.5
    data.ctrl = 0.25
    assert data.ctrl[1, 0] == 0.25
    with pytest.raises(AttributeError, match="no attribute 'qposs'"):
        data.qposs = 1
    with pytest.raises(AttributeError, match="qposs"):
        data.qposs


def test_misspelt_members_are_told():
    for name, right in (("substep", "substeps"), ("terminate", "terminated"), ("randomize", "randomise"), ("rewards", "reward")):
        with pytest.warns(UserWarning, match=f"Off.{name}: .*is it {right}"):
            type("Off", (Counting,), {name: 5})
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        type("Fine", (Counting,), {"height": 0.3, "up": 1, "_terminate": 2, "substeps": 3})
        CartPole()
    with pytest.raises(gsp.Error, match="there is no option 'profil': give profile"):
        CartPole(profil="mujoco")
    with pytest.raises(gsp.Error, match="substeps a whole number"):
        type("Half", (Counting,), {"substeps": 2.5})()


def test_what_is_no_task_is_told():
    for make in (gsp.gymnasium.VectorEnv, gsp.gymnasium.Env):
        with pytest.raises(gsp.Error, match=r"takes a task, not its class: give CartPole\(worlds=64\)"):
            make(CartPole)
        with pytest.raises(gsp.Error, match="takes a gsp.Task, not Data"):
            make(gsp.Data(SLIDER))

    class Forgets(Counting):
        def __init__(self, worlds=1):
            self.memory = self.age * 2

    with pytest.raises(AttributeError, match=r"has no attribute 'age' yet: its __init__ calls super\(\).__init__"):
        Forgets()
    with pytest.raises(AttributeError, match="has no attribute 'agee'$"):
        Counting(worlds=3).agee


@pytest.mark.parametrize("array", ["numpy", "torch"])
def test_actions_that_are_not_finite_are_refused(array):
    xp = pytest.importorskip("torch") if array == "torch" else np
    task = type("Any", (CartPole,), {"observe": lambda self, data: data.qpos, "reward": lambda self, data: data.qpos[:, 0]})(worlds=3, array=array)
    task.reset()
    action = xp.zeros((3, 1))
    action[1] = float("nan")
    with pytest.raises(gsp.Error, match="the action of world 1 is not finite"):
        task.step(action)
    assert not task.data.status.any() and not task.age.any()  # nothing was done


def test_values_per_world_in_a_task():
    class Heavy(CartPole):
        def __init__(self, worlds=1, **options):
            super().__init__(worlds, per_world=["body_mass"], **options)
            self.mass = self.data.values("body_mass").copy()

        def randomise(self, data, mask):
            super().randomise(data, mask)
            data.set("body_mass", self.mass[mask] * self.uniform(0.5, 1.5, 1, mask)[:, :, None], mask)

    task = Heavy(worlds=6, seed=2)
    task.reset()
    first = task.data.values("body_mass").copy()
    assert len(np.unique(first[:, 1])) == 6
    mask = np.array([True, False] * 3)
    task.reset(mask)
    second = task.data.values("body_mass").copy()
    assert np.array_equal(first[~mask], second[~mask]) and np.all(first[mask, 1] != second[mask, 1])


def test_stable_baselines3_of_many_worlds():
    pytest.importorskip("stable_baselines3")
    import gsp.sb3
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor

    env, theirs = gsp.sb3.VecEnv(Short(worlds=5)), gsp.gymnasium.VectorEnv(Short(worlds=5))
    env.seed(3)
    assert np.array_equal(env.reset(), theirs.reset(seed=[3, 4, 5, 6, 7])[0])
    ends = 0
    for _ in range(40):
        action = np.full((5, 1), 0.3, dtype=np.float32)
        seen, rewards, done, infos = env.step(action)
        a = theirs.step(action)
        assert np.array_equal(seen, a[0]) and np.array_equal(rewards, a[1]) and np.array_equal(done, a[2] | a[3])
        for k in range(5):
            assert infos[k]["angle"] == (a[4]["final_info"] if done[k] else a[4])["angle"][k]
            assert ("terminal_observation" in infos[k]) == done[k]
            if done[k]:
                assert np.array_equal(infos[k]["terminal_observation"], a[4]["final_obs"][k])
                assert infos[k]["TimeLimit.truncated"] == (a[3][k] and not a[2][k])
                ends += 1
    assert ends > 5 and env.get_attr("num_envs", [0, 2]) == [5, 5] and env.env_is_wrapped(VecMonitor) == [False] * 5
    with pytest.raises(gsp.Error, match="all worlds are one task"):
        env.set_attr("x", 1)
    model = PPO("MlpPolicy", VecMonitor(gsp.sb3.VecEnv(CartPole(worlds=16))), n_steps=16, batch_size=64, n_epochs=1, device="cpu").learn(512)
    assert model.ep_info_buffer is not None


class Looks(Remembers):
    """Sees 8-bit pictures, which are as old as the episode, as its renderer would write them."""

    alone = False

    def observe(self, data):
        picture = self.xp.zeros((self.worlds, 48, 40, 3), dtype=self.xp.uint8) + (self.age + 250).reshape(-1, 1, 1, 1)
        picture = picture.astype("uint8") if self.xp is np else picture.to(self.xp.uint8)
        return picture if self.alone else {"state": data.qpos, "picture": picture}


@pytest.mark.parametrize("array", ["numpy", "torch"])
def test_pictures_of_8_bits_stay_that(array):
    xp = pytest.importorskip("torch") if array == "torch" else np
    box = gymnasium.spaces.Box(0, 255, (48, 40, 3), np.uint8)
    envs = gsp.gymnasium.VectorEnv(Looks(worlds=3, array=array))
    assert envs.single_observation_space["picture"] == box and envs.observation_space["picture"].dtype == np.uint8
    seen, _ = envs.reset()
    assert seen["picture"].dtype == xp.uint8 and seen["state"].dtype == xp.float32 and (seen["picture"] == 250).all()
    envs.step(xp.zeros((3, 1)))
    seen, *_, infos = envs.step(xp.zeros((3, 1)))
    last = infos["final_obs"][0]["picture"]
    assert last.dtype == xp.uint8 and (last == 252).all() and seen["picture"][:, 0, 0, 0].tolist() == [250, 252, 252]
    alone = type("Alone", (Looks,), {"alone": True})
    assert gsp.gymnasium.VectorEnv(alone(worlds=2, array=array)).single_observation_space == box
    if array == "numpy":
        check_env(gsp.gymnasium.Env(Looks()))


def test_a_renderers_pictures_go_to_tasks_as_they_are():
    torch = pytest.importorskip("torch")

    class Sees(Counting):
        def observe(self, data):
            frames = self.renderer.render(data, gsp.look_at((0, -1, 0.2), (0, 0, 0)), gsp.pinhole(12, 8, 60))
            return {"rgb8": frames.rgb8, "rgb": frames.rgb}

    for array, xp in (("numpy", np), ("torch", torch)):
        task = Sees(worlds=1, array=array)
        task.renderer = gsp.Renderer(gsp.Scene(SLIDER).add_surface(), 12, 8, rgb8=True)
        task.reset()
        seen, again = task.observations(), task.observations()
        assert seen["rgb8"].dtype == xp.uint8 and seen["rgb"].dtype == xp.float32 and seen["rgb8"].shape == (1, 8, 12, 3)
        assert seen["rgb8"].max() > 50 and (seen["rgb8"] == again["rgb8"]).all()
        seen["rgb8"][:] = 0  # a copy
        assert again["rgb8"].max() > 50


def test_stable_baselines3_sees_pictures():
    pytest.importorskip("stable_baselines3")
    import gsp.sb3
    from stable_baselines3 import PPO
    from stable_baselines3.common.torch_layers import NatureCNN
    from stable_baselines3.common.vec_env import VecTransposeImage

    env = gsp.sb3.VecEnv(Looks(worlds=3))
    env.reset()
    env.step(np.zeros((3, 1)))
    seen, _, done, infos = env.step(np.zeros((3, 1)))
    assert done[0] and infos[0]["terminal_observation"]["picture"].dtype == seen["picture"].dtype == np.uint8
    options = dict(n_steps=4, batch_size=6, n_epochs=1, device="cpu")
    model = PPO("MultiInputPolicy", env, **options).learn(12)
    assert isinstance(model.env, VecTransposeImage)
    extractors = model.policy.features_extractor.extractors
    assert isinstance(extractors["picture"], NatureCNN) and not isinstance(extractors["state"], NatureCNN)
    alone = type("Alone", (Looks,), {"alone": True})
    model = PPO("CnnPolicy", gsp.sb3.VecEnv(alone(worlds=3)), **options).learn(12)
    assert isinstance(model.policy.features_extractor, NatureCNN)


def test_rsl_rl_sees_pictures():
    torch = pytest.importorskip("torch")
    pytest.importorskip("rsl_rl")
    import gsp.rsl_rl
    from rsl_rl.runners import OnPolicyRunner

    seen = gsp.rsl_rl.VecEnv(Looks(worlds=3)).get_observations()
    assert seen["picture"].dtype == torch.uint8 and seen["picture"].shape == (3, 48, 40, 3)

    class First(Looks):
        def observe(self, data):  # as docs/python_tasks.md says it for CNNModel
            seen = super().observe(data)
            return {"state": seen["state"], "picture": (seen["picture"] / np.float32(255)).transpose(0, 3, 1, 2)}

    cnn = {"output_channels": [4], "kernel_size": 8, "stride": 4}
    network = {"class_name": "CNNModel", "hidden_dims": [8], "cnn_cfg": cnn}
    cfg = {
        "num_steps_per_env": 4,
        "save_interval": 10,
        "obs_groups": {"actor": ["state", "picture"], "critic": ["state", "picture"]},
        "actor": {**network, "distribution_cfg": {"class_name": "GaussianDistribution"}},
        "critic": network,
        "algorithm": {"class_name": "PPO", "rnd_cfg": None, "symmetry_cfg": None},
    }
    OnPolicyRunner(gsp.rsl_rl.VecEnv(First(worlds=3)), cfg, log_dir=None, device="cpu").learn(1)


class Plain(CartPole):
    """CartPole for either kind of array."""

    bad = 0.0

    def observe(self, data):
        return data.qpos

    def act(self, data, action):
        data.ctrl[:] = action
        data.ctrl[1] += self.bad

    def reward(self, data):
        return data.qpos[:, 0] * 0 + 1

    def terminated(self, data):
        return ~self._everywhere

    def randomise(self, data, mask):
        pass


@pytest.mark.parametrize("array", ["numpy", "torch"])
def test_the_first_world_that_stops_is_told(array):
    import warnings

    xp = pytest.importorskip("torch") if array == "torch" else np
    task = Plain(worlds=3, array=array)
    task.reset()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        task.step(xp.zeros((3, 1)))
    task.bad = float("nan")
    with pytest.warns(UserWarning, match=r"Plain: the physics of world 1 stopped at step 2 of its episode.*data\.ctrl of it is not finite") as told:
        _, _, truncated = task.step(xp.zeros((3, 1)))
    assert len(told) == 1 and told[0].filename == __file__ and truncated.tolist() == [False, True, False]
    with warnings.catch_warnings():  # once
        warnings.simplefilter("error")
        task.reset(truncated)
        task.step(xp.zeros((3, 1)))
    far = Plain(worlds=3, array=array)
    far.reset()
    far.data.qvel[2] = 1e11
    with pytest.warns(UserWarning, match=r"world 2 stopped at step 1 .*beyond 1e10"):
        far.step(xp.zeros((3, 1)))


@pytest.mark.parametrize("array", ["numpy", "torch"])
def test_rewards_that_are_not_finite_are_refused(array):
    xp = pytest.importorskip("torch") if array == "torch" else np

    class Divides(Plain):
        def reward(self, data):
            return self.worth / 1.0

    task = Divides(worlds=3, array=array)
    task.reset()
    for bad, text in ((float("nan"), "nan"), (float("inf"), "inf")):
        task.worth = xp.zeros(3)
        task.step(xp.zeros((3, 1)))
        task.worth[2] = bad
        with pytest.raises(gsp.Error, match=f"Divides.reward of world 2 is {text}: look at what it is made of"):
            task.step(xp.zeros((3, 1)))


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
def test_rewards_of_an_episode_that_begins_are_looked_at_where_they_are_read(mode):
    class Divides(Plain):
        def reward(self, data):
            return self.worth

        def terminated(self, data):
            return self.over

    task = Divides(worlds=3)
    task.worth, task.over = np.zeros(3), np.array([False, True, False])
    envs = gsp.gymnasium.VectorEnv(task, mode)
    envs.reset()
    envs.step(np.zeros((3, 1)))
    task.worth, task.over = np.array([0, np.nan, 0]), np.zeros(3, dtype=bool)
    if mode is AutoresetMode.SAME_STEP:  # world 1 was reset in the step that ended it: this is its first one
        with pytest.raises(gsp.Error, match="Divides.reward of world 1 is nan"):
            envs.step(np.zeros((3, 1)))
    else:  # this step resets it, and its reward is 0
        assert envs.step(np.zeros((3, 1)))[1].tolist() == [0, 0, 0]
        with pytest.raises(gsp.Error, match="Divides.reward of world 1 is nan"):
            envs.step(np.zeros((3, 1)))


class Sees(Short):
    """Pictures that chance changes, of both kinds."""

    def __init__(self, worlds=1, **options):
        super().__init__(worlds, **options)
        self.renderer = gsp.Renderer(gsp.Scene(self.model).add_surface(), 24, 16, rgb8=True, depth=False)

    def observe(self, data):
        mount = dict(body="world", pos=(0, -3, 1), quat=(0.77, 0.64, 0, 0), fovy=60)
        at = data.cameras([mount], 24, 16)
        episode = self.chance("episode")
        develop = dict(exposure=0.3, noise=0.05, background=(0.6, 0.7, 0.9), chance=self.chance(), light_chance=episode)
        return {"seen": super().observe(data), "picture": self.renderer.render(data, *at, develop=develop, jitter=dict(position=0.2, chance=episode)).rgb8}


def test_pictures_of_a_world_are_its_own():
    seeds = [5, 6, 7]
    ours = gsp.gymnasium.VectorEnv(Sees(worlds=3))
    theirs = SyncVectorEnv([lambda: gsp.gymnasium.Env(Sees())] * 3, autoreset_mode=AutoresetMode.SAME_STEP)
    other = gsp.gymnasium.VectorEnv(Sees(worlds=3))
    (a, _), (b, _), (c, _) = ours.reset(seed=seeds), theirs.reset(seed=seeds), other.reset(seed=[99, 6, 7])
    rng, before = np.random.default_rng(0), a["picture"]
    for _ in range(40):
        assert np.array_equal(a["picture"], b["picture"]) and np.array_equal(a["seen"], b["seen"])
        assert np.array_equal(a["picture"][1:], c["picture"][1:]) and not np.array_equal(a["picture"][0], c["picture"][0])
        assert len({p.tobytes() for p in a["picture"]}) == 3
        action = rng.uniform(-1, 1, (3, 1)).astype(np.float32)
        a, b, c = (e.step(action)[0] for e in (ours, theirs, other))
        assert not any(np.array_equal(x, y) for x, y in zip(before, a["picture"]))
        before = a["picture"]
    assert ours.task._episode.max() > 0


@pytest.mark.parametrize("array", ["numpy", "torch"])
def test_chance_is_of_a_world_its_episode_and_its_step(array):
    xp = pytest.importorskip("torch") if array == "torch" else np
    task = Plain(worlds=3, array=array, seed=4)
    task.reset()
    rows = lambda *words, **more: np.asarray(task.chance(*words, **more))  # noqa: E731
    first, episode = rows(), rows("episode")
    assert first.dtype == np.int64 and first.shape == (3, 3) and len(np.unique(first, axis=0)) == 3
    task.step(xp.zeros((3, 1)))
    assert np.array_equal(rows("episode"), episode) and np.array_equal(rows()[:, 1], first[:, 1] + 1)
    task.reset(xp.asarray([True, False, False]))
    changed = rows("episode") != episode
    assert changed[0, 1] and changed.sum() == 1
    two = rows(pictures=2)
    assert two.shape == (6, 3) and len(np.unique(two, axis=0)) == 6 and np.array_equal(two[::2, :2], two[1::2, :2])
    assert np.array_equal(two[::2], rows()) and np.array_equal(two[1::2, 2], rows()[:, 2] + (1 << 24))
    task.reset(seed=5)
    low = rows()
    task.reset(seed=2**63 + 5)
    assert not np.array_equal(rows()[:, 0], low[:, 0])
    with pytest.raises(gsp.Error, match="Plain.chance: of is 'world'"):
        task.chance("world")
    with pytest.raises(gsp.Error, match="Plain.chance: of is 'step' and pictures 2.5"):
        task.chance(pictures=2.5)
    with pytest.raises(gsp.Error, match=r"Plain: size is \(2, 3\): give how many numbers"):
        task.uniform(0, 1, (2, 3))
    with pytest.raises(gsp.Error, match=r"Plain: size is None"):
        task.normal(1, None)


def test_a_model_without_actuators_is_told():
    falls = gsp.Model.from_string('<mujoco><worldbody><body><freejoint/><geom size="0.1"/></body></worldbody></mujoco>')

    class Falls(Counting):
        model = falls
        ends = (9,)

    with pytest.raises(gsp.Error, match="Falls: the model has no actuators.*say action_size"):
        Falls()

    class Pushed(Falls):
        action_size = 3

        def act(self, data, action):
            data.qfrc_applied[:, :3] = action

    pushed = Pushed()
    pushed.reset()
    pushed.step(np.ones((1, 3)))
    assert pushed.data.qvel[0, 0] > 0
    watched = type("Watched", (Falls,), {"action_size": 0, "reward": lambda self, data: data.qpos[:, 2]})()
    watched.reset()
    watched.step(np.zeros((1, 0)))
