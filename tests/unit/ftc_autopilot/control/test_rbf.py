"""The network's basis functions against a computation with arrays."""

import numpy as np
import pytest

from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.control.rbf import Rbf, basis_norm


@pytest.mark.parametrize("neurons", [1, 2, 3, 15])
def test_centres_lie_on_the_diagonal_from_end_to_end(neurons: int) -> None:
    network = Rbf(neurons=neurons, span=0.8, width=1.3, speed_scale=0.03)
    record = np.zeros(1, record_dtype(Rbf))[0]
    fill(record, network)
    v, phi = (44.0, 1.0, -3.0), (0.3, -0.2, 1.0)
    omega, delta = (0.5, -0.4, 0.1), (0.05, -0.1, 0.3)
    theta = np.concatenate([np.multiply(0.03, v), phi, omega, delta])
    centres = np.linspace(-0.8, 0.8, neurons)  # eq. (24): one alone stands at the low end
    distance2 = ((theta - centres[:, None]) ** 2).sum(axis=1)
    expected = (np.exp(-distance2 / 1.3**2) ** 2).sum()
    assert basis_norm(v, phi, omega, delta, record) == pytest.approx(expected)
