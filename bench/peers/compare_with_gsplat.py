"""Draws what `gsp render` drew with gsplat 1.5.3 and compares the pictures; then times gsplat.

usage: compare_with_gsplat.py SCENE.ply CAMERAS.npz IMAGES.npz     (needs torch and gsplat; IMAGES from gsp render --npz, with rgb, depth and alpha)
Cameras with an array "fisheye" of zeros are gsplat's camera_model "fisheye", which has no coefficients.
Prints one JSON object: the mean and the quantiles of |RGB - gsplat's|, the same of alpha, and of the relative depth where alpha > 0.5.
"""
import json
import sys
import time

import numpy as np
import torch
from gsplat import rasterization


def load(path, device="cuda"):
    with open(path, "rb") as f:
        names, count = [], 0
        while (line := f.readline().split())[0] != b"end_header":
            if line[0] == b"element":
                count = int(line[2])
            if line[0] == b"property":
                names.append(line[2].decode())
        table = np.frombuffer(f.read(4 * count * len(names)), "<f4").reshape(count, len(names))
    column = {name: i for i, name in enumerate(names)}

    def take(*keys):
        return torch.tensor(table[:, [column[k] for k in keys]].copy(), device=device)

    rest = [n for n in names if n.startswith("f_rest_")]
    sh = take("f_dc_0", "f_dc_1", "f_dc_2")[:, None]
    if rest:
        sh = torch.cat([sh, take(*[f"f_rest_{i}" for i in range(len(rest))]).reshape(count, 3, -1).transpose(1, 2)], 1)
    return dict(
        means=take("x", "y", "z"),
        quats=take("rot_0", "rot_1", "rot_2", "rot_3"),
        scales=take("scale_0", "scale_1", "scale_2").exp(),
        opacities=torch.sigmoid(take("opacity")[:, 0]),
        colors=sh.contiguous(),
        sh_degree=round(sh.shape[1] ** 0.5) - 1,
    )


def summary(error):
    error = np.sort(error.ravel())
    at = lambda q: float(error[min(len(error) - 1, int(q * len(error)))])
    return {"mean": float(error.mean()), "p99": at(0.99), "p99.9": at(0.999), "max": float(error[-1])}


def main():
    scene, cameras, images = load(sys.argv[1]), np.load(sys.argv[2]), np.load(sys.argv[3])
    views, Ks = (torch.tensor(cameras[k], dtype=torch.float32, device="cuda") for k in ("viewmats", "Ks"))
    count, height, width = images["rgb"].shape[:3]
    model = "fisheye" if "fisheye" in cameras else "pinhole"
    if model == "fisheye" and np.any(cameras["fisheye"]) or "distortion" in cameras:
        sys.exit(f"{sys.argv[2]}: has lenses that gsplat's rasterization() without its unscented transform does not draw; leave out their coefficients")

    def draw(first, batch):
        return rasterization(viewmats=views[first : first + batch], Ks=Ks[first : first + batch], width=width, height=height,
                             render_mode="RGB+ED", packed=True, camera_model=model, **scene)

    errors = {"rgb": [], "alpha": [], "depth": []}
    with torch.no_grad():
        for c in range(count):
            picture, alpha, _ = draw(c, 1)
            picture, alpha = picture[0].double().cpu().numpy(), alpha[0, ..., 0].double().cpu().numpy()
            errors["rgb"].append(np.abs(images["rgb"][c] - picture[..., :3]))
            errors["alpha"].append(np.abs(images["alpha"][c] - alpha))
            solid = alpha > 0.5
            errors["depth"].append(np.abs(images["depth"][c] - picture[..., 3])[solid] / picture[..., 3][solid])
        frames = []
        for _ in range(6):
            torch.cuda.synchronize()
            start = time.perf_counter()
            draw(0, count)
            torch.cuda.synchronize()
            frames.append(count / (time.perf_counter() - start))
    result = {k: summary(np.concatenate([e.ravel() for e in v])) for k, v in errors.items()}
    print(json.dumps({"images": count, "camera_model": model, "width": width, "height": height, **result, "gsplat_frames_per_second": float(np.median(frames[1:]))}))


if __name__ == "__main__":
    main()
