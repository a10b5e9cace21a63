"""Maximum-likelihood estimation of the parameters of any dynamic model, from records of its inputs and outputs.

    from flightpower.analysis.estimation import Model, Parameter, Segment, fit_output_error, uncertainty

    k = Parameter(name="k", start=1.0, unit="1/s")
    decay = Model(name="decay", states=("x",), outputs=("x",), parameters=(k,),
                  dynamics=lambda x, u, p: (-p.k * x.x,), output_function=lambda x, u, p: (x.x,))
    fit = fit_output_error(decay, Segment(name="run", t_s=t, u={}, z={"x": measured}))
    print(fit)                                  # verdict, estimates, standard errors, large correlations
    uncertainty.morelli_klein(fit)              # standard errors where residuals are colored

Vocabulary
    Segment     one record (a maneuver): time t_s (n,), uniform; inputs u and measured outputs z, each a mapping of name
                to (n,); NaN where an output was not measured. Units are the user's, if consistent; time is in seconds.
    Model       xdot = dynamics(x, u, p), y = output_function(x, u, p), z = y + noise. Both functions use NumPy and
                get states, inputs and parameters by name: x.alpha, u.elevator, p.CLa. Frames and signs are the model's.
    Parameter   free or fixed, with starting value, bounds and a normal prior.
    theta       the m unknowns: free parameters, then the free initial states of each segment, then noise parameters.
    Fit         estimates and their covariance (m, m) in the order of `fit.names`; residuals z - y (n, outputs);
                `fit.verdict` says whether the fit can be used (`verdict.ok`) and what is wrong with it (`findings`).
    R           covariance (outputs, outputs) of the measurement noise, estimated unless given (`MeasurementNoise`).
    ProcessNoise  white noise that drives a state, with an intensity in the state's unit per square root of a second.

Estimators: `fit_output_error` (measurement noise), `fit_filter_error` (also process noise, such as turbulence),
`fit_equation_error` (regression on measured states, for starting values); `best_of_starts` fits from several starts.
Modules: `uncertainty` of the estimates, `validation` on other records, `term_selection` for a model's terms.

The package imports only `flight.arrays`, `flight.errors` and `flight.settings` from the rest of this project. Mistakes
of the user raise `InputError`.
Equation numbers, such as (3.32), are those of L. Soltmann's dissertation; methods follow R. V. Jategaonkar, Flight
Vehicle System Identification, 2nd ed., and V. Klein & E. A. Morelli, Aircraft System Identification, 2006.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flightpower.analysis.estimation import term_selection as term_selection
    from flightpower.analysis.estimation import uncertainty as uncertainty
    from flightpower.analysis.estimation import validation as validation
    from flightpower.analysis.estimation.data import Segment as Segment
    from flightpower.analysis.estimation.equation_error import fit_equation_error as fit_equation_error
    from flightpower.analysis.estimation.filter_error import fit_filter_error as fit_filter_error
    from flightpower.analysis.estimation.fit import Fit as Fit
    from flightpower.analysis.estimation.model import Model as Model
    from flightpower.analysis.estimation.model import Parameter as Parameter
    from flightpower.analysis.estimation.output_error import MeasurementNoise as MeasurementNoise
    from flightpower.analysis.estimation.output_error import fit_output_error as fit_output_error
    from flightpower.analysis.estimation.problem import FitOptions as FitOptions
    from flightpower.analysis.estimation.process_noise import ProcessNoise as ProcessNoise
    from flightpower.analysis.estimation.starts import best_of_starts as best_of_starts

# Imported when first used: CasADi and SciPy take a fifth of a second.
_MODULE_OF = {
    "Segment": "data",
    "Model": "model",
    "Parameter": "model",
    "FitOptions": "problem",
    "MeasurementNoise": "output_error",
    "ProcessNoise": "process_noise",
    "Fit": "fit",
    "fit_output_error": "output_error",
    "fit_filter_error": "filter_error",
    "fit_equation_error": "equation_error",
    "best_of_starts": "starts",
}
_MODULES = ("term_selection", "uncertainty", "validation")
__all__ = [*_MODULE_OF, *_MODULES]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"{__name__}.{name}")
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; known: {', '.join(__all__)}")
    return getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
