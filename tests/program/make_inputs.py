"""Input files for the tests of the program, good and bad, with the standard library alone: make_inputs.py FOLDER"""
import io
import math
import os
import struct
import sys
import zipfile

folder = sys.argv[1]


def npy(shape, values, code="d"):
    descr = {"d": "<f8", "f": "<f4"}[code]
    header = "{'descr': '%s', 'fortran_order': False, 'shape': (%s), }" % (descr, "".join("%d," % n for n in shape))
    header += " " * (63 - (10 + len(header)) % 64) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + struct.pack("<%d%s" % (len(values), code), *values)


def write(name, data):
    with open(os.path.join(folder, name), "wb") as file:
        file.write(data if isinstance(data, bytes) else data.encode())


def npz(name, **arrays):
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w") as archive:
        for key, data in arrays.items():
            archive.writestr(key + ".npy", data)
    write(name, memory.getvalue())


model = """<mujoco model="cart">
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    <body name="cart" pos="0 0 0.3">
      <joint name="slide" type="slide" axis="1 0 0"/>
      <geom name="box" type="box" size=".2 .1 .1" rgba=".8 .2 .2 1"/>
      <body name="pole" pos="0 0 0.1">
        <joint name="hinge" type="hinge" axis="0 1 0" damping=".01"/>
        <geom type="capsule" fromto="0 0 0 0 0 .5" size=".02" contype="0" conaffinity="0"/>
      </body>
    </body>
    <body name="ball" pos="1 0 0.5">
      <freejoint name="ball"/>
      <geom type="sphere" size=".1" rgba=".2 .3 .8 1"/>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="slide"/></actuator>
  <keyframe><key name="tilted" qpos="0.1 0.2 1 0 0.5 1 0 0 0"/></keyframe>
</mujoco>
"""
write("cart.xml", model)
# cameras of the model: one that looks along y from (0, -3, .5), and one on the cart that does so from (0, -3, .2) of it
mount = '<camera name="%s" pos="0 -3 %s" xyaxes="1 0 0 0 0 1" fovy="60"/>'
write("eye.xml", model.replace("<worldbody>", "<worldbody>" + mount % ("side", ".5"), 1).replace('<body name="cart" pos="0 0 0.3">', '<body name="cart" pos="0 0 0.3">' + mount % ("on", ".2"), 1))
write("far_key.xml", model.replace('qpos="0.1 0.2', 'qpos="0.1 2e22'))
write("broken.xml", model.replace('<body name="pole" pos="0 0 0.1">', '<body name="pole" pos="0 0 0.1"'))
write("element.xml", model.replace("<freejoint", "<freejiont"))
write("attribute.xml", model.replace('damping=".01"', 'dampnig=".01"'))
write("value.xml", model.replace('size=".02"', 'size="thin"'))
write("nan.xml", model.replace('size=".02"', 'size="nan"'))
write("mesh.xml", model.replace('<geom type="sphere" size=".1" rgba=".2 .3 .8 1"/>', '<geom type="mesh" mesh="ball"/>').replace("<worldbody>", '<asset><mesh name="ball" file="ball.stl"/></asset><worldbody>', 1))
write("string.xml", model.replace('<freejoint name="ball"/>', '<freejoint name="ball"/><site name="end"/>').replace("</worldbody>", '<site name="hook" pos="1 0 1"/></worldbody><tendon><spatial name="string" limited="true" range="0 1"><site site="hook"/><site site="end"/></spatial></tendon>'))
write("winch.xml", model.replace('<freejoint name="ball"/>', '<freejoint name="ball"/><site name="end"/>').replace('<geom type="sphere" size=".1"', '<geom name="drum" type="sphere" size=".1"').replace("</worldbody>", '<site name="hook" pos="1 0 1"/></worldbody><tendon><spatial name="winch"><site site="hook"/><geom geom="drum"/><site site="end"/></spatial></tendon><actuator><motor tendon="winch" armature=".1"/></actuator>'))
write("condim.xml", model.replace('<geom type="sphere" size=".1"', '<geom type="sphere" condim="6" size=".1"'))
write("massless.xml", model.replace('<geom type="sphere" size=".1" rgba=".2 .3 .8 1"/>', ""))
write("friction.xml", model.replace('size=".02"', 'size=".02" friction="-1"'))
write("row.xml", '<mujoco>\n<asset>\n<hfield name="strip" nrow="1" ncol="4" size="1 1 .1 .1"/>\n</asset><worldbody><geom type="hfield" hfield="strip"/></worldbody></mujoco>')
write("recursive.xml", '<mujoco><include file="recursive.xml"/></mujoco>')
write("empty.xml", "")
write("deep.xml", "<mujoco><worldbody>" + "<body>" * 100000)

# A gripper that falls along a rail: the second finger mimics the first, of the blade's two objects the second is not taken
robot = """<robot name="lift">
  <link name="rail"><inertial><mass value="3"/><inertia ixx=".2" ixy="0" ixz="0" iyy=".2" iyz="0" izz=".2"/></inertial></link>
  <link name="carriage">
    <inertial><mass value="2"/><inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial>
    <visual><geometry><mesh filename="blade.obj"/></geometry></visual>
    <collision><geometry><sphere radius=".05"/></geometry></collision>
  </link>
  <link name="left"><inertial><origin xyz="0 0 -.1"/><mass value=".5"/><inertia ixx=".01" ixy="0" ixz="0" iyy=".01" iyz="0" izz=".01"/></inertial></link>
  <link name="right"><inertial><origin xyz="0 0 -.1"/><mass value=".5"/><inertia ixx=".01" ixy="0" ixz="0" iyy=".01" iyz="0" izz=".01"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="carriage"/><axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="0" velocity="1"/></joint>
  <joint name="open" type="revolute"><parent link="carriage"/><child link="left"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="5" velocity="1"/></joint>
  <joint name="close" type="continuous"><parent link="carriage"/><child link="right"/><axis xyz="0 1 0"/><mimic joint="open" multiplier="-1"/></joint>
</robot>
"""
write("lift.urdf", robot)
write("blade.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\ng handle\nf 1 2 3\n")
write("lift_attribute.urdf", robot.replace('<axis xyz="0 0 1"/>', '<axis xzy="0 0 1"/>'))
write("lift_massless.urdf", robot.replace('<mass value="2"/>', '<mass value="0"/>'))
write("lift_mesh.urdf", robot.replace("blade.obj", "package://nowhere/blade.obj"))
write("lift_loop.urdf", robot.replace('<parent link="rail"/>', '<parent link="left"/>'))

# Gaussians: a 3DGS PLY, and what goes wrong with it
names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
count = 400


def header(n, extra=()):
    return ("ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % n + "".join("property float %s\n" % p for p in names) + "".join(extra) + "end_header\n").encode()


def rows(bad=None):
    data = b""
    for i in range(count):
        a = 2.399963 * i
        r = 0.05 * math.sqrt(i)
        row = [r * math.cos(a), r * math.sin(a), 0, 0.5, -0.5, 0.2, 4, -3, -3, -6, 1, 0, 0, 0]
        if i == 7 and bad is not None:
            row[0] = bad
        data += struct.pack("<14f", *row)
    return data


write("disc.ply", header(count) + rows())
write("cut.ply", (header(count) + rows())[:-100])
write("nan.ply", header(count) + rows(float("nan")))
write("absurd.ply", header(4000000000) + rows())
write("text.ply", "this is not a PLY file at all\n")
write("link.ply.links.json", '{"links": [{"name": "wheel", "first": 0, "count": 10}]}')
write("link.ply", header(count) + rows())
write("cut.spz", b"\x1f\x8b\x08\x00\x00\x00")

# Cameras: two that look at the origin from 3 m, x right, y down, z forward
view = [1, 0, 0, 0, 0, 0, -1, 0.5, 0, 1, 0, 3, 0, 0, 0, 1]
eye = [60, 0, 32, 0, 60, 24, 0, 0, 1]
npz("cameras.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2))
npz("cameras_plain.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2), distortion=npy((4,), [0] * 4))
npz("cameras_lens.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2), distortion=npy((2, 5), [0] * 5 + [-0.3, 0.1, 0, 0, 0]))
npz("cameras_fisheye.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2), fisheye=npy((4,), [0] * 4))
npz("cameras_two_lenses.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2), fisheye=npy((4,), [0] * 4), distortion=npy((4,), [0] * 4))
npz("cameras_prism.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2), distortion=npy((12,), [0] * 12))
npz("cameras_folds.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2), distortion=npy((4,), [-100, 0, 0, 0]))
npz("cameras_few_lenses.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2), distortion=npy((3, 4), [0] * 12))
npz("cameras_one_lens.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2), distortion=npy((1, 5), [-0.3, 0.1, 0, 0, 0]))
npz("cameras_row_lens.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2), distortion=npy((5,), [-0.3, 0.1, 0, 0, 0]))
npz("cameras_misnamed.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2), dist=npy((5,), [-0.3, 0.1, 0, 0, 0]))
npz("cameras_fisheye5.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((2, 3, 3), eye * 2), fisheye=npy((1, 5), [0] * 5))
npz("camera.npz", viewmats=npy((1, 4, 4), view, "f"), Ks=npy((1, 3, 3), eye, "f"))
astray = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -90, 0, 0, 0, 1]  # beyond the disc, and away from it
npz("cameras_astray.npz", viewmats=npy((2, 4, 4), view + astray), Ks=npy((3, 3), eye))
wide = [200, 0, 320, 0, 200, 240, 0, 0, 1]  # 640 x 480
npz("cameras_steep.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((3, 3), wide), distortion=npy((2, 4), [-0.05, 0, 0, 0, -0.3, 0.08, 0, 0]))
npz("cameras_mild.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((3, 3), wide), distortion=npy((4,), [-0.05, 0.008, 0, 0]))
moved = [v for t in range(11) for w in range(2) for v in (0.03 * t, 0.3 + 0.05 * t, 1, 0, 0.5 - 0.02 * t, 1, 0, 0, 0)]  # the cart goes along x
npz("moved.npz", time=npy((11,), [0.02 * t for t in range(11)]), qpos=npy((11, 2, 9), moved), qvel=npy((11, 2, 8), [0] * 176))
f60 = 24 / math.tan(math.radians(30))  # 64 x 48
npz("side_camera.npz", viewmats=npy((1, 4, 4), [1, 0, 0, 0, 0, 0, -1, 0.5, 0, 1, 0, 3, 0, 0, 0, 1]), Ks=npy((1, 3, 3), [f60, 0, 32, 0, f60, 24, 0, 0, 1]))
npz("cameras_shape.npz", viewmats=npy((2, 3, 4), [0] * 24), Ks=npy((2, 3, 3), eye * 2))
npz("cameras_count.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((3, 3, 3), eye * 3))
npz("cameras_one_K.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((1, 3, 3), eye))
npz("cameras_flat_K.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((3, 3), eye))
npz("cameras_numbers_K.npz", viewmats=npy((2, 4, 4), view * 2), Ks=npy((9,), eye))
npz("away.npz", viewmats=npy((1, 4, 4), [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -90, 0, 0, 0, 1]), Ks=npy((1, 3, 3), eye))
npz("cameras_nan.npz", viewmats=npy((1, 4, 4), [float("nan")] * 16), Ks=npy((1, 3, 3), eye))
npz("cameras_mirror.npz", viewmats=npy((1, 4, 4), [-v for v in view[:4]] + view[4:]), Ks=npy((1, 3, 3), eye))
npz("cameras_missing.npz", Ks=npy((1, 3, 3), eye))
with open(os.path.join(folder, "cameras.npz"), "rb") as file:
    write("cameras_cut.npz", file.read()[:200])

# Starts and controls of cart.xml: nq 9, nv 8, nu 1
q = [0, 0.3, 1, 0, 0.5, 1, 0, 0, 0]
npz("start.npz", time=npy((1,), [0]), qpos=npy((1, 1, 9), q), qvel=npy((1, 1, 8), [0] * 8))
npz("start3.npz", time=npy((1,), [0]), qpos=npy((1, 3, 9), q * 3), qvel=npy((1, 3, 8), [0] * 24))
npz("start_flies.npz", time=npy((1,), [0]), qpos=npy((1, 2, 9), q + q[:4] + [9.99e9] + q[5:]), qvel=npy((1, 2, 8), [0] * 12 + [9e9] + [0] * 3))  # beyond 1e10 in a step
npz("start_shape.npz", time=npy((1,), [0]), qpos=npy((1, 1, 8), q[:8]), qvel=npy((1, 1, 8), [0] * 8))
npz("start_nan.npz", time=npy((1,), [0]), qpos=npy((1, 1, 9), [float("nan")] * 9), qvel=npy((1, 1, 8), [0] * 8))
npz("start_far.npz", time=npy((1,), [0]), qpos=npy((1, 1, 9), [0, 1e300] + q[2:]), qvel=npy((1, 1, 8), [0] * 8))
npz("start_quat.npz", time=npy((1,), [0]), qpos=npy((1, 1, 9), q[:6] + [1e30] + q[7:]), qvel=npy((1, 1, 8), [0] * 8))
npz("start_act.npz", time=npy((1,), [0]), qpos=npy((1, 1, 9), q), qvel=npy((1, 1, 8), [0] * 8), act=npy((1, 1, 2), [0, 0]))
write("ctrl.npy", npy((50, 1), [0.5] * 50))
write("ctrl_worlds.npy", npy((50, 2, 1), [0.5, -0.5] * 50))
write("ctrl_far.npy", npy((50, 1), [0.5] * 7 + [1e11] + [0.5] * 42))
write("ctrl_nan.npy", npy((50, 1), [0.5] * 7 + [float("nan")] + [0.5] * 42))
write("ctrl_worlds_nan.npy", npy((50, 2, 1), [0.5, -0.5] * 7 + [0.5, float("inf")] + [0.5, -0.5] * 42))
write("ctrl_shape.npy", npy((50, 2), [0.5] * 100))
