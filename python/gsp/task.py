"""A task for learning: what a policy does, sees and is rewarded for, as batched code on the arrays of many worlds.

gsp.gymnasium and gsp.rsl_rl make environments of it.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from . import _gsp
from ._gsp import Array, Data, Error, Model

Numbers = Any  # an array of NumPy or of torch

_HOOKS = ("act", "observe", "reward", "terminated", "randomise", "info")
_SAID = _HOOKS + ("model", "keyframe", "substeps", "seconds", "action_size")
_OPTIONS = ("profile", "precision", "timestep", "iterations", "tolerance", "threads", "per_world")
_LOW = 0xFFFFFFFF


def philox(key: Numbers, counter: tuple[Numbers, ...]) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """Four arrays of 32-bit numbers (int64) of a key (int64) and a counter of four: Philox4x32-10, as gsp/math/philox.hpp has it."""
    c0, c1, c2, c3 = counter
    k0, k1 = key & _LOW, (key >> 32) & _LOW
    for _ in range(10):
        a, b = c0 * 0xD2511F53, c2 * 0xCD9E8D57  # wrap round 64 bits, all of which are used
        c0, c1, c2, c3 = ((b >> 32) & _LOW) ^ c1 ^ k0, b & _LOW, ((a >> 32) & _LOW) ^ c3 ^ k1, a & _LOW
        k0, k1 = (k0 + 0x9E3779B9) & _LOW, (k1 + 0xBB67AE85) & _LOW
    return c0, c1, c2, c3


class _Data(Data):
    """A gsp.Data whose attributes are NumPy's arrays, or torch's, of the same memory."""

    def __init__(self, convert: Any, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        object.__setattr__(self, "_convert", convert)

    def __getattribute__(self, name: str) -> Any:
        value = super().__getattribute__(name)
        return super().__getattribute__("_convert")(value) if isinstance(value, Array) else value

    def __setattr__(self, name: str, value: Any) -> None:
        if not hasattr(Data, name):  # a class of Python takes any
            raise AttributeError(f"gsp.Data has no attribute '{name}': what a task remembers is the task's own")
        super().__setattr__(name, value)


def _nearest(name: str, names: tuple[str, ...]) -> str:
    import difflib

    return next(iter(difflib.get_close_matches(name, names, 1, 0.85)), "")


class Task:
    """Many worlds of a model, in which one policy learns.

    Derive from it, say `model`, and write `observe`, `reward`, and where they are needed `terminated`, `randomise`, `act` and `info`: each
    works on all worlds at once. `data` is a gsp.Data whose arrays are NumPy's, or torch's, without a copy: data.qpos is (worlds, nq).
    `self.data` is the same, which gsp.Renderer and other functions take as any, and `self.model` the gsp.Model.

        class Balance(gsp.Task):
            model = "cartpole.xml"
            def observe(self, data): return np.concatenate([data.qpos, data.qvel], axis=1)
            def reward(self, data): return np.cos(data.qpos[:, 1])
            def terminated(self, data): return abs(data.qpos[:, 0]) > 2
            def randomise(self, data, mask): data.qpos[mask] += self.uniform(-0.1, 0.1, 2, mask)

    An episode that has taken `seconds` is truncated, not terminated: what follows it still has a value. So is one whose physics stopped
    (data.status), which `stops` counts; the first of a task is warned of.
    """

    model: Model | str | os.PathLike[str] | None = None
    """gsp.Model, or the path of an MJCF or URDF file."""
    keyframe: str | int | None = None
    """Name or number of the keyframe that episodes begin with; None: the model's initial positions."""
    substeps: int = 1
    """Steps of physics in one of control."""
    seconds: float = 10.0
    """Longest episode [s]."""
    action_size: int | None = None
    """Numbers of an action; None: the model's nu, which must not be 0 then."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        for name in vars(cls):
            near = _nearest(name, _SAID)
            if near and not hasattr(Task, name) and not name.startswith("_"):
                import warnings

                warnings.warn(f"{cls.__name__}.{name}: a gsp.Task has no {name} and takes no notice of it: is it {near}?", stacklevel=2)

    def __getattr__(self, name: str) -> Any:  # of what is not there
        if "_everywhere" in self.__dict__:
            raise AttributeError(f"{type(self).__name__} has no attribute '{name}'")
        raise AttributeError(
            f"{type(self).__name__} has no attribute '{name}' yet: its __init__ calls super().__init__(worlds, ...) before all else"
        )

    def __init__(self, worlds: int = 1, device: str = "cpu", *, seed: Any = None, array: str | None = None, **options: Any) -> None:
        """seed: a whole number, or one for each world; None: 0, but gsp.gymnasium.Env begins with one by chance. array: "numpy" or "torch",
        what `data` and all results are; None: NumPy's on the CPU, torch's on a GPU. options: gsp.Data's."""
        if self.model is None:
            raise Error(f"{type(self).__name__} has no model: write `model = ...`, a gsp.Model or the path of an MJCF or URDF file")
        if not isinstance(self.model, Model):
            path = Path(self.model)
            self.model = Model.from_urdf(path) if path.suffix == ".urdf" else Model.from_xml(path)
        array = array or ("numpy" if device == "cpu" else "torch")
        if array not in ("numpy", "torch"):
            raise Error(f"{type(self).__name__}: array '{array}' is not known: give 'numpy' or 'torch'")
        if array == "numpy" and device != "cpu":
            raise Error(f"{type(self).__name__}: NumPy reads the host's memory, and the worlds lie on '{device}': give array='torch'")
        for name in options:
            if name not in _OPTIONS:
                raise Error(f"{type(self).__name__}: there is no option '{name}': give {', '.join(_OPTIONS)}, as to gsp.Data")
        if array == "torch":
            import torch

            self.xp: Any = torch
            self._on: dict[str, Any] = {"device": device}
        else:
            self.xp, self._on = np, {}
        self.data: Any = _Data(np.asarray if array == "numpy" else self.xp.from_dlpack, self.model, worlds, device, **options)
        """gsp.Data of all worlds; its attributes are arrays of NumPy or torch."""
        self.worlds = worlds
        self.device = device
        if self.substeps < 1 or self.substeps != int(self.substeps) or not 0 < self.seconds < 1e9:
            raise Error(
                f"{type(self).__name__}: substeps is {self.substeps} and seconds {self.seconds}: "
                "both must be positive and finite, and substeps a whole number"
            )
        self.substeps = int(self.substeps)
        self.dt = self.data.timestep * self.substeps
        self.episode_steps = round(self.seconds / self.dt)
        if self.episode_steps < 1:
            raise Error(f"{type(self).__name__}: an episode of {self.seconds} s is shorter than a step of control, {self.dt} s")
        if self.action_size is None:
            self.action_size = self.model.nu
            if self.action_size == 0:
                raise Error(
                    f"{type(self).__name__}: the model has no actuators, and actions would have no numbers: give it some, or say action_size "
                    "and write act(self, data, action); action_size = 0 is a task without actions"
                )
        if self.action_size != int(self.action_size) or self.action_size < 0:
            raise Error(f"{type(self).__name__}: action_size is {self.action_size} and must be a whole number, 0 or more")
        self.action_size = int(self.action_size)
        if type(self).act is Task.act:
            self._expect_size(self.action_size)
        low, high = np.asarray(self.model.actuator_ctrlrange, dtype=np.float32).reshape(-1, 2).T
        unbounded = low >= high
        self._middle = self._floats(np.where(unbounded, 0, (low + high) / 2))
        self._half = self._floats(np.where(unbounded, 1, (high - low) / 2))
        self.age = self._zeros("int64")
        """(worlds) steps of control since the episode began."""
        self.stops = self._zeros("int64")
        """(worlds) how often a world was reset whose physics had stopped."""
        self.action = self._zeros("float32", self.action_size)
        """(worlds, action_size) of the step just done, 0 after a reset: what `observe` usually gives a policy."""
        self.last_action = self._zeros("float32", self.action_size)
        """(worlds, action_size) of the step before that one."""
        self._next_action = self._zeros("float32", self.action_size)
        self._everywhere = self._zeros("bool") == 0
        self._key: Numbers = self._zeros("int64")
        self._world: Numbers = self._zeros("int64")
        self._episode: Numbers = self._zeros("int64")
        self._hook = self._draw = 0
        self._told = False
        self._seeded = seed is not None
        self.seed = 0 if seed is None else seed
        self._seed(self.seed, self._everywhere)

    # What a task says.

    def act(self, data: Any, action: Numbers) -> None:
        """Writes controls. By default actions from -1 to 1 are those from end to end of an actuator's ctrlrange; where there is none, 1 is 1."""
        self._expect_size(action.shape[1])
        data.ctrl[:] = self._middle + self._half * action

    def observe(self, data: Any) -> Any:
        """(worlds, n), or several by name: {"actor": (worlds, n), "critic": (worlds, m)}; uint8, as pictures of 8 bits are, or what becomes
        float32. Called once or twice a step: it changes nothing."""
        raise NotImplementedError(f"{type(self).__name__} has no observe(self, data): write it")

    def reward(self, data: Any) -> Numbers:
        """(worlds)"""
        raise NotImplementedError(f"{type(self).__name__} has no reward(self, data): write it")

    def terminated(self, data: Any) -> Numbers:
        """(worlds) bool, what ends an episode for good."""
        return ~self._everywhere

    def randomise(self, data: Any, mask: Numbers) -> None:
        """Changes how episodes begin, and what a task remembers, in worlds of the mask (worlds) bool, just reset."""

    def info(self, data: Any) -> dict[str, Numbers]:
        """Arrays (worlds, ...) by name for infos of Gymnasium; their means go to rsl_rl's log."""
        return {}

    # Random numbers.

    def uniform(self, low: Numbers, high: Numbers, size: int, mask: Numbers = None) -> Numbers:
        """(worlds, size) float32 from low to high (numbers, or size of them); with a mask (mask.sum(), size), of its worlds alone.

        The numbers follow from the seed, the world, its episode, its step, the method that draws and which draw of it that is: a world
        has the same ones whatever the number of worlds, and whatever becomes of the others.
        """
        u = self._uniform(size, mask)
        low, high = self._floats(low), self._floats(high)
        return low + (high - low) * u

    def normal(self, deviation: Numbers, size: int, mask: Numbers = None) -> Numbers:
        """(worlds, size) float32 of mean 0; see `uniform`."""
        u = self._uniform(size, mask, 2)
        return self._floats(deviation) * self.xp.sqrt(-2 * self.xp.log(u[:, :size])) * self.xp.cos(2 * np.pi * u[:, size:])

    def chance(self, of: str = "step", pictures: int = 1) -> Numbers:
        """(worlds * pictures, 3) int64: seed, step and number by which `develop` and `jitter` of gsp.Renderer.render draw what each
        picture has of its own, picture k of a world (256 at most) in row world * pictures + k. of: "step", others in each step of control, or
        "episode", which stay until the world is reset. As of `uniform`, a world has the same ones whatever the others do."""
        if of not in ("step", "episode") or not isinstance(pictures, (int, np.integer)) or not 1 <= pictures <= 256:
            raise Error(f"{type(self).__name__}.chance: of is {of!r} and pictures {pictures!r}: give \"step\" or \"episode\", and 1 to 256")
        step = (self._episode & 0xFFFFFFFF) << 24
        if of == "step":
            step = step | (self.age & 0xFFFFFF)
        rows = self.xp.stack([self._key, step, self._world & 0xFFFFFF], -1)
        rows = rows[:, None].repeat(pictures, 1) if self.xp is np else rows[:, None].repeat(1, pictures, 1)
        rows[:, :, 2] |= self.xp.arange(pictures, **self._on) << 24
        self._to_library()  # which reads them where it draws
        return rows.reshape(-1, 3)

    # What environments call.

    def reset(self, mask: Numbers = None, seed: Any = None) -> None:
        """Begins new episodes, in worlds of the mask (worlds) bool. seed: a number, from which each world has a stream of its own, or one for
        each world; None: streams go on."""
        mask = self._everywhere if mask is None else self._bools(mask, "the mask of reset")
        if seed is not None:
            self._seed(seed, mask)
        stopped = self._stopped() & mask
        if not self._told:  # on a GPU it is looked at here alone, where masks are waited for as it is
            self._tell(stopped)
        self.stops += stopped
        self._episode[mask] += 1
        self.age[mask] = 0
        self.action[mask] = 0
        self.last_action[mask] = 0
        self._to_library()
        _gsp.reset(self.data.model, self.data, mask=mask.astype("int32") if self.xp is np else mask.int(), keyframe=self.keyframe)
        self._from_library()
        self._call("randomise", mask)
        self._to_library()
        _gsp.forward(self.data.model, self.data)
        self._from_library()

    def step(self, action: Numbers, unread: Numbers | None = None) -> tuple[Numbers, Numbers, Numbers]:
        """One step of control of all worlds: rewards, who is terminated and who truncated, each (worlds), copies. Resets nothing. unread:
        worlds whose rewards nobody takes, as they had ended before; others' must be finite."""
        action = self._actions(action)
        if tuple(action.shape) != (self.worlds, self.action_size):
            raise Error(f"{type(self).__name__}: actions have shape {tuple(action.shape)} and must have {(self.worlds, self.action_size)}")
        if self.device == "cpu" and not bool(self.xp.isfinite(action).all()):  # on a GPU the answer would be waited for
            world = int((~self.xp.isfinite(action)).any(1).nonzero()[0][0])
            raise Error(f"{type(self).__name__}: the action of world {world} is not finite: look at what the policy gives")
        before = self.action, self.last_action
        self.action, self.last_action = self._next_action, self.action
        self.action[:] = action
        try:
            self._call("act", self.action)
        except BaseException:  # it was not done
            self.action, self.last_action = before
            raise
        self._next_action = before[1]
        self._to_library()
        _gsp.step(self.data.model, self.data, self.substeps)
        self._from_library()
        self.age += 1
        reward = self._copy(self._floats(self._call("reward")))  # it may be a part of the state, which a reset writes
        if tuple(reward.shape) != (self.worlds,):
            raise Error(f"{type(self).__name__}.reward gives shape {tuple(reward.shape)} and must give {(self.worlds,)}")
        stopped = self._stopped()
        if self.device == "cpu":
            if not self._told:
                self._tell(stopped)
            fine = self.xp.isfinite(reward) if unread is None else self.xp.isfinite(reward) | unread
            if not bool(fine.all()):
                world = int((~fine).nonzero()[0][0])
                raise Error(f"{type(self).__name__}.reward of world {world} is {float(reward[world])}: look at what it is made of")
        # like the reward it may be what the task remembers, which randomise clears
        terminated = self._copy(self._bools(self._call("terminated"), f"what {type(self).__name__}.terminated gives"))
        return reward, terminated, (self.age >= self.episode_steps) | stopped

    def observations(self) -> Any:
        """What `observe` gives, copied: uint8 where it is that, else float32."""
        seen = self._call("observe")
        if isinstance(seen, dict):
            return {name: self._checked(value, f"['{name}']") for name, value in seen.items()}
        return self._checked(seen, "")

    def infos(self) -> dict[str, Numbers]:
        """What `info` gives, copied."""
        out = {name: self._copy(value) for name, value in self._call("info").items()}
        for name, value in out.items():
            if value.ndim < 1 or value.shape[0] != self.worlds:
                raise Error(f"{type(self).__name__}.info['{name}'] has shape {tuple(value.shape)} and must have ({self.worlds}, ...)")
        return out

    def _call(self, hook: str, *arguments: Any) -> Any:
        self._hook, self._draw = 1 + _HOOKS.index(hook), 0
        try:
            return getattr(self, hook)(self.data, *arguments)
        finally:
            self._hook, self._draw = 0, 0

    def _stopped(self) -> Numbers:
        status = self.data.status
        return (status if self.xp is np else status.view(self.xp.int32)) != 0

    def _tell(self, stopped: Numbers) -> None:
        """Warns of the first world whose physics stopped, once a task: who learns goes on, and would not know."""
        if not bool(stopped.any()):
            return
        import warnings

        self._told = True
        world = int(stopped.nonzero()[0][0])
        said = _gsp.status_text(int(self.data.status[world]))
        for name in ("ctrl", "qfrc_applied", "qvel", "qpos"):
            if not bool(self.xp.isfinite(getattr(self.data, name)[world]).all()):
                said = f"data.{name} of it is not finite: look at what writes it"
                break
        warnings.warn(
            f"{type(self).__name__}: the physics of world {world} stopped at step {int(self.age[world])} of its episode, and its episode is "
            f"truncated ({said}); task.stops counts such worlds, and only the first is told",
            stacklevel=3,
        )

    def _to_library(self) -> None:
        """The library's kernels come after torch's, whose stream may be another; `_from_library`: torch's after the library's."""
        if self.device != "cpu":
            _gsp.wait_for_stream(self.xp.cuda.current_stream())

    def _from_library(self) -> None:
        if self.device != "cpu":
            _gsp.let_stream_wait(self.xp.cuda.current_stream())

    def _zeros(self, dtype: str, *size: int) -> Numbers:
        return self.xp.zeros((self.worlds, *size), dtype=getattr(self.xp, dtype), **self._on)

    def _floats(self, value: Any) -> Numbers:
        if self.xp is np:
            return np.asarray(value, dtype=np.float32)
        return self.xp.as_tensor(value, dtype=self.xp.float32, **self._on)

    def _actions(self, value: Any) -> Numbers:
        told = value.is_complex() if hasattr(value, "is_complex") else np.asarray(value).dtype.kind not in "fiub"
        if told:  # NumPy would make numbers of text, and drop imaginary parts
            dtype = value.dtype if hasattr(value, "dtype") else np.asarray(value).dtype
            raise Error(f"{type(self).__name__}: an action holds {dtype}: give real numbers")
        return self._floats(value)

    def _expect_size(self, size: int) -> None:
        if size != self.model.nu:
            raise Error(
                f"{type(self).__name__}: actions of {size} numbers are for the model's {self.model.nu} actuators: "
                "write act(self, data, action), which says what they do, or leave action_size out"
            )

    def _copy(self, value: Any) -> Numbers:
        return np.array(value) if self.xp is np else self.xp.as_tensor(value, **self._on).clone()

    def _bools(self, value: Any, what: str) -> Numbers:
        value = np.asarray(value) if self.xp is np else self.xp.as_tensor(value, **self._on)
        if value.dtype != self.xp.bool or tuple(value.shape) != (self.worlds,):
            raise Error(f"{type(self).__name__}: {what} must be {(self.worlds,)} of bool and is {tuple(value.shape)} of {value.dtype}")
        return value

    def _seen(self, value: Any) -> Numbers:
        """uint8, as pictures of 8 bits are, or float32."""
        if self.xp is np:
            value = np.asarray(value)
        else:
            value = self.xp.from_dlpack(value) if isinstance(value, Array) else self.xp.as_tensor(value, **self._on)
        return value if value.dtype == self.xp.uint8 else self._floats(value)

    def _checked(self, value: Any, name: str) -> Numbers:
        value = self._copy(self._seen(value))
        if value.ndim < 2 or value.shape[0] != self.worlds:
            raise Error(f"{type(self).__name__}.observe{name} gives shape {tuple(value.shape)} and must give ({self.worlds}, ...): a row for each world")
        return value

    def _seed(self, seed: Any, mask: Numbers) -> None:
        whole = np.asarray(seed)
        if whole.dtype.kind not in "iuO" or (whole.ndim and whole.shape != (self.worlds,)):
            raise Error(f"{type(self).__name__}: a seed is a whole number, or one for each of the {self.worlds} worlds, and is {seed!r}")
        if any(s is None or s < 0 for s in whole.reshape(-1)):
            raise Error(f"{type(self).__name__}: seeds are 0 or more, one for each world, and are {seed!r}")
        folded = [int(s) ^ (int(s) >> 64) for s in whole.reshape(-1)]  # Gymnasium makes seeds of 128 bits
        keys = np.array([s & 0xFFFFFFFFFFFFFFFF for s in folded], dtype=np.uint64).view(np.int64)
        keys = np.broadcast_to(keys, self.worlds)
        worlds = np.zeros(self.worlds, dtype=np.int64) if whole.ndim else np.arange(self.worlds)
        if self.xp is not np:
            keys, worlds = (self.xp.as_tensor(np.array(a), **self._on) for a in (keys, worlds))
        self._key[mask] = keys[mask]
        self._world[mask] = worlds[mask]
        self._episode[mask] = -1

    def _uniform(self, size: int, mask: Numbers, each: int = 1) -> Numbers:
        """(worlds, each * size) in (0, 1), by the 23 upper bits."""
        if not isinstance(size, (int, np.integer)) or size < 1:
            raise Error(f"{type(self).__name__}: size is {size!r}: give how many numbers a world draws, and reshape them")
        if self._draw > 255:
            raise Error(f"{type(self).__name__} draws more than 256 times in one method: draw more numbers at once")
        size = each * size
        blocks = -(-size // 4)
        if blocks > 1 << 16:
            raise Error(f"{type(self).__name__} draws {size} numbers a world at once: draw 262,144 or fewer, several times")
        what = (self._hook << 24 | self._draw << 16) + self.xp.arange(blocks, **self._on)
        self._draw += 1
        rows = (self._key, self._world, self._episode, self.age)
        key, *counter = ((a if mask is None else a[mask])[:, None] for a in rows)
        words = self.xp.stack(philox(key, (*counter, what[None])), -1).reshape(-1, 4 * blocks)[:, :size]
        return self._floats((words >> 9)) * 2.0**-23 + 2.0**-24


def expect_task(task: Any, where: str) -> Any:
    """The task. Error where it is something else."""
    if isinstance(task, type) and issubclass(task, Task):
        raise Error(f"{where} takes a task, not its class: give {task.__name__}(worlds=64)")
    if not isinstance(task, Task):
        raise Error(f"{where} takes a gsp.Task, not {type(task).__name__}")
    return task
