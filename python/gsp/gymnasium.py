"""Environments of Gymnasium 1.0 and later of a gsp.Task.

    envs = gsp.gymnasium.VectorEnv(MyTask(worlds=1024))
    envs = gymnasium.make_vec("gsp/CartPole-v0", num_envs=1024)     # after `import gsp.gymnasium`
"""

import importlib

try:
    import gymnasium
    from gymnasium.vector import AutoresetMode
    from gymnasium.vector.utils import batch_space
except ImportError as e:
    raise ImportError("gsp.gymnasium needs Gymnasium, 1.0 or later: pip install gymnasium") from e

import numpy as np

from ._gsp import Error
from .task import expect_task

__all__ = ["Env", "VectorEnv", "register"]


def _spaces(task, seen):
    """Of one world: what it sees, and does."""

    def box(a):
        if a.dtype == task.xp.uint8:
            return gymnasium.spaces.Box(0, 255, tuple(a.shape[1:]), np.uint8)
        return gymnasium.spaces.Box(-np.inf, np.inf, tuple(a.shape[1:]), np.float32)

    see = gymnasium.spaces.Dict({k: box(v) for k, v in seen.items()}) if isinstance(seen, dict) else box(seen)
    return see, gymnasium.spaces.Box(-1, 1, (task.action_size,), np.float32)


def _row(seen, world):
    return {k: v[world] for k, v in seen.items()} if isinstance(seen, dict) else seen[world]


def _metadata(task, **more):
    return {"render_modes": [], "render_fps": round(1 / task.dt), **more}


class VectorEnv(gymnasium.vector.VectorEnv):
    """A task's worlds. Observations, rewards and flags are copies, NumPy's or torch's as the task's arrays are.

    autoreset_mode: SAME_STEP resets a world in the step that ends its episode, and infos["final_obs"], ["final_info"] have what was before;
    NEXT_STEP in the step after it, whose action does nothing; DISABLED leaves it to reset(options={"reset_mask": mask}).
    reset(seed=n): each world has a stream of its own, the same whatever num_envs is; reset(seed=[...]): world k that of Env's reset(seed=...).
    """

    def __init__(self, task, autoreset_mode=AutoresetMode.SAME_STEP):
        self.task = expect_task(task, "gsp.gymnasium.VectorEnv")
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = _metadata(task, autoreset_mode=self.autoreset_mode)
        self.num_envs = task.worlds
        task.reset(seed=task.seed)
        self.single_observation_space, self.single_action_space = _spaces(task, task.observations())
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._ended = task.xp.zeros_like(task._everywhere)
        self._begun = False

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed if isinstance(seed, int) else None)
        mask = (options or {}).get("reset_mask")
        if mask is not None:
            self._check(mask)
        if not self._begun:
            seed = self.task.seed if seed is None else seed
            if mask is not None and not mask.all():
                raise Error("gsp.gymnasium.VectorEnv: the first reset is of all worlds: leave reset_mask out")
        self._begun = True
        self.task.reset(mask, seed)
        self._ended[self.task._everywhere if mask is None else mask] = False
        return self.task.observations(), self._infos(self.task._everywhere if mask is None else mask)

    def step(self, actions):
        task, mode = self.task, self.autoreset_mode
        if not self._begun:
            raise Error("gsp.gymnasium.VectorEnv: reset comes before the first step")
        begin = self._ended
        if mode is AutoresetMode.DISABLED and begin.any():
            raise Error(
                f"gsp.gymnasium.VectorEnv: world {int(begin.nonzero()[0][0])} has ended: "
                'reset(options={"reset_mask": mask}) before the next step, or take another autoreset_mode'
            )
        unread = begin if mode is AutoresetMode.NEXT_STEP else None
        rewards, terminations, truncations = task.step(actions, unread)
        infos = {}
        if mode is AutoresetMode.NEXT_STEP and begin.any():
            rewards[begin], terminations, truncations = 0, terminations & ~begin, truncations & ~begin
            task.reset(begin)
        self._ended = terminations | truncations
        if mode is AutoresetMode.SAME_STEP and self._ended.any():
            infos = self._final(task.observations())
            task.reset(self._ended)
        infos.update(self._infos(task._everywhere))
        return task.observations(), rewards, terminations, truncations, infos

    def _final(self, seen):
        ended = self.task._copy(self._ended)
        last = np.full(self.num_envs, None, dtype=object)
        for k in np.flatnonzero(np.asarray(ended.tolist())):
            last[k] = _row(seen, k)
        return {"final_obs": last, "_final_obs": ended, "final_info": self._infos(ended), "_final_info": self.task._copy(ended)}

    def _infos(self, mask):
        out = {}
        for name, value in self.task.infos().items():
            value[~mask] = 0
            out[name], out["_" + name] = value, self.task._copy(mask)
        return out

    def _check(self, mask):
        """With the sentences of Gymnasium's own."""
        xp = self.task.xp
        kind = np.ndarray if xp is np else xp.Tensor
        if not isinstance(mask, kind):
            raise TypeError(f"`options['reset_mask']` must be a {'numpy array' if xp is np else 'torch tensor'}, got {type(mask)}")
        if tuple(mask.shape) != (self.num_envs,):
            raise ValueError(f"`options['reset_mask']` must have shape `({self.num_envs},)`, got {tuple(mask.shape)}")
        if mask.dtype != xp.bool:
            raise TypeError(f"`options['reset_mask']` must have `dtype=np.bool_`, got {mask.dtype}")
        if not mask.any():
            raise ValueError(
                f"`options['reset_mask']` must contain a boolean array with at least one True value, got reset_mask={mask}"
            )


class Env(gymnasium.Env):
    """A task of one world, for what knows no vectors: checkers, Stable-Baselines3.

    Where neither the task nor the first `reset` is given a seed, it begins with one by chance, `np_random_seed`, as Gymnasium's own do.
    """

    def __init__(self, task):
        if expect_task(task, "gsp.gymnasium.Env").worlds != 1:
            raise Error(f"gsp.gymnasium.Env is one world, and the task has {task.worlds}: make it with worlds=1, or take VectorEnv")
        self.task = task
        self.metadata = _metadata(task)
        task.reset(seed=task.seed)
        self.observation_space, self.action_space = _spaces(task, task.observations())
        self._begun = False

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        if seed is None and not self._begun:
            seed = self.task.seed if self.task._seeded else self.np_random_seed
        self._begun = True
        self.task.reset(seed=None if seed is None else [seed])
        return self._seen()

    def step(self, action):
        if not self._begun:
            raise Error("gsp.gymnasium.Env: reset comes before the first step")
        reward, terminated, truncated = self.task.step(self.task._actions(action)[None])
        seen, info = self._seen()
        return seen, float(reward[0]), bool(terminated[0]), bool(truncated[0]), info

    def _seen(self):
        return _row(self.task.observations(), 0), {name: value[0] for name, value in self.task.infos().items()}


def _task(name):
    if not isinstance(name, str):
        return name
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)


def _expect_no_picture(render_mode):
    if render_mode is not None:
        raise Error(
            f"gsp.gymnasium: environments draw nothing, and render_mode={render_mode!r} is asked for: leave it out, "
            "and draw the task's data with gsp.Renderer"
        )


def _make(task, render_mode=None, **options):
    _expect_no_picture(render_mode)
    return Env(_task(task)(1, **options))


def _make_vec(task, num_envs, autoreset_mode=AutoresetMode.SAME_STEP, render_mode=None, **options):
    _expect_no_picture(render_mode)
    return VectorEnv(_task(task)(num_envs, **options), autoreset_mode)


def register(id, task):
    """gymnasium.make(id) and make_vec(id, num_envs=..., autoreset_mode=..., **options) make the task, a class or "module:Class"."""
    gymnasium.register(
        id, entry_point="gsp.gymnasium:_make", vector_entry_point="gsp.gymnasium:_make_vec", kwargs={"task": task}
    )


for _name in ("CartPole", "Stand"):
    register(f"gsp/{_name}-v0", f"gsp.tasks:{_name}")
