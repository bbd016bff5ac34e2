"""``python -m docs.make.pictures.bound``: the least error that any flow could have, beside ours."""

import argparse
import sys
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

import components.optical.image as image
from components.optical.picture import union_coverage
from docs.make.pictures.flow import SIZES, recorded
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say_lines

_STEP_PX, _DRAWS = 0.05, 200
_AXES = ("column", "row")


class BoundedCamera(image.ImageCamera):
    """The camera; keeps what its pictures tell of shifts, by target and scan."""

    told: ClassVar[dict[tuple[str, int], Any]] = {}

    def _render_patch(self, scene: Any, corner: Any, middle: Any, attitude: Any, which: int) -> Any:
        if which == image._CURRENT:
            step = _STEP_PX * scene.binned
            slope = [
                scene.contrast
                * (self._covered(scene, corner, middle + step * by)
                   - self._covered(scene, corner, middle - step * by)) / (2.0 * step)
                for by in np.eye(2)
            ]  # fmt: skip
            information = np.array([[(a * b).sum() for a in slope] for b in slope])
            key = scene.cells.roster.names[scene.cells.target[scene.cell]]
            scan = int(scene.cells.scan[scene.cell])
            # Both frames are noisy; a coarser picture has less noise and fewer pixels.
            noise = self.pixel_noise / scene.binned
            self.told[key, scan] = 2.0 * noise**2 * np.linalg.inv(information)
        return super()._render_patch(scene, corner, middle, attitude, which)

    def _covered(self, scene: Any, corner: Any, middle: Any) -> Any:
        side = 2 * scene.half
        at = 2.0 * (middle / scene.binned - corner)
        outlines = [at + (2.0 / scene.binned) * outline for outline in scene.outlines]
        fine = union_coverage(outlines, 2 * side, 2 * side, 2.0 * scene.smear)
        spread, cv2 = 2.0 * self.p.blur_pixels / scene.binned, image.single_threaded_opencv()
        fine = cv2.GaussianBlur(fine, (0, 0), spread, borderType=cv2.BORDER_REPLICATE)
        return fine.reshape(side, 2, side, 2).mean(axis=(1, 3))


def _bounds() -> dict[tuple[str, int], Any]:
    """Return what the camera keeps: of the module that a scene imports, which may be run here."""
    from docs.make.pictures import bound

    return bound.BoundedCamera.told


def errors_and_bounds(noise: float, seeds: Iterable[int]) -> np.ndarray:
    """Return covered pixels, the flow's error, and draws by the bound, (2 + draws, looks)."""
    rng, found = np.random.default_rng(0), []
    for seed in seeds:
        told = _bounds()
        told.clear()
        covered = {(r["target"], r["scan"]): r["pixels"] for r in recorded(seed, noise, 0.0)}
        rows = recorded(seed, noise, 0.0, "docs.make.pictures.bound:BoundedCamera")
        looks = {(row["target"], row["scan"]): row for row in rows}
        for key, row in looks.items():
            before = looks.get((key[0], key[1] - 1))
            if before is None or row["flow_column_px"] is None:
                continue
            off = [
                row[f"flow_{a}_px"] - (row[f"true_{a}_px"] - before[f"true_{a}_px"]) for a in _AXES
            ]
            root = np.linalg.cholesky(told[key])
            least = np.hypot(*(root @ rng.normal(size=(2, _DRAWS))))
            found.append([covered[key], np.hypot(*off), *least])
    return np.array(found).T


def bound_table(noise: float = 0.05, seeds: Iterable[int] = range(2)) -> str:
    """Return a table of flows beside the bound, by size."""
    pixels, off, *least = errors_and_bounds(noise, seeds)
    text = "| pixels | flow | bound | rms over the bound's |\n|---|---|---|---|\n"
    for low, high in SIZES:
        mine = (pixels >= low) & (pixels < high)
        bound = np.array(least)[:, mine]
        rms = np.sqrt((off[mine] ** 2).mean() / (bound**2).mean())
        size = f"{low} to {high:g}" if np.isfinite(high) else f"{low} and more"
        edges = np.quantile(off[mine], 0.95), np.quantile(bound, 0.95)
        text += f"| {size} | {edges[0]:.3f} | {edges[1]:.3f} | {rms:.2f} |\n"
    return text


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--noise", type=float, default=0.05)
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args(arguments)
    say_lines(bound_table(options.noise, range(options.seeds)).rstrip())
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
