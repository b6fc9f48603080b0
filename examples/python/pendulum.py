"""A pendulum of one's own: the periods of 64 amplitudes at once, beside the closed form.

    python examples/python/pendulum.py
"""

import numpy as np

import gsp

model = gsp.Model.from_string("""
<mujoco>
  <option timestep="0.001"/>
  <worldbody>
    <body>
      <joint name="pivot" axis="0 1 0"/>
      <geom type="sphere" size="0.01" pos="0 0 -1" mass="1"/>
    </body>
  </worldbody>
</mujoco>""")

data = gsp.Data(model, worlds=64, profile="mujoco", precision="float64")
amplitude = np.linspace(0.05, 2.5, data.worlds)
data.qpos = amplitude[:, None]
angles = [data.qpos[:, 0].copy()]
for _ in range(4000):
    gsp.step(model, data)
    angles.append(data.qpos[:, 0].copy())
angle = np.array(angles)

# Half a period lies between two moments at which the angle crosses 0, found between the steps that it changes sign in.
crosses = (angle[:-1] > 0) != (angle[1:] > 0)
periods = []
for w in range(data.worlds):
    k = np.flatnonzero(crosses[:, w])[:2]
    at = k + angle[k, w] / (angle[k, w] - angle[k + 1, w])
    periods.append(2 * model.timestep * (at[1] - at[0]))

# T = 4 sqrt(I / (m g l)) K(sin(a / 2)), K by the mean of arithmetic and geometric means; I: the sphere about the pivot.
inertia = 1 + 0.4 * 0.01**2
mean, other = np.ones_like(amplitude), np.cos(amplitude / 2)
for _ in range(6):
    mean, other = (mean + other) / 2, np.sqrt(mean * other)
exact = 2 * np.pi * np.sqrt(inertia / 9.81) / mean
print(f"periods of {data.worlds} amplitudes: {min(periods):.4f} to {max(periods):.4f} s")
print(f"farthest from the closed form: {np.max(np.abs(np.array(periods) / exact - 1)):.1e}")
