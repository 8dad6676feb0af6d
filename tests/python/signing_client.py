"""A ground station made of pymavlink that signs: its commands count, replayed, unsigned and wrongly signed ones do not.

usage: signing_client.py CONNECTION PASSPHRASE

CONNECTION is pymavlink's, for example udpout:127.0.0.1:14550. Exits with 1 and a line on stderr at the first thing
that is not as the MAVLink guide says.
"""

import hashlib
import os
import sys
import time

# Read by pymavlink when it is imported: a station that signs speaks MAVLink 2 from its first frame.
os.environ["MAVLINK20"] = "1"

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mav

VEHICLE = 1
GLEANER = 191
PATIENCE_S = 20


def connect(connection, key):
    link = mavutil.mavlink_connection(connection, source_system=255, source_component=190)
    if key is not None:
        link.setup_signing(key, sign_outgoing=True)
    return link


def preference(link, weight):
    """The bytes of MAV_CMD_USER_1, signed if the link signs."""
    command = link.mav.command_long_encode(VEHICLE, GLEANER, mav.MAV_CMD_USER_1, 0, weight, 0, 0, 0, 0, 0, 0)
    return command.pack(link.mav)


def acknowledgement(link, patience_s):
    """The result of the next acknowledgement, or None."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        message = link.recv_match(blocking=True, timeout=0.1)
        if message is not None and message.get_type() == "COMMAND_ACK":
            return message.result
    return None


def heartbeat(link):
    """Waits for Gleaner's heartbeat. pymavlink drops frames whose signature is wrong or missing."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        link.mav.heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)
        message = link.recv_match(type="HEARTBEAT", blocking=True, timeout=0.2)
        if message is not None and message.get_srcComponent() == GLEANER:
            return message
    sys.exit("no signed heartbeat of Gleaner")


def main(connection, passphrase):
    key = hashlib.sha256(passphrase.encode()).digest()
    station = connect(connection, key)
    if not heartbeat(station).get_signed():
        sys.exit("the heartbeat is not signed")
    command = preference(station, 0.25)
    station.write(command)
    result = acknowledgement(station, PATIENCE_S)
    if result != mav.MAV_RESULT_ACCEPTED:
        sys.exit(f"a signed command gave result {result}")
    for what, bytes_sent in [
        ("replayed", command),
        ("unsigned", preference(connect(connection, None), 0.5)),
        ("wrongly signed", preference(connect(connection, hashlib.sha256(b"another").digest()), 0.75)),
    ]:
        station.write(bytes_sent)
        result = acknowledgement(station, 0.5)
        if result is not None:
            sys.exit(f"a {what} command was answered with {result}")
    station.write(preference(station, 1.0))
    if acknowledgement(station, PATIENCE_S) != mav.MAV_RESULT_ACCEPTED:
        sys.exit("a signed command after the others was not accepted")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
