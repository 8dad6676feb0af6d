"""Takes off, engages Gleaner and waits for its decisions, so that the caller can measure `gleaner run` in flight.

usage: flight_bench.py CONNECTION DECISIONS

One contender, see rounds.py: `fly` waits for DECISIONS decisions; the time of a round is the wall time per decision.
"""

import sys

import rounds
from pymavlink.dialects.v20 import ardupilotmega as mav
from station import GLEANER, Station, expect, take_off

ALTITUDE_M = 60


def main(connection, decisions):
    station = Station(connection)
    station.wait("Gleaner's heartbeat", lambda m: m.get_type() == "HEARTBEAT")
    take_off(station, ALTITUDE_M)
    engaged = station.command(GLEANER, mav.MAV_CMD_USER_2, 1)
    expect(engaged == mav.MAV_RESULT_ACCEPTED, f"engage gave result {engaged}")
    station.wait_for_decisions(2)

    def fly():
        for _ in range(decisions):
            station.wait_for_decisions(1)

    def one_round():
        return rounds.timed(1, fly)() / decisions

    rounds.serve("engaged", {"fly": one_round})


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]))
