"""What the workers of all peers share: requests and answers, one JSON object a line.

Requests come on standard input. Answers go to what was standard output when the program started; whatever
libraries print goes to standard error instead.
"""

import json
import os
import resource
import sys
import time

# Answers have a file of their own, so that no library can write between them.
_ANSWERS = os.fdopen(os.dup(1), "w", buffering=1)
os.dup2(2, 1)


def restrict(threads):
    """Keeps this process, and the threads that it starts, to as many processors."""
    allowed = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, allowed[:threads])


def peak_memory():
    """Most memory that this process has had resident, bytes."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def timed(work):
    """The result of `work`, and the seconds of wall time that it took."""
    start = time.perf_counter()
    result = work()
    return result, time.perf_counter() - start


def answer(value):
    _ANSWERS.write(json.dumps(value) + "\n")
    _ANSWERS.flush()


def serve(operations):
    """Answers requests by the operation that they name, until standard input ends."""
    for line in sys.stdin:
        request = json.loads(line)
        try:
            reply = operations[request.pop("op")](**request)
        except Exception as error:  # Whatever it is, the other side should hear of it.
            words = " ".join(f"{type(error).__name__}: {error}".split())
            reply = {"error": words[:500]}
        answer({"peak_memory": peak_memory(), **reply})
    # Some libraries abort while the interpreter is torn down.
    _ANSWERS.flush()
    os._exit(0)
