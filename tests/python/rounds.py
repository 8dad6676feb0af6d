"""Timed rounds on request, so that a peer runs in turns with Gleaner.

A program of Rust writes one line for each round: the name of a contender. The answer is one line: microseconds per call.
"""

import sys
import time


def timed(calls, call):
    """A contender: `calls` calls per round."""

    def one_round():
        start = time.perf_counter()
        for _ in range(calls):
            call()
        return (time.perf_counter() - start) * 1e6 / calls

    return one_round


def serve(about, contenders):
    """Prints a line about the peer, then answers until standard input ends."""
    print(about, flush=True)
    for line in sys.stdin:
        print(contenders[line.strip()](), flush=True)
