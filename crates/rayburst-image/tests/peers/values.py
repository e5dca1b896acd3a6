"""Prints what the ꟻLIP authors' tool and scikit-image say about the pictures of
`tests/all/pictures.rs`, which are computed here by the same integer formulas.

    pip install flip-evaluator==1.7 scikit-image==0.26.0
    python values.py

The output stands in `tests/all/metrics.rs`.
"""

import flip_evaluator
import numpy as np
from skimage.metrics import mean_squared_error, peak_signal_noise_ratio, structural_similarity


def pcg(v):
    v &= 0xFFFFFFFF
    state = (v * 747796405 + 2891336453) & 0xFFFFFFFF
    word = (((state >> ((state >> 28) + 4)) ^ state) * 277803737) & 0xFFFFFFFF
    return (word >> 22) ^ word


def reference(w, h, x, y):
    if (x - w // 3) ** 2 + (y - h // 2) ** 2 < (h // 4) ** 2:
        return [220, 60, 40]
    if x > 2 * w // 3 and ((x + y) // 3) % 2 == 0:
        return [30, 40, 200]
    return [255 * x // (w - 1), 255 * y // (h - 1), (4 * (x ^ y)) & 255]


def noisy(w, h, x, y):
    c = reference(w, h, x, y)
    return [min(max(c[i] + pcg(3 * (y * w + x) + i) % 61 - 30, 0), 255) for i in range(3)]


def shifted(w, h, x, y):
    return reference(w, h, max(x - 1, 0), y) if 2 * y > h else reference(w, h, x, y)


def tinted(w, h, x, y):
    c = reference(w, h, x, y)
    return [min(c[0] + 9, 255), c[1], c[2]]


def radiance(w, h, x, y):
    c = reference(w, h, x, y)
    if (x - 3 * w // 4) ** 2 + (y - h // 4) ** 2 < 20:
        return [900.0, 700.0, 500.0]
    return [v / 64 * 2.0 ** (x // 12 % 8 - 5) for v in c]


def grainy(w, h, x, y):
    c = radiance(w, h, x, y)
    if (x, y) == (w // 5, h // 5):
        return [300.0, 300.0, 250.0]
    return [c[i] * (1 + (pcg(3 * (y * w + x) + i + 7) % 33 - 16.0) / 64) for i in range(3)]


def picture(f, w, h, kind):
    return np.array([[f(w, h, x, y) for x in range(w)] for y in range(h)], dtype=kind)


for w, h in [(96, 64), (37, 23)]:
    a8 = picture(reference, w, h, np.uint8)
    for f in (noisy, shifted, tinted):
        a, b = a8 / 255, picture(f, w, h, np.uint8) / 255
        error, mean, _ = flip_evaluator.evaluate(
            a.astype(np.float32), b.astype(np.float32), "LDR", applyMagma=False
        )
        ssim = structural_similarity(
            a, b, gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
            data_range=1, channel_axis=2,
        )
        print(f"Ldr {{ size: ({w}, {h}), test: {f.__name__}, flip: {mean:.6f}, "
              f"flip_at: [{', '.join(f'{error[h * i // 4, w * i // 4, 0]:.6f}' for i in (0, 1, 2, 3))}], "
              f"rmse: {np.sqrt(mean_squared_error(a, b)):.6f}, "
              f"psnr: {peak_signal_noise_ratio(a, b, data_range=1):.6f}, ssim: {ssim:.6f} }},")
    a, b = picture(radiance, w, h, np.float32), picture(grainy, w, h, np.float32)
    error, mean, parameters = flip_evaluator.evaluate(a, b, "HDR", applyMagma=False)
    print(f"Hdr {{ size: ({w}, {h}), flip: {mean:.6f}, "
          f"flip_at: [{', '.join(f'{error[h * i // 4, w * i // 4, 0]:.6f}' for i in (0, 1, 2, 3))}], "
          f"start: {parameters['startExposure']:.6f}, stop: {parameters['stopExposure']:.6f}, "
          f"count: {parameters['numExposures']}, "
          f"rmse: {np.sqrt(mean_squared_error(a, b)):.6f} }},", parameters)
