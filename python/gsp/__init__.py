"""Gaussian splats and physics: many worlds of real robots, with pictures, on the CPU and the GPU.

    import gsp
    model = gsp.Model.from_xml("robot.xml")
    data = gsp.Data(model, worlds=1024)
    data.ctrl[:] = 0.1                      # the very memory that the kernels read
    gsp.step(model, data, n=4)
    print(data.qpos.numpy()[0], data.xpos[0, 1])
"""

from __future__ import annotations

import atexit as _atexit
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import os

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from .task import Task as Task

from . import _library
from ._gsp import (
    Array,
    Contacts,
    Data,
    Error,
    FixedRenderer,
    Frames,
    Model,
    Renderer,
    ReportLine,
    Scene,
    StepCounts,
    forward,
    let_stream_wait,
    reset,
    status_text,
    step,
    wait_for_stream,
    world_fields,
)
from ._gsp import _depth_to_rgb, _end, _write_png  # type: ignore[attr-defined]

__version__ = "0.1.0"
__all__ = [
    "Array",
    "Contacts",
    "Data",
    "Error",
    "FixedRenderer",
    "Frames",
    "Model",
    "Renderer",
    "ReportLine",
    "Scene",
    "StepCounts",
    "Task",
    "depth_to_rgb",
    "forward",
    "let_stream_wait",
    "look_at",
    "pinhole",
    "reset",
    "status_text",
    "step",
    "wait_for_stream",
    "world_fields",
    "write_png",
]

_atexit.register(_end)
Error.__doc__ = "What is wrong with what you gave, where, and what to do about it. A ValueError."


def __getattr__(name: str) -> Any:
    if name == "Task":  # brings NumPy, which `import gsp` does without
        from .task import Task

        return Task
    from ._mujoco_names import missing

    raise AttributeError(missing("", name))


def _of_missing(owner: str) -> Any:
    def __getattr__(self: Any, name: str) -> Any:  # costs attributes that there are 10 ns
        from ._mujoco_names import missing

        raise AttributeError(missing(owner, name))

    return __getattr__


for _class in (Data, Model):
    setattr(_class, "__getattr__", _of_missing(_class.__name__))


def _expect_mounts(mounts: Any) -> None:
    """What the compiled function could not read of them, in a sentence."""
    where = "gsp.Data.cameras: "
    if isinstance(mounts, dict) or not hasattr(mounts, "__len__"):
        raise Error(where + "the mounts are a list: give [dict(body='world', pos=(0, -3, 1), quat=(1, 0, 0, 0), fovy=60)], or ['name']") from None
    for k, mount in enumerate(mounts):
        if not isinstance(mount, dict):
            continue
        for name, size in (("pos", 3), ("quat", 4), ("fovy", 0)):
            given = mount.get(name, (0.0,) * size if size else 1.0)
            try:
                numbers = [float(x) for x in given] if size else [float(given)]
            except (TypeError, ValueError):
                numbers = []
            if len(numbers) != (size or 1):
                remedy = {"pos": "3 numbers [m]", "quat": "4 numbers, w x y z", "fovy": "a number of degrees"}[name]
                raise Error(f"{where}{name} of mount {k} is {given!r}: give {remedy}") from None
        if not isinstance(mount.get("body", ""), str):
            raise Error(f"{where}body of mount {k} is {mount['body']!r}: give its name, 'world' for what does not move") from None


def _told_of_mounts(compiled: Any) -> Any:
    import functools

    @functools.wraps(compiled)
    def cameras(self: Any, mounts: Any, width: int = 640, height: int = 480) -> Any:
        try:
            return compiled(self, mounts, width, height)
        except TypeError:
            _expect_mounts(mounts)
            raise

    return cameras


setattr(Data, "cameras", _told_of_mounts(Data.cameras))


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> NDArray[np.float32]:
    """World to camera, (..., 4, 4) float32, of a camera at `eye` that looks at `target`: x right, y down, z ahead."""
    import numpy as np

    eye, target, up = (np.asarray(v, dtype=float) for v in (eye, target, up))
    eye, target, up = np.broadcast_arrays(eye, target, up)
    ahead = target - eye
    if not np.all(np.isfinite(eye) & np.isfinite(target) & np.isfinite(up)):
        raise Error("gsp.look_at: eye, target and up must be finite numbers")
    length = np.linalg.norm(ahead, axis=-1, keepdims=True)
    if not np.all(length > 0):
        raise Error("gsp.look_at: eye and target are one point: move one of them")
    ahead = ahead / length
    right = np.cross(ahead, up)
    width = np.linalg.norm(right, axis=-1, keepdims=True)
    if not np.all(width > 1e-9):
        raise Error("gsp.look_at: the camera looks along `up`: give another up")
    right = right / width
    down = np.cross(ahead, right)
    out = np.zeros(eye.shape[:-1] + (4, 4), dtype=np.float32)
    rotation = np.stack([right, down, ahead], axis=-2)
    out[..., :3, :3] = rotation
    out[..., :3, 3] = -np.einsum("...ij,...j->...i", rotation, eye)
    out[..., 3, 3] = 1
    return out


def pinhole(width: int, height: int, fovy: float) -> NDArray[np.float32]:
    """(3, 3) float32 intrinsics [pixel] of a camera that sees `fovy` degrees from top to bottom."""
    import numpy as np

    if not (width > 0 and height > 0):
        raise Error(f"gsp.pinhole: width and height must be positive and are {width} and {height}")
    if not 0 < fovy < 180:
        raise Error(f"gsp.pinhole: fovy must be between 0 and 180 degrees and is {fovy}")
    f = 0.5 * height / np.tan(np.radians(0.5 * fovy))
    return np.array([[f, 0, 0.5 * width], [0, f, 0.5 * height], [0, 0, 1]], dtype=np.float32)


def depth_to_rgb(depth: ArrayLike, near: float = 0.0, far: float = 0.0) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 of a depth picture (H, W) [m]: near red, far blue, black where nothing is. near, far: of the colours; equal: of the
    picture."""
    import numpy as np

    depth = np.ascontiguousarray(depth, dtype=np.float32)
    if depth.ndim != 2 or depth.size == 0:
        raise Error(f"gsp.depth_to_rgb: the depth has shape {depth.shape} and must have (height, width): give one picture")
    if not 0 <= near <= far < float("inf"):
        raise Error(f"gsp.depth_to_rgb: near is {near} and far {far}: give 0 <= near < far in metres, or neither, for the picture's own")
    height, width = depth.shape
    return np.frombuffer(_depth_to_rgb(depth.tobytes(), width, height, near, far), dtype=np.uint8).reshape(height, width, 3)


def write_png(path: str | os.PathLike[str], image: ArrayLike) -> None:
    """Writes a picture, (H, W), (H, W, 1), (H, W, 3) or (H, W, 4): numbers of 0 to 1, what lies outside clipped, NaN black; or uint8.
    All or nothing."""
    import os

    import numpy as np

    image = np.asarray(image)
    if image.ndim == 2:
        image = image[..., None]
    if image.ndim != 3 or image.shape[2] not in (1, 3, 4) or image.size == 0:
        raise Error(f"gsp.write_png: the picture has shape {image.shape} and must have (height, width) or (height, width, 1, 3 or 4)")
    if image.dtype.kind not in "fb" and image.dtype != np.uint8:
        raise Error(f"gsp.write_png: the picture holds {image.dtype} and must hold real numbers of 0 to 1, or uint8 of 0 to 255")
    if image.dtype != np.uint8:
        image = image.astype(np.float32)
    _write_png(os.fspath(path), np.ascontiguousarray(image).tobytes(), image.shape[1], image.shape[0], image.shape[2])
