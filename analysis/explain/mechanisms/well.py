"""The well: what its walls reflect, how they scatter, and how long a simulation followed the light between them."""

from analysis.explain.mechanisms.base import Stage
from analysis.explain.mechanisms.retraced import Retraced
from analysis.explain.parameter import Parameter


class WallReflectance(Retraced):
    """The well's walls reflect more or less than assumed."""

    id = "wall-reflectance"
    stage = Stage.WELL
    leaves_out = "The well's walls reflect more or less than was simulated; it counts once per bounce."
    local_error = 0.3  # where light of many bounces leaves, the lens decides
    parameters = (Parameter("wall_reflectance", "1", "reflectance of the well", 0.3, 1.0, 0.03, (0.9,), centre=0.95),)
    needs = "a variant, or the systems' description"
    source = "sum over bounces R^n S_n; Swift and Smith 1995, Sol. Energy Mater. Sol. Cells 36"
    tie_breaker = "a reflectance measurement of the wall at grazing incidence, or a test with the sun low in the tube"


class BounceTruncation(Retraced):
    """The ray tracer stopped after too few bounces."""

    id = "bounce-truncation"
    stage = Stage.WELL
    leaves_out = "The simulation stopped its rays after too few bounces; light that bounces often is missing."
    local_error = 0.3  # where light of many bounces leaves, the lens decides
    parameters = (
        Parameter(
            "max_bounces", "1", "wall bounces after which the simulation stopped", 1.0, 40.0, 12.0, (4.0,), centre=40.0
        ),
    )
    needs = "a variant, or the systems' description"
    source = "re-simulation without a limit; report chapters 7 to 9 (12, 20 and 50 bounces)"
    tie_breaker = "run the simulation again with a higher limit"


class WallScatter(Retraced):
    """The specular wall scatters a little."""

    like_a_lens = True
    local_error = 0.3  # by what lobe a wall scatters is not known

    id = "wall-scatter"
    stage = Stage.WELL
    leaves_out = "The specular wall scatters part of the light."
    parameters = (Parameter("scatter", "1", "share of each reflection that is diffuse", 0.0, 1.0, 0.15, (0.1,)),)
    needs = "a variant, or the systems' description"
    source = "re-simulation; report chapters 6 and 8 (foam core, tube wall)"
    tie_breaker = "a scatter measurement of the wall"
