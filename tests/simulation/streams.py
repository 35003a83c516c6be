"""The random numbers that docs/simulate.md specifies, from its text alone: FNV-1a, the C++ standard's seed_seq and
mt19937_64, and Marsaglia's polar method. Shares no code with the product."""

import math

WORD, LONG = 0xFFFFFFFF, 0xFFFFFFFFFFFFFFFF


def fnv1a(text):
    value = 0x811C9DC5
    for byte in text.encode():
        value = (value ^ byte) * 0x01000193 & WORD
    return value


def seed_seq(seeds, count):
    """[rand.util.seedseq], 8: `count` words of 32 bits."""
    def mixed(x):
        return x ^ x >> 27
    b = [0x8B8B8B8B] * count
    s = len(seeds)
    t = 11 if count >= 623 else 7 if count >= 68 else 5 if count >= 39 else 3 if count >= 7 else (count - 1) // 2
    p = (count - t) // 2
    q = p + t
    m = max(s + 1, count)
    for k in range(m):
        r1 = 1664525 * mixed(b[k % count] ^ b[(k + p) % count] ^ b[(k - 1) % count]) & WORD
        r2 = r1 + (s if k == 0 else k % count + seeds[k - 1] if k <= s else k % count) & WORD
        b[(k + p) % count] = b[(k + p) % count] + r1 & WORD
        b[(k + q) % count] = b[(k + q) % count] + r2 & WORD
        b[k % count] = r2
    for k in range(m, m + count):
        r3 = 1566083941 * mixed(b[k % count] + b[(k + p) % count] + b[(k - 1) % count] & WORD) & WORD
        r4 = r3 - k % count & WORD
        b[(k + p) % count] ^= r3
        b[(k + q) % count] ^= r4
        b[k % count] = r4
    return b


class Twister64:
    """mt19937_64."""

    def __init__(self, seeds):
        words = seed_seq(seeds, 2 * 312)
        self.state = [words[2 * i] | words[2 * i + 1] << 32 for i in range(312)]
        self.next = 312

    def draw(self):
        if self.next == 312:
            x = self.state
            for i in range(312):
                y = x[i] & 0xFFFFFFFF80000000 | x[(i + 1) % 312] & 0x7FFFFFFF
                x[i] = x[(i + 156) % 312] ^ y >> 1 ^ (0xB5026F5AA96619E9 if y & 1 else 0)
            self.next = 0
        z = self.state[self.next]
        self.next += 1
        z ^= z >> 29 & 0x5555555555555555
        z ^= z << 17 & 0x71D67FFFEDA60000
        z ^= z << 37 & 0xFFF7EEE000000000 & LONG
        return z ^ z >> 43


class Stream:
    """The stream of the n-th (from 0) `purpose` of `sender`."""

    def __init__(self, seed, sender, purpose, ordinal=0):
        self.twister = Twister64([seed & WORD, seed >> 32, fnv1a(sender), fnv1a(purpose), ordinal])
        self.spare = None

    def uniform(self):
        return (self.twister.draw() >> 11) * 2.0**-53

    def normal(self):
        if self.spare is not None:
            value, self.spare = self.spare, None
            return value
        while True:
            x, y = 2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0
            square = x * x + y * y
            if 0.0 < square < 1.0:
                break
        stretch = math.sqrt(-2.0 * math.log(square) / square)
        self.spare = y * stretch
        return x * stretch
