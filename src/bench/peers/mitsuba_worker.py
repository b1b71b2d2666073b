"""Renders exported scenes with Mitsuba 3, on request."""

import re
from pathlib import Path

import worker


class Renderer:
    """Mitsuba with one variant."""

    path = None
    scenes = {}

    def start(self, variant, threads):
        worker.restrict(threads)

        def work():
            import drjit
            import mitsuba

            mitsuba.set_variant(variant)
            mitsuba.set_log_level(mitsuba.LogLevel.Error)
            drjit.set_thread_count(threads)
            if variant.startswith("llvm"):
                # LLVM is only sought when something is computed.
                drjit.eval(mitsuba.Float(0.0) + 1.0)
            self.mi, self.dr = mitsuba, drjit
            return mitsuba.__version__

        version, seconds = worker.timed(work)
        llvm = None
        if variant.startswith("llvm"):
            llvm = ".".join(map(str, self.dr.detail.llvm_version()))
        return {"seconds": seconds, "version": version, "llvm": llvm}

    def scene(self, path, sampler, integrator):
        """A scene with another sampler and integrator than it says; all of one file are kept."""
        if path != self.path:
            self.path, self.scenes = path, {}
        if (sampler, integrator) not in self.scenes:
            text = Path(path).read_text()
            text = re.sub(r'<sampler type="\w+">', f'<sampler type="{sampler}">', text)
            text = re.sub(r'<integrator type="\w+">', f'<integrator type="{integrator}">', text)
            changed = Path(path).with_name(f"{sampler}-{integrator}.xml")
            changed.write_text(text)
            self.scenes[sampler, integrator] = self.mi.load_file(str(changed))
        return self.scenes[sampler, integrator]

    def render(self, path, sampler, integrator, spp, seed, out=None):
        """A picture; the seconds are those until its pixels are in memory."""
        import numpy

        scene, loading = worker.timed(lambda: self.scene(path, sampler, integrator))
        source = scene.sensors()[0].sampler()
        # A sampler may take more than it is asked for.
        source.set_sample_count(spp)
        spp = source.sample_count()
        picture, seconds = worker.timed(
            lambda: numpy.array(self.mi.render(scene, spp=spp, seed=seed), dtype="<f4"))
        if out is not None:
            picture.tofile(out)
        return {"loading": loading, "seconds": seconds, "spp": spp, "size": [picture.shape[1], picture.shape[0]]}


def main():
    renderer = Renderer()
    worker.serve({"start": renderer.start, "render": renderer.render})


if __name__ == "__main__":
    main()
