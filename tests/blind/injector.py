#!/usr/bin/python3
"""Makes recordings of two gyros with effects hidden from the gap workflow: a folder with configuration, DBC file,
the model before, measured.log.xz and fresh.log.xz, and, elsewhere, the sealed answer."""

import argparse
import json
import sys
import zlib
from pathlib import Path

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parent))
import cases  # noqa: E402
import drive  # noqa: E402
import effects as kinds  # noqa: E402
import recording  # noqa: E402
import strangers  # noqa: E402

VERSION = 1  # version of the meaning of a seed


def make(case, folder, answer_path, recordings=("measured", "fresh")):
    """Writes the case; returns the answer. For a drive the fresh recording may be left out."""
    root = [VERSION, case.seed, zlib.crc32(case.name.encode())]
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    alike = lambda: np.random.default_rng([*root, 0])
    worlds = [
        cases.world_for(case, alike(), np.random.default_rng([*root, 1, i])) for i in range(len(recordings))
    ]
    hidden, odd, label = cases.hidden_in(case, worlds[0], np.random.default_rng([*root, 2]))
    if case.world == "bench" and any(e["kind"] == "vibration_rectification" for e in hidden):
        for world in worlds[1:]:
            cases.shake(world, np.random.default_rng([*root, 3]))
    if any(e["kind"] == "supply_voltage_bias" for e in hidden):
        for world in worlds[1:]:
            cases.feed(world, np.random.default_rng([*root, 3]))
    if any(e["kind"] == "cross_axis" for e in hidden):
        for world in worlds[1:]:
            cases.sway(world, np.random.default_rng([*root, 3]))
    (folder / "vgyro.toml").write_text(recording.config_text(worlds[0]))
    (folder / "bench.dbc").write_text(recording.dbc_text(worlds[0]))
    if not case.nothing_given:
        (folder / "model.toml").write_text(recording.model_text(worlds[0]))
    for i, (world, name) in enumerate(zip(worlds, recordings)):
        rng = np.random.default_rng([*root, 4, i])
        temperatures = cases.recorded_temperatures(case, world, rng)
        recording.write_log(
            folder / f"{name}.log.xz", recording.streams(world, hidden, odd, temperatures, rng)
        )
    kind = hidden[0]["kind"] if case.group == "single" else case.kind
    answer = {
        "case": case.name, "group": case.group, "kind": kind, "seed": case.seed, "strength": case.strength,
        "reference": case.reference, "duration_s": worlds[0].motion.duration_s, "rates_hz": list(worlds[0].rates_hz),
        "effects": hidden, "outside": label, "world": case.world, "nothing_given": case.nothing_given,
        "benign": drive.benign(worlds[0], case) if case.world == "drive" else [], "traits": worlds[0].traits,
    }  # fmt: skip
    if answer_path is not None:
        Path(answer_path).parent.mkdir(parents=True, exist_ok=True)
        Path(answer_path).write_text(json.dumps(answer, indent=1) + "\n")
    return answer


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--answer", type=Path, required=True, help="the sealed answer, outside FOLDER")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument(
        "--group", choices=["clean", "single", "pair", "triple", "outside", "decoy"], required=True
    )
    parser.add_argument(
        "--kind", default="", choices=["", *kinds.KINDS, *strangers.MAKERS, *cases.DECOYS], metavar="KIND"
    )
    parser.add_argument("--strength", type=float, help="wanted |t|; without: a size as benches meet it")
    parser.add_argument("--no-reference", action="store_true")
    parser.add_argument("--short", action="store_true", help="240 s at 100 Hz")
    parser.add_argument("--world", choices=["bench", "drive"], default="bench")
    parser.add_argument("--nothing-given", action="store_true", help="no model file")
    a = parser.parse_args()
    if a.folder.resolve() in a.answer.resolve().parents:
        parser.error("the answer must lie outside the folder that the workflow sees")
    case = cases.Case(a.group, a.seed, a.kind, a.strength, not a.no_reference, a.short, a.world, a.nothing_given)
    print(json.dumps(make(case, a.folder, a.answer)))


if __name__ == "__main__":
    main()
