"""bench_bakes from Python: several bakes of one scene in turn, and the errors between them."""

import itertools
import json
import math
import os
import subprocess
import sys
import tempfile

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
PROGRAM = os.environ.get("LUXEL_BENCH_BAKES") or os.path.join(ROOT, "build/release/bench/bench_bakes")
sys.dont_write_bytecode = True
sys.path[:0] = [os.path.join(ROOT, folder) for folder in ("bench", "scenes", "tests/cli", "tests/statistical")]


def shared(name):
    """Path of a scene that is not part of the project; None where it is absent."""
    for folder in (os.environ.get("LUXEL_SCENES", ""), os.path.join(ROOT, "..", "shared", "scenes")):
        path = os.path.join(folder, name)
        if folder and os.path.exists(path):
            return path
    return None


def bakes_of_room(name, bakes, **options):
    """Bakes of one of tests/statistical/rooms.py."""
    import rooms
    here = os.getcwd()
    with tempfile.TemporaryDirectory(prefix="luxel-rooms-") as folder:
        os.chdir(folder)
        try:
            scene, sky = rooms.make(name)
            scene.save("scene.glb")
            return Bakes("scene.glb", bakes, sky=sky[1] if sky else None, **options)
        finally:
            os.chdir(here)


class Bakes:
    """bakes: "integrator=path,samples=64,salt=1" or "exr:PATH,scale=3.14" each; options: page_size=128, threads=2, sky="1,1,1" and so on."""

    def __init__(self, scene, bakes, **options):
        command = [PROGRAM, scene] + ["%s=%s" % (k, v) for k, v in options.items() if v is not None]
        command += [b if b.startswith("exr:") else "bake:" + b for b in bakes]
        run = subprocess.run(command, capture_output=True, text=True)
        if run.returncode:
            raise RuntimeError("%s: %s" % (" ".join(command), run.stderr.strip()))
        self.told = json.loads(run.stdout)
        self.bakes = self.told["bakes"]
        self.texels = self.told["compared_texels"]
        self._products = self.told["products"]

    def seconds(self, k):
        return self.bakes[k]["seconds"]

    def mean(self, k):
        return self.bakes[k]["mean"]

    def dot(self, a, b, c, d):
        """Mean of (X_a - X_b)(X_c - X_d) over texels and channels."""
        p = self._products
        return p[a][c] - p[a][d] - p[b][c] + p[b][d]

    def error(self, k, reference):
        """Relative RMSE: of the difference, over the reference's mean."""
        return math.sqrt(max(0.0, self.dot(k, reference, k, reference))) / self.mean(reference)

    def error_against(self, k, first, second):
        """Relative RMSE against a referee that was baked twice with independent noise, free of that noise in the mean; and the standard error that the noise
        leaves on it, as the RMSE that could hide in it."""
        square = self.dot(k, first, k, second)
        mean = (self.mean(first) + self.mean(second)) / 2
        noise = self.dot(first, second, first, second) / 2  # variance of one referee
        # (G - P1)(G - P2) = b² - b (n1 + n2) + n1 n2: the last has variance noise² per value, the middle one 2 b² noise. Channels count as one value.
        spread = math.sqrt((noise ** 2 + 2 * max(0.0, square) * noise) / max(1, self.texels))
        return math.copysign(math.sqrt(abs(square)), square) / mean, math.sqrt(spread) / mean

    def error_of(self, bakes, referees):
        """Relative RMSE of bakes of one kind against referees with independent noise, two of these at a time: free of their noise in the mean."""
        pairs = list(itertools.combinations(referees, 2))
        square = sum(self.dot(k, p, k, q) for p, q in pairs for k in bakes) / len(pairs) / len(bakes)
        return math.sqrt(max(0.0, square)) / self.mean(referees[0])

    def bias(self, pair, referees):
        """Relative RMSE between the means of two kinds of bakes, each made twice with independent noise, free of the noise of both; negative where noise made
        its square negative; and the standard error that noise leaves on it, as the RMSE that could hide in it."""
        (a, b), (p, q) = pair, referees
        square = (self.dot(a, p, b, q) + self.dot(a, q, b, p)) / 2
        mean = (self.mean(p) + self.mean(q)) / 2
        noise = (self.dot(a, b, a, b) + self.dot(p, q, p, q)) / 2  # variances of one bake of either kind
        # Per texel and pairing (b + n1)(b + n2): variances noise² and 2 b² noise; what the two pairings share is counted whole. Channels count as one value.
        spread = math.sqrt((noise ** 2 + 2 * max(0.0, square) * noise) / max(1, self.texels))
        return math.copysign(math.sqrt(abs(square)), square) / mean, math.sqrt(spread) / mean

    def noise(self, first, second):
        """Relative RMSE of either of two bakes of one kind."""
        return math.sqrt(self.dot(first, second, first, second) / 2) / ((self.mean(first) + self.mean(second)) / 2)


def samples_for(target, points):
    """Where a curve of (samples or seconds, error) meets a target: interpolated or carried on with its last slope in log-log. Also says if carried on."""
    points = sorted(points)
    for (x0, e0), (x1, e1) in zip(points, points[1:]):
        if e0 >= target >= e1:
            t = math.log(e0 / target) / math.log(e0 / e1) if e0 > e1 else 0.0
            return math.exp(math.log(x0) + t * (math.log(x1) - math.log(x0))), False
    x, e = points[-1] if target < points[-1][1] else points[0]
    return x * (e / target) ** 2, True
