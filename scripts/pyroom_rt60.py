#!/usr/bin/env python3
"""Decay times of shoe boxes and of two coupled rooms, by ray tracing.

    python3 scripts/pyroom_rt60.py > crates/enfilade-bench/peers/pyroom-rt60.csv

Needs `pyroomacoustics`. Walls scatter half of what they reflect, as in furnished rooms; air absorbs nothing. The time is that of a
decay by 30 dB, doubled, from the backward integral of the energy that rays bring, the mean of four places in a room. Each line has
the size of one room or of two side by side, the area of the opening between them from floor to ceiling (0 for one room), the
absorption of all walls, and the times heard in each room from a source in the first.
"""

import sys

import numpy as np
import pyroomacoustics as pra

BOXES = [(6.0, 5.0, 3.0), (10.0, 8.0, 4.0), (4.0, 3.5, 2.5)]
# Widths of two rooms along x, their depth and height, which is the third coordinate here.
COUPLED = [(6.0, 4.0, 5.0, 3.0), (5.0, 8.0, 6.0, 3.0)]
GAP, THICK = 0.5, 0.2
ABSORPTIONS = [0.03, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5]
N_RAYS = 10000
BIN = 0.004
PLACES = [(0.7, 0.35, 0.6), (0.3, 0.7, 0.4), (0.6, 0.7, 0.5), (0.45, 0.25, 0.35)]


def time_of(energy):
    """Twice the time from −5 to −35 dB of the backward integral (Schroeder 1965), by a straight line."""
    left = np.cumsum(energy[::-1])[::-1]
    level = 10 * np.log10(np.maximum(left / left[0], 1e-30))
    first, last = np.argmax(level < -5), np.argmax(level < -35)
    return -60 / np.polyfit(np.arange(first, last) * BIN, level[first:last], 1)[0]


def traced(room, source, ears):
    """The mean time at some places."""
    room.set_ray_tracing(n_rays=N_RAYS, receiver_radius=0.4, hist_bin_size=BIN)
    room.add_source(source)
    for at in ears:
        room.add_microphone(at)
    room.image_source_model()
    room.ray_tracing()
    return [time_of(np.asarray(room.rt_histograms[k][0][0]).sum(0)) for k in range(len(ears))]


def main():
    np.random.seed(1)
    print("x,x of the second,z,height,opening,absorption,time,time in the second")
    for absorption in ABSORPTIONS:
        walls = pra.Material(absorption, 0.5)
        for x, z, height in BOXES:
            room = pra.ShoeBox([x, z, height], materials=walls, max_order=0, ray_tracing=True)
            ears = [[u * x, v * z, w * height] for u, v, w in PLACES]
            time = np.mean(traced(room, [0.25 * x, 0.3 * z, 0.5 * height], ears))
            print(f"{x},0,{z},{height},0,{absorption},{time:.4f},0", flush=True)
        for x, second, z, height in COUPLED:
            low, high = 0.5 * z - 0.5 * GAP, 0.5 * z + 0.5 * GAP
            behind = x + THICK
            corners = [
                (0, 0), (x, 0), (x, low), (behind, low), (behind, 0), (behind + second, 0),
                (behind + second, z), (behind, z), (behind, high), (x, high), (x, z), (0, z),
            ]
            room = pra.Room.from_corners(np.array(corners).T, materials=walls, max_order=0, ray_tracing=True)
            room.extrude(height, materials=walls)
            ears = [[u * x, v * z, w * height] for u, v, w in PLACES]
            ears += [[behind + u * second, v * z, w * height] for u, v, w in PLACES]
            times = traced(room, [0.25 * x, 0.3 * z, 0.5 * height], ears)
            times = [np.mean(times[:4]), np.mean(times[4:])]
            line = [x, second, z, height, GAP * height, absorption, *(f"{t:.4f}" for t in times)]
            print(",".join(map(str, line)), flush=True)
        print(absorption, file=sys.stderr)


if __name__ == "__main__":
    main()
