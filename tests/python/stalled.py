"""Stops the pilot's process for 3.5 s in flight, and judges what it does when it continues.

usage: stalled.py CONNECTION PID ardupilot|px4 taken|untouched

taken: the aircraft's pilot takes LOITER (PX4: HOLD) during the stall; nothing may move it out of that mode afterwards.
untouched, ArduPilot: the mode is still GUIDED; Gleaner asks for a return, after a fresh heartbeat.
untouched, PX4: it has left OFFBOARD by itself; nothing may bring it back.
"""

import json
import os
import signal
import sys
import time

from pymavlink.dialects.v20 import ardupilotmega as mav

from station import AUTOPILOT, GLEANER, HOLD, LOITER, OFFBOARD, RTL, Station
from station import enter_offboard, expect, set_px4_mode, take_off, take_off_px4

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


def hold(station, kind):
    """The aircraft's pilot takes a mode that holds the position; returns it."""
    if kind == "px4":
        result, mode = set_px4_mode(station, HOLD), HOLD
    else:
        result, mode = station.command(AUTOPILOT, mav.MAV_CMD_DO_SET_MODE, 1, LOITER), LOITER
    expect(result == mav.MAV_RESULT_ACCEPTED, f"mode {mode} gave result {result}")
    station.wait_for_mode(mode)
    return mode


def main(connection, pid, kind, case):
    station = Station(connection)
    station.wait("Gleaner's heartbeat", lambda m: m.get_type() == "HEARTBEAT")
    (take_off_px4 if kind == "px4" else take_off)(station, 60)
    expect(station.set_parameter("GLN_W_DATA", 1.0) == 1.0, "w = 1 was not accepted")
    engaged = station.command(GLEANER, mav.MAV_CMD_USER_2, 1)
    expect(engaged == mav.MAV_RESULT_ACCEPTED, f"engage gave result {engaged}")
    if kind == "px4":
        enter_offboard(station)
    station.wait_for_decisions(3)

    os.kill(pid, signal.SIGSTOP)
    begin = time.monotonic()
    try:
        if case == "taken":
            modes(station, TAKE_OVER_S)
            taken = hold(station, kind)
        modes(station, STALL_S - (time.monotonic() - begin))
    finally:
        os.kill(pid, signal.SIGCONT)

    decisions = station.decisions
    after = modes(station, WATCH_S)
    if case == "taken":
        expect(after == [taken], f"the pilot had mode {taken}; then the modes were {after}: {station.texts}")
        expect(station.decisions == decisions, "Gleaner decided after the stall")
    elif kind == "px4":
        expect(after and OFFBOARD not in after, f"modes {after} after the stall, texts {station.texts}")
        expect(station.decisions == decisions, "Gleaner decided after the stall")
    else:
        expect(after[-1] == RTL, f"no return after the stall: modes {after}, texts {station.texts}")
    station.wait("Gleaner's heartbeat after the stall", lambda m: m.get_type() == "HEARTBEAT")
    print(json.dumps({"kind": kind, "case": case, "modes": after, "texts": station.texts}))


if __name__ == "__main__":
    if len(sys.argv) != 5 or sys.argv[3] not in ("ardupilot", "px4") or sys.argv[4] not in ("taken", "untouched"):
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3], sys.argv[4])
