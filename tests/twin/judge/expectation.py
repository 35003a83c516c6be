"""Expected errors of the bound from the injected noise: the standard deviation of its heading error. N
and K are densities, so steps of half a second are enough."""

import numpy as np

from judge import motion, rivals

STEP_S = 0.5


def heading_sigmas_deg(gyros, true, horizons_s):
    """σ of the bound's heading error, at each horizon after the beginning of the motion."""
    ends = {round((motion.BEGIN_S + horizon_s) / STEP_S): horizon_s for horizon_s in horizons_s}
    t = np.arange(max(ends)) * STEP_S
    there = np.stack([true.there(k, t) for k in range(2)])
    kinds = rivals.step_kinds(there, true.standing(t)).astype(np.int8)
    gains, _ = rivals.bound_gains(gyros, STEP_S, kinds.tobytes())
    weights = rivals.weights_of(gyros, there).T * (STEP_S * (t >= motion.BEGIN_S))[:, None]
    walk = np.diag([g.walk_dps_rts**2 * STEP_S for g in gyros] + [0.0])
    noise = np.diag([g.white_dps_rthz**2 / STEP_S for g in gyros])

    sigmas = {}
    # Errors of both drifts (true less estimated) and of the heading.
    covariance = np.diag([rivals.FIRST_SIGMA_DPS**2, rivals.FIRST_SIGMA_DPS**2, 0.0])
    for i, (kind, gain, weight) in enumerate(zip(kinds, gains, weights), 1):
        of_errors, of_noise = _step(kind, gain, weight)
        covariance = of_errors @ (covariance + walk) @ of_errors.T + of_noise @ noise @ of_noise.T
        if i in ends:
            sigmas[ends[i]] = float(np.sqrt(covariance[2, 2]))
    return sigmas


def _step(kind, gain, weight):
    """Matrices that give the errors after a step from those before (3, 3) and from the readings' noise
    (3, 2)."""
    drift = np.eye(2, 5)
    noise = np.eye(2, 5, k=3)
    if kind == rivals.DIFFERENCE:
        drift = drift - np.outer(gain[:2], drift[0] + noise[0] - drift[1] - noise[1])
    if kind in (rivals.FIRST, rivals.BOTH):
        drift = drift - np.outer(gain[:2], drift[0] + noise[0])
    if kind in (rivals.SECOND, rivals.BOTH):
        drift = drift - np.outer(gain[2:], drift[1] + noise[1])
    heading = np.eye(1, 5, k=2)[0] + weight @ (drift + noise)
    all_of_it = np.vstack([drift, heading])
    return all_of_it[:, :3], all_of_it[:, 3:]
