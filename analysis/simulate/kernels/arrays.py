"""What the kernels are given, bundled: named tuples of numbers and arrays (numba takes them apart at compile time)."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = tuple[float, ...]
Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Indices = NDArray[np.int64]
Cells = NDArray[np.int32]
Table = NDArray[np.int16]

# columns of the geometry
SHAPE, AX, AY, HEIGHT, BOOT, COVER, RISE, CAP_RADIUS, CAP_CENTRE, AREA, TURN_C, TURN_S = range(12)
RECTANGLE, DISC = 0, 1
FLAT, PYRAMID, DOME = 0, 1, 2
# columns of a facet row: outward normal, offset along it, area
NX, NY, NZ, OFFSET, FACET_AREA = range(5)
# columns of a wall
RHO, LAMBERT, SPREAD = range(3)
# columns of a lens
KIND, COS, SIN, MIRROR, ISOTROPIC, HAZE, SOIL, INDEX, DEPTH, TRANSMIT, REFLECT, HALF, WIDE, GRAIN = range(14)
NONE, CLEAR, TABLE, DIFFUSING = 0, 1, 2, 3
# units of the scatter tables; a lens of a file that sends on more light than it gets has a coarser unit of weight
DELTA_SCALE: Final = 1.0 / 16000.0
WEIGHT_SCALE: Final = 1.0 / 32000.0
# kinds of source
SKY, SUN, GIVEN = 0, 1, 2
# what became of the light, columns of the balance
IN, OUTSIDE, OUT, BACK, LENS, WALL, CUT, ROULETTE, RAYS = range(9)


class Skylight(NamedTuple):
    """A system, ready to trace.

    Attributes
    ----------
    geometry, well, boot, entry, exit
        Tuples of numbers, see the columns above.
    facets : shape (4, 5)
        Of the pyramid: east, north, west, south.
    above, below, under
        Scatter tables (parts, rows, samples, 3), int16: the entry from outside and from inside, the exit lens from
        inside. The kernels are given one part: each batch reads a part of its own, so that the scatter between batches
        shows the tables' noise too.
    nodes, wide : shape (rows, 2)
        Tangential direction cosines of incidence of the tables' rows: of a pattern with the symmetry of a square, and
        of any pattern.
    exact
        Whether ``above`` was made for this very sun: one row for each facet, in the facet's own frame.
    spots : shape (facets, 2)
        Then: tangential direction cosines of the sun's light on each facet.
    ring : shape (parts, rows, samples, 3)
        The exit lens from inside at one angle of incidence, that of a sun which reaches it by mirrors alone; rows go
        from azimuth 0 to 45 degrees.
    ring_nodes, ring_cosine
        Tangential cosines of its rows, and the cosine of that angle (2: there is none).
    lobe : shape (1, samples, 3)
        The lower half of a cosine lobe in the form of a scatter table.
    powers : shape (2, 64)
        Powers 0, 1, 2 ... of the reflectances of well and boot.
    obstructions : shape (n, 12)
        What stands around it; see `analysis.simulate.obstruction.rows`.
    """

    geometry: Numbers
    facets: Floats
    well: Numbers
    boot: Numbers
    entry: Numbers
    exit: Numbers
    above: Table
    below: Table
    under: Table
    nodes: Floats
    wide: Floats
    exact: bool
    spots: Floats
    ring: Table
    ring_nodes: Floats
    ring_cosine: float
    lobe: Table
    powers: Floats
    obstructions: Floats


class Light(NamedTuple):
    """A source; see `analysis.simulate.source.Source`. ``steps`` (cells + 1) is cumulative probability."""

    mode: int
    side: int
    steps: Floats
    flux: Floats
    span: Indices
    suns: Floats
    rays: Floats


class Counts(NamedTuple):
    """Where rays are counted.

    Attributes
    ----------
    sharp, soft : flat float32 arrays
        Lumens by (boot bounces, wall bounces, field, cell, member): light of specular paths, and light that a diffuse
        wall sent.
    sharp_side, soft_side
        Direction cells along the side of the square.
    classes, sharp_classes, bounces
        Sizes of the first two axes; ``sharp`` has one bounce class only if the wall is diffuse.
    members
        Size of the last axis.
    diffuse_well, diffuse_boot
        Whether a bounce there makes light soft.
    distance
        Of the near field's sensors [m]; 0 leaves it out.
    flat
        Whether they lie in a plane so far below the aperture, instead of on a sphere around its centre.
    split, glow
        Samples scored for each ray that reaches the last lens, and that a diffuse wall sends on.
    limit
        Most wall reflections.
    balance : shape (9,)
    fan_a, fan_b, fan_w, fan_far, fan_near : shape (split,)
        Room for the samples of one lens pass, in single precision: twice as many fit a register.
    """

    sharp: Singles
    soft: Singles
    sharp_side: int
    soft_side: int
    classes: int
    sharp_classes: int
    bounces: int
    members: int
    diffuse_well: bool
    diffuse_boot: bool
    distance: float
    flat: bool
    split: int
    glow: int
    limit: int
    balance: Floats
    fan_a: Singles
    fan_b: Singles
    fan_w: Singles
    fan_far: Cells
    fan_near: Cells


class Aims(NamedTuple):
    """Directions in which light is scored instead of counted; see `analysis.simulate.kernels.aiming`.

    Attributes
    ----------
    on
        Whether it is.
    back
        Whether rays run backwards, from sensors to the sky; then what leaves by the cover is scored, and nothing else.
    where : shape (4, n)
        Unit vectors from the aperture's centre in the skylight's frame (z < 0), and the sensors' distance [m]; 0: far.
    entry, exit : shape (11,)
        Prismatic sheets, as `analysis.bsdf.prism_trace` wants them; of an entry that is none, empty.
    entry_up, exit_up
        Whether the prisms look up.
    wanted, reach, found : shape (4, n), (n,), (n,)
        Work of `analysis.bsdf.prism_aim`; ``found`` are the sums [cd].
    state : shape (1,)
        Random numbers of the sheets.
    """

    on: bool
    back: bool
    where: Singles
    entry: Floats
    exit: Floats
    entry_up: bool
    exit_up: bool
    wanted: Singles
    reach: Singles
    found: Floats
    state: NDArray[np.uint64]


class Scene(NamedTuple):
    """All that a run works with."""

    sky: Skylight
    counts: Counts
    light: Light
    aims: Aims


class Ray(NamedTuple):
    """A place [m] and a direction of travel (unit vector)."""

    x: float
    y: float
    z: float
    dx: float
    dy: float
    dz: float


class Frame(NamedTuple):
    """Two axes along a sheet or wall, and the normal that points away from where its light goes."""

    ex: float
    ey: float
    ez: float
    fx: float
    fy: float
    fz: float
    nx: float
    ny: float
    nz: float


class Load(NamedTuple):
    """What a ray carries.

    Attributes
    ----------
    source
        Cell of the source it came from.
    area
        Projected area of the cover that it stands for [m²].
    unit
        Its light when it fell on the cover [lm], for the balance.
    weight
        Share of that still on its way.
    boot, wall
        Bounces so far.
    seen
        Whether the aperture was shown the light of the last event already (by a fan), so that it must not count again.
    """

    source: int
    area: float
    unit: float
    weight: float
    boot: int
    wall: int
    seen: bool
