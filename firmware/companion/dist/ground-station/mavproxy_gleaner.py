"""MAVProxy module: command Gleaner, the pilot on a companion computer (component 191).

Copy this file into a folder of the Python path and type `module load mavproxy_gleaner` (in MAVProxy's own folder `modules`:
`module load gleaner`), then one of

    gleaner engage | off | shadow | return
    gleaner w 0.25          the preference: weight of data, 0 to 1
    gleaner status          the values that Gleaner has reported last

Before MAVProxy sends a command of its own, `gleaner component N` selects another component id.
"""

from MAVProxy.modules.lib import mp_module
from pymavlink import mavutil

SET_PREFERENCE, ENABLE, RETURN = 31010, 31011, 31012  # MAV_CMD_USER_1 to _3
REQUESTS = {"off": 0, "engage": 1, "shadow": 2}
VALUES = ("w_data", "collected", "spare_bat", "infer_us", "attn_dev", "unit_pct", "land_pct", "snr_off")


class Gleaner(mp_module.MPModule):
    """The command `gleaner`."""

    def __init__(self, mpstate):
        super().__init__(mpstate, "gleaner", "Gleaner: gathers data from ground sensors")
        self.component = 191
        self.values = {}
        self.add_command("gleaner", self.command, "command Gleaner", ["engage", "off", "shadow", "return", "w", "status", "component"])

    def command(self, words):
        """Runs one command line."""
        word = words[0] if words else ""
        if word in REQUESTS and len(words) == 1:
            self.send(ENABLE, REQUESTS[word])
        elif word == "return" and len(words) == 1:
            self.send(RETURN)
        elif word == "w" and len(words) == 2:
            self.set_preference(words[1])
        elif word == "component" and len(words) == 2 and words[1].isdigit():
            self.component = int(words[1])
        elif word == "status" and len(words) == 1:
            for name in VALUES:
                print(f"{name:10} {self.values.get(name, '-')}")
        else:
            print("usage: gleaner engage|off|shadow|return|w WEIGHT|status|component ID")

    def set_preference(self, text):
        """Sends the weight of data, if it is one."""
        try:
            weight = float(text)
        except ValueError:
            weight = -1.0
        if 0.0 <= weight <= 1.0:
            self.send(SET_PREFERENCE, weight)
        else:
            print(f"gleaner: {text} is not a weight from 0 to 1")

    def send(self, command, param1=0.0):
        """Sends a COMMAND_LONG to Gleaner."""
        self.master.mav.command_long_send(self.target_system, self.component, command, 0, param1, 0, 0, 0, 0, 0, 0)

    def mavlink_packet(self, message):
        """Notes Gleaner's values and prints its answers."""
        if message.get_srcComponent() != self.component:
            return
        if message.get_type() == "NAMED_VALUE_FLOAT":
            self.values[message.name] = message.value
        elif message.get_type() == "COMMAND_ACK" and SET_PREFERENCE <= message.command <= RETURN:
            result = mavutil.mavlink.enums["MAV_RESULT"][message.result].name
            print(f"gleaner: {result}")


def init(mpstate):
    """Called by MAVProxy."""
    return Gleaner(mpstate)
