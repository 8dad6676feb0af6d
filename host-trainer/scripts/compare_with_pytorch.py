"""Compares the time of one update with PyTorch's eager mode, on one core, and prints the ratio.

    python3 host-trainer/scripts/compare_with_pytorch.py [--python PYTHON_WITH_TORCH] [--rounds 5]

Rounds alternate, so that other load affects both equally. Times are CPU milliseconds per update of one thread, the
minimum of a round; the ratio is the median over the rounds, with its range. Needs cargo and a Python with torch.
"""

import argparse
import json
import os
import pathlib
import re
import statistics
import subprocess
import sys

HERE = pathlib.Path(__file__).parent
BUILD = ["cargo", "bench", "-p", "gleaner-host-trainer", "--bench", "update_ms", "--no-run", "--message-format=json"]


def build():
    """Builds the Rust side; returns the program's path."""
    out = subprocess.run(BUILD, cwd=HERE, check=True, stdout=subprocess.PIPE, text=True).stdout
    for line in out.splitlines():
        message = json.loads(line)
        if message.get("executable") and message["target"]["name"] == "update_ms":
            return message["executable"]
    sys.exit("gleaner: no program built: type: " + " ".join(BUILD))


def cpu_ms(command):
    one_thread = {**os.environ, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    out = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=one_thread).stdout.strip()
    print("  " + out)
    return float(re.search(r"cpu_ms ([0-9.]+)", out).group(1))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", default=sys.executable, help="a Python that has torch")
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    ours = [build()]
    torch = [arguments.python, str(HERE / "pytorch_update_bench.py"), "6"]
    # Both run on one core, the last of those that this process may use.
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    pairs = [(cpu_ms(ours), cpu_ms(torch)) for _ in range(arguments.rounds)]
    ratios = sorted(theirs / mine for mine, theirs in pairs)
    print(
        f"gleaner {min(mine for mine, _ in pairs):.1f} ms, PyTorch eager {min(theirs for _, theirs in pairs):.1f} ms:"
        f" {statistics.median(ratios):.2f} times as fast [{ratios[0]:.2f} .. {ratios[-1]:.2f}]"
    )


if __name__ == "__main__":
    main()
