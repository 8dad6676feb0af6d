#!/usr/bin/env python3
"""Writes valid inputs for the fuzz targets from the repository's files: seeds.py FOLDER."""

import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
SEMTECH = bytes([2, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0]) + (
    b'{"rxpk":[{"stat":1,"datr":"SF7BW125","lsnr":1,"data":"QNobASaAAQABqv8="}]}'
)


def packets():
    lines = (ROOT / "firmware/link/tests/golden/packets.txt").read_text().splitlines()
    return [bytes.fromhex(line.split()[1]) for line in lines if not line.startswith("#")]


def field(name):
    return [path.read_bytes() for path in sorted((ROOT / "tests/field").glob(f"*/{name}"))]


def main(folder):
    frames = packets()
    seeds = {
        "mavlink_stream": frames + [b"".join(frames[at : at + 6]) for at in range(0, len(frames), 3)],
        "radio_frame": [b'{"id":1,"snr_db":2.5,"remaining":1000,"age_s":0.2}\n', SEMTECH],
        "model_blob": [(ROOT / "models/gleaner.gln").read_bytes()],
        "onnx_file": [(ROOT / "models/gleaner.onnx").read_bytes()],
        "mission_file": field("mission.toml") + [(ROOT / "firmware/companion/dist/mission.toml").read_bytes()],
        "mission_image": [],
        "city_file": field("city.csv"),
        "decision_log": (ROOT / "tests/data/decisions.jsonl").read_bytes().splitlines(keepends=True)[:3],
        "parameter_store": [],
    }
    for target, inputs in seeds.items():
        corpus = pathlib.Path(folder) / target
        corpus.mkdir(parents=True, exist_ok=True)
        for number, data in enumerate(inputs):
            (corpus / f"seed-{number}").write_bytes(data)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
