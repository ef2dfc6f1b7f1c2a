"""Random fields that repeat without a seam: the raw material of the procedural textures."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from scipy import fft

Image = UInt8[ndarray, "height width 3"]
Colour = tuple[int, int, int]


def fractal_noise(
    shape: tuple[int, int],
    rng: np.random.Generator,
    *,
    falloff: float = 1.5,
    stretch: float = 1.0,
    coarsest: float = 1.0,
) -> Float[ndarray, "height width"]:
    """Periodic noise of mean 0 and deviation 1 whose amplitude falls as 1 / frequency^`falloff`.

    `stretch` > 1 draws features out along the columns' direction (u); features larger than the image divided
    by `coarsest` are damped.
    """
    height, width = shape
    v = (fft.fftfreq(height)[:, None] * height).astype(np.float32)
    u = (fft.rfftfreq(width)[None, :] * width).astype(np.float32)
    frequency = np.hypot(v, u * np.float32(stretch))
    amplitude = (frequency + np.float32(coarsest)) ** np.float32(-falloff)
    amplitude[0, 0] = 0.0
    field = fft.irfft2(fft.rfft2(rng.standard_normal(shape, dtype=np.float32)) * amplitude, s=shape)
    return field / field.std()


def shaded(
    base: Colour | Float[ndarray, "... 3"], relative: Float[ndarray, "height width"]
) -> Float[ndarray, "height width 3"]:
    """`base` colour made lighter or darker by the factor `1 + relative` per texel."""
    factor = np.asarray(1.0 + relative[..., None], dtype=np.float32)
    return np.asarray(base, dtype=np.float32) * factor


def blended(
    below: Float[ndarray, "height width 3"],
    above: Colour | Float[ndarray, "... 3"],
    weight: Float[ndarray, "height width"],
) -> Float[ndarray, "height width 3"]:
    share = np.clip(np.asarray(weight, dtype=np.float32), 0.0, 1.0)[..., None]
    return below + (np.asarray(above, dtype=np.float32) - below) * share


def toned(colour: Colour, factor: float) -> Colour:
    """`colour` made lighter or darker."""
    red, green, blue = (min(255, int(factor * c)) for c in colour)
    return red, green, blue


def as_image(colours: Float[ndarray, "height width 3"]) -> Image:
    return np.clip(colours + 0.5, 0, 255).astype(np.uint8)


def texel_grid(shape: tuple[int, int]) -> tuple[Float[ndarray, "height 1"], Float[ndarray, "1 width"]]:
    """Row and column coordinates of texel centres in [0, 1)."""
    height, width = shape
    return (np.arange(height)[:, None] + 0.5) / height, (np.arange(width)[None, :] + 0.5) / width
