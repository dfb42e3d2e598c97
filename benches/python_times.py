"""Times of the Python package, in new processes: its import, and the first picture of an array.

Run it with the Python of an environment that has the package: `python benches/python_times.py [ROUNDS]`. It prints medians in milliseconds and asserts nothing.
"""

import json
import statistics
import subprocess
import sys
import tempfile

IMPORT = """
import json, time
begin = time.perf_counter()
import sheetsplat
print(json.dumps({"import sheetsplat": time.perf_counter() - begin}))
"""

#: The array is there before, as it is in a program that has made or read it.
PICTURE = """
import json, sys, time
import numpy as np
values = np.load(sys.argv[1])
begin = time.perf_counter()
import sheetsplat
imported = time.perf_counter()
volume = sheetsplat.Volume(values, spacing=(2, 2, 2))
read = time.perf_counter()
view = sheetsplat.View(volume, image={"width": 512, "height": 512})
prepared = time.perf_counter()
image = view.render()
drawn = time.perf_counter()
array = np.asarray(image)
assert array.shape == (512, 512, 4)
again = time.perf_counter()
view.render()
end = time.perf_counter()
print(json.dumps({
    "import sheetsplat after NumPy": imported - begin,
    "head:128, the volume of an array": read - imported,
    "head:128, the view": prepared - read,
    "head:128, its first picture": drawn - prepared,
    "head:128, all of these: a picture in hand after the import": drawn - imported,
    "head:128, a further picture": end - again,
}))
"""


def run(code: str, *arguments: str) -> dict[str, float]:
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 15
    with tempfile.NamedTemporaryFile(suffix=".npy") as file:
        save = "import sys, numpy as np, sheetsplat; np.save(sys.argv[1], sheetsplat.Volume('builtin:head:128').values.astype('u1'))"
        subprocess.run([sys.executable, "-c", save, file.name], check=True)
        times: dict[str, list[float]] = {}
        for _ in range(rounds):
            for name, seconds in {**run(IMPORT), **run(PICTURE, file.name)}.items():
                times.setdefault(name, []).append(1000 * seconds)
    print(f"| in {rounds} new processes | median, ms | min | max |\n|---|---|---|---|")
    for name, found in times.items():
        print(f"| {name} | {statistics.median(found):.0f} | {min(found):.0f} | {max(found):.0f} |")


if __name__ == "__main__":
    main()
