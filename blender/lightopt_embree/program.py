"""The program lightopt-embree: where it is, its version, and a run of it in the background."""

import os
import shutil
import signal
import subprocess
import threading

NAME = "lightopt-embree"
# The versions that this add-on knows: the same up to the second dot.
VERSION = "0.1"
HERE = os.path.dirname(os.path.abspath(__file__))


def find(preferred=""):
    """Path of the program: as preferred, on PATH, or beside this add-on. Raises ValueError that says what to do."""
    if preferred:
        if os.path.isfile(preferred):
            return preferred
        raise ValueError(f"{preferred}: no such program; set its path in the add-on's preferences")
    found = shutil.which(NAME)
    if found:
        return found
    beside = os.path.join(HERE, "bin", NAME)
    if os.path.isfile(beside):
        if not os.access(beside, os.X_OK):  # An archive may lose the permission.
            os.chmod(beside, 0o755)
        return beside
    raise ValueError(f"{NAME} is not there: unpack its archive and set the program's path in the add-on's preferences")


def check(path):
    """The program's version. Raises ValueError, in one line, where it does not fit or does not start."""
    try:
        done = subprocess.run([path, "--version"], capture_output=True, text=True, timeout=30)
        version = done.stdout.split()[-1]
    except (OSError, IndexError, subprocess.TimeoutExpired) as error:
        raise ValueError(f"{path}: does not start ({error}); set another path in the add-on's preferences") from error
    if version.split(".")[:2] != VERSION.split("."):
        raise ValueError(f"{path}: version {version}; this add-on needs {VERSION}: install that of the same archive")
    return version


def offers(path, *words):
    """Whether the help of `run` has all these words."""
    done = subprocess.run([path, "run", "--help"], capture_output=True, text=True, timeout=30)
    return all(word in done.stdout for word in words)


def command(path, scene, run, look, free, locks=(), ratios=(), lamps=0, move=False, more=()):
    """The command line that finds the lights of a scene."""
    words = [path, "run", "--target", look, "--out", run, "--force", "--free", ",".join(free)]
    for lock in locks:
        words += ["--lock", lock]
    for ratio in ratios:
        words += ["--ratio", ratio]
    if lamps:
        words += ["--lamps", str(lamps)]
    if move:
        words.append("--move-lights")
    return [*words, *more, scene]


class Run:
    """The program at work. Its threads only read: what Blender shows is asked from Blender's own."""

    def __init__(self, words, log=None):
        self.lines, self.log = [], log
        flags = {"start_new_session": True} if os.name == "posix" else {}
        self.process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                        errors="replace", stdin=subprocess.DEVNULL, **flags)
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stderr:
            if line.strip():
                self.lines.append(line.strip())
            if self.log:
                with open(self.log, "a", encoding="utf-8") as out:
                    out.write(line)

    def says(self):
        """The last line of its progress."""
        return self.lines[-1] if self.lines else "starting"

    def is_done(self):
        return self.process.poll() is not None

    def status(self):
        """0 done, 130 cancelled with what was found kept, otherwise failed; None while it works."""
        return self.process.poll()

    def cancel(self):
        """Ends it in order: within two seconds, with what was found kept."""
        if not self.is_done():
            self.process.send_signal(signal.SIGINT)

    def wait(self, seconds=None):
        status = self.process.wait(seconds)
        self.reader.join(5)
        return status
