"""The vectorised environment of Stable-Baselines3 of a gsp.Task.

    model = stable_baselines3.PPO("MlpPolicy", gsp.sb3.VecEnv(MyTask(worlds=64)), device="cpu")
"""

from typing import Any

try:
    from stable_baselines3.common.vec_env import VecEnv as _VecEnv
except ImportError as e:
    raise ImportError("gsp.sb3 needs Stable-Baselines3 2: pip install stable-baselines3") from e

import numpy as np

from . import gymnasium as _gymnasium
from ._gsp import Error
from .task import expect_task

__all__ = ["VecEnv"]


class VecEnv(_VecEnv):
    """Worlds are reset in the step that ends their episode; infos[k] has "terminal_observation" and "TimeLimit.truncated" then, and what the
    task's `info` gives always. `seed(n)` holds from the next reset on."""

    def __init__(self, task: Any) -> None:
        self.envs = _gymnasium.VectorEnv(expect_task(task, "gsp.sb3.VecEnv"))
        if task.xp is not np:
            raise Error("gsp.sb3.VecEnv: Stable-Baselines3 reads NumPy's arrays: make the task with array='numpy'")
        super().__init__(task.worlds, self.envs.single_observation_space, self.envs.single_action_space)

    def reset(self) -> Any:
        seeds = [s for s in self._seeds if s is not None]
        self._reset_seeds()
        return self.envs.reset(seed=seeds or None)[0]

    def step_async(self, actions: Any) -> None:
        self._actions = actions

    def step_wait(self) -> Any:
        seen, rewards, terminated, truncated, infos = self.envs.step(self._actions)
        done = terminated | truncated
        names = [name for name in infos if "_" + name in infos and name not in ("final_obs", "final_info")]
        each: list[dict[str, Any]] = [{name: infos[name][k] for name in names} for k in range(self.num_envs)]
        for k in np.flatnonzero(done):
            each[k] = {name: infos["final_info"][name][k] for name in names}
            each[k]["terminal_observation"] = infos["final_obs"][k]
            each[k]["TimeLimit.truncated"] = bool(truncated[k] and not terminated[k])
        return seen, rewards, done, each

    def set_options(self, options: Any = None) -> None:
        if any([options] if isinstance(options, dict) else options or []):
            raise Error(
                "gsp.sb3.VecEnv: a reset of a task has no options: give them to the task as it is made, or set attributes of env.envs.task"
            )

    def close(self) -> None:
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise Error("gsp.sb3.VecEnv: all worlds are one task: set its attributes yourself, env.envs.task")

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        raise Error("gsp.sb3.VecEnv: all worlds are one task: call its methods yourself, env.envs.task")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]
