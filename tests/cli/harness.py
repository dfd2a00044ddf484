"""Runs the program as a person would and checks exit code, output and what lies on the disk. See cases.py."""

import fnmatch
import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(SOURCE, "scenes"))

CASES = {}
PROGRAM = None  # set by main()


class Failed(Exception):
    """What a case expected and did not get."""


def case(function):
    """Registers a function as a test case; it runs in an empty folder of its own."""
    CASES[function.__name__] = function
    return function


def expect(condition, message):
    if not condition:
        raise Failed(message)


def restore_interrupt():
    # Test runners started in the background ignore SIGINT, and children inherit that.
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start(*arguments, **keywords):
    environment = dict(os.environ, LC_ALL="C")
    return subprocess.Popen([PROGRAM, *arguments], env=environment, stdin=subprocess.DEVNULL,
                            preexec_fn=restore_interrupt, **keywords)


class Result:
    def __init__(self, code, out, err):
        self.code, self.out, self.err = code, out, err

    def errors(self):
        """Lines of stderr that are neither warnings nor notes nor progress."""
        return [line for line in self.err.splitlines() if not re.match(r"luxel: (warning|note): |luxel: \w+ \d+ %", line)]


def luxel(*arguments, code=0, out=None, err=None, timeout=120):
    """Runs `luxel ARGUMENTS`. `out` and `err` are globs for the whole of stdout and stderr (None: anything)."""
    process = start(*arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        stdout, stderr = (stream.decode("utf-8", "replace") for stream in process.communicate(timeout=timeout))
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise Failed("luxel %s: not done after %d s" % (" ".join(arguments), timeout))
    told = "luxel %s\n-- stdout\n%s-- stderr\n%s" % (" ".join(arguments), stdout, stderr)
    expect(process.returncode == code, "exit code %d instead of %d: %s" % (process.returncode, code, told))
    expect(out is None or fnmatch.fnmatchcase(stdout, out), "stdout does not match '%s': %s" % (out, told))
    expect(err is None or fnmatch.fnmatchcase(stderr, err), "stderr does not match '%s': %s" % (err, told))
    return Result(process.returncode, stdout, stderr)


def refused(*arguments, code, says):
    """The command fails with one line that holds each glob of `says`, and prints nothing else."""
    result = luxel(*arguments, code=code, out="")
    lines = result.errors()
    expect(len(lines) == 1, "%d lines instead of one on stderr: %s" % (len(lines), result.err))
    expect(lines[0].startswith("luxel"), "not in the form 'luxel…: …': %s" % lines[0])
    for glob in says:
        expect(fnmatch.fnmatchcase(lines[0], "*%s*" % glob), "no '%s' in: %s" % (glob, lines[0]))
    return lines[0]


def tree(folder):
    """Every file below a folder with a hash of its content."""
    found = {}
    for path, _, files in os.walk(folder):
        for name in files:
            full = os.path.join(path, name)
            with open(full, "rb") as file:
                found[os.path.relpath(full, folder)] = hashlib.sha256(file.read()).hexdigest()
    return found


def write(path, data):
    with open(path, "wb") as file:
        file.write(data if isinstance(data, bytes) else data.encode())
    return path


def read(path):
    with open(path, "rb") as file:
        return file.read()


def sanitized():
    """Is the program built with a sanitizer?"""
    return b"__asan_init" in read(PROGRAM) or b"__tsan_init" in read(PROGRAM)


def main():
    global PROGRAM
    if sys.argv[1:] == ["--list"]:
        print("\n".join(CASES))
        return 0
    if len(sys.argv) < 2:
        print("usage: cases.py --list | cases.py LUXEL [CASE...]", file=sys.stderr)
        return 2
    PROGRAM = os.path.abspath(sys.argv[1])
    failures = 0
    for name in sys.argv[2:] or CASES:
        folder = tempfile.mkdtemp(prefix="luxel-cli-")
        os.chdir(folder)
        try:
            CASES[name]()
            print("%s: passed" % name)
        except Failed as failure:
            failures += 1
            print("%s: FAILED: %s" % (name, failure))
        finally:
            os.chdir(SOURCE)
            shutil.rmtree(folder, ignore_errors=True)
    return 1 if failures else 0
