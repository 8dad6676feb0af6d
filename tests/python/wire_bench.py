"""Times pymavlink on a stream of packets.

usage: wire_bench.py STREAM

Contenders, see rounds.py: `read` (microseconds per packet of the stream) and `write` (per position target).
"""

import sys
import time

import pymavlink
import rounds
from pymavlink.dialects.v20 import ardupilotmega as mav

READ_BYTES = 512
WRITTEN = 2000


def read(stream):
    """Microseconds per packet of one reading."""
    link = mav.MAVLink(None, srcSystem=42, srcComponent=191)
    found = 0
    start = time.perf_counter()
    for at in range(0, len(stream), READ_BYTES):
        found += len(link.parse_buffer(stream[at : at + READ_BYTES]) or [])
    return (time.perf_counter() - start) * 1e6 / found


def write():
    """Microseconds per position target."""
    link = mav.MAVLink(None, srcSystem=42, srcComponent=191)
    start = time.perf_counter()
    for number in range(WRITTEN):
        target = mav.MAVLink_set_position_target_local_ned_message(
            number, 1, 1, 1, 0x0DF8, 1.0, 2.0, -60.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        )
        target.pack(link)
    return (time.perf_counter() - start) * 1e6 / WRITTEN


def main(path):
    with open(path, "rb") as file:
        stream = file.read()
    rounds.serve(f"pymavlink {pymavlink.__version__}", {"read": lambda: read(stream), "write": write})


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
