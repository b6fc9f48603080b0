"""Pictures of a robot in a furnished room: one of each world, by cameras in a circle around it, beside each other.

    python examples/python/pictures.py --out out
    python examples/python/pictures.py --model robot.xml --splats room.ply
"""

import argparse
import pathlib

import numpy as np

import gsp
from gsp.tasks import MODELS

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--model", default=MODELS / "quadruped.xml", help="MJCF")
parser.add_argument("--splats", help="a room of Gaussians, PLY or SPZ; without it one that the library makes")
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
scene = scene.add_splats(arguments.splats) if arguments.splats else scene.add_room()
scene.add_surface()  # Gaussians on the robot's geoms, which move with its links

width, height = 320, 240
angle = np.linspace(0, 2 * np.pi, data.worlds, endpoint=False)
eye = np.stack([1.4 * np.cos(angle), 1.4 * np.sin(angle), np.full_like(angle, 0.8)], axis=1)
viewmats = gsp.look_at(eye, [0.0, 0.0, 0.25])
Ks = np.broadcast_to(gsp.pinhole(width, height, fovy=55), (data.worlds, 3, 3))

frames = gsp.Renderer(scene, width, height, device=arguments.device).render(data, viewmats, Ks)  # camera c sees world c
rgb, depth = frames.rgb.copy(), frames.depth.copy()
folder = pathlib.Path(arguments.out)
folder.mkdir(parents=True, exist_ok=True)
gsp.write_png(folder / "pictures.png", np.concatenate(rgb, axis=1))
print(f"{folder / 'pictures.png'}: {data.worlds} worlds, nearest {depth[depth > 0].min():.2f} m, mean brightness {rgb.mean():.2f}")
