#!/bin/sh
# mavlink-server between autopilot, Gleaner and a ground station. Gleaner keeps `autopilot = "udpin:0.0.0.0:14540"`, without
# `ground`. By default mavlink-server is component 191 itself, as Gleaner is: two components with one id confuse every
# ground station, and Gleaner does not engage. So it becomes 192 here.
exec mavlink-server --mavlink-component-id 192 --web-server 127.0.0.1:8081 \
    serial:/dev/ttyAMA0:921600 \
    udpout:127.0.0.1:14540 \
    udpout:192.168.1.10:14550
