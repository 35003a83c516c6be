"""The paper's two experiments on the twin: the errors of the virtual gyro and of the plain mean, and those
expected from the injected noise."""

import dataclasses
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import canlog  # noqa: E402
import make_twin  # noqa: E402
import product  # noqa: E402

DPH = 3600.0  # deg/h in 1 deg/s
REST_S = 60.0
WINDOW_S = 10.0
ORDER = 1
RUNS = {"rest": 120.0, "turn": 900.0}


@dataclasses.dataclass(frozen=True)
class Errors:
    mean_dps: float  # error of the run's mean rate
    worst_window_dps: float  # largest |mean error| of any 10-s window
    angle_deg: float  # integral of the error over the run


def options_of(run, seed):
    return make_twin.Options(scenario=run, rest_s=REST_S, run_s=RUNS[run], seed=seed)


def scored_from_s(run):
    """The ramp to 50 deg/s is not part of the run."""
    return REST_S + (make_twin.RAMP_S if run == "turn" else 0.0)


def errors_of(run, rate):
    rate_dps = make_twin.EARTH_DPS + (50.0 if run == "turn" else 0.0)
    at_s = (rate.stamps_us - rate.age_us) * 1e-6 - make_twin.Options().start_s
    after_s = at_s - scored_from_s(run)
    scored = (after_s >= 0.0) & (after_s < RUNS[run])
    error = rate.rate_dps[scored] - rate_dps
    if not rate.valid[scored].all():
        raise RuntimeError("VG_Rate is invalid in the run")
    window = (after_s[scored] / WINDOW_S).astype(int)
    window_means = np.bincount(window, error) / np.bincount(window)
    return Errors(error.mean(), np.abs(window_means).max(), error.mean() * RUNS[run])


def measure(run, seed, methods=("mean", "mutual")):
    """Method → Errors, on one recording."""
    options = options_of(run, seed)
    with tempfile.TemporaryDirectory(prefix="vgyro-") as folder:
        config = product.write_config(folder, REST_S, WINDOW_S, ORDER)
        log = Path(folder) / "twin.log"
        with open(log, "wb") as file:
            canlog.write(file, make_twin.simulate(options).streams)
        return {
            method: errors_of(
                run, canlog.virtual_rate(canlog.read(product.replay(config, log, Path(folder) / "out.log", method)))
            )
            for method in methods
        }


@dataclasses.dataclass(frozen=True)
class Expectation:
    mean_dps: float  # expected mean error of the run
    sigma_dps: float  # and its standard deviation


def expect(run, method):
    """The mean error over the run is a linear functional of both gyros' white noise and walks. For `mutual` only
    the common walk and the white noise of the half sum matter, less the calibration's line, extrapolated to the
    middle of the run."""
    rate_hz = 20.0  # rate of the integration; the noise is given as densities
    t = (np.arange((scored_from_s(run) + RUNS[run]) * rate_hz) + 0.5) / rate_hz
    weights = np.zeros_like(t)
    scored = t >= scored_from_s(run)
    weights[scored] = 1.0 / scored.sum()
    bias_dps = 0.5 * sum(g.bias_dps for g in make_twin.GYROS)
    if method == "mutual":
        calibration = t < REST_S
        design = np.vander(t[calibration] - REST_S / 2, ORDER + 1)
        at_middle = np.vander([t[scored].mean() - REST_S / 2], ORDER + 1)[0]
        weights[calibration] -= at_middle @ np.linalg.pinv(design)
        bias_dps = 0.0
    white = sum(g.white_dps_rthz**2 for g in make_twin.GYROS) / 4.0
    walk = sum(g.walk_dps_rts**2 for g in make_twin.GYROS) / 4.0
    later_weight = np.cumsum(weights[::-1])[::-1]
    variance = white * rate_hz * np.sum(weights**2) + walk / rate_hz * np.sum(later_weight**2)
    return Expectation(bias_dps, float(np.sqrt(variance)))
