"""The environment of rsl_rl 5 (PyPI: rsl-rl-lib) of a gsp.Task.

    runner = rsl_rl.runners.OnPolicyRunner(gsp.rsl_rl.VecEnv(MyTask(worlds=1024)), cfg, log_dir)
"""

try:
    import torch
    from rsl_rl.env import VecEnv as _VecEnv
    from tensordict import TensorDict
except ImportError as e:
    raise ImportError("gsp.rsl_rl needs rsl_rl 5 with torch and tensordict: pip install rsl-rl-lib") from e

from .task import expect_task

__all__ = ["VecEnv"]


class VecEnv(_VecEnv):
    """Worlds are reset in the step that ends their episode; extras["time_outs"] are those that were truncated and not terminated.

    What `observe` gives without a name is the group "policy". extras["log"] has the means of the task's `info`, "/info/NAME", and "/stops", how
    many worlds' physics stopped in this step.
    """

    def __init__(self, task, cfg=None):
        self.task = expect_task(task, "gsp.rsl_rl.VecEnv")
        self.num_envs = task.worlds
        self.num_actions = task.action_size
        self.max_episode_length = task.episode_steps
        self.device = task.device
        self.cfg = {"task": type(task).__name__, "worlds": task.worlds, "seed": task.seed} if cfg is None else cfg
        task.reset(seed=task.seed)

    @property
    def episode_length_buf(self):
        return torch.as_tensor(self.task.age)

    @episode_length_buf.setter
    def episode_length_buf(self, value):
        self.task.age[:] = value if torch.is_tensor(self.task.age) else value.numpy()

    def get_observations(self):
        seen = self.task.observations()
        seen = seen if isinstance(seen, dict) else {"policy": seen}
        return TensorDict({name: torch.as_tensor(value) for name, value in seen.items()}, batch_size=[self.num_envs], device=self.device)

    def step(self, actions):
        task = self.task
        stops = task.stops.sum()
        rewards, terminated, truncated = task.step(actions if torch.is_tensor(task.age) else actions.detach().numpy())
        rewards = torch.as_tensor(rewards)
        log = {f"/info/{name}": torch.as_tensor(value).float().mean() for name, value in task.infos().items()}
        done = terminated | truncated
        if done.any():
            task.reset(done)
        log["/stops"] = float(task.stops.sum() - stops)
        extras = {"time_outs": torch.as_tensor(truncated & ~terminated), "log": log}
        return self.get_observations(), rewards, torch.as_tensor(done), extras
