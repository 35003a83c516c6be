"""The motion of a vehicle: its yaw rate on a fine grid, the speed of its wheels, and a description in words. A life
is a rest followed by chapters; a chapter calls small acts (bend, stop, drive). Every length and height is drawn
here; the requirements for the whole life (longest time without a stop, slowest turn) come in as Limits."""

import math
from dataclasses import dataclass

import numpy as np

GRID_S = 0.002  # A quarter of the period of 125 Hz; the fastest motion here has 2.5 Hz.
ROUGH_KNOT_S = 0.16  # Road noise: cubic splines on random knots, hence up to some 2.5 Hz.
WANDER_KNOT_S = 1.6  # A driver keeping the lane: some 0.25 Hz.
SWAY_KNOT_S = 0.4
SPLINE_RMS = 0.69  # RMS of a cubic B-spline on knots of variance 1.


QUIET_STOP_S = 8.0  # Shortest stop that counts where stops are required.
# Acceleration of a car and of a train, m/s^2.
CAR_PULL, TRAIN_PULL = (1.2, 3.0), (0.5, 1.1)
# Lateral acceleration that passengers accept, m/s^2: a fast vehicle turns slowly.
CAR_GRIP, TRAIN_GRIP = 4.5, 1.5


@dataclass
class Limits:
    """Limits that keep a life fair: drift that both gyros share shows only at stops."""

    longest_without_stop_s: float = math.inf
    slowest_smooth_dps: float = 0.0


def smooth_noise(rng, count, knot_s):
    """Noise of unit variance, twice differentiable, with the bandwidth of its knots."""
    per_knot = round(knot_s / GRID_S)
    x = np.arange(per_knot) / per_knot
    weights = np.array([(1 - x) ** 3, 3 * x**3 - 6 * x**2 + 4, -3 * x**3 + 3 * x**2 + 3 * x + 1, x**3]) / 6
    knots = rng.standard_normal(count // per_knot + 5)
    rows = np.lib.stride_tricks.sliding_window_view(knots, 4)
    return (rows @ weights).ravel()[:count] / SPLINE_RMS


class Life:
    """A sequence of acts; the next one begins at `now`."""

    def __init__(self, rng, duration_s, rest_s, limits):
        self.rng, self.duration_s, self.limits = rng, duration_s, limits
        self.count = int(duration_s / GRID_S) + 1
        self.rate = np.zeros(self.count)
        self.now, self.speed = rest_s, 0.0
        self.last_stop_s = rest_s
        self.speeds, self.rough, self.wander = ([(0.0, 0.0), (rest_s, 0.0)] for _ in range(3))
        self.pull, self.grip = CAR_PULL, CAR_GRIP
        self.sways, self.told, self.wheel_lies = [], [], []
        self.road = (rng.uniform(0.02, 0.08), rng.uniform(0.1, 0.3))

    def u(self, low, high):
        return self.rng.uniform(low, high)

    def log_u(self, low, high):
        return math.exp(self.rng.uniform(math.log(low), math.log(high)))

    def over(self, end_s):
        return self.now >= min(end_s, self.duration_s)

    def add_bump(self, begin_s, length_s, height_dps, ramp_s):
        """Rises and falls with a cosine: steering is never turned in an instant."""
        first, last = (min(self.count, math.ceil(x / GRID_S)) for x in (begin_s, begin_s + length_s))
        if last <= first:
            return
        t = np.arange(first, last) * GRID_S - begin_s
        ramp_s = min(ramp_s, length_s / 2)
        edge = np.clip(np.minimum(t, length_s - t) / ramp_s, 0, 1)
        self.rate[first:last] += height_dps * 0.5 * (1 - np.cos(np.pi * edge))

    def set(self, speed, rough, wander, ramp_s):
        """From here on, after a ramp: wheel speed in m/s, road noise and lane wander in deg/s rms."""
        end_s = self.now + ramp_s
        for points, value in ((self.speeds, speed), (self.rough, rough), (self.wander, wander)):
            points.append((self.now, points[-1][1]))
            points.append((end_s, value))
        self.speed = speed
        self.now = end_s

    def ramp_to(self, speed):
        return max(1.5, abs(speed - self.speed) / self.u(*self.pull))

    def go(self, speed, rough=1.0, wander=1.0):
        """Drives at this speed, with this share of the road's noise and wander."""
        self.set(speed, rough * self.road[0], wander * self.road[1], self.ramp_to(speed))

    def stop(self, length_s, people=False):
        """The wheels stand for length_s; people who get in shake the car."""
        self.set(0.0, 0.0, 0.0, self.ramp_to(0.0))
        begin = self.now
        self.stay(length_s)
        quiet_s = length_s
        if people and length_s > 6:
            quiet_s = self.u(0.1, 0.6) * length_s
            shaken_from = begin + quiet_s
            self.sways.append((shaken_from, min(self.now - 0.5, shaken_from + self.u(3, 20))))
        if quiet_s >= QUIET_STOP_S:
            self.last_stop_s = begin + quiet_s

    def stay(self, length_s):
        for points in (self.speeds, self.rough, self.wander):
            points.append((self.now + length_s, points[-1][1]))
        self.now += length_s

    def bend(self, height_dps, hold_s, ramp_s):
        length_s = hold_s + 2 * ramp_s
        if self.speed > 0:
            height_dps = math.copysign(min(abs(height_dps), math.degrees(self.grip / self.speed)), height_dps)
        self.add_bump(self.now, length_s, height_dps, ramp_s)
        self.stay(length_s)

    def side(self):
        return self.rng.choice([-1.0, 1.0])

    def room_s(self):
        """How long an act may last before a stop is due."""
        return self.last_stop_s + self.limits.longest_without_stop_s - self.now

    def due(self, next_act_s=25.0):
        """Stops if the next act would be too long without."""
        if self.room_s() < next_act_s:
            self.stop(self.u(QUIET_STOP_S, 30))
            return True
        return False

    def finish(self):
        """Rate in deg/s and wheel speed in m/s on the grid."""
        grid = np.arange(self.count) * GRID_S
        level = {name: np.interp(grid, *zip(*points))
                 for name, points in (("speed", self.speeds), ("rough", self.rough), ("wander", self.wander))}
        self.rate += level["rough"] * smooth_noise(self.rng, self.count, ROUGH_KNOT_S)
        self.rate += level["wander"] * smooth_noise(self.rng, self.count, WANDER_KNOT_S)
        for begin, end in self.sways:
            first, last = int(begin / GRID_S), min(self.count, int(end / GRID_S))
            if last - first > 100:
                shape = np.sin(np.linspace(0, np.pi, last - first)) * 0.05
                self.rate[first:last] += shape * smooth_noise(self.rng, last - first, SWAY_KNOT_S)
        for begin, end, speed in self.wheel_lies:
            inside = slice(int(begin / GRID_S), int(end / GRID_S))
            level["speed"][inside] = speed
        return grid, self.rate, level["speed"]


def city(life, end_s):
    stops_a_minute = life.u(0, 1)
    while not life.over(end_s):
        if not life.due(20) and life.rng.random() < stops_a_minute * 14 / 60:
            life.stop(life.u(5, 60), people=life.rng.random() < 0.4)
        if not 5 <= life.speed <= 12:
            life.go(life.u(6, 11))
        if life.rng.random() < 0.12:
            roundabout(life)
        else:
            length = life.u(4, 9)
            hold = length * life.u(0, 0.5)
            life.bend(life.side() * life.u(4, 25), hold, (length - hold) / 2)
        life.stay(life.u(2, 12))


def roundabout(life):
    side, turn = life.side(), life.u(18, 32)
    life.bend(-side * life.u(6, 12), 0, life.u(1, 1.6))
    life.bend(side * turn, life.u(2, 9), life.u(0.9, 1.5))
    life.bend(-side * life.u(6, 12), 0, life.u(1, 1.6))


def motorway(life, end_s):
    life.go(life.u(24, 36), rough=0.6, wander=0.5)
    while not life.over(end_s):
        hold = life.u(20, 90)
        if life.due(hold + 30) or life.rng.random() < 0.03:
            if life.speed > 0:
                life.stop(life.u(8, 40))
            life.go(life.u(24, 36), rough=0.6, wander=0.5)
        life.bend(life.side() * life.log_u(0.2, 2), hold, life.u(3, 8))
        life.stay(life.u(5, 40))


def circles(life, end_s):
    while not life.over(end_s):
        hold = min(life.log_u(20, 120), max(20.0, life.room_s() - 40))
        life.due(hold + 30)
        smooth = life.rng.random() < 0.5
        life.go(life.u(4, 10), rough=0.2 if smooth else 1.0, wander=0.0 if smooth else 1.0)
        life.bend(life.side() * life.log_u(5, 30), hold, life.u(2, 5))
        if life.rng.random() < 0.3:
            life.stop(life.u(5, 40))
        # Other motion for two thirds of the time, so that an unknown scale error does not dominate.
        city(life, min(end_s, life.now + hold * life.u(1.0, 2.5)))


def car_park(life, end_s):
    while not life.over(end_s):
        life.due(20)
        life.go(life.u(0.8, 3), rough=0.4, wander=0.5)
        for _ in range(life.rng.integers(1, 4)):
            length = life.u(3, 8)
            life.bend(life.side() * life.u(5, 20), length * 0.3, length * 0.35)
            life.stay(life.u(0.5, 4))
        life.stop(life.u(1, 6))


def rail(life, end_s):
    life.pull, life.grip = TRAIN_PULL, TRAIN_GRIP
    life.go(life.u(12, 40), rough=0.3, wander=0.1)
    while not life.over(end_s):
        hold = min(life.u(30, 200), max(30.0, life.room_s() - 110))
        if life.due(hold + 100) or (life.rng.random() < 0.35 and life.speed > 0):
            if life.speed > 0:
                life.stop(life.u(20, 60), people=True)
            life.go(life.u(12, 40), rough=0.3, wander=0.1)
        life.bend(life.side() * life.log_u(0.2, 3), hold, life.u(8, 20))
        life.stay(life.u(10, 60))


def slow_turns(life, end_s):
    while not life.over(end_s):
        hold = life.u(20, 120)
        life.due(hold + 40)
        smooth = life.limits.slowest_smooth_dps < 0.06 and life.rng.random() < 0.35
        slowest = max(0.01, life.limits.slowest_smooth_dps if smooth else 0.0)
        life.go(life.u(3, 15), rough=0.1 if smooth else 0.7, wander=0.0 if smooth else 0.6)
        life.bend(life.side() * life.log_u(slowest, 0.1), hold, life.u(2, 5))
        life.stay(life.u(5, 30))


def ferry(life, end_s):
    """The car stands on a ship that turns, docks, turns again; its wheels stand throughout."""
    steady = life.rng.random() < 0.2
    slowest = min(0.8, max(0.05, life.limits.slowest_smooth_dps))
    life.stop(life.u(10, 30))
    while not life.over(end_s):
        begin = life.now
        longest = min(240.0, life.room_s() - 20)
        for _ in range(life.rng.integers(1, 4)):
            hold = life.u(0.4, 1.0) * (longest - 30)
            life.bend(life.side() * life.log_u(slowest, 1.0), hold, life.u(3, 12))
            life.stay(life.u(5, 30))
            longest = min(240.0, life.room_s() - 20)
            if longest < 50 or life.over(end_s):
                break
        if not steady:
            swell(life, begin, life.now)
        life.stay(life.u(10, 40))  # docked
        life.last_stop_s = life.now
    life.told.append("the ferry is perfectly steady" if steady else "the ferry rolls a little")


def swell(life, begin_s, end_s):
    first, last = int(begin_s / GRID_S), min(life.count, int(end_s / GRID_S))
    if last - first < 1000:
        return
    t = np.arange(last - first) * GRID_S
    fade = np.clip(np.minimum(t, t[-1] - t) / 15, 0, 1)
    height, period = life.u(0.01, 0.08), life.u(5, 12)
    swing = 1 + 0.4 * smooth_noise(life.rng, last - first, 20.0)
    life.rate[first:last] += height * fade * swing * np.sin(2 * np.pi * t / period + life.u(0, 6))


def tow_truck(life, end_s):
    """A car on a truck's bed: the truck drives and stops, the car's wheels stand."""
    life.stop(life.u(8, 25))
    begin = life.now
    (city if life.rng.random() < 0.6 else motorway)(life, min(end_s, begin + life.u(100, 300)))
    life.stop(life.u(8, 25))
    life.wheel_lies.append((begin, life.now, 0.0))


def wheel_slip(life, end_s):
    """On ice or a roller bench: the wheels roll, the car does not."""
    while not life.over(end_s):
        life.stop(life.u(3, 15))
        begin = life.now
        life.stay(life.u(3, 20))
        if life.rng.random() < 0.5:
            life.sways.append((begin, life.now))
        life.wheel_lies.append((begin, life.now, life.u(0.5, 6)))
        city(life, min(end_s, life.now + life.u(40, 120)))


CAR_CHAPTERS = {"city": city, "motorway": motorway, "circles": circles, "car park": car_park, "slow turns": slow_turns,
                "ferry": ferry, "tow truck": tow_truck, "wheel slip": wheel_slip}
CHAPTERS = CAR_CHAPTERS | {"rail": rail}


def live(rng, duration_s, rest_s, chapters, limits):
    """The chapters share the time that is left after the rest."""
    life = Life(rng, duration_s, rest_s, limits)
    for index, name in enumerate(chapters):
        share = (duration_s - life.now) / (len(chapters) - index)
        CHAPTERS[name](life, life.now + share)
        if life.now >= duration_s:
            break
    return life
