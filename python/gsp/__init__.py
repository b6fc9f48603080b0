"""Gaussian splats and physics: many worlds of real robots, with pictures, on the CPU and the GPU.

    import gsp
    model = gsp.Model.from_xml("robot.xml")
    data = gsp.Data(model, worlds=1024)
    data.ctrl[:] = 0.1                      # the very memory that the kernels read
    gsp.step(model, data, n=4)
    print(data.qpos.numpy()[0], data.xpos[0, 1])
"""

import atexit as _atexit

from ._gsp import (
    Array,
    Contacts,
    Data,
    Error,
    Frames,
    Model,
    Renderer,
    ReportLine,
    Scene,
    StepCounts,
    forward,
    reset,
    status_text,
    step,
    world_fields,
)
from ._gsp import _end

__version__ = "0.1.0"
__all__ = [
    "Array",
    "Contacts",
    "Data",
    "Error",
    "Frames",
    "Model",
    "Renderer",
    "ReportLine",
    "Scene",
    "StepCounts",
    "Task",
    "forward",
    "look_at",
    "pinhole",
    "reset",
    "status_text",
    "step",
    "world_fields",
]

_atexit.register(_end)
Error.__doc__ = "What is wrong with what you gave, where, and what to do about it. A ValueError."


def __getattr__(name):
    if name == "Task":  # brings NumPy, which `import gsp` does without
        from .task import Task

        return Task
    raise AttributeError(f"module 'gsp' has no attribute '{name}'")


def look_at(eye, target, up=(0.0, 0.0, 1.0)):
    """World to camera, (..., 4, 4) float32, of a camera at `eye` that looks at `target`: x right, y down, z ahead."""
    import numpy as np

    eye, target, up = (np.asarray(v, dtype=float) for v in (eye, target, up))
    eye, target, up = np.broadcast_arrays(eye, target, up)
    ahead = target - eye
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


def pinhole(width, height, fovy):
    """(3, 3) float32 intrinsics [pixel] of a camera that sees `fovy` degrees from top to bottom."""
    import numpy as np

    if not 0 < fovy < 180:
        raise Error(f"gsp.pinhole: fovy must be between 0 and 180 degrees and is {fovy}")
    f = 0.5 * height / np.tan(np.radians(0.5 * fovy))
    return np.array([[f, 0, 0.5 * width], [0, f, 0.5 * height], [0, 0, 1]], dtype=np.float32)
