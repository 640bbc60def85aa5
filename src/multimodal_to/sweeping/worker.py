"""A process that makes plans: it reads orders from its standard input and answers on its standard output, JSON lines.

It ends when its input does, which closes with the process that drives the sweep, however that ends.
"""

from __future__ import annotations

import ctypes
import json
import os
import queue
import signal
import sys
import threading
from typing import IO

from multimodal_to.errors import OutputError
from multimodal_to.sweeping.plan import Order, perform

READY = "ready"
"""What a worker says first, when it has loaded what takes time."""
_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG


def main() -> None:
    """Work until there are no orders left."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the driver, and that ends this
    if sys.platform == "linux":  # also in the middle of compiled code, where no thread of Python runs
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # whatever compiled code prints
    orders: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_read, args=(sys.stdin, orders), daemon=True).start()
    _say(answers, {READY: os.getpid()})
    while True:
        try:
            _say(answers, {"row": perform(Order.of_plain(json.loads(orders.get())))})
        except OutputError as error:
            _say(answers, {"unwritten": str(error)})


def _read(stream: IO[str], orders: queue.Queue[str]) -> None:
    for line in stream:
        orders.put(line)
    os._exit(0)


def _say(stream: IO[str], answer: object) -> None:
    stream.write(json.dumps(answer) + "\n")
    stream.flush()


if __name__ == "__main__":
    main()
