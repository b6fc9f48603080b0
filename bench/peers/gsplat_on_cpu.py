#!/usr/bin/env python3
"""Seconds that gsplat's own CPU path takes for what of a picture it can do without CUDA: projection and the list of (Gaussian, tile) pairs
(gsplat.cuda._torch_impl). Its blending asks a CUDA kernel which Gaussians a pixel meets, so a picture takes longer than this.

usage: gsplat_on_cpu.py SCENE.ply CAMERAS.npz [WIDTH HEIGHT [THREADS]]   (a 3DGS PLY; the first camera; gsplat 1.5.3 and torch)
Beside it: OMP_NUM_THREADS=2 bench_splat_render --scene SCENE.ply --cameras CAMERAS.npz --images 64 --device cpu
"""
import sys
import time

import numpy as np
import torch
from compare_with_gsplat import load
from gsplat.cuda._torch_impl import _fully_fused_projection, _isect_tiles, _quat_scale_to_covar_preci

given = sys.argv[1:] + [None] * 5
width, height, threads = int(given[2] or 640), int(given[3] or 480), int(given[4] or 2)
torch.set_num_threads(threads)
scene = load(given[0], "cpu")
cameras = np.load(given[1])
view = torch.from_numpy(cameras["viewmats"][:1]).float()
K = torch.from_numpy(cameras["Ks"][:1]).float()

begin = time.perf_counter()
covars, _ = _quat_scale_to_covar_preci(torch.nn.functional.normalize(scene["quats"], dim=-1), scene["scales"], True, False)
radii, means2d, depths, _, _ = _fully_fused_projection(scene["means"], covars, view, K, width, height)
projected = time.perf_counter()
_, ids, _ = _isect_tiles(means2d, radii, depths, 16, (width + 15) // 16, (height + 15) // 16)
listed = time.perf_counter()
print(f"{len(covars)} Gaussians, {width} x {height}, {threads} threads: projection {projected - begin:.3f} s, {len(ids)} pairs {listed - projected:.2f} s")
