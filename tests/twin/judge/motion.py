"""The platform's motion: true rate, standstills, drop-outs and temperature of each scenario. Seconds count from the
first sample; each scenario begins at rest, for the calibration."""

import dataclasses

import numpy as np

EARTH_DPS = 0.0032
CALIBRATION_S = 60.0
BEGIN_S = 60.05  # the motion begins, and the heading error counts from here
LEG_S = 300.0
STOP_S = 20.0  # at the end of each leg
GRID_HZ = 200.0
MINUTES_15_S = 900.0
HOUR_S = 3600.0

TURN_DPS = 50.0
# One for each leg that ends on the ferry, in turns.
FERRY_DPS = (0.3, -0.1, 1.0, -0.5, 0.15, 0.7)
FERRY_S = 70.0


@dataclasses.dataclass(frozen=True)
class Scenario:
    name: str
    drive: str  # "rest", "turn" or "drive"
    run_s: float = HOUR_S
    stops: bool = False
    ferry: bool = False
    temperature: bool = False
    scale_error_2: float = 0.0
    delay_2_s: float = 0.0
    gone_s: tuple = ((), ())  # per gyro: (from, to) after BEGIN_S
    # The estimate without a model file lacks information that the bound has.
    blind_without_model: bool = False


SCENARIOS = {
    s.name: s
    for s in (
        Scenario("rest", "rest"),
        Scenario("turn", "turn", run_s=MINUTES_15_S),
        Scenario("drive", "drive"),
        Scenario("stops", "drive", stops=True),
        Scenario("temperature", "drive", stops=True, temperature=True, blind_without_model=True),
        Scenario("scale", "drive", stops=True, scale_error_2=3e-3),
        Scenario("skew", "drive", stops=True, delay_2_s=5e-3),
        Scenario("dropout", "drive", stops=True, gone_s=(((420.0, 720.0),), ((2100.0, 2400.0),))),
        Scenario("ferry", "drive", stops=True, ferry=True),
    )
}


def smooth_step(x):
    x = np.clip(x, 0.0, 1.0)
    return x * x * x * (x * (6.0 * x - 15.0) + 10.0)


def leg_ends(scenario, run_s):
    """(leg's end, rate of the ferry or 0, whether the ferry begins to turn only after a standstill)."""
    legs = int(run_s // LEG_S)
    for leg in range(legs):
        on_ferry = scenario.ferry and leg % 2 == 1
        turn = leg // 2
        yield (leg + 1) * LEG_S, FERRY_DPS[turn % len(FERRY_DPS)] if on_ferry else 0.0, on_ferry and turn % 2 == 1


def stops_of(scenario, run_s):
    """(from, to) of the standstills, after BEGIN_S."""
    if scenario.drive == "rest":
        return ((0.0, run_s),)
    if not scenario.stops:
        return ()
    stops = []
    for end_s, ferry_dps, late in leg_ends(scenario, run_s):
        if ferry_dps == 0.0:
            stops.append((end_s - STOP_S, end_s))
        elif late:
            stops.append((end_s - FERRY_S, end_s - FERRY_S + STOP_S))
    return tuple(stops)


class Motion:
    """The true rate on a fine grid, linear between; everything else as functions of time."""

    def __init__(self, scenario, run_s, rng):
        self.scenario = scenario
        self.run_s = run_s
        self.length_s = BEGIN_S + run_s
        self.stops = stops_of(scenario, run_s)
        # The grid extends beyond both ends: clocks differ, and stamps may be late.
        self._from_s = -1.0
        self._t = self._from_s + np.arange(int((self.length_s + 3.0) * GRID_HZ)) / GRID_HZ
        self._rate = self._make(self._t - BEGIN_S, rng)

    def rate(self, t_s):
        return np.interp(t_s, self._t, self._rate)

    def standing(self, t_s):
        """The platform stands still and this is known: the calibration and the true stops."""
        standing = t_s < CALIBRATION_S
        for begin, end in self.stops:
            standing |= (t_s >= BEGIN_S + begin) & (t_s < BEGIN_S + end)
        return standing

    def there(self, gyro, t_s):
        there = np.ones(len(t_s), dtype=bool)
        for begin, end in self.scenario.gone_s[gyro]:
            there &= (t_s < BEGIN_S + begin) | (t_s >= BEGIN_S + end)
        return there

    def temperature_c(self, t_s):
        """25 degC in the calibration, then towards 45 degC."""
        if not self.scenario.temperature:
            return np.full_like(t_s, 25.0)
        after = np.maximum(t_s - BEGIN_S, 0.0)
        return 25.0 + 20.0 * (1.0 - np.exp(-after / 900.0)) * smooth_step(after / 60.0)

    def _make(self, t, rng):
        if self.scenario.drive == "rest":
            return np.full_like(t, EARTH_DPS)
        if self.scenario.drive == "turn":
            return EARTH_DPS + TURN_DPS * smooth_step(t / 2.0)
        rate = self._driving(t) * (turns(t, self.run_s, rng) + band_noise(t, rng))
        for end_s, ferry_dps, late in leg_ends(self.scenario, self.run_s):
            if ferry_dps == 0.0:
                continue
            begin = end_s - FERRY_S + (STOP_S if late else -3.0)
            rate += ferry_dps * smooth_step((t - begin) / (5.0 if late else 3.0)) * smooth_step((end_s + 3.0 - t) / 3.0)
        return EARTH_DPS + rate

    def _driving(self, t):
        """1 while driving, 0 while the vehicle stands, with gentle edges of 3 s."""
        driving = smooth_step(t / 3.0)
        if not self.scenario.stops:
            return driving
        for end_s, ferry_dps, _ in leg_ends(self.scenario, self.run_s):
            begin = end_s - (STOP_S if ferry_dps == 0.0 else FERRY_S)
            driving *= 1.0 - smooth_step((t - (begin - 3.0)) / 3.0) * smooth_step((end_s + 3.0 - t) / 3.0)
        return driving


def turns(t, run_s, rng):
    """Each leg has four bends and their opposites in random order: it ends on its first heading."""
    rate = np.zeros_like(t)
    for leg in range(int(np.ceil(run_s / LEG_S))):
        angles = rng.uniform(20.0, 100.0, 4) * rng.choice((-1.0, 1.0), 4)
        angles = rng.permutation(np.concatenate([angles, -angles]))
        begins = leg * LEG_S + 8.0 + 26.0 * np.arange(8) + rng.uniform(0.0, 14.0, 8)
        for angle, begin, length in zip(angles, begins, rng.uniform(4.0, 9.0, 8)):
            part = slice(*np.searchsorted(t, (begin, begin + length)))
            rate[part] += 2.0 * angle / length * np.sin(np.pi * (t[part] - begin) / length) ** 2
    return rate


def band_noise(t, rng):
    """Lane wander (0.05 … 0.2 Hz, 0.5 deg/s rms) and road noise (0.1 deg/s rms, falling with f² above
    1 Hz and gone above 6 Hz)."""
    f = np.fft.rfftfreq(len(t), 1.0 / GRID_HZ)
    total = np.zeros_like(t)
    wander = (f > 0.05) & (f < 0.2)
    road = np.where((f > 0.2) & (f < 6.0), 1.0 / (1.0 + f**2), 0.0)
    for shape, rms_dps in ((wander, 0.5), (road, 0.1)):
        used = np.flatnonzero(shape)
        spectrum = np.zeros(len(f), dtype=complex)
        spectrum[used] = shape[used] * (rng.standard_normal(len(used)) + 1j * rng.standard_normal(len(used)))
        noise = np.fft.irfft(spectrum, len(t))
        total += noise * (rms_dps / noise.std())
    return total
