"""Whether the machine kept time while a case played in real time. Only then is a failure the product's: a host that stalls
causes time-outs for frames that would have come in time."""

import verdicts

# Half the shortest time-out of a gyro.
STALL_MOST_US = 50_000


def longest_stall_us(folder, steps, result):
    """The longest stall of the whole guest, by its watch while only daemon and player should run, or of the player alone, by
    the capture."""
    seen = [overlap_us(end - length, end, result["listened_us"]) for end, length in result.get("stalls_us", [])]
    return max([*seen, player_lateness_us(folder, steps)])


def overlap_us(begin, end, spans):
    return sum(max(0, min(end, until) - max(begin, since)) for since, until in spans)


def player_lateness_us(folder, steps):
    """Greatest delay of a captured frame against the played log; the earliest frame of each play counts as in time. 0 if frames
    are missing, which no stall of the player explains."""
    plays = [verdicts.read_log(what if verb == "play" else what[0]) for verb, what in steps if verb.startswith("play")]
    if not plays or not (folder / "capture.log").exists():
        return 0
    seen = verdicts.read_log(folder / "capture.log")
    played_ids = {(line.bus, line.name) for play in plays for line in play}
    worst = [0]
    for bus in {bus for bus, _ in played_ids}:
        captured = [line for line in seen if line.bus == bus and (bus, line.name) in played_ids]
        for play in plays:
            sent = [line for line in play if line.bus == bus]
            late = [got.us - line.us for got, line in zip(captured, sent) if got.content == line.content]
            if len(late) != len(sent):
                return 0
            captured = captured[len(sent):]
            worst.append(max(late) - min(late) if late else 0)
    return max(worst)
