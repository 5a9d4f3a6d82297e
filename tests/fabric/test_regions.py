"""Fabrics per element and per subdomain: one ply equals the sum of its parts."""

import numpy as np
import pytest
from skfem import MeshQuad, asm

from skfem_textile import (
    Condition,
    Fabric,
    FormTerm,
    Full,
    Linear,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    Sin2,
    Tabulated,
    split,
)
from skfem_textile.fabric.regions import RegionalLaw
from skfem_textile.mesh.splitting import cut
from tests.helpers import Coupled, assert_derivatives, form_parameters, random_u

LEFT = Fabric((1e3, 500.0), Sin2(1.0), warp=(1, 0.3), weft=(-0.2, 1))
RIGHT = Fabric((2e3, 100.0), Linear(3.0), warp=(1, 0.6), weft=(-0.5, 1))
COUPLED = Fabric(Coupled(1e3, 300.0), 1.0, warp=(1, 0.3), weft=(-0.2, 1))


def halves(mesh):
    left = mesh.p[0, mesh.t].mean(axis=0) < 5
    halves = {"left": np.flatnonzero(left), "right": np.flatnonzero(~left)}
    return mesh.with_subdomains(halves)


def rectangle():
    mesh = MeshQuad.init_tensor(np.linspace(0, 10, 5), np.linspace(0, 8, 4))
    return halves(mesh.with_defaults())


def test_a_table_is_evaluated_in_its_region_only(caplog):
    table = Tabulated([0.0, 0.1], [0.0, 1.0], "linear")
    law = RegionalLaw([table, Linear(3.0)], np.array([0, 1])).at()
    energy = law.energy(np.array([[0.1], [0.5]]))
    np.testing.assert_allclose(energy, [[0.05], [0.375]])
    assert caplog.records == []
    law.energy(np.array([[0.2], [0.5]]))
    assert len(caplog.records) == 1


PLIES = {
    "full": (Full(), rectangle, LEFT),
    "full, coupled": (Full(), rectangle, COUPLED),
    "one point": (OnePoint(), rectangle, LEFT),
    "rate": (OnePoint(1.0, "rate"), rectangle, LEFT),
    "continuity": (OnePoint(1.0, "continuity"), rectangle, LEFT),
    "isotropic": (OnePoint(1.0, "isotropic"), rectangle, LEFT),
    "macro": (Macro(), lambda: split(rectangle()), LEFT),
    "macro, coupled": (Macro(), lambda: split(rectangle()), COUPLED),
    "macro triangles": (Macro(), lambda: split(halves(cut(rectangle()))), LEFT),
    "quadratic": (Quadratic(), lambda: halves(cut(rectangle())), LEFT),
    "mean": (Quadratic(20.0), lambda: halves(cut(rectangle())), LEFT),
    "mean, coupled": (Quadratic(20.0), lambda: halves(cut(rectangle())), COUPLED),
}
every_ply = pytest.mark.parametrize(
    ("formulation", "mesh", "left"), PLIES.values(), ids=PLIES
)


@every_ply
def test_a_fabric_of_a_subdomain_applies_to_its_elements(formulation, mesh, left):
    mesh = mesh()
    ply = Ply(mesh, {"left": left, "right": RIGHT}, formulation)
    u = 0.3 * random_u(ply, 1)
    in_left = np.isin(np.arange(mesh.nelements), mesh.subdomains["left"])
    for alone, half in ((left, in_left), (RIGHT, ~in_left)):
        tension = Ply(mesh, alone, formulation).fibre_tension(u)
        T = ply.fibre_tension(u)
        np.testing.assert_allclose(T[:, half], tension[:, half], rtol=1e-9)


@every_ply
def test_forms_and_kernels_agree_and_are_derivatives(formulation, mesh, left):
    ply = Ply(mesh(), {"left": left, "right": RIGHT}, formulation)
    u = 0.3 * random_u(ply, 1)
    for term in ply.terms:
        if isinstance(term, FormTerm):
            energy = asm(term.forms.energy, term.basis, u=u, **form_parameters(term))
            assert ply.energies(u)[term.name] == pytest.approx(energy, rel=1e-10)
    if getattr(formulation, "kind", "") == "rate":
        return  # which has no energy, and an approximate tangent
    assert_derivatives(ply, u, random_u(ply, 2))


@pytest.mark.parametrize("parts", [False, True])
def test_values_of_the_users_elements_apply_to_their_parts(parts):
    mesh = split(rectangle()) if parts else rectangle()
    of_left = np.isin(np.arange(12), rectangle().subdomains["left"])

    def by_element(left, right):
        return np.where(of_left, np.transpose([left]), np.transpose([right])).squeeze()

    left = Fabric((1e3, 500.0), 1.0, (1, 0.3), (-0.2, 1))
    right = Fabric((2e3, 100.0), 3.0, (1, 0.6), (-0.5, 1))
    tensions = (by_element(1e3, 2e3), by_element(500.0, 100.0))
    directions = by_element(left.warp, right.warp), by_element(left.weft, right.weft)
    by_values = Fabric(tensions, by_element(1.0, 3.0), *directions)
    one, other = (
        Ply(mesh, given, Macro() if parts else OnePoint())
        for given in (by_values, {"left": left, "right": right})
    )
    u = 0.3 * random_u(one, 1)
    assert one.energies(u) == pytest.approx(other.energies(u), rel=1e-12)
    np.testing.assert_allclose(one.residual(u), other.residual(u), atol=1e-9)


def test_a_run_with_two_fabrics_is_resumed_and_distinguished_from_others(tmp_path):
    conditions = {"clamp": Condition("left"), "pull": Condition("right", (0.2, 0.1))}
    regions = {"left": LEFT, "right": RIGHT}

    def stepper(regions, on_step=None):
        ply = Ply(rectangle(), regions, OnePoint())
        options = {"checkpoint": tmp_path, "on_step": on_step}
        return LoadStepper(ply, conditions, 3, **options)

    def stop(state):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stepper(regions, stop).run()
    with pytest.raises(ValueError, match="belongs to another run"):
        stepper({"left": RIGHT, "right": LEFT}).run(resume=True)
    assert stepper(regions).run(resume=True).converged
