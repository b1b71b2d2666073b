#!/bin/sh
# Mitsuba 3.9.1: what a sampler is asked for is not what it takes, and `mi.render(scene, spp=N)` obeys the sampler.
# "orthogonal" rounds up to the square of a prime (64 -> 121, nearly twice), "ldsampler" to a power of four
# (128 -> 256), "stratified" to a square, "multijitter" to a product of two near factors (128 -> 132); only
# "independent" takes what is asked. Whoever compares samplers, or programs, "at 64 samples" compares 64 with 121.
# A line of the log says so, which a Python program that sets the log level to error does not show.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q mitsuba==3.9.1
cat > "$dir/try.py" <<'END'
import mitsuba as mi

mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)
asked = [64, 100, 128]
counts = {}
for kind in ["independent", "multijitter", "stratified", "orthogonal", "ldsampler"]:
    counts[kind] = [mi.load_dict({"type": kind, "sample_count": n}).sample_count() for n in asked]
print("seen: Mitsuba", mi.__version__, "asked", asked, "taken", counts)
assert counts == {
    "independent": [64, 100, 128],
    "multijitter": [64, 100, 132],
    "stratified": [64, 100, 144],
    "orthogonal": [121, 121, 169],
    "ldsampler": [64, 256, 256],
}



class Counter(mi.SamplingIntegrator):
    """Sees nothing, and counts how often it is asked to look."""

    n = 0

    def sample(self, scene, sampler, ray, medium, active):
        Counter.n += 1
        return (mi.Color3f(0), True, [])


mi.register_integrator("counter", lambda props: Counter(props))


def samples_of_a_pixel(kind, spp):
    film = {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}}
    sensor = {"type": "perspective", "film": film, "sampler": {"type": kind}}
    scene = mi.load_dict({"type": "scene", "integrator": {"type": "counter"}, "sensor": sensor})
    Counter.n = 0
    mi.render(scene, spp=spp)
    return Counter.n / 64


rendered = {kind: samples_of_a_pixel(kind, 64) for kind in ["independent", "orthogonal"]}
print("seen: samples of a pixel that render(spp=64) takes", rendered)
assert rendered == {"independent": 64, "orthogonal": 121}
END
"$dir/venv/bin/python" "$dir/try.py" > "$dir/log" 2>&1 || { cat "$dir/log"; echo "behaviour changed"; exit 1; }
grep "^seen:" "$dir/log"
