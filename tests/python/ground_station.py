"""Engages Gleaner, changes its preference in flight, takes over: what an operator does with a ground station.

usage: ground_station.py CONNECTION

CONNECTION is pymavlink's, for example udpout:127.0.0.1:14550. Prints one JSON object with what was seen; exits with 1
and a line on stderr at the first difference from the MAVLink contract.
"""

import json
import math
import sys

from pymavlink.dialects.v20 import ardupilotmega as mav

from station import AUTOPILOT, GLEANER, GUIDED, LOITER, VEHICLE, Station, expect, named_value, take_off

PARAMETERS = {
    "GLN_W_DATA", "GLN_ENABLE", "GLN_ALT", "GLN_SPEED", "GLN_RESERVE", "GLN_BAT_UNITS", "GLN_ARRIVE_R",
    "GLN_SNR_AGE", "GLN_W_RC", "GLN_LOOKAHEAD", "GLN_MODEL",
}


def read_parameters(station):
    station.link.mav.param_request_list_send(VEHICLE, GLEANER)
    values = {}

    def collect(message):
        if message.get_type() == "PARAM_VALUE":
            expect(message.param_type == mav.MAV_PARAM_TYPE_REAL32, f"{message.param_id} is not REAL32")
            values[message.param_id] = message.param_value
            return len(values) == message.param_count
        return False

    station.wait("all parameters", collect)
    expect(set(values) >= PARAMETERS, f"parameters are {sorted(values)}")
    return values


def refuse_bad_values(station):
    before = station.set_parameter("GLN_W_DATA", 0.75)
    expect(before == 0.75, f"GLN_W_DATA 0.75 came back as {before}")
    for bad in (math.nan, -1.0, 2.0):
        said = len(station.texts)
        after = station.set_parameter("GLN_W_DATA", bad)
        expect(after == before, f"GLN_W_DATA {bad} was answered with {after}, not with the old {before}")
        station.wait(f"a text that refuses {bad}", lambda m: len(station.texts) > said)
        result = station.command(GLEANER, mav.MAV_CMD_USER_1, bad)
        expect(result == mav.MAV_RESULT_DENIED, f"MAV_CMD_USER_1 with {bad} gave result {result}")
    echo = station.set_parameter("GLN_W_DATA", before)
    expect(echo == before, "a refused value changed something")


def main(connection):
    station = Station(connection)
    beat = station.wait("Gleaner's heartbeat", lambda m: m.get_type() == "HEARTBEAT")
    expect(beat.type == mav.MAV_TYPE_ONBOARD_CONTROLLER, f"type is {beat.type}")
    expect(beat.autopilot == mav.MAV_AUTOPILOT_INVALID, f"autopilot is {beat.autopilot}")
    expect(beat.get_srcSystem() == VEHICLE, "Gleaner did not take over the vehicle's system id")

    values = read_parameters(station)
    refuse_bad_values(station)
    take_off(station, values["GLN_ALT"])

    expect(station.set_parameter("GLN_W_DATA", 1.0) == 1.0, "w = 1 was not accepted")
    engaged = station.command(GLEANER, mav.MAV_CMD_USER_2, 1)
    expect(engaged == mav.MAV_RESULT_ACCEPTED, f"engage gave result {engaged}")
    station.wait_for_decisions(10)

    switched = station.command(GLEANER, mav.MAV_CMD_USER_1, 0.0)
    expect(switched == mav.MAV_RESULT_ACCEPTED, f"preference by command gave result {switched}")
    station.wait("the telemetry of w = 0", named_value("w_data", 0.0))
    station.wait_for_decisions(6)

    expect(station.set_parameter("GLN_W_DATA", 0.25) == 0.25, "w = 0.25 was not accepted in flight")
    station.wait("the telemetry of w = 0.25", named_value("w_data", 0.25))
    station.wait_for_decisions(2)
    before_takeover = station.decisions

    # The aircraft's pilot takes over, then selects GUIDED again without a request to Gleaner.
    result = station.command(AUTOPILOT, mav.MAV_CMD_DO_SET_MODE, 1, LOITER)
    expect(result == mav.MAV_RESULT_ACCEPTED, "LOITER was refused")
    station.wait_for_mode(LOITER)
    beats = 0

    def three_beats(message):
        nonlocal beats
        beats += message.get_type() == "HEARTBEAT"
        return beats >= 3

    station.wait("Gleaner's heartbeats after the take-over", three_beats)
    settled = station.decisions
    result = station.command(AUTOPILOT, mav.MAV_CMD_DO_SET_MODE, 1, GUIDED)
    expect(result == mav.MAV_RESULT_ACCEPTED, "GUIDED was refused")
    station.wait_for_mode(GUIDED)
    beats = 0
    station.wait("Gleaner's heartbeats after GUIDED came back", three_beats)
    expect(station.decisions == settled, "Gleaner decided after the pilot had taken over")
    expect(settled <= before_takeover + 1, "Gleaner went on after the take-over")

    print(json.dumps({"parameters": values, "decisions": station.decisions, "texts": station.texts}))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
