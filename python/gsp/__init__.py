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


def _of_setting(owner: str, plain: Any) -> Any:
    def __setattr__(self: Any, name: str, value: Any) -> None:
        try:
            plain(self, name, value)
        except AttributeError:
            from ._mujoco_names import missing, not_assigned

            there = getattr(type(self), name, None)
            if getattr(there, "fset", None) is not None:  # what is assigned has raised it
                raise
            raise AttributeError(missing(owner, name) if there is None else not_assigned(owner, name)) from None

    return __setattr__


for _class in (Data, Model):
    setattr(_class, "__getattr__", _of_missing(_class.__name__))
    setattr(_class, "__setattr__", _of_setting(_class.__name__, _class.__setattr__))


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
    """(H, W, 3) uint8 of a depth picture (H, W) [m]: near red, far blue, black where nothing is. near, far: of the colours; without
    them, of the picture."""
    import numpy as np

    depth = np.ascontiguousarray(depth, dtype=np.float32)
    if depth.ndim != 2 or depth.size == 0:
        raise Error(f"gsp.depth_to_rgb: the depth has shape {depth.shape} and must have (height, width): give one picture")
    ends = np.array([near, far], dtype=np.float32)  # as they are used
    if not (near == far == 0 or 0 <= ends[0] < ends[1] < np.inf):
        raise Error(f"gsp.depth_to_rgb: near is {near} and far {far}: give 0 <= near < far in metres, or neither, for the picture's own")
    height, width = depth.shape
    return np.frombuffer(_depth_to_rgb(depth.tobytes(), width, height, near, far), dtype=np.uint8).reshape(height, width, 3)


def write_png(path: str | os.PathLike[str], image: ArrayLike) -> None:
    """Writes a picture, (H, W), (H, W, 1), (H, W, 3) or (H, W, 4): numbers of 0 to 1, what lies outside clipped, NaN black; or uint8.
    All or nothing."""
    import os

    import numpy as np

    if not os.fsdecode(path).lower().endswith(".png"):
        raise Error(f"gsp.write_png: {os.fsdecode(path)!r} does not end in .png, and PNG is what is written: name it so")
    image = np.asarray(image)
    if image.ndim == 2:
        image = image[..., None]
    if image.ndim != 3 or image.shape[2] not in (1, 3, 4) or image.size == 0:
        raise Error(f"gsp.write_png: the picture has shape {image.shape} and must have (height, width) or (height, width, 1, 3 or 4)")
    if image.dtype.kind not in "fb" and image.dtype != np.uint8:
        raise Error(f"gsp.write_png: the picture holds {image.dtype} and must hold real numbers of 0 to 1, or uint8 of 0 to 255")
    if image.dtype != np.uint8:
        image = image.astype(np.float32)
    _write_png(os.fsdecode(path), np.ascontiguousarray(image).tobytes(), image.shape[1], image.shape[0], image.shape[2])
