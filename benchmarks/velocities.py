"""Velocities from positions: the error of a window of fixed width beside that of one that the data choose.

    python benchmarks/velocities.py

Two sines, one 0.37 times as fast as the other, and noise or an encoder's steps; printed is the root mean square error
over the true velocities' root mean square, of a window of 0.05 s (5 samples at least), of the chosen one, and of the
best one for this signal, known only to who knows the truth.
"""

import numpy as np

from symoden.data import choose_spans, estimate_velocities

FIXED = 0.05  # [s]
SENSORS = {
    "exact": (0.0, 0.0),
    "σ = 1e-3": (1e-3, 0.0),
    "σ = 1e-2": (1e-2, 0.0),
    "4096 counts": (0.0, 2 * np.pi / 4096),
}
LOGS = [
    (5, 0.05),
    (10, 0.01),
    (20, 1),
    (250, 0.5),
    (500, 1),
    (500, 20),
    (1000, 0.2),
    (1000, 5),
    (1000, 50),
    (10_000, 1),
    (10_000, 50),
    (10_000, 500),
    (1_000_000, 3000),
]


def motion(rate: float, hertz: float, sensor: tuple[float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time stamps, uneven by a fifth, positions as measured and true velocities."""
    generator = np.random.default_rng(0)
    noise, step = sensor
    samples = round(min(20_000, max(600, 10 * rate / hertz)))
    ts = np.cumsum(generator.uniform(0.8, 1.2, samples)) / rate
    omega = 2 * np.pi * hertz
    q = np.sin(omega * ts) + 0.3 * np.sin(0.37 * omega * ts + 1) + noise * generator.normal(size=samples)
    v = omega * np.cos(omega * ts) + 0.3 * 0.37 * omega * np.cos(0.37 * omega * ts + 1)
    return ts, (np.round(q / step) * step if step else q)[:, None], v[:, None]


def error(ts: np.ndarray, q: np.ndarray, v: np.ndarray, span: int) -> float:
    """Relative error of velocities from so many samples."""
    estimate = estimate_velocities(ts, q, name="run", spans=np.array([span]))
    return float(np.sqrt(np.mean((estimate - v) ** 2) / np.mean(v**2)))


def main() -> None:
    """Print a table."""
    print("| log [Hz] | motion [Hz] | sensor | 0.05 s | chosen | best | samples chosen |")
    print("|---:|---:|---|---:|---:|---:|---:|")
    for rate, hertz in LOGS:
        for name, sensor in SENSORS.items():
            ts, q, v = motion(rate, hertz, sensor)
            span = int(choose_spans([ts], [q])[0])
            spans = {int(5 * 1.2**k) for k in range(60)}
            best = min(error(ts, q, v, each) for each in spans if each <= len(ts) / 4)
            fixed = error(ts, q, v, max(5, 2 * round(FIXED * rate / 2) + 1))
            print(
                f"| {rate:g} | {hertz:g} | {name} | {fixed:.2g} | {error(ts, q, v, span):.2g} | {best:.2g} | {span} |"
            )


if __name__ == "__main__":
    main()
