"""Evidence files of fleets whose truth is known, drawn from statistics: no drive is simulated, and no code of the product
is used. A drive has an information matrix of its own, scores that scatter by it about those of the true sizes, and noise
and bias like a unit of its type."""

import base64
import json

import numpy as np

# Shapes, each with the size of one standard error of a drive.
SHAPES = {"bias_ramp": 2e-6, "warm_up:15": 5e-3, "warm_up:60": 8e-3, "temperature_bias": 2e-3, "temperature_rate_bias": 0.02,
          "scale_factor": 5e-5, "scale_factor_asymmetry": 8e-5, "scale_factor_quadratic": 3e-6, "scale_factor_cubic": 4e-8,
          "g_sensitivity:x": 2e-3, "g_sensitivity:y": 2e-3, "g_sensitivity:z": 4e-3, "vibration_rectification": 0.5,
          "delay": 2e-5, "bandwidth:6": 0.02, "bandwidth:15": 0.05, "clock_skew": 3.0}
NAMES = list(SHAPES)
SIGMA = np.array([SHAPES[name] for name in NAMES])
YEAR_S = 365.25 * 86400.0


def information(rng):
    """Information matrix of one drive: some shapes resemble each other, and there is more or less motion."""
    count = len(NAMES)
    factors = 0.6 * rng.standard_normal((count, 4))
    # Families that resemble each other: scale factors; delay and low-passes; slow effects.
    for family in ((5, 6, 7, 8), (13, 14, 15, 16), (0, 1, 2, 3, 4)):
        factors[list(family)] += 0.9 * rng.standard_normal(4)
    covariance = factors @ factors.T + np.eye(count)
    root = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(root, root)
    size = SIGMA * np.exp(0.3 * rng.standard_normal(count))
    return correlation / np.outer(size, size)


def packed_correlation(matrix):
    own = np.diag(matrix)
    correlation = matrix / np.sqrt(np.outer(own, own))
    packed = np.round(32767.0 * correlation[np.tril_indices(len(NAMES), -1)]).astype("<i2")
    return base64.b64encode(packed.tobytes()).decode()


def place(rng, gyro, sizes):
    matrix = information(rng)
    score = matrix @ sizes + np.linalg.cholesky(matrix) @ rng.standard_normal(len(NAMES))
    return {"gyros": [gyro], "gyro": [gyro] * len(NAMES), "shapes": NAMES, "score": score.tolist(),
            "information": np.diag(matrix).tolist(), "correlation": packed_correlation(matrix), "beside": []}


class Unit:
    """One gyro, with its own deviations. `effects`: shape → size in parameter units, in addition to its type's."""

    def __init__(self, rng, gyro_type, serial, noise=1.0, wander=1.0, walk=1.0, effects=None, spread=None, bias_a_year_dps=0.0,
                 effects_a_year=None):
        self.type, self.serial, self.wander, self.bias_a_year_dps = gyro_type, serial, wander, bias_a_year_dps
        self.white = 1e-3 * noise * np.exp(0.08 * rng.standard_normal())
        self.walk = 1e-5 * walk * np.exp(0.1 * rng.standard_normal())
        self.bias = 0.05 * rng.standard_normal()
        self.sizes = np.zeros(len(NAMES))
        for name, size in (effects or {}).items():
            self.sizes[NAMES.index(name)] += size
        for name, sigma in (spread or {}).items():
            self.sizes[NAMES.index(name)] += sigma * rng.standard_normal()
        self.sizes_a_year = np.zeros(len(NAMES))
        for name, size in (effects_a_year or {}).items():
            self.sizes_a_year[NAMES.index(name)] += size

    def sizes_at(self, years):
        return self.sizes + years * self.sizes_a_year

    def gyro(self, rng, number, years=0.0):
        return {"name": "ab"[number - 1], "type": self.type, "unit": self.serial, "samples": 30000, "lost_share": 0.0,
                "masked_share": 0.0, "bias_sigma_dps": 1e-4,
                "bias_dps": self.bias + years * self.bias_a_year_dps + 2e-3 * self.wander * rng.standard_normal(),
                "white_dps_rthz": self.white * np.exp(0.01 * rng.standard_normal()),
                "walk_dps_rts": self.walk * np.exp(0.4 * rng.standard_normal()), "log_noise_covariance": [1e-4, 0.0, 0.16],
                "temperature_c": [20.0, 25.0, 31.0], "named": []}


def drive(rng, number, pair):
    years = rng.random()
    return {"format": 1, "evidence": "drive", "vgyro": "0", "recording": f"{number:016x}",
            "began_s": 1.7e9 + YEAR_S * years, "seconds": 300.0, "config": "c", "model": "none", "verdict": "no_gap",
            "gyros": [unit.gyro(rng, i + 1, years) for i, unit in enumerate(pair)],
            "places": [place(rng, i + 1, unit.sizes_at(years)) for i, unit in enumerate(pair)]}


def lines(rng, pairs, drives):
    """Evidence lines of drives, which go round the vehicles."""
    return [json.dumps(drive(rng, number, pairs[number % len(pairs)])) + "\n" for number in range(drives)]


def numbers(values):
    return "[" + ",".join(f"{value:.9g}" for value in values) + "]"


class QuickDrives:
    """Lines for fleets of a million drives, with numbers as short as `vgyro gap` writes them. The information of a drive is one
    of a few hundred drawn in advance."""

    def __init__(self, rng, matrices=400):
        self.rng = rng
        self.matrices = [information(rng) for _ in range(matrices)]
        self.roots = [np.linalg.cholesky(matrix) for matrix in self.matrices]
        self.ends = [f'"information":{numbers(np.diag(matrix))},"correlation":"{packed_correlation(matrix)}","beside":[]}}'
                     for matrix in self.matrices]
        self.shapes = json.dumps(NAMES, separators=(",", ":"))

    def place(self, gyro, sizes):
        which = self.rng.integers(len(self.matrices))
        score = self.matrices[which] @ sizes + self.roots[which] @ self.rng.standard_normal(len(NAMES))
        return (f'{{"gyros":[{gyro}],"gyro":{json.dumps([gyro] * len(NAMES), separators=(",", ":"))},"shapes":{self.shapes},'
                f'"score":{numbers(score)},{self.ends[which]}')

    def line(self, number, pair):
        years = self.rng.random()
        gyros = json.dumps([{key: float(f"{value:.9g}") if isinstance(value, float) else value
                             for key, value in unit.gyro(self.rng, i + 1, years).items()} for i, unit in enumerate(pair)],
                           separators=(",", ":"))
        places = ",".join(self.place(i + 1, unit.sizes_at(years)) for i, unit in enumerate(pair))
        return (f'{{"format":1,"evidence":"drive","vgyro":"0","recording":"{number:016x}","began_s":{1.7e9 + YEAR_S * years:.6f},'
                f'"seconds":300.0,"config":"c","model":"none","verdict":"no_gap","gyros":{gyros},"places":[{places}]}}\n')
