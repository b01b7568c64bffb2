"""Foxglove: strain with its band, live in the browser or the desktop application.

    pip install foxglove-sdk
    some-device | python foxglove_live.py sensor.toml

Lines `time_s,reading` come from stdin. In Foxglove open a connection to ws://localhost:8765 and plot /strain.strain, /strain.lower and
/strain.upper, the ends of the 95 % interval. PORT in the environment is another port.
"""

import os
import sys

import foxglove
import ohmstrain as oh

NUMBER = {"type": "number"}
SCHEMA = {"type": "object", "properties": {name: NUMBER for name in ("time_s", "reading", "strain", "lower", "upper")}}


def main(sensor_file):
    live = oh.Sensor.load(sensor_file).filter()
    server = foxglove.start_server(name="ohmstrain", port=int(os.environ.get("PORT", "8765")))
    channel = foxglove.Channel("/strain", schema=SCHEMA)
    print(f"waiting for readings; Foxglove finds them at ws://localhost:{server.port}", flush=True)
    for line in sys.stdin:
        try:
            time_s, _, reading = line.partition(",")
            row = live.step(float(time_s), float(reading) if reading.strip() else None)
        except ValueError as error:
            print(f"{line!r}: {error}", file=sys.stderr)
            continue
        strain, half = row["strain"], 1.96 * row["strain_sd"]
        known = {} if row["resistance_ohm"] is None else {"reading": row["resistance_ohm"]}
        channel.log({"time_s": row["time_s"], **known, "strain": strain, "lower": strain - half, "upper": strain + half})
    server.stop()


if __name__ == "__main__":
    main(*sys.argv[1:])
