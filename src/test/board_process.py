"""A board as a process of its own: its C code on a bus of this host in real time, until its input ends.

python board_process.py CHANNEL
"""

import select
import sys
import time

from board_bench import blob_of

from gravcomp.canbus.multicast import LoopbackMulticastBus
from gravcomp.firmware.host_board import HostBoard


def main(channel: str) -> None:
    """Serve a board with a model of four modes."""
    board, begin = HostBoard(model=blob_of()), time.monotonic()
    with LoopbackMulticastBus(channel) as bus:
        print("ready", flush=True)
        while not select.select([sys.stdin], [], [], 0.0)[0]:
            message = bus.recv(0.001)
            while message is not None:
                board.receive(message)
                message = bus.recv(0.0)
            board.advance(int(1e6 * (time.monotonic() - begin)))
            for frame in board.sent():
                bus.send(frame)


if __name__ == "__main__":
    main(sys.argv[1])
