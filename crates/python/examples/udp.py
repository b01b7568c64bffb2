"""UDP: lines of time and reading in, lines of strain out. Needs nothing but ohmstrain.

    python udp.py sensor.toml 9000 127.0.0.1:9001

A datagram holds one or more lines `time_s,reading`; each is answered by a datagram `time_s,strain,strain_sd`. Try it without a device:
`echo 0.0,1600 | nc -u -w1 127.0.0.1 9000` while `nc -ul 9001` prints.
"""

import socket
import sys

import ohmstrain as oh


def main(sensor_file, port, out):
    live = oh.Sensor.load(sensor_file).filter()
    host, out_port = out.rsplit(":", 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("0.0.0.0", int(port)))
        print(f"waiting for readings at UDP port {port}", flush=True)
        while True:
            for line in udp.recv(65536).decode(errors="replace").splitlines():
                try:
                    time_s, _, reading = line.partition(",")
                    row = live.step(float(time_s), float(reading) if reading.strip() else None)
                except ValueError as error:  # No numbers, or a datagram that has overtaken another.
                    print(f"{line!r}: {error}", file=sys.stderr)
                    continue
                answer = f"{row['time_s']!r},{row['strain']!r},{row['strain_sd']!r}\n"
                udp.sendto(answer.encode(), (host, int(out_port)))


if __name__ == "__main__":
    main(*sys.argv[1:])
