"""Line charts as SVG and Gaussians on surfaces as PLY, for scripts/stability and scripts/coverage."""
import math

import numpy as np

INK = {"gsp": "#2b7de9", "MuJoCo": "#e8710a", "MotrixSim": "#1f9d55", "warm": "#2b7de9", "cold": "#c0399f",
       "Mid-40": "#2b7de9", "Mid-70": "#c0399f", "Mid-360": "#1f9d55", "VLP-32C": "#e8710a"}
GREY = "#7d8590"  # text and axes: readable on white and on black


def ticks(lo, hi, log):
    if log:
        return [10.0 ** k for k in range(math.floor(math.log10(lo) + 1e-9), math.ceil(math.log10(hi) - 1e-9) + 1)]
    step = 10 ** math.floor(math.log10((hi - lo) / 4))
    step *= next(k for k in (1, 2, 5, 10) if (hi - lo) / (step * k) <= 5)
    return [step * k for k in range(math.ceil(lo / step - 1e-9), math.floor(hi / step + 1e-9) + 1)]


def text_of(value):
    return "0" if abs(value) < 1e-12 else f"{value:.6g}" if 1e-3 <= abs(value) < 1e5 else f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")


def chart(path, panels):
    """Panels side by side: (title, label of y, {name: (x, y)}, options log, low, high). What lies beyond high is cut off there."""
    wide, tall, left, top = 400, 250, 58, 42
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide * len(panels)} {tall}" width="{wide * len(panels)}" '
           f'font-family="sans-serif" font-size="11" fill="{GREY}">']
    for k, (title, label, curves, options) in enumerate(panels):
        log = options.get("log", False)
        x0, x1, y0, y1 = wide * k + left, wide * (k + 1) - 14, tall - 36, top
        ends = [max(x[-1] for x, _ in curves.values()), [np.min(y) for _, y in curves.values()], [np.max(y) for _, y in curves.values()]]
        right, low, high = ends[0], options.get("low", min(ends[1])), options.get("high", max(ends[2]))
        marks = ticks(low, high, log)
        low, high = (marks[0], marks[-1]) if log else (min(low, marks[0]), max(high, marks[-1]))
        scale = math.log10 if log else float
        px = lambda x: x0 + (x1 - x0) * x / right
        py = lambda y: y0 + (y1 - y0) * (scale(min(max(y, low), high)) - scale(low)) / (scale(high) - scale(low))
        out.append(f'<text x="{x0}" y="14" font-weight="bold">{title}</text>')
        for mark in marks:
            out.append(f'<path d="M{x0} {py(mark):.1f}H{x1}" stroke="{GREY}" stroke-opacity=".3"/>'
                       f'<text x="{x0 - 5}" y="{py(mark) + 4:.1f}" text-anchor="end">{text_of(mark)}</text>')
        for mark in ticks(0, right, False):
            out.append(f'<path d="M{px(mark):.1f} {y0}v4" stroke="{GREY}"/><text x="{px(mark):.1f}" y="{y0 + 16}" text-anchor="middle">{text_of(mark)}</text>')
        out.append(f'<path d="M{x0} {y1}V{y0}H{x1}" fill="none" stroke="{GREY}"/>'
                   f'<text x="{(x0 + x1) / 2}" y="{tall - 5}" text-anchor="middle">time [s]</text>'
                   f'<text transform="translate({x0 - 46} {(y0 + y1) / 2}) rotate(-90)" text-anchor="middle">{label}</text>')
        for i, (name, (x, y)) in enumerate(curves.items()):
            thin = max(1, len(x) // 400)
            points = " ".join(f"{px(a):.1f},{py(b):.1f}" for a, b in zip(x[::thin], y[::thin]))
            out.append(f'<polyline points="{points}" fill="none" stroke="{INK[name]}" stroke-width="1.5"/>'
                       f'<path d="M{x0 + 84 * i} 28h16" stroke="{INK[name]}" stroke-width="3"/><text x="{x0 + 84 * i + 20}" y="32">{name}</text>')
    path.write_text("\n".join(out + ["</svg>\n"]))


def box_triangles(size):
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return np.array([[corner[i] for i in t] for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])


def triangles(m, g, floor):
    """Of a geom of MuJoCo's model, in its frame; None for those that gsp samples itself."""
    kind = m.geom_type[g]
    if kind == 0:  # a plane, as a patch
        a, b, c, d = [np.array([x, y, 0.0]) for x, y in ((-floor, -floor), (floor, -floor), (floor, floor), (-floor, floor))]
        return np.array([[a, b, c], [a, c, d]])
    if kind == 6:
        return box_triangles(m.geom_size[g])
    if kind != 7:
        return None
    k = m.geom_dataid[g]
    vertices = m.mesh_vert[m.mesh_vertadr[k]:][:m.mesh_vertnum[k]]
    return vertices[m.mesh_face[m.mesh_faceadr[k]:][:m.mesh_facenum[k]]].astype(float)


def write_splats(path, m, d, moving, floor, spacing):
    """PLY of discs on planes, boxes and meshes: of the world alone, or of `moving` geoms too, bound to their bodies (docs/io/ply.md).
    `spacing(geom)`: metres between two of them. Light from above and the front, at the poses of d."""
    rows, names = [], [m.body(b).name for b in range(m.nbody)]
    for g in range(m.ngeom):
        body = m.geom_bodyid[g]
        t = triangles(m, g, floor) if (body == 0 or moving) and m.geom_group[g] < 3 else None
        if t is None:
            continue
        cross = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        area = np.linalg.norm(cross, axis=1) / 2
        gap = spacing(g)
        n = max(40, int(area.sum() / gap**2))
        which = np.searchsorted(np.cumsum(area) / area.sum(), (np.arange(n) + 0.5) / n).clip(0, len(area) - 1)
        u, v = (np.mod(k * np.arange(1, n + 1), 1)[:, None] for k in (0.7548776662466927, 0.5698402909980532))  # evenly (R2 sequence)
        u = np.sqrt(u)
        p = (1 - u) * t[which, 0] + u * (1 - v) * t[which, 1] + u * v * t[which, 2]
        normal = cross[which] / np.maximum(2 * area[which, None], 1e-30)
        q = d.geom_xmat[g].reshape(3, 3)
        shade = 0.55 + 0.45 * np.maximum(0, (normal @ q.T) @ np.array([0.35, -0.45, 0.82]))
        rgba = m.mat_rgba[m.geom_matid[g]] if m.geom_matid[g] >= 0 else m.geom_rgba[g]
        colour = rgba[None, :3] * shade[:, None]
        if m.geom_type[g] == 0:  # squares, so that one sees the floor
            at = np.floor(p[:, :2] / (floor / 8)).sum(axis=1) % 2
            colour = (0.80 + 0.08 * at)[:, None] * np.array([0.93, 0.95, 1.0])
        to_body = d.xmat[body].reshape(3, 3).T
        p = (to_body @ ((q @ p.T).T + d.geom_xpos[g] - d.xpos[body]).T).T
        normal = (to_body @ (q @ normal.T)).T
        turn = np.column_stack([1 + normal[:, 2], -normal[:, 1], normal[:, 0], np.zeros(n)])  # z onto the normal
        turn[normal[:, 2] < -0.99999] = [0, 1, 0, 0]
        size = np.full((n, 2), math.log(0.8 * math.sqrt(area.sum() / n)))
        rows.append(np.column_stack([p, (colour - 0.5) / 0.28209479177387814, np.full(n, 4.0), size, np.full(n, math.log(1e-4)), turn,
                                     np.full(n, body - 1.0)]))
    data = np.vstack(rows)
    fields = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split()
    with open(path, "wb") as out:
        header = ["ply", "format binary_little_endian 1.0"] + [f"comment link {b - 1} {names[b]}" for b in range(1, m.nbody) if moving]
        header += [f"element vertex {len(data)}"] + [f"property float {f}" for f in fields]
        header += ["property int link"] if moving else []
        out.write(("\n".join(header + ["end_header"]) + "\n").encode())
        kind = [(f, "<f4") for f in fields] + ([("link", "<i4")] if moving else [])
        table = np.zeros(len(data), kind)
        for i, (f, _) in enumerate(kind):
            table[f] = data[:, i]
        out.write(table.tobytes())


def camera(path, eye, target, width, height, view):
    """cameras.npz of one camera; `view`: degrees from top to bottom."""
    z = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.array([x, np.cross(z, x), z])
    pose[:3, 3] = -pose[:3, :3] @ np.asarray(eye, float)
    f = height / 2 / math.tan(math.radians(view) / 2)
    np.savez(path, viewmats=pose[None], Ks=np.array([[[f, 0, width / 2], [0, f, height / 2], [0, 0, 1.0]]]))
