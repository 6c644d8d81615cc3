"""A pseudo-terminal for a program: HOW PROGRAM ARGS...; exit code 0 if it takes the terminal and gives it back."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time

PATIENCE_S = 40
SGR_COLOUR = re.compile(rb"\x1b\[[0-9;]*3[0-9](;[0-9;]*)?m")


def set_size(fd, columns, rows):
    fcntl.ioctl(fd, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))


class Terminal:
    def __init__(self, command, env=None, stdin_too=True):
        self.master, self.slave = pty.openpty()
        set_size(self.slave, 80, 24)
        self.before = termios.tcgetattr(self.slave)
        # Its own session, with this as its terminal, as from a login.
        self.child = subprocess.Popen(
            command,
            stdin=self.slave if stdin_too else subprocess.DEVNULL,
            stdout=self.slave,
            stderr=self.slave,
            env={**os.environ, "TERM": "xterm-256color", "LANG": "C.UTF-8", **(env or {})},
            start_new_session=True,
        )
        self.shown = b""

    def read(self, seconds):
        ready, _, _ = select.select([self.master], [], [], seconds)
        if ready:
            try:
                self.shown += os.read(self.master, 1 << 16)
            except OSError:
                pass

    def wait_for(self, what, after=0):
        deadline = time.monotonic() + PATIENCE_S
        while what not in self.shown[after:]:
            assert time.monotonic() < deadline, f"{what!r} did not come: {self.shown[-2000:]!r}"
            assert self.child.poll() is None, f"it ended: {self.shown[-2000:]!r}"
            self.read(0.1)

    def end(self, code):
        deadline = time.monotonic() + PATIENCE_S
        while self.child.poll() is None:
            assert time.monotonic() < deadline, "it does not end"
            self.read(0.05)
        for _ in range(3):
            self.read(0.05)
        assert self.child.returncode == code, (self.child.returncode, self.shown[-500:])
        assert termios.tcgetattr(self.slave) == self.before, "the terminal is not as it was"
        for given_back in (b"\x1b[?1049l", b"\x1b[?25h"):
            assert given_back in self.shown, f"{given_back!r} is missing"
        assert self.shown.index(b"\x1b[?1049h") < self.shown.rindex(b"\x1b[?1049l")


def rows_of_last_frame(shown):
    frame = shown[shown.rindex(b"\x1b[?2026h"):]
    return re.sub(rb"\x1b\[[0-9;?]*[A-Za-z]", lambda m: b"\n" if m[0].endswith(b"H") else b"", frame).split(b"\n")


def main():
    how, command = sys.argv[1], sys.argv[2:]
    env = {"NO_COLOR": "1"} if how == "no-color" else {}
    terminal = Terminal(command, env, stdin_too=how != "no-stdin")
    terminal.wait_for(b"late us")
    raw = not termios.tcgetattr(terminal.slave)[3] & (termios.ICANON | termios.ECHO)
    assert raw == (how != "no-stdin"), "keys come at once, where there are any"
    coloured = SGR_COLOUR.search(terminal.shown) is not None
    assert coloured == (how != "no-color"), terminal.shown[:500]
    code = 0
    if how in ("q", "no-color"):
        # What is no key of its does nothing.
        os.write(terminal.master, b"x\x1b[A")
        terminal.wait_for(b"late us", len(terminal.shown))
        os.write(terminal.master, b"q")
    elif how == "ctrl-c":
        os.write(terminal.master, b"\x03")
    elif how == "term":
        terminal.child.send_signal(signal.SIGTERM)
    elif how in ("hup", "no-stdin"):
        terminal.child.send_signal(signal.SIGHUP)
    elif how == "resize":
        assert b"STEP99us" not in terminal.shown
        set_size(terminal.master, 132, 40)
        terminal.wait_for(b"STEP99us", len(terminal.shown))
        seen = len(terminal.shown)
        set_size(terminal.master, 50, 12)
        terminal.wait_for(b"more lines", seen)
        rows = rows_of_last_frame(terminal.shown)
        assert len([row for row in rows if row.strip()]) <= 12, rows
        assert all(len(row.decode()) <= 50 for row in rows), rows
        os.write(terminal.master, b"q")
    elif how == "down":
        program, robot = command[0], command[-1]
        subprocess.run([program, "down", "--robot", robot], check=True, stdout=subprocess.DEVNULL)
        code = 1
    terminal.end(code)
    if how == "down":
        last = terminal.shown[terminal.shown.rindex(b"\x1b[?1049l"):]
        assert b"went down" in last, last
    print("as it should")


main()
