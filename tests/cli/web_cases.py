"""luxel view and luxel export-web: what a person, a browser and a stranger get from them. Part of cases.py."""

import base64
import contextlib
import html.parser
import json
import os
import re
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time

from harness import case, expect, Failed, luxel, read, refused, start, tree, write
import scenes
from gltf import quad

SECRET = b"the secret of another folder"


def make_viewer(folder="viewer"):
    """Stands for the built viewer: what the server and the export need of it is an index.html."""
    os.makedirs(folder + "/assets")
    write(folder + "/index.html", "<!doctype html><title>viewer</title>")
    write(folder + "/assets/app.js", "export const ready = true;\n" * 5000)
    write(folder + "/assets/style.css", "body {}")
    write(folder + "/luxel_rt.wasm", b"\0asm\1\0\0\0")
    os.environ["LUXEL_VIEWER"] = os.path.abspath(folder)
    return folder


def make_baked(folder="room.baked", *options):
    write("room.glb", scenes.GOOD)
    luxel("bake", "room.glb", "-o", folder, "--page-size", "64", "--samples", "1", "--quiet", *(options or ("--no-preview",)))
    return folder


class Server:
    def __init__(self, process, line):
        self.process, self.line = process, line
        self.port = int(re.search(r"http://127\.0\.0\.1:(\d+)/", line).group(1))

    def send(self, data, address="127.0.0.1", timeout=10.0, close=True):
        """Sends raw bytes and reads until the server closes, or until `timeout` when it waits for more."""
        with socket.create_connection((address, self.port), timeout=timeout) as connection:
            connection.sendall(data)
            if close:
                connection.shutdown(socket.SHUT_WR)
            answer = b""
            with contextlib.suppress(socket.timeout, ConnectionResetError):
                while chunk := connection.recv(65536):
                    answer += chunk
            return answer

    def ask(self, target, method="GET", headers=(), host=None):
        """One request as typed; status, headers (lower case), body."""
        lines = ["%s %s HTTP/1.1" % (method, target), "Host: %s" % (host or "127.0.0.1:%d" % self.port), "Connection: close", *headers]
        answer = self.send("\r\n".join(lines).encode("latin-1") + b"\r\n\r\n", close=False)
        expect(answer.startswith(b"HTTP/1.1 "), "%s: no answer but %r" % (target, answer[:200]))
        head, _, body = answer.partition(b"\r\n\r\n")
        fields = dict(line.split(": ", 1) for line in head.decode("latin-1").split("\r\n")[1:])
        return int(head[9:12]), {key.lower(): value for key, value in fields.items()}, body


@contextlib.contextmanager
def viewing(folder="room.baked", *options):
    process = start("view", folder, "--no-browser", *options, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        expect(select.select([process.stdout], [], [], 30)[0], "no address after 30 s")
        line = process.stdout.readline().decode()
        if not line:
            raise Failed("luxel view: %s" % process.stderr.read().decode())
        yield Server(process, line)
        expect(process.poll() is None, "the server ended: %s" % process.returncode)
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise Failed("not stopped 10 s after Ctrl-C")
        rest = process.stderr.read().decode()
        process.stdout.close()
        process.stderr.close()
    expect(process.returncode == 0, "exit code %d: %s" % (process.returncode, rest))
    expect(rest == "", "on stderr: %s" % rest)


def setup():
    make_viewer()
    make_baked()


# --- Serving ------------------------------------------------------------------------------------------------------------


@case
def view_prints_its_address_and_serves_both_folders():
    setup()
    with viewing() as server:
        expect(re.fullmatch(r"viewing room\.baked at http://127\.0\.0\.1:\d+/ — Ctrl-C ends\n", server.line), server.line)
        for target, file in (("/", "viewer/index.html"), ("/index.html", "viewer/index.html"), ("/assets/app.js?v=1", "viewer/assets/app.js"),
                             ("/%61ssets/style.css", "viewer/assets/style.css"), ("/baked/luxel.pack", "room.baked/luxel.pack"),
                             ("/baked/scene.glb", "room.baked/scene.glb"), ("/baked/luxel.json", "room.baked/luxel.json")):
            status, headers, body = server.ask(target)
            expect(status == 200 and body == read(file), "%s: %d, %d bytes" % (target, status, len(body)))
            expect(int(headers["content-length"]) == len(body), "%s: %s" % (target, headers))


@case
def view_names_types_and_forbids_other_hosts():
    setup()
    write("room.baked/sky.hdr", "#?RADIANCE")
    types = {"/": "text/html; charset=utf-8", "/assets/app.js": "text/javascript; charset=utf-8", "/luxel_rt.wasm": "application/wasm",
             "/assets/style.css": "text/css; charset=utf-8", "/baked/scene.glb": "model/gltf-binary", "/baked/luxel.json": "application/json",
             "/baked/luxel.pack": "application/octet-stream", "/baked/sky.hdr": "image/vnd.radiance"}
    with viewing() as server:
        for target, type_ in types.items():
            status, headers, _ = server.ask(target)
            expect(status == 200 and headers["content-type"] == type_, "%s: %d %s" % (target, status, headers))
            policy = headers["content-security-policy"]
            expect(policy.startswith("default-src 'self';") and "http" not in policy and "*" not in policy, policy)
            expect(headers["cross-origin-resource-policy"] == "same-origin" and headers["x-content-type-options"] == "nosniff", "%s" % headers)
            expect("access-control-allow-origin" not in headers, "%s" % headers)


@case
def view_answers_head_etag_and_ranges():
    setup()
    pack = read("room.baked/luxel.pack")
    with viewing() as server:
        status, headers, body = server.ask("/baked/luxel.pack", "HEAD")
        expect(status == 200 and body == b"" and int(headers["content-length"]) == len(pack), "HEAD: %d %s" % (status, headers))
        tag = headers["etag"]
        for value, expected in ((tag, 304), ('"other", W/%s' % tag, 304), ("*", 304), ('"other"', 200), (tag[:-2] + '"', 200), ('"', 200)):
            status, _, body = server.ask("/baked/luxel.pack", headers=["If-None-Match: " + value])
            expect(status == expected and body == (b"" if status == 304 else pack), "If-None-Match %s: %d" % (value, status))
        for value, first, last in (("bytes=0-0", 0, 0), ("bytes=100-199", 100, 199), ("bytes=-7", len(pack) - 7, len(pack) - 1),
                                   ("bytes=9-", 9, len(pack) - 1), ("bytes=5-99999999999999999999999", 5, len(pack) - 1)):
            status, headers, body = server.ask("/baked/luxel.pack", headers=["Range: " + value])
            expect(status == 206 and body == pack[first:last + 1], "%s: %d, %d bytes" % (value, status, len(body)))
            expect(headers["content-range"] == "bytes %d-%d/%d" % (first, last, len(pack)), "%s" % headers)
        status, headers, _ = server.ask("/baked/luxel.pack", headers=["Range: bytes=%d-" % len(pack)])
        expect(status == 416 and headers["content-range"] == "bytes */%d" % len(pack), "%d %s" % (status, headers))
        for value in ("bytes=5-2", "bytes=a-b", "lines=1-2", "bytes=0-1,4-5", "bytes=", "bytes=-"):
            status, _, body = server.ask("/baked/luxel.pack", headers=["Range: " + value])
            expect(status == 200 and body == pack, "%s: %d" % (value, status))
        expect(server.ask("/baked/luxel.pack", headers=["Range: bytes=0-0", "If-Range: " + tag])[0] == 206, "If-Range of this content")
        expect(server.ask("/baked/luxel.pack", method="HEAD", headers=["Range: bytes=0-0"])[0] == 200, "HEAD has no parts")
        expect(server.ask("/baked/luxel.pack", headers=["Range: bytes=0-0", 'If-Range: "old"'])[0] == 200, "If-Range of other content")
        # A new bake has another tag, and shows without a new server.
        luxel("bake", "room.glb", "-o", "room.baked", "--page-size", "64", "--samples", "1", "--seed", "7", "--quiet", "--no-preview")
        status, _, body = server.ask("/baked/luxel.pack", headers=["If-None-Match: " + tag])
        expect(status == 200 and body == read("room.baked/luxel.pack") and body != pack, "the old bake is shown: %d" % status)


# --- Strangers ----------------------------------------------------------------------------------------------------------

TRICKS = """/../secret.txt /baked/../secret.txt /baked/../../secret.txt /baked/%2e%2e/secret.txt /baked/%2E%2E/%2e%2e/secret.txt
/baked/..%2fsecret.txt /baked/%2e%2e%2fsecret.txt /baked/..\\secret.txt /baked/..%5csecret.txt /baked/%252e%252e/secret.txt
/baked/%252e%252e%252fsecret.txt /baked/.%2e/secret.txt /baked/%c0%ae%c0%ae/secret.txt /baked/..%c0%afsecret.txt /baked/..;/secret.txt
/baked/./luxel.json /baked//luxel.json //baked/luxel.json /baked/luxel.json/ /baked/luxel.json%00 /baked/luxel.json%00.png
/baked/%00 /baked/.work/tile /baked/%2ework/tile /baked/.hidden /.git/config /%2egit/config /baked /baked/ /baked/folder /baked/folder/
/assets /assets/ //etc/passwd /etc/passwd /%2fetc%2fpasswd /baked//etc/passwd /baked/%2fetc/passwd file:///etc/passwd
http://127.0.0.1/baked/luxel.json http://evil.example/ baked/luxel.json * /% /%2 /%zz /baked/%e /baked/link.txt /baked/link/secret.txt
/baked/chain/secret.txt /baked/absolute.txt /link.txt /baked/pipe /baked/luxel.json%0d%0aX:1 /baked/luxel.json%20 /baked/LUXEL.JSON
/baked/~root /baked/con /BAKED/luxel.json /baked/secret.txt /baked/%2e /baked/%2e%2e /.. /%2e%2e /baked/.. /baked/...""".split()


@case
def view_serves_nothing_outside_of_its_folders():
    setup()
    write("secret.txt", SECRET)
    os.makedirs("room.baked/.work")
    os.makedirs("room.baked/folder")
    os.makedirs("other")
    write("room.baked/.work/tile", SECRET)
    write("room.baked/.hidden", SECRET)
    write("room.baked/folder/.hidden", SECRET)
    write("other/secret.txt", SECRET)
    os.makedirs("viewer/.git")
    write("viewer/.git/config", SECRET)
    os.makedirs("viewer/baked")  # the baked folder hides it
    write("viewer/baked/secret.txt", SECRET)
    os.symlink("../secret.txt", "room.baked/link.txt")
    os.symlink("../other", "room.baked/link")
    os.symlink("link", "room.baked/chain")
    os.symlink(os.path.abspath("secret.txt"), "room.baked/absolute.txt")
    os.symlink("../secret.txt", "viewer/link.txt")
    os.mkfifo("room.baked/pipe")
    with viewing() as server:
        for target in TRICKS:
            status, headers, body = server.ask(target)
            expect(status in (400, 403, 404), "%s: status %d" % (target, status))
            expect(SECRET not in body and len(body) < 400 and b"root:" not in body, "%s: %r" % (target, body[:200]))
        expect(server.ask("/baked/" + "a" * 3000)[0] == 404 and server.ask("/baked/" + "a/" * 1500)[0] == 404, "long paths")
        expect(server.ask("/baked/luxel.json")[0] == 200, "the good file is no longer there")


@case
def view_refuses_other_methods_and_other_hosts():
    setup()
    with viewing() as server:
        for method in ("POST", "PUT", "DELETE", "OPTIONS", "TRACE", "PATCH", "CONNECT", "PROPFIND", "get", "X"):
            status, headers, body = server.ask("/baked/luxel.json", method)
            expect(status == 405 and headers["allow"] == "GET, HEAD" and b"version" not in body, "%s: %d" % (method, status))
        for host in ("evil.example", "evil.example:80", "127.0.0.1.evil.example", "localhost.evil.example", "0.0.0.0", "127.0.0.2",
                     "localhost@evil.example", "127.0.0.1:80:80", "127.0.0.1:", "::1", "[::2]", "localhost:x", "2130706433"):
            status, _, body = server.ask("/", host=host)
            expect(status == 403 and b"viewer" not in body, "Host %s: %d" % (host, status))
        for host in ("localhost", "LOCALHOST:1", "127.0.0.1", "[::1]:65535"):
            expect(server.ask("/", host=host)[0] == 200, "Host %s is refused" % host)
        two = server.send(b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\n\r\n")
        expect(two.startswith((b"HTTP/1.1 403", b"HTTP/1.1 400")), "two hosts: %r" % two[:100])
        for version in (b"1.0", b"1.1"):
            none = server.send(b"GET / HTTP/" + version + b"\r\n\r\n")
            expect(b" 200 " not in none[:20] and b"viewer" not in none, "no host: %r" % none[:100])
        body = server.send(b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n\r\nhello")
        expect(body.startswith(b"HTTP/1.1 400"), "a body: %r" % body[:100])


def other_addresses():
    """Addresses of this machine besides 127.0.0.1 on which a server that binds all of them would answer."""
    found = ["127.0.0.2"]
    with contextlib.suppress(OSError):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(("192.0.2.1", 9))  # sends nothing: only asks for the address in use
            found.append(probe.getsockname()[0])
    with contextlib.suppress(OSError):
        found += [info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)]
    return {address for address in found if address != "127.0.0.1"}


@case
def view_answers_on_loopback_alone():
    setup()
    with viewing() as server:
        with open("/proc/net/tcp") as table:
            listening = [line.split()[1] for line in table if line.split()[3] == "0A"]
        expect("0100007F:%04X" % server.port in listening, "not on 127.0.0.1: %s" % listening)
        others = [entry for entry in listening if entry.endswith(":%04X" % server.port) and not entry.startswith("0100007F")]
        expect(others == [], "listens elsewhere too: %s" % others)
        for address in other_addresses():
            try:
                answer = server.send(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", address, 3.0)
            except OSError:
                continue
            raise Failed("answers on %s: %r" % (address, answer[:60]))


NONSENSE = [
    b"", b"\n", b"\r\n\r\n", b"\0", b"\0" * 5000, b"GET", b"GET ", b"GET /", b"GET / HTTP/1.1", b"GET / HTTP/1.1\r\n", b"GET /\r\n\r\n",
    b"GET / HTTP/9.9\r\n\r\n", b"GET / HTTP/1.1\r\nHost\r\n\r\n", b"GET / HTTP/1.1\r\n: x\r\n\r\n", b"GET / HTTP/1.1\r\nHost: \xff\xfe\r\n\r\n",
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(range(256)), b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", b"GET " + b"/a" * 40000 + b" HTTP/1.1\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"y" * 200000 + b"\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\n" + b"X: y\r\n" * 20000 + b"\r\n", b"A" * 100000,
    b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999999999999\r\n\r\n", b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n", b"%s%n%x / HTTP/1.1\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\nRange: bytes=" + b"0-1," * 50000 + b"\r\n\r\n",
]


@case
def view_survives_nonsense():
    setup()
    good = read("room.baked/luxel.pack")
    with viewing() as server:
        for data in NONSENSE:
            for close in (True, False):
                try:
                    answer = server.send(data, timeout=0.3, close=close)
                except OSError:
                    continue  # closed while we were still sending
                expect(b"HTTP/1.1 200" not in answer[:12], "%r: %r" % (data[:60], answer[:100]))
        # A raw zero byte ends the path for the HTTP library: the rest must not count.
        write("secret.txt", SECRET)
        for zero in (b"/index.html\0/../secret.txt", b"/baked/../secret.txt\0.png", b"/baked/\0/../../secret.txt", b"\0/../secret.txt"):
            answer = server.send(b"GET " + zero + b" HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n", timeout=2.0)
            expect(SECRET not in answer, "%r: %r" % (zero, answer[:200]))
        status, _, body = server.ask("/baked/luxel.pack")
        expect(status == 200 and body == good, "after all that: %d" % status)


@case
def view_survives_many_and_slow_connections():
    setup()
    with viewing() as server:
        held = []
        for number in range(150):  # half requests, kept open
            connection = socket.create_connection(("127.0.0.1", server.port), timeout=10)
            connection.sendall(b"GET /baked/luxel.pack HTTP/1.1\r\nHost: localhost\r\nX: " + b"y" * number)
            held.append(connection)
        lazy = socket.create_connection(("127.0.0.1", server.port), timeout=10)  # asks and does not read
        lazy.sendall(b"GET /assets/app.js HTTP/1.1\r\nHost: localhost\r\n\r\n" * 50)
        begin = time.monotonic()
        status, _, body = server.ask("/baked/luxel.pack")
        expect(status == 200 and body == read("room.baked/luxel.pack"), "beside 150 half requests: %d" % status)
        expect(time.monotonic() - begin < 5, "%.1f s for one file" % (time.monotonic() - begin))
        rude = socket.create_connection(("127.0.0.1", server.port), timeout=10)
        rude.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        rude.sendall(b"GET /assets/app.js HTTP/1.1\r\nHost: localhost\r\n\r\n")
        rude.close()  # reset in the middle of the answer
        expect(server.ask("/")[0] == 200, "after a reset connection")
        # Ctrl-C with all of them open: viewing() demands that it ends.
        begin = time.monotonic()
        server.process.send_signal(signal.SIGINT)
        server.process.wait(10)
        expect(time.monotonic() - begin < 2, "%.1f s to stop" % (time.monotonic() - begin))
        for connection in held:
            connection.close()
        lazy.close()
        server.process.poll = lambda: None  # ended as it should


@case
def view_ends_half_requests_in_time():
    setup()
    with viewing() as server:
        connection = socket.create_connection(("127.0.0.1", server.port), timeout=40)
        connection.sendall(b"GET / HTTP/1.1\r\nHost: lo")
        begin = time.monotonic()
        with contextlib.suppress(ConnectionResetError):
            while connection.recv(4096):
                pass
        expect(5 < time.monotonic() - begin < 35, "closed after %.1f s" % (time.monotonic() - begin))
        connection.close()


# --- Starting and stopping ----------------------------------------------------------------------------------------------


@case
def view_stops_on_signals_with_exit_code_0():
    setup()
    for number in (signal.SIGINT, signal.SIGTERM):
        process = start("view", "room.baked", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        expect(b"http://127.0.0.1:" in process.stdout.readline(), "no address")
        begin = time.monotonic()
        process.send_signal(number)
        out, err = process.communicate(timeout=10)
        expect(process.returncode == 0 and err == b"" and out == b"", "%d: %r %r" % (process.returncode, out, err))
        expect(time.monotonic() - begin < 2, "%.1f s to stop" % (time.monotonic() - begin))


@case
def view_opens_a_browser_where_there_is_a_display():
    setup()
    os.mkdir("bin")
    write("bin/xdg-open", "#!/bin/sh\necho \"$1\" >opened.tmp && mv opened.tmp opened\n")
    os.chmod("bin/xdg-open", 0o755)
    path = os.environ["PATH"]
    for display, options, expected in ((":7", [], True), (":7", ["--no-browser"], False), ("", [], False)):
        os.environ.update(PATH=os.path.abspath("bin") + ":" + path, DISPLAY=display, WAYLAND_DISPLAY="")
        process = start("view", "room.baked", *options, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        line = process.stdout.readline().decode()
        until = time.monotonic() + (10 if expected else 1)
        while not os.path.exists("opened") and time.monotonic() < until:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=10)
        expect(process.returncode == 0 and err == b"", "%d: %r" % (process.returncode, err))
        expect(os.path.exists("opened") == expected, "display '%s' %s: opened: %s" % (display, options, not expected))
        if expected:
            expect(read("opened").decode().strip() in line, "opened %r" % read("opened"))
            os.remove("opened")
    os.environ.update(PATH=os.path.abspath("nothing"), DISPLAY=":7")
    process = start("view", "room.baked", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.readline()
    note = process.stderr.readline()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=10)
    os.environ["PATH"] = path
    expect(process.returncode == 0 and b"note: " in note and b"xdg-open" in note, "without xdg-open: %r" % note)


@case
def view_refuses_what_cannot_be_shown():
    make_viewer()
    refused("view", "nowhere", code=1, says=["nowhere: is no baked folder"])
    os.mkdir("empty")
    refused("view", "empty", code=1, says=["empty: holds no luxel.json"])
    make_baked()
    shutil.copytree("room.baked", "broken.baked")
    write("broken.baked/luxel.pack", b"not a pack")
    refused("view", "broken.baked", code=1, says=["broken.baked/luxel.pack"])
    refused("view", "room.baked", "--port", "70000", code=2, says=["--port", "70000"])
    with viewing() as server:
        refused("view", "room.baked", "--port", str(server.port), code=3, says=["port %d" % server.port, "in use"])


@case
def view_and_export_say_where_the_viewer_is_missing():
    make_baked()
    os.mkdir("empty")
    os.environ["LUXEL_VIEWER"] = os.path.abspath("empty")
    for command in (["view", "room.baked"], ["export-web", "room.baked", "-o", "site"]):
        refused(*command, code=1, says=["LUXEL_VIEWER: *empty holds no index.html"])
    expect(not os.path.exists("site") and not os.path.exists("site.partial"), "left behind: %s" % os.listdir("."))


@case
def view_finds_the_viewer_beside_the_program_and_in_share():
    import harness
    make_baked()
    os.environ.pop("LUXEL_VIEWER", None)
    os.makedirs("prefix/bin")
    program = harness.PROGRAM
    shutil.copy(program, "prefix/bin/luxel")
    harness.PROGRAM = os.path.abspath("prefix/bin/luxel")
    try:
        refused("view", "room.baked", code=1, says=["prefix/bin/viewer", "script/build"])
        os.makedirs("prefix/share/luxel/viewer")
        write("prefix/share/luxel/viewer/index.html", "shared")
        with viewing() as server:
            expect(server.ask("/")[2] == b"shared", "not the one in share")
        os.makedirs("prefix/bin/viewer")
        write("prefix/bin/viewer/index.html", "beside")
        with viewing() as server:
            expect(server.ask("/")[2] == b"beside", "not the one beside the program")
    finally:
        harness.PROGRAM = program


# --- Export -------------------------------------------------------------------------------------------------------------


@case
def export_web_writes_a_site_for_any_path():
    make_viewer()
    make_baked("room.baked", "--format", "exr", "--sky", "#203040")
    os.makedirs("room.baked/.work")
    write("room.baked/.work/tile", SECRET)
    write("room.baked/notes.txt", SECRET)
    result = luxel("export-web", "room.baked", "-o", "site", err="", out="site  *files, *iB\n*python3 -m http.server -d site\n*")
    files = set(tree("site"))
    expect(files == {".luxel-export", "index.html", "luxel_rt.wasm", "assets/app.js", "assets/style.css", "baked/luxel.json", "baked/luxel.pack",
                     "baked/scene.glb", "baked/sky.hdr", "baked/preview.png", "baked/report.html"}, "files are %s" % sorted(files))
    for name in files - {".luxel-export", "baked/luxel.json"}:
        source = name.replace("baked/", "room.baked/") if name.startswith("baked/") else "viewer/" + name
        expect(read("site/" + name) == read(source), "%s differs" % name)
    manifest, original = json.loads(read("site/baked/luxel.json")), json.loads(read("room.baked/luxel.json"))
    expect(original["files"] and manifest["files"] == [], "lightmap files that are not there: %s" % manifest["files"])
    original["files"] = []
    expect(manifest == original, "the manifest says something else")
    expect(str(len(files) - 1) + " files" in result.out, result.out)
    luxel("inspect", "site/baked", err="")


@case
def export_web_replaces_only_what_it_wrote():
    setup()
    luxel("export-web", "room.baked", "-o", "site", "--quiet", out="", err="")
    os.remove("viewer/assets/style.css")
    luxel("export-web", "room.baked", "-o", "site/", "--quiet", out="", err="")
    expect(not os.path.exists("site/assets/style.css"), "the old file is still there")
    expect(not os.path.exists("site.partial"), "site.partial is left")
    os.makedirs("site/.git")
    write("site/.git/config", "irreplaceable")
    before = tree(".")
    refused("export-web", "room.baked", "-o", "site", code=2, says=["site: holds .git/config"])
    os.mkdir("photos")
    write("photos/holiday.jpg", "irreplaceable")
    refused("export-web", "room.baked", "-o", "photos", code=2, says=["photos: is not empty"])
    refused("export-web", "room.baked", "-o", "room.baked", code=2, says=["room.baked: is not empty"])
    refused("export-web", "room.baked", "-o", "a/b", code=2, says=["a/b", "does not exist"])
    refused("export-web", "room.baked", "-o", "viewer/site", code=2, says=["viewer/site: lies inside of the viewer"])
    refused("export-web", "room.baked", code=2, says=["-o DIR"])
    os.symlink("photos", "link")
    refused("export-web", "room.baked", "-o", "link", code=2, says=["link: is a symbolic link"])
    os.remove("link")
    after = tree(".")
    after.pop("photos/holiday.jpg")
    expect(after == before, "files changed")


@case
def export_web_failing_leaves_the_old_site():
    setup()
    luxel("export-web", "room.baked", "-o", "site", "--quiet")
    before = tree("site")
    write("secret.txt", SECRET)
    os.symlink("../secret.txt", "viewer/link.txt")
    refused("export-web", "room.baked", "-o", "site", code=1, says=["viewer/link.txt: is a symbolic link"])
    os.remove("viewer/link.txt")
    os.remove("room.baked/scene.glb")
    refused("export-web", "room.baked", "-o", "site", code=1, says=["room.baked/scene.glb", "No such file"])
    expect(tree("site") == before and not os.path.exists("site.partial"), "left behind: %s" % os.listdir("."))


@case
def export_web_works_below_a_path_of_a_plain_server():
    setup()
    os.makedirs("www/deep")
    luxel("export-web", "room.baked", "-o", "www/deep/room", "--quiet")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen([sys.executable, "-m", "http.server", "-d", "www", "--bind", "127.0.0.1", str(port)],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        plain = Server(process, "http://127.0.0.1:%d/" % port)
        for _ in range(100):
            with contextlib.suppress(OSError):
                plain.send(b"\r\n", timeout=0.2)
                break
            time.sleep(0.05)
        for name in ("index.html", "assets/app.js", "baked/luxel.pack", "baked/scene.glb"):
            answer = plain.send(b"GET /deep/room/%s HTTP/1.0\r\n\r\n" % name.encode())
            expect(answer.partition(b"\r\n\r\n")[2] == read("www/deep/room/" + name), name)
    finally:
        process.kill()
        process.wait()


# --- report.html --------------------------------------------------------------------------------------------------------


class Page(html.parser.HTMLParser):
    """Checks that every element is closed where it must be, and collects what is shown and what is asked for."""

    VOID = {"meta", "link", "img", "br"}

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.addresses, self.tags, self.text, self.handlers = [], [], [], "", []
        self.feed(text)
        self.close()
        expect(self.open == [], "not closed: %s" % self.open)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attributes:
            if name in ("src", "href", "srcset", "data", "action", "poster", "background"):
                self.addresses.append(value)
            if name.startswith("on"):
                self.handlers.append(name)

    def handle_endtag(self, tag):
        expect(self.open and self.open[-1] == tag, "</%s> closes %s" % (tag, self.open[-1:]))
        self.open.pop()

    def handle_data(self, data):
        if "style" not in self.open:
            self.text += data


def report(folder):
    raw = read(folder + "/report.html")
    text = raw.decode("utf-8")
    page = Page(text)
    expect(text.startswith("<!DOCTYPE html>") and page.tags[:2] == ["html", "head"], text[:100])
    expect(page.handlers == [] and "script" not in page.tags, "scripts: %s" % page.handlers)
    expect(page.addresses.count("data:,") == 1, "no empty icon")
    for address in set(page.addresses) - {"data:,"}:
        expect(address.startswith("data:image/"), "an address of elsewhere: %s" % address[:100])
        kind, data = re.fullmatch(r"data:image/(jpeg|png);base64,([A-Za-z0-9+/=]+)", address).groups()
        data = base64.b64decode(data, validate=True)
        expect(data.startswith(b"\xff\xd8\xff" if kind == "jpeg" else b"\x89PNG"), "%s: %r" % (kind, data[:10]))
    for foreign in ("http:", "https:", "url(", "@import", "//"):
        expect(foreign not in re.sub(r'"data:[^"]*"', "", text), "'%s' in the page" % foreign)
    return page


@case
def report_shows_layers_sizes_times_and_settings():
    make_baked("room.baked", "--sky", "0.2,0.3,0.5", "--seed", "77")
    page = report("room.baked")
    expect(page.tags.count("img") == 1 + 4 + 1, "%d pictures" % page.tags.count("img"))
    for word in ("room.baked", "lamp", "neon left", "neon right", "sky", "10.0\u00a0cd", "Page 0", "64 × 64", "covered", "texels per metre", "RAM",
                 "GPU, composed", "GPU, all layers", "scene.glb", "luxel.pack", "preview.png", "sky.hdr", "import", "unwrap", "luxels", "bake", "post",
                 "save", "preview", "77", "samples per texel", "direct and bounced"):
        expect(word in page.text, "no '%s' in: %s" % (word, page.text))
    expect("warning" not in page.text, page.text)
    expect(os.path.getsize("room.baked/report.html") < 400000, "%d bytes" % os.path.getsize("room.baked/report.html"))
    make_baked("other.baked", "--no-preview")  # layers as they lie in the atlas
    page = report("other.baked")
    expect(page.tags.count("img") == 3 + 1, "%d pictures" % page.tags.count("img"))
    make_baked("none.baked", "--no-preview", "--no-report")
    expect(not os.path.exists("none.baked/report.html"), "there is a report")


@case
def report_shows_any_names_as_they_are():
    g = scenes.room()
    names = ["<script>alert(1)</script>", "\"><img src=http://evil.example/x onerror='x'>", "Straße & Söhne\u202e"]
    for node, name in zip(g.json["nodes"][2:5], names):
        node["name"] = name
    g.json["nodes"][0].setdefault("extras", {})["luxel_</li><b>"] = 1
    write("room.glb", g.to_bytes())
    folder = "a&b<i>.baked"
    luxel("bake", "room.glb", "-o", folder, "--page-size", "64", "--samples", "1", "--quiet", "--no-preview")
    text = read(folder + "/report.html").decode()
    page = Page(text)
    for name in names:
        expect(name.replace("\u202e", "\ufffd") in page.text, "no %r in: %s" % (name, page.text))
    expect(folder in page.text and "1 warning" in page.text and "luxel_</li><b>" in page.text, page.text)
    expect("script" not in page.tags and "i" in page.tags and page.handlers == [], "%s" % set(page.tags))
    expect(all(address.startswith("data:") for address in page.addresses), "%s" % [a[:60] for a in page.addresses])


@case
def report_shows_monitors_as_one():
    g = scenes.room()
    screen = g.add_material("screen", (0, 0, 0), emissive=(1, 0.9, 0.8), strength=40)
    g.add_node("tv", mesh=g.add_mesh("tv", (quad(1.6, 0.9), screen)), translation=(0, 1, -1), extras={"luxel_monitor": "8x5"})
    write("room.glb", g.to_bytes())
    luxel("bake", "room.glb", "-o", "room.baked", "--page-size", "64", "--samples", "1", "--quiet", "--max-layers", "100")
    page = report("room.baked")
    layers = json.loads(read("room.baked/luxel.json"))["layers"]
    expect(len(layers) == 3 + 40, "%d layers" % len(layers))
    expect("8 × 5 cells" in page.text and layers[3]["name"] in page.text and layers[-1]["name"] in page.text, page.text)
    expect(page.tags.count("img") == 1 + 3 + 2 + 1, "%d pictures" % page.tags.count("img"))


@case
def stages_and_memory_are_told_everywhere():
    write("room.glb", scenes.GOOD)
    result = luxel("bake", "room.glb", "-o", "room.baked", "--page-size", "64", "--samples", "1", "--json", "--no-preview")
    summary, manifest = json.loads(result.out), json.loads(read("room.baked/luxel.json"))
    inspected = json.loads(luxel("inspect", "room.baked", "--json").out)
    expect(summary["memory"] == manifest["memory"] == inspected["memory"], "%s\n%s" % (summary["memory"], inspected["memory"]))
    memory = summary["memory"]
    texels = 64 * 64 + 32 * 32 + 16 * 16  # padding 4: three levels
    expect(memory["gpu_composed"] == 4 * texels and memory["gpu_layers"] == 3 * 4 * texels, "%s" % memory)
    expect(summary["pack_bytes"] <= memory["ram"] <= summary["pack_bytes"] + 65536, "%s" % memory)
    expect(memory["accumulator"] >= 12 * texels and memory["dense"] >= memory["gpu_layers"], "%s" % memory)
    stages = summary["stages"]
    expect(set(stages) == {"import", "unwrap", "luxels", "bake", "direct", "cache", "gather", "denoise", "post", "save", "preview"}, "%s" % stages)
    expect(all(value > 0 for name, value in stages.items() if name != "preview") and stages["preview"] == 0, "%s" % stages)
    parts = ("direct", "cache", "gather", "denoise")  # of "bake"
    expect(sum(stages[part] for part in parts) <= stages["bake"], "%s" % stages)
    expect(sum(value for name, value in stages.items() if name not in parts) <= summary["total_seconds"], "%s in %g s" % (stages, summary["total_seconds"]))
    for key, value in manifest["bake"]["stages"].items():
        expect(abs(stages[key] - value) < 1e-6, "%s: %g and %g" % (key, stages[key], value))
    text = luxel("inspect", "room.baked").out
    expect(re.search(r"\nmemory\n  ram +[\d.]+ KiB\n", text) and re.search(r"gpu_composed +21\.0 KiB", text), text)
    text = luxel("bake", "room.glb", "-o", "room.baked", "--page-size", "64", "--samples", "1", "--no-preview").out
    expect(re.search(r"\n  memory +[\d.]+ KiB in RAM.*\n  GPU +21\.0 KiB composed.*63\.0 KiB as layers\n", text), text)
