"""What the camera does to a rendered scene: light falloff, defocus, motion, exposure, noise,
JPEG."""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

Rng = np.random.Generator


def photograph(rgb: Tensor, rng: Rng) -> Tensor:
    """(3, H, W) scene to (3, H, W) picture 0 to 1; geometry does not move, so labels stay valid."""
    rgb = _falloff(rgb, rng)
    if rng.random() < 0.35:
        rgb = defocus(rgb, rng.uniform(0.3, 1.3))
    if rng.random() < 0.12:
        rgb = _motion(rgb, rng.uniform(-np.pi, np.pi), rng.uniform(1.0, 4.0))
    rgb = _expose(rgb, rng)
    if rng.random() < 0.7:
        rgb = _noise(rgb, rng)
    if rng.random() < 0.5:
        rgb = jpeg(rgb, float(rng.uniform(0.01, 0.09)))
    return rgb.clamp(0, 1)


def jpeg(rgb: Tensor, step: float) -> Tensor:
    """Quantizes 8 × 8 cosine blocks; ``step`` (share of full scale) grows with frequency, twice for
    color."""
    height, width = rgb.shape[1:]
    padded = F.pad(rgb[None], (0, -width % 8, 0, -height % 8), mode="replicate")[0]
    luma = padded.mean(0, keepdim=True)
    planes = torch.cat([luma, padded - luma])
    c, h, w = planes.shape
    blocks = planes.view(c, h // 8, 8, w // 8, 8).permute(0, 1, 3, 2, 4).reshape(c, -1, 64)
    basis = _cosines(rgb.device)
    transform = torch.kron(basis, basis)  # rows and columns in one product of matrices
    frequency = torch.arange(8, device=rgb.device)
    quantum = (step * (1 + 0.5 * (frequency[:, None] + frequency[None]))).view(64)
    quantum = quantum * torch.tensor([1.0, 2.0, 2.0, 2.0], device=rgb.device).view(4, 1, 1)
    restored = (torch.round(blocks @ transform.T / quantum) * quantum) @ transform
    planes = restored.view(c, h // 8, w // 8, 8, 8).permute(0, 1, 3, 2, 4).reshape(c, h, w)
    return (planes[1:] + planes[:1])[:, :height, :width]


def _cosines(device: torch.device) -> Tensor:
    k = torch.arange(8, device=device, dtype=torch.float32)
    basis = torch.cos((2 * k[None] + 1) * k[:, None] * torch.pi / 16) * 0.5
    basis[0] *= 0.5**0.5
    return basis


def _falloff(rgb: Tensor, rng: Rng) -> Tensor:
    """Vignetting and a lamp that lights one side more than the other."""
    h, w = rgb.shape[1:]
    x = torch.linspace(-1, 1, w, device=rgb.device)[None]
    y = torch.linspace(-1, 1, h, device=rgb.device)[:, None]
    tilt = rng.normal(0.0, 0.18, 2)
    field = 1 + tilt[0] * x + tilt[1] * y - rng.uniform(0.0, 0.25) * (x**2 + y**2)
    if rng.random() < 0.25:
        cx, cy = rng.uniform(-1, 1, 2)
        spread = rng.uniform(0.02, 0.3)
        field = field + rng.uniform(0.2, 1.2) * torch.exp(-((x - cx) ** 2 + (y - cy) ** 2) / spread)
    return rgb * field.clamp(min=0.1)


def defocus(rgb: Tensor, sigma: float) -> Tensor:
    """(3, H, W) blurred by a Gaussian of ``sigma`` px."""
    radius = min(int(np.ceil(2.5 * sigma)), min(rgb.shape[1:]) - 1)
    x = torch.arange(-radius, radius + 1, device=rgb.device, dtype=torch.float32)
    kernel = torch.exp(-0.5 * (x / sigma) ** 2)
    kernel = (kernel / kernel.sum()).expand(3, 1, 1, -1)
    image = F.pad(rgb[None], (radius, radius, radius, radius), mode="replicate")
    image = F.conv2d(image, kernel, groups=3)
    return F.conv2d(image, kernel.transpose(2, 3), groups=3)[0]


def _motion(rgb: Tensor, angle: float, length: float) -> Tensor:
    """Mean of five pictures moved by whole pixels along ``angle``, ``length`` px in all."""
    h, w = rgb.shape[1:]
    room = int(np.ceil(length)) + 1
    padded = F.pad(rgb[None], (room,) * 4, mode="replicate")[0]
    moved = torch.zeros_like(rgb)
    for t in np.linspace(-0.5, 0.5, 5):
        x, y = room + round(t * length * np.cos(angle)), room + round(t * length * np.sin(angle))
        moved += padded[:, y : y + h, x : x + w]
    return moved / 5


def _expose(rgb: Tensor, rng: Rng) -> Tensor:
    gain = float(np.exp(rng.normal(0.0, 0.28)))
    if rng.random() < 0.08:
        gain *= float(rng.uniform(1.4, 2.2))  # over-exposed: bright cables and tables burn out
    tint = torch.as_tensor(np.exp(rng.normal(0.0, 0.06, 3)).astype(np.float32), device=rgb.device)
    gamma = float(np.exp(rng.normal(0.0, 0.2)))
    rgb = (rgb * gain * tint[:, None, None]).clamp(1e-4, 1) ** gamma
    gray = rgb.mean(0, keepdim=True)
    return gray + (rgb - gray) * float(rng.uniform(0.6, 1.3))


def _noise(rgb: Tensor, rng: Rng) -> Tensor:
    sigma = rng.uniform(0.0, 0.04)
    noise = torch.as_tensor(rng.standard_normal(rgb.shape, dtype=np.float32), device=rgb.device)
    return rgb + sigma * noise * (0.5 + rgb.clamp(0, 1))
