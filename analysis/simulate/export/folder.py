"""Write a folder with all that other programs need of a skylight."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from analysis.bsdf.xml_write import write_bsdf
from analysis.simulate.components import Lens, Wall
from analysis.simulate.export.meshes import write_obj, write_stl
from analysis.simulate.export.solids import Solid, solids
from analysis.simulate.radiance.lenses import bsdf_file, klems_file
from analysis.simulate.radiance.scene import surfaces_text
from analysis.simulate.rays import RaySet, write_rays
from analysis.simulate.system import System
from analysis.simulate.whole import klems_of_system, tree_of_system
from labdaq.errors import SimulationError, StorageError
from labdaq.whole_file import write_whole_bytes

_ABOUT: Final = """# {name}

Skylight as labdaq simulates it. Frame: x east, y north, z up; the origin is the centre of the aperture in the ceiling.

| file | what | unit |
|---|---|---|
| `skylight.obj` | all bodies, each an object and a material of its own name | mm |
| `cover.stl` ... | each body alone; closed, outward normals | mm |
| `entry.xml`, `exit.xml` | BSDF of a prismatic lens as a tensor tree (Radiance); front is the flat side | 1/sr |
| `entry-klems.xml` ... | the same in the full Klems basis (WINDOW, LightTools, TracePro by conversion) | 1/sr |
| `whole.xml`, `whole-klems.xml` | the whole skylight as such files; front is outside, x east, y south | 1/sr |
| `skylight.rad` | Radiance scene without a light source: `oconv skylight.rad` | mm |
| `rays.txt`, `rays.tm25ray` | rays of sun and sky before the cover: x y z l m n flux | m (TM-25: mm), lm |

Files that are not here do not apply. The inner surfaces of well and boot, the lower one of the cover, and the upper one
of the exit lens are those that the engines work with; prisms are in the BSDFs, not in the bodies. Obstructions
outside are in the Radiance scene alone.

## Materials

{materials}
"""


def write_folder(
    folder: Path, system: System, rays: RaySet | None = None, when: str = ""
) -> tuple[list[Path], list[str]]:
    """Write geometry, BSDFs, a Radiance scene and (if given) rays into a folder, which is made.

    Returns the files and, for what cannot be written, the reasons. ``when``: an ISO 8601 moment for ray files.
    Raises `StorageError`.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"{folder}: {error.strerror}", "name a folder that can be made") from error
    bodies = solids(system)
    files = [folder / "skylight.obj", *(folder / f"{body.name}.stl" for body in bodies)]
    write_obj(files[0], bodies)
    for body, path in zip(bodies, files[1:], strict=True):
        write_stl(path, body)
    reasons: list[str] = []
    for name, made in (("whole.xml", tree_of_system(system)), ("whole-klems.xml", klems_of_system(system))):
        write_bsdf(folder / name, made)
        files.append(folder / name)
    lenses = _lens_files(folder, system, files)
    try:
        text = "# millimetres; add a sky and a sun\n" + surfaces_text(system, lenses)
        write_whole_bytes(folder / "skylight.rad", text.encode())
        files.append(folder / "skylight.rad")
    except SimulationError as error:
        reasons.append(f"skylight.rad: {error.message}")
    if rays is not None:
        for name in ("rays.txt", "rays.tm25ray"):
            write_rays(folder / name, rays, f"light that falls on skylight {system.name}", when)
            files.append(folder / name)
    about = _ABOUT.format(name=system.name, materials="\n".join(_materials(system, bodies)))
    write_whole_bytes(folder / "README.md", about.encode())
    return [*files, folder / "README.md"], reasons


def _lens_files(folder: Path, system: System, files: list[Path]) -> dict[str, Path]:
    """BSDFs of the prismatic lenses, as tensor tree and in the Klems basis."""
    found = {}
    for place in ("entry", "exit"):
        lens: Lens = getattr(system, place)
        if lens.kind not in ("prismatic", "bsdf"):
            continue
        path, klems = folder / f"{place}.xml", folder / f"{place}-klems.xml"
        shutil.move(bsdf_file(lens, folder), path)
        found[place] = path
        if lens.kind == "bsdf":
            files.append(path)
            continue
        shutil.move(klems_file(lens, folder), klems)
        files += [path, klems]
    return found


def _materials(system: System, bodies: list[Solid]) -> Iterator[str]:
    names = {body.name for body in bodies}
    if "cover" in names:
        yield f"- cover: {_lens(system.entry)}"
    yield f"- well: {_wall(system.wall)}"
    if "boot" in names:
        yield f"- boot: {_wall(system.boot)}"
    if "exit" in names:
        yield f"- exit: {_lens(system.exit)}"


def _wall(wall: Wall) -> str:
    spread = f", spread {wall.scatter_deg:g} degrees rms" if wall.scatter_deg else ""
    mixed = (
        f", of which {wall.diffuse_fraction:g} Lambertian"
        if wall.finish == "specular" and wall.diffuse_fraction
        else ""
    )
    return f"{wall.finish}, reflectance {wall.reflectance:g}{mixed}{spread}"


def _lens(lens: Lens) -> str:
    if lens.kind == "bsdf":
        front = "up" if lens.prisms == "down" else "down"
        return f"a BSDF file, front {front}, turned by {lens.orientation_deg:g} degrees"
    if lens.kind == "diffusing":
        return f"diffusing, transmittance {lens.transmittance:g}, reflectance {lens.reflectance:g}"
    if lens.kind == "shift":
        return "a density of differences of direction cosines, which no file holds"
    solid = f"index {lens.refractive_index:g}, {lens.thickness_mm:g} mm, absorption {lens.absorption_per_mm:g}/mm"
    if lens.kind == "clear":
        return f"clear, {solid}"
    return (
        f"prismatic, {solid}; pyramids {lens.prisms}, pitch {lens.pitch_mm:g} mm, slope {lens.slope_deg:g} degrees "
        f"(blurred by {lens.blur_deg:g} degrees rms), pattern turned by {lens.orientation_deg:g} degrees"
        f"{', mirrored' if lens.mirrored else ''}"
    )
