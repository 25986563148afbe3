"""What an `anchored_process` runs: it answers questions about one robot.

    python -m gravcomp.load_estimation.anchored_worker DESCRIPTOR < ROBOT

DESCRIPTOR: number of the inherited connection. ROBOT: the pickled robot and scene. The process ends when the other end of the
connection is closed, also by the death of its owner.
"""

import contextlib
import pickle
import signal
import socket
import sys
from typing import BinaryIO

from gravcomp.full_model.robot_model import RobotModel
from gravcomp.load_estimation.anchored_follower import AtOnce
from gravcomp.load_estimation.anchored_model import AnchoredModel
from gravcomp.load_estimation.message_pipe import framed


def serve(connection: socket.socket, described: BinaryIO) -> None:
    """Answer the questions that come over a connection, about the pickled robot and scene of a file, until it is closed."""
    robot, scene = pickle.load(described)
    model = AtOnce(AnchoredModel(RobotModel(robot), scene))
    generation = 0
    with contextlib.suppress(EOFError, OSError), connection.makefile("rb") as questions:
        connection.sendall(framed(None))
        while True:
            asked, question = pickle.load(questions)
            if asked != generation:
                model.reset()
                generation = asked
            (answer,) = model.exchange(question)
            connection.sendall(framed((asked, answer)))


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    serve(socket.socket(fileno=int(sys.argv[1])), sys.stdin.buffer)
