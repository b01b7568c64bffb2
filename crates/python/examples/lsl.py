"""Lab Streaming Layer: a stream of readings in, a stream of strain out.

    pip install pylsl
    python lsl.py sensor.toml resistance strain

The first channel of the stream `resistance` is read; `strain` has two channels, the strain and its standard deviation, each with the
stamp of its reading. On Linux, where this is tested, the wheel of pylsl brings liblsl with it.
"""

import sys

import ohmstrain as oh
import pylsl


def main(sensor_file, name_in, name_out):
    live = oh.Sensor.load(sensor_file).filter()
    print(f"looking for the stream {name_in}", flush=True)
    [found, *_] = pylsl.resolve_byprop("name", name_in)
    inlet = pylsl.StreamInlet(found, processing_flags=pylsl.proc_clocksync | pylsl.proc_monotonize)

    about = pylsl.StreamInfo(name_out, "strain", 2, found.nominal_srate(), pylsl.cf_double64, f"ohmstrain-{name_out}")
    channels = about.desc().append_child("channels")
    for label in ("strain", "strain_sd"):
        channels.append_child("channel").append_child_value("label", label)
    outlet = pylsl.StreamOutlet(about)

    begin = None
    while True:
        sample, stamp = inlet.pull_sample()
        begin = stamp if begin is None else begin
        row = live.step(stamp - begin, sample[0])
        outlet.push_sample([row["strain"], row["strain_sd"]], stamp)


if __name__ == "__main__":
    main(*sys.argv[1:])
