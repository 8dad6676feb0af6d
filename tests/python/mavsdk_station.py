"""Drives MAVSDK as its users do: parameters and commands of component 191, engage, take-over with `hold`.

usage: mavsdk_station.py URL

URL is MAVSDK's, for example udpout://127.0.0.1:14550. Prints one JSON object with what was seen; exits with 1 and a line
on stderr at the first difference.
"""

import asyncio
import contextlib
import json
import sys

from mavsdk import ComponentType, Configuration
from mavsdk.asyncio.mavsdk import Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.plugins.mavlink_direct import MavlinkMessage
from mavsdk.plugins.param import ParamError, ProtocolVersion

AUTOPILOT = 1
GLEANER = 191
GUIDED = 4
DECISION = 40001
ACCEPTED = 0
DENIED = 2
ARM = 400
SET_MODE = 176
TAKE_OFF = 22
SET_INTERVAL = 511
LOCAL_POSITION = 32
SET_PREFERENCE = 31010
SET_ENABLE = 31011
# How long anything may take, wall time.
PATIENCE_S = 60


def expect(condition, what):
    if not condition:
        sys.exit(what)


class Pilot:
    """What Gleaner and the autopilot have sent so far."""

    def __init__(self, direct):
        self.direct = direct
        self.decisions = 0
        self.texts = []
        self.values = {}
        self.mode = None
        self.altitude_m = 0.0
        self.heard = set()

    async def listen(self):
        async for message in self.direct.subscribe_message(""):
            fields = json.loads(message.fields_json)
            self.heard.add(message.component_id)
            name = message.message_name
            if message.component_id == GLEANER:
                self.decisions += name == "TUNNEL" and fields["payload_type"] == DECISION
                if name == "STATUSTEXT":
                    self.texts.append(fields["text"])
                if name == "NAMED_VALUE_FLOAT":
                    self.values[fields["name"]] = fields["value"]
            elif message.component_id == AUTOPILOT:
                if name == "HEARTBEAT":
                    self.mode = fields["custom_mode"]
                if name == "LOCAL_POSITION_NED":
                    self.altitude_m = -fields["z"]

    async def until(self, what, wanted):
        for _ in range(PATIENCE_S * 20):
            if wanted():
                return
            await asyncio.sleep(0.05)
        sys.exit(f"waited {PATIENCE_S} s for {what}; Gleaner sent {self.texts[-5:]}")

    async def command(self, component, command, *parameters):
        fields = {"target_system": 1, "target_component": component, "command": command, "confirmation": 0}
        for index in range(7):
            fields[f"param{index + 1}"] = parameters[index] if index < len(parameters) else 0.0
        message = MavlinkMessage("COMMAND_LONG", 0, 0, 1, component, json.dumps(fields))
        answer = await self.direct.send_command(message)
        return json.loads(answer.fields_json)["result"]


async def take_off(pilot, altitude_m):
    expect(await pilot.command(AUTOPILOT, SET_MODE, 1, GUIDED) == ACCEPTED, "GUIDED was refused")
    # Arming fails until the estimator has a position.
    for _ in range(PATIENCE_S):
        if await pilot.command(AUTOPILOT, ARM, 1) == ACCEPTED:
            break
        await asyncio.sleep(0.5)
    result = await pilot.command(AUTOPILOT, TAKE_OFF, 0, 0, 0, 0, 0, 0, altitude_m)
    expect(result == ACCEPTED, f"take-off gave result {result}")
    await pilot.command(AUTOPILOT, SET_INTERVAL, LOCAL_POSITION, 100_000)
    await pilot.until("the altitude", lambda: pilot.altitude_m > altitude_m - 0.5)


async def set_preference(pilot, param):
    # MAVSDK 4.1 selects the component and raises UNKNOWN all the same.
    with contextlib.suppress(ParamError):
        await param.select_component(GLEANER, ProtocolVersion.V1)
    everything = await param.get_all_params()
    names = {one.name for one in everything.float_params}
    expect({"GLN_W_DATA", "GLN_ENABLE", "GLN_ALT", "GLN_SPEED"} <= names, f"parameters are {sorted(names)}")
    expect(not everything.int_params, "a parameter is not REAL32")
    await param.set_param_float("GLN_W_DATA", 0.75)
    value = await param.get_param_float("GLN_W_DATA")
    expect(value == 0.75, f"GLN_W_DATA is {value} after 0.75 was set")
    result = await pilot.command(GLEANER, SET_PREFERENCE, 2.0)
    expect(result == DENIED, f"a preference of 2 gave result {result}")
    return sorted(names)


async def fly(mavsdk, url):
    await mavsdk.add_any_connection(url)
    system = await mavsdk.first_autopilot(timeout_s=PATIENCE_S)
    expect(system is not None, "no autopilot found")
    pilot = Pilot(MavlinkDirectAsync(system))
    listening = asyncio.create_task(pilot.listen())
    await pilot.until("component 191", lambda: GLEANER in pilot.heard)
    names = await set_preference(pilot, ParamAsync(system))
    await take_off(pilot, 60)

    expect(await pilot.command(GLEANER, SET_ENABLE, 1) == ACCEPTED, "engage was refused")
    await pilot.until("two decisions", lambda: pilot.decisions >= 2)
    expect(await pilot.command(GLEANER, SET_PREFERENCE, 0.25) == ACCEPTED, "the preference was refused")
    await pilot.until("the preference", lambda: pilot.values.get("w_data") == 0.25)

    await ActionAsync(system).hold()
    await pilot.until("another mode", lambda: pilot.mode != GUIDED)
    await pilot.until("the take-over's text", lambda: any("passive" in text for text in pilot.texts))
    settled = pilot.decisions
    await asyncio.sleep(3)
    expect(pilot.decisions == settled, "Gleaner decided after the take-over")
    listening.cancel()
    print(json.dumps({"parameters": names, "decisions": pilot.decisions, "texts": pilot.texts}))


async def main(url):
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await fly(mavsdk, url)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    asyncio.run(main(sys.argv[1]))
