"""Stops the pilot's process for 3.5 s in flight, and judges what it does when it continues.

usage: stalled.py CONNECTION PID taken|untouched

taken: the aircraft's pilot takes LOITER during the stall; nothing may move it out of that mode afterwards.
untouched: the mode is still GUIDED; Gleaner asks for a return, after a fresh heartbeat.
"""

import json
import os
import signal
import sys
import time

from pymavlink.dialects.v20 import ardupilotmega as mav

from station import AUTOPILOT, GLEANER, LOITER, RTL, Station, expect, take_off

STALL_S = 3.5
# The take-over comes late in the stall, so that its heartbeat is behind seconds of older messages.
TAKE_OVER_S = 3.0
# How long the aircraft is watched after the stall, wall time.
WATCH_S = 12


def modes(station, seconds):
    """The modes that the autopilot's heartbeats show, for so long."""
    seen = []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        message = station.receive()
        if message is not None and message.get_srcComponent() == AUTOPILOT and message.get_type() == "HEARTBEAT":
            if not seen or seen[-1] != message.custom_mode:
                seen.append(message.custom_mode)
    return seen


def main(connection, pid, case):
    station = Station(connection)
    station.wait("Gleaner's heartbeat", lambda m: m.get_type() == "HEARTBEAT")
    take_off(station, 60)
    expect(station.set_parameter("GLN_W_DATA", 1.0) == 1.0, "w = 1 was not accepted")
    engaged = station.command(GLEANER, mav.MAV_CMD_USER_2, 1)
    expect(engaged == mav.MAV_RESULT_ACCEPTED, f"engage gave result {engaged}")
    station.wait_for_decisions(3)

    os.kill(pid, signal.SIGSTOP)
    begin = time.monotonic()
    try:
        if case == "taken":
            modes(station, TAKE_OVER_S)
            result = station.command(AUTOPILOT, mav.MAV_CMD_DO_SET_MODE, 1, LOITER)
            expect(result == mav.MAV_RESULT_ACCEPTED, f"LOITER gave result {result}")
            station.wait_for_mode(LOITER)
        modes(station, STALL_S - (time.monotonic() - begin))
    finally:
        os.kill(pid, signal.SIGCONT)

    decisions = station.decisions
    after = modes(station, WATCH_S)
    if case == "taken":
        expect(after == [LOITER], f"the pilot had LOITER; after the stall the modes were {after}: {station.texts}")
        expect(station.decisions == decisions, "Gleaner decided after the stall")
    else:
        expect(after[-1] == RTL, f"no return after the stall: modes {after}, texts {station.texts}")
    station.wait("Gleaner's heartbeat after the stall", lambda m: m.get_type() == "HEARTBEAT")
    print(json.dumps({"case": case, "modes": after, "texts": station.texts}))


if __name__ == "__main__":
    if len(sys.argv) != 4 or sys.argv[3] not in ("taken", "untouched"):
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3])
