"""Worlds that differ: a cart-pole of other masses and damping in each, and what that makes of one and the same push.

    python examples/python/randomise.py --worlds 1024
"""

import argparse

import numpy as np

import gsp
from gsp.tasks import MODELS

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--worlds", type=int, default=1024)
arguments = parser.parse_args()

model = gsp.Model.from_xml(MODELS / "cartpole.xml")
fields = ["body_mass", "body_inertia", "dof_damping"]
data = gsp.Data(model, worlds=arguments.worlds, per_world=fields)
random = np.random.default_rng(0)

mass = data.values("body_mass").numpy().copy()  # (worlds, bodies, 1)
scale = random.uniform(0.5, 2.0, size=mass.shape)
data.set("body_mass", mass * scale, scale_inertia=True)  # inertias follow
damping = data.values("dof_damping").numpy()
data.set("dof_damping", damping + random.uniform(0, 0.1, size=damping.shape))

data.ctrl = np.ones(model.nu)
gsp.step(model, data, n=int(0.2 / model.timestep))
cart = data.qpos[:, 0]
heavy = scale[:, 1:, 0].sum(axis=1) > np.median(scale[:, 1:, 0].sum(axis=1))
print(f"after 0.2 s of one push the carts stand at {cart.min():.4f} to {cart.max():.4f} m")
print(f"the heavier half at {cart[heavy].mean():.4f} m in the mean, the lighter at {cart[~heavy].mean():.4f} m")

# Of one world all again: the same bits as in the batch.
one = gsp.Data(model, per_world=fields)
for field in fields:
    one.set(field, data.values(field).numpy()[7:8])
one.ctrl = np.ones(model.nu)
gsp.step(model, one, n=int(0.2 / model.timestep))
print(f"world 7 alone: {'the same bits' if one.qpos[0].tobytes() == data.qpos[7].tobytes() else 'OTHER BITS'}")
