"""Makes records with several optima or one that is hard to find: two modes of known damping, an unstable aircraft.

If damping is free, the search passes through a heavily damped response. If it is known, a wrong frequency slips cycles,
and each slip is an optimum of its own.
"""

from typing import NamedTuple

import numpy as np

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.problem import FitOptions
from flightpower.analysis.estimation.process_noise import ProcessNoise
from flightpower.analysis.estimation.simulation import build_simulator
from tests.analysis.estimation import twins

DUTCH_ROLL_TRUTH = {"Nb": 6.0, "Ndr": -1.6, "Ydr": 0.03}
DUTCH_ROLL = Model(
    name="Dutch roll of known damping",
    states=("beta", "r"),
    inputs=("dr",),
    outputs=("beta", "r"),
    parameters=tuple(Parameter(name=name, start=value) for name, value in DUTCH_ROLL_TRUTH.items()),
    dynamics=lambda x, u, p: (-0.02 * x.beta - x.r + p.Ydr * u.dr, p.Nb * x.beta - 0.05 * x.r + p.Ndr * u.dr),
    output_function=lambda x, u, p: (x.beta, x.r),
)
MODE_TRUTH = {"k": 9.0, "b": 1.0}
MODE = Model(
    name="a mode of which the displacement alone is measured",
    states=("x", "v"),
    inputs=("u",),
    outputs=("x",),
    parameters=tuple(Parameter(name=name, start=value) for name, value in MODE_TRUTH.items()),
    dynamics=lambda x, u, p: (x.v, -p.k * x.x - 0.05 * x.v + p.b * u.u),
    output_function=lambda x, u, p: (x.x,),
    initial_state=lambda segment: {"x": float(segment.z["x"][0]), "v": 0.0},
)


class Bimodal(NamedTuple):
    """A record, its model and true values. noise : process noise that filter error looks for; the records have none"""

    model: Model
    record: Segment
    truth: dict[str, float]
    noise: tuple[ProcessNoise, ...]
    options: FitOptions = FitOptions()

    def starts(self, count: int, seed: int, factor: float = 2.0) -> list[dict[str, float]]:
        """Return the true values, each times a random factor between 1/factor and factor."""
        rng = np.random.default_rng(seed)
        return [
            {name: value * factor ** rng.uniform(-1, 1) for name, value in self.truth.items()} for _ in range(count)
        ]


def cases(seed: int) -> dict[str, Bimodal]:
    """Return cases with white and with colored noise. With colored noise, residuals are never white, so the verdict
    alone cannot distinguish optima."""
    bimodals = {}
    for kind, color in (("white", 0.0), ("colored", 0.8)):
        bimodals |= {
            f"Dutch roll, {kind} noise": Bimodal(
                DUTCH_ROLL, _ringing(DUTCH_ROLL, DUTCH_ROLL_TRUTH, (0.001, 0.002), color, seed), DUTCH_ROLL_TRUTH,
                (ProcessNoise(state="r", start=0.01),),
            ),
            f"unmeasured rate, {kind} noise": Bimodal(
                MODE, _ringing(MODE, MODE_TRUTH, (0.0005,), color, seed), MODE_TRUTH,
                (ProcessNoise(state="v", start=0.01),),
            ),
        }  # fmt: skip
    bimodals["unstable, 7 s"] = Bimodal(
        twins.UNSTABLE, _first(twins.unstable(seed), 140), twins.UNSTABLE_TRUTH, twins.UNSTABLE_NOISE,
        FitOptions(inputs="held"),
    )  # fmt: skip
    return bimodals


def _ringing(model: Model, truth: dict[str, float], sigma: tuple[float, ...], color: float, seed: int) -> Segment:
    """Return 30 s of a mode that rings from the start, with a doublet. color: lag-one correlation of the noise."""
    t, step_s = np.arange(600) * twins.STEP_S, twins.STEP_S
    (name,) = model.inputs
    u = twins.steps(t, 1.0, 0.5, (1, 1), 0.02)
    y = build_simulator(model, ()).run(np.array([0.1, 0.0]), u[:, None], np.array(list(truth.values())), step_s).y
    noise = np.array(sigma) * np.random.default_rng(seed).standard_normal(y.shape)
    for k in range(1, len(noise)):
        noise[k] += color * noise[k - 1]
    return Segment(name="run", t_s=t, u={name: u}, z=dict(zip(model.outputs, (y + noise).T, strict=True)))


def _first(segment: Segment, samples: int) -> Segment:
    u, z = ({name: values[:samples] for name, values in part.items()} for part in (segment.u, segment.z))
    return Segment(name=segment.name, t_s=segment.t_s[:samples], u=u, z=z)
