"""Tissue from recordings, from one end to the other."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.cases.moments import Moments
from warpbrain.cases.shipped import as_case
from warpbrain.errors import SolveError, require_kind
from warpbrain.estimation.finer_mesh import Discretisation, DiscretisationError, FinerMesh, discretisation_error
from warpbrain.estimation.fit import Estimate, GaussNewton
from warpbrain.estimation.forward import Forward
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.options import EstimationOptions, Listener
from warpbrain.estimation.parameters import Parameters, PriorMode, prior_modes, prior_of
from warpbrain.estimation.posterior import Posterior
from warpbrain.estimation.problem import Nuisances, Problem
from warpbrain.estimation.registration import registration_of
from warpbrain.estimation.sampling import Proposal, Target, importance_sampling, run_chain
from warpbrain.gp.prior import Prior
from warpbrain.gp.process import Process
from warpbrain.recordings.comparison import root_mean_square
from warpbrain.seconds import Seconds
from warpbrain.simulation.locking import elements_of_fits, on_linear_elements

#: The error of the mesh is computed again until the estimate moves by no more than this, in standard deviations.
_SETTLED = 0.2
#: Tolerance of Gauss-Newton before the error of the mesh is known.
_BEFORE = 0.1
#: A mesh whose displacements change by more than this on elements of half the size is too coarse to be corrected well.
_TOO_COARSE = 0.15
#: And no more often than this.
_MOST_ERRORS = 4


def estimate(
    case: Case | str,
    prior: Prior | Process | None = None,
    options: EstimationOptions | None = None,
    device: str | None = None,
    listener: Listener | None = None,
) -> Posterior:
    """Estimate the laws of a case's tissues from its recordings.

    Parameters
    ----------
    case : Case or str
        A case, the name of a shipped one, or the path of a case folder. Its laws say what kind of law each tissue has;
        their parameters do not count.
    prior : Prior or Process, optional
        Of the tissues, or the generative model that gives it; the default one unless given.
    options : EstimationOptions, optional
    device : str, optional
        Warp device.
    listener : Listener, optional

    Raises
    ------
    InputError
        If there is nothing to estimate from, a noise is not positive, or a tissue has no prior.
    SolveError
        If no equilibrium is found, or what was recorded is gross errors only.

    Examples
    --------
    >>> from warpbrain import estimate, find_case
    >>> posterior = estimate(find_case("0529", "single"))  # doctest: +SKIP
    >>> [marginal.interval for marginal in posterior.marginals]  # doctest: +SKIP
    """
    require_kind(options or EstimationOptions(), EstimationOptions, "options", "EstimationOptions(...)")
    return Estimation(as_case(case), prior, options, device, listener).run()


class Estimation:
    """The stages of an estimation; parameters as of `estimate`."""

    def __init__(
        self,
        case: Case,
        prior: Prior | Process | None = None,
        options: EstimationOptions | None = None,
        device: str | None = None,
        listener: Listener | None = None,
    ) -> None:
        self.case = case
        self.options = options or EstimationOptions()
        self.listener = listener or Listener()
        self.seconds = Seconds()
        self._solves: dict[str, int] = {}
        self._device = device
        self._registration = registration_of(case) if self.options.registration else None
        self._remarks = on_linear_elements(case.poisson, "an estimate")
        # what is wrong with recordings is known before anything is computed
        self.moments = Moments.recorded(case)
        self.observations = Observations.to_fit(case, self.moments)
        self._remarks += self.observations.remarks
        self.parameters = Parameters.of(case)
        with self.seconds.of("prior"):
            self.prior = prior if isinstance(prior, Prior) else prior_of(case, prior, seed=self.options.seed)
            self.prior_modes = prior_modes(self.prior, self.parameters)
        with self.seconds.of("pre-processing"):
            elements = elements_of_fits(case.poisson)
            self.forward = Forward(case, self.prior_modes[0].gaussian.mean, device, elements, self.moments)

    def run(self) -> Posterior:
        with self._counted("estimate"):
            modes = self.fit(Nuisances(registration=self._registration))
        errors: list[DiscretisationError] = []
        if self.options.discretisation is not None:
            with self._counted("estimate with the error of the mesh", "error of the mesh"):
                modes = self._corrected_for_mesh(modes, self.options.discretisation, errors)
        modes[0].require_explained()
        with self._counted("check of the posterior"):
            target, proposal = Target(self.prior, modes), Proposal.of(modes)
            count, rng = self.options.samples, np.random.default_rng([self.options.seed, 0])
            self.listener.stage(f"check of the posterior: {count} equilibria")
            importance = importance_sampling(target, proposal, count, rng, lambda n: self.listener.progress(n / count))
        doubts, chain = importance.doubts(modes[0].laplace), None
        if doubts:
            with self._counted("chain"):
                solves, rng = self.options.chain, np.random.default_rng([self.options.seed, 1])
                self.listener.stage(f"Laplace's approximation fails: a chain of {solves} equilibria instead")
                best = int(np.argmax(importance.log_densities))
                begin = importance.theta[best] if np.isfinite(importance.log_densities[best]) else modes[0].theta
                chain = run_chain(target, proposal, begin, solves, rng, lambda n: self.listener.progress(n / solves))
        about = self.case, self.options, self.prior, modes, tuple(self._remarks), tuple(errors)
        return Posterior(*about, importance, doubts, chain, self._solves, self.seconds)

    @contextmanager
    def _counted(self, solves: str, seconds: str = "") -> Iterator[None]:
        """A stage whose equilibria and time are counted, by these names."""
        before = self.forward.solves
        with self.seconds.of(seconds or solves):
            yield
        self._solves[solves] = self.forward.solves - before

    def fit(self, nuisances: Nuisances, starts: tuple[Estimate, ...] = ()) -> tuple[Estimate, ...]:
        """The estimate in every mode of the prior, the most probable first; `SolveError` if there is none in any.

        It goes on from `starts`, estimates with other nuisances, if there are any.
        """
        estimates, failures = [], []
        begun: list[tuple[PriorMode, Estimate | None]]
        begun = [(start.problem.mode, start) for start in starts] or [(mode, None) for mode in self.prior_modes]
        for prior_mode, start in begun:
            try:
                estimates.append(self._fit_one(prior_mode, nuisances, start))
            except SolveError as error:
                failures.append(error)
                remark = f"{_where(self.parameters, prior_mode)}: {error}"
                if remark not in self._remarks:
                    self._remarks.append(remark)
        if not estimates:
            raise failures[0]
        return tuple(sorted(estimates, key=lambda mode: -mode.log_evidence))

    def _fit_one(self, prior_mode: PriorMode, nuisances: Nuisances, start: Estimate | None) -> Estimate:
        text = "Gauss-Newton" + (f", {_where(self.parameters, prior_mode)}" if len(self.prior_modes) > 1 else "")
        self.listener.stage(text if start is None else f"{text}, with the error of the mesh")
        problem = Problem(self.forward, self.observations, prior_mode, self.options.likelihood, nuisances)
        # what is only the start of something better need not be exact
        final = self.options.discretisation is None or nuisances.error is not None
        tolerance = self.options.tolerance if final else max(self.options.tolerance, _BEFORE)
        fitted = GaussNewton(problem, tolerance, self.listener.step).solve(start)
        if not fitted.converged:
            self._remarks.append(f"{text}: not converged")
        return fitted

    def _corrected_for_mesh(
        self, modes: tuple[Estimate, ...], believed: Discretisation, errors: list[DiscretisationError]
    ) -> tuple[Estimate, ...]:
        finer = [FinerMesh(self._device) for _ in self.forward.states]
        for _ in range(_MOST_ERRORS):
            self.listener.stage("error of the mesh: one equilibrium on elements of half the size")
            state, derivatives = modes[0].point.state, modes[0].linearised.derivatives
            errors.append(discretisation_error(finer, self.forward, state, derivatives))
            modes = self.fit(Nuisances(believed, errors[-1], self._registration), modes)
            if np.sqrt(2.0 * modes[0].laplace.posterior.negative_log(errors[-1].change.theta)) <= _SETTLED:
                break
        else:
            self._remarks.append("the error of the mesh was still changing when it was last computed")
        change, moved = errors[-1].change.size, root_mean_square(modes[0].point.state.u)
        # where nothing acts nothing moves, on either mesh
        part = change / moved if moved > 0.0 else 0.0
        if part > _TOO_COARSE:
            self._remarks.append(
                f"the mesh is coarse: on elements of half the size displacements change by {100.0 * part:.0f} %; what "
                "is left of its error may be larger than the intervals"
            )
        self._solves["on elements of half the size"] = sum(mesh.solves for mesh in finer)
        return modes


def _where(parameters: Parameters, mode: PriorMode) -> str:
    """Which mode, in words: the signs of its exponents."""
    ends = zip(parameters, mode.low, strict=True)
    words = [
        f"{parameter.name} {'>' if low > 0.0 else '<'} 0" for parameter, low in ends if parameter.coordinate.signed
    ]
    return ", ".join(words) or "prior"
