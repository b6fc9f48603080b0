"""Pictures of a robot in a furnished room: one of each world, by cameras in a circle around it, beside each other.

    python examples/python/pictures.py --out out
    python examples/python/pictures.py --model robot.xml --splats room.ply --quat 0.7071 -0.7071 0 0

Captured rooms have y down as a rule, which this quaternion (w x y z) turns to z up; the example says where the room is then, and --pos and
--scale put its floor at z = 0, in metres.
"""

import argparse
import pathlib

import numpy as np

import gsp
from gsp.tasks import MODELS

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--model", default=MODELS / "quadruped.xml", help="MJCF")
parser.add_argument("--splats", help="a room of Gaussians, PLY or SPZ; without it one that the library makes")
parser.add_argument("--pos", type=float, nargs=3, default=(0, 0, 0), help="where the room's origin is put [m]")
parser.add_argument("--quat", type=float, nargs=4, default=(1, 0, 0, 0), help="how the room is turned: w x y z")
parser.add_argument("--scale", type=float, default=1, help="metres of one unit of the room")
parser.add_argument("--distance", type=float, default=1.4, help="of the cameras from the robot [m]")
parser.add_argument("--worlds", type=int, default=4)
parser.add_argument("--device", default="cpu")
parser.add_argument("--out", default="out", help="folder")
arguments = parser.parse_args()

model = gsp.Model.from_xml(arguments.model)
data = gsp.Data(model, worlds=arguments.worlds, device=arguments.device)
if model.nkey > 0:
    gsp.reset(model, data, keyframe=0)
data.ctrl = data.ctrl.copy() + np.random.default_rng(1).uniform(-0.3, 0.3, size=(data.worlds, model.nu))
gsp.step(model, data, n=int(0.5 / model.timestep))

scene = gsp.Scene(model)
if arguments.splats:
    scene.add_splats(arguments.splats, pos=arguments.pos, quat=arguments.quat, scale=arguments.scale)
else:
    scene.add_room()
print(scene)
scene.add_surface()  # Gaussians on the robot's geoms, which move with its links

width, height = 320, 240
angle = np.linspace(0, 2 * np.pi, data.worlds, endpoint=False)
eye = np.stack([arguments.distance * np.cos(angle), arguments.distance * np.sin(angle), np.full_like(angle, 0.8)], axis=1)
viewmats = gsp.look_at(eye, [0.0, 0.0, 0.25])
Ks = np.broadcast_to(gsp.pinhole(width, height, fovy=55), (data.worlds, 3, 3))

frames = gsp.Renderer(scene, width, height, device=arguments.device).render(data, viewmats, Ks)  # camera c sees world c
rgb, depth = frames.rgb.copy(), frames.depth.copy()
folder = pathlib.Path(arguments.out)
folder.mkdir(parents=True, exist_ok=True)
gsp.write_png(folder / "pictures.png", np.concatenate(rgb, axis=1))
print(f"{folder / 'pictures.png'}: {data.worlds} worlds, nearest {depth[depth > 0].min():.2f} m, mean brightness {rgb.mean():.2f}")
