"""Runs programs and keeps every figure that was taken."""

import json
import os
import shutil
import statistics
import subprocess
import sys
import time


class Command:
    """A program and its arguments; what it writes is removed before each run, so that no run pays for freeing it."""

    def __init__(self, name, *args, out=None, ok=(0,)):
        self.name = name
        self.args = [str(a) for a in args]
        self.out = out
        self.ok = ok

    def __str__(self):
        return " ".join([self.name, *self.args])


def median(values):
    return statistics.median(values)


class Bench:
    """Where programs and files are, how often is measured, and the figures so far. `work` is the current directory."""

    def __init__(self, root, build, work, runs, sizes):
        self.root = root
        self.bin = os.path.join(build, "bin")
        self.work = work
        self.runs = runs
        self.sizes = sizes  # of "S", "M", "L" those that are measured
        self.raw = {}
        self.start = time.monotonic()

    def path(self, name):
        return os.path.join(self.work, name)

    def size(self, name):
        return os.path.getsize(self.path(name))

    def exists(self, name):
        return os.path.exists(self.path(name))

    def program(self, name):
        """Path of one of our programs, or of the system's; None where there is none."""
        ours = os.path.join(self.bin, name)
        return ours if os.access(ours, os.X_OK) else shutil.which(name)

    def has(self, *names):
        return all(self.program(name) for name in names)

    def say(self, text):
        print(f"[{time.monotonic() - self.start:6.0f} s] {text}", file=sys.stderr, flush=True)

    def remove(self, command):
        if command.out and self.exists(command.out):
            os.remove(self.path(command.out))

    def run(self, command):
        """Runs it and returns what it prints."""
        self.remove(command)
        done = subprocess.run([self.program(command.name), *command.args], capture_output=True, text=True)
        self._check(command, done.returncode, done.stderr)
        return done.stdout

    def once(self, command):
        """Wall seconds of the whole process, from before it is there until it is gone."""
        self.remove(command)
        argv = [self.program(command.name), *command.args]
        errors = self.path("stderr.txt")
        quiet = [(os.POSIX_SPAWN_OPEN, 1, "/dev/null", os.O_WRONLY, 0),
                 (os.POSIX_SPAWN_OPEN, 2, errors, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)]
        start = time.perf_counter()
        _, status = os.waitpid(os.posix_spawn(argv[0], argv, os.environ, file_actions=quiet), 0)
        seconds = time.perf_counter() - start
        with open(errors, encoding="utf-8", errors="replace") as file:
            self._check(command, os.waitstatus_to_exitcode(status), file.read())
        return seconds

    def memory(self, command):
        """Peak memory in MiB, through GNU time: a child of this program would count its memory as its own."""
        self.remove(command)
        figures = self.path("figures.txt")
        argv = ["/usr/bin/time", "-f", "%M", "-o", figures, self.program(command.name), *command.args]
        done = subprocess.run(argv, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self._check(command, done.returncode, done.stderr)
        with open(figures, encoding="utf-8") as file:
            mib = int(file.read().split()[-1]) / 1024
        self.raw.setdefault(f"memory: {command}", []).append(mib)
        return mib

    def in_turn(self, *commands, runs=None, warm=True):
        """For each command the seconds of its runs, taken in turn (A B A B ...)."""
        runs = runs or self.runs
        for command in commands:
            self.say(f"{command}")
            if warm:
                self.once(command)
        rounds = [[self.once(command) for command in commands] for _ in range(runs)]
        columns = [list(column) for column in zip(*rounds)]
        for command, seconds in zip(commands, columns):
            self.raw.setdefault(str(command), []).extend(seconds)
        return columns

    def timings(self, command):
        """Lines "NAME SECONDS SECONDS ..." of a program that times itself."""
        self.say(f"{command}")
        lines = [line.split() for line in self.run(command).splitlines()]
        taken = {words[0]: [float(w) for w in words[1:]] for words in lines if len(words) > 1}
        for name, seconds in taken.items():
            self.raw.setdefault(f"{command}: {name}", []).extend(seconds)
        return taken

    def save(self, page_figures):
        with open(self.path("figures.json"), "w", encoding="utf-8") as out:
            json.dump({"seconds": self.raw, "rows": page_figures}, out, indent=1)

    @staticmethod
    def _check(command, code, errors):
        if code not in command.ok:
            raise RuntimeError(f"{command}: exit {code}\n{errors[-2000:]}")
