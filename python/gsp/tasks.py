"""Tasks of the package's own models (gsp/models), to begin with and to copy from."""

from pathlib import Path
from typing import Any

import numpy as np

from .task import Numbers, Task

MODELS = Path(__file__).parent / "models"


class CartPole(Task):
    """A pole on a cart is to be kept upright by pushing the cart."""

    model = MODELS / "cartpole.xml"
    substeps = 2

    def observe(self, data: Any) -> Any:
        return np.concatenate([data.qpos, data.qvel], axis=1)

    def reward(self, data: Any) -> Numbers:
        return np.cos(data.qpos[:, 1]) - 0.05 * data.qpos[:, 0] ** 2

    def terminated(self, data: Any) -> Numbers:
        return (abs(data.qpos[:, 0]) > 2.4) | (abs(data.qpos[:, 1]) > 0.5)

    def randomise(self, data: Any, mask: Numbers) -> None:
        data.qpos[mask] = self.uniform([-0.5, -0.2], [0.5, 0.2], 2, mask)
        data.qvel[mask] = self.uniform(-0.2, 0.2, 2, mask)


class Stand(Task):
    """A quadruped that crouches is to rise to its height, and to stand still there. An action of 0 goes on crouching."""

    model = MODELS / "quadruped.xml"
    keyframe = "crouch"
    substeps = 4
    crouch = np.tile(np.array([0, 1.3, -2.5], dtype=np.float32), 4)
    height = 0.3

    def act(self, data: Any, action: Numbers) -> None:
        data.ctrl[:] = self.crouch + 0.5 * action

    def up(self, data: Any) -> Numbers:
        """The world's z axis as the trunk has it."""
        w, x, y, z = data.qpos[:, 3:7].T
        return np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)

    def observe(self, data: Any) -> Any:
        seen = [data.sensordata, self.up(data), data.qpos[:, 7:] - self.crouch, data.qvel[:, 6:]]
        noise = np.repeat(np.array([0.05, 0.2, 0.02, 0.01, 0.5], dtype=np.float32), [3, 3, 3, 12, 12])
        return np.concatenate([np.concatenate(seen, axis=1) + noise * self.uniform(-1, 1, 33), self.action], axis=1)

    def reward(self, data: Any) -> Numbers:
        low = (data.qpos[:, 2] - self.height) / 0.1
        tilt = 1 - self.up(data)[:, 2]
        moves = np.square(data.qvel[:, :6]).sum(axis=1)
        change = np.square(self.action - self.last_action).sum(axis=1)
        return np.exp(-(low**2)) - tilt - 0.02 * moves - 0.005 * change

    def terminated(self, data: Any) -> Numbers:
        return self.up(data)[:, 2] < 0.7

    def randomise(self, data: Any, mask: Numbers) -> None:
        data.qpos[mask, 2] += self.uniform(0, 0.05, 1, mask)[:, 0]
        data.qpos[mask, 7:] += self.uniform(-0.1, 0.1, 12, mask)
        data.qvel[mask, :6] += self.uniform(-0.3, 0.3, 6, mask)

    def info(self, data: Any) -> dict[str, Numbers]:
        return {"height": data.qpos[:, 2]}
