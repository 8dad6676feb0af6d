"""Reads Gleaner's component metadata over MAVLink FTP, first with pymavlink's client, then with MAVSDK's.

usage: metadata_station.py HOST:PORT

Prints one JSON object with both files; exits with 1 and a line on stderr at the first difference.
"""

import asyncio
import json
import os
import struct
import sys
import tempfile
import time
import zlib

from mavsdk import ComponentType, Configuration
from mavsdk.asyncio.mavsdk import Mavsdk
from mavsdk.asyncio.plugins.component_metadata import ComponentMetadataAsync
from mavsdk.plugins.component_metadata import ComponentMetadataError, MetadataType
from pymavlink.dialects.v20 import ardupilotmega as mav
from pymavlink.mavftp import MAVFTP, FtpError

from station import GLEANER, VEHICLE, PATIENCE_S, Station, expect

COMPONENT_METADATA = 397


def checksum(content):
    """CRC-32 as MAVLink FTP computes it: initial value 0, no final inversion."""
    return zlib.crc32(content, 0xFFFFFFFF) ^ 0xFFFFFFFF


def read(ftp, uri, crc):
    """The file at an mftp URI, after its checksum was compared."""
    scheme, path = uri.split("://")
    expect(scheme == "mftp", f"the URI is {uri}")
    got = []
    ftp.cmd_get([path], callback=lambda content: got.append(content.read() if content else b""))
    expect(ftp.process_ftp_reply("OpenFileRO", timeout=20).error_code == FtpError.Success, f"no {path}")
    expect(got and got[0], f"{path} is empty")
    expect(checksum(got[0]) == crc, f"the checksum of {path} is {checksum(got[0])}, not {crc}")
    return json.loads(got[0])


def answers(operation, path, wanted):
    """The answer to one operation. pymavlink may take a late answer to its own last request for it, so it is repeated."""
    for _ in range(5):
        code = operation([path]).error_code
        if code == wanted:
            return
    sys.exit(f"{operation.__name__} of {path} gave {code}, not {wanted}")


def named_file(station):
    """URI and checksum in COMPONENT_METADATA, which no dialect of pymavlink has yet: read from the frame."""
    expect(station.command(GLEANER, mav.MAV_CMD_REQUEST_MESSAGE, COMPONENT_METADATA) == 0, "no metadata")
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        message = station.receive()
        if message is not None and message.get_type() == f"UNKNOWN_{COMPONENT_METADATA}":
            frame = bytes(message.get_msgbuf() or message.data)
            # MAVLink 2 leaves out trailing zeros.
            payload = frame[10 : 10 + frame[1]].ljust(108, b"\0")
            _, crc, uri = struct.unpack("<II100s", payload)
            return uri.rstrip(b"\0").decode(), crc
    sys.exit(f"waited {PATIENCE_S} s for COMPONENT_METADATA")


def by_pymavlink(connection):
    station = Station(connection)
    station.wait("Gleaner's heartbeat", lambda m: m.get_type() == "HEARTBEAT")
    station.command(GLEANER, mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    version = station.wait("the capabilities", lambda m: m.get_type() == "AUTOPILOT_VERSION")
    expect(version.capabilities & mav.MAV_PROTOCOL_CAPABILITY_FTP, "no capability for MAVLink FTP")
    uri, crc = named_file(station)

    ftp = MAVFTP(station.link, VEHICLE, GLEANER)
    general = read(ftp, uri, crc)
    parameter = general["metadataTypes"][0]
    expect(parameter["type"] == 1, "the first type is not that of the parameters")
    parameters = read(ftp, parameter["uri"], parameter["fileCrc"])
    answers(ftp.cmd_rm, "gleaner/general.json", FtpError.FileProtected)
    answers(ftp.cmd_crc, "etc/passwd", FtpError.FileNotFound)
    answers(ftp.cmd_list, "/", FtpError.Success)
    station.link.close()
    return general, parameters


async def by_mavsdk(url):
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(url)
        system = await mavsdk.first_autopilot(timeout_s=PATIENCE_S)
        expect(system is not None, "no autopilot found")
        metadata = ComponentMetadataAsync(system)
        await metadata.request_component(GLEANER)
        for _ in range(PATIENCE_S * 2):
            try:
                found = await metadata.get_metadata(GLEANER, MetadataType.PARAMETER)
                return json.loads(found.json_metadata)
            except ComponentMetadataError:
                await asyncio.sleep(0.5)
        sys.exit("MAVSDK finds no parameter metadata")


def main(address):
    general, parameters = by_pymavlink(f"udpout:{address}")
    with tempfile.TemporaryDirectory() as home:
        # MAVSDK keeps files that it has read before in a cache there.
        os.environ["HOME"] = os.environ["XDG_CACHE_HOME"] = home
        again = asyncio.run(by_mavsdk(f"udpout://{address}"))
    expect(again == parameters, "MAVSDK and pymavlink read different files")
    print(json.dumps({"general": general, "parameters": parameters["parameters"]}))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
