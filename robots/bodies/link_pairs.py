"""Plan of an arm's self-collision check: which pairs of links are checked, how, and why not the others."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from itertools import combinations

import numpy as np

from robots.bodies.geometry import Body, enlarged, exact_body, hull_bodies, hull_body, surface
from robots.bodies.pair_study import (
    FEWEST_FALSE,
    MEMORY_LIMIT,
    MOST_TRIANGLES,
    SURVEYED,
    TIME_LIMIT_S,
    Case,
    Finding,
    study_results,
)
from robots.bodies.sampling import SAMPLES, allowed_positions
from robots.bodies.self_collision import Pairs, SelfPairs, self_pairs, touching_pairs
from robots.bodies.verdicts import ELSEWHERE, EXACT, IGNORED, Kind, Verdict
from robots.descriptions.description import load
from robots.kinematics.joints import FloatArray
from robots.kinematics.kinematic_tree import Tree, TreeLink, are_neighbours, tree_of
from robots.kinematics.model import RobotModel, build_model, link_placements
from robots.schema.robot_toml import Model, RobotDescription, UrdfDescription

Bodies = tuple[tuple[int, Body], ...]
Links = tuple[str, str]
# Parameters of the verdicts' texts.
_VALUES: dict[Kind, dict[str, str | int]] = {
    Kind.ALWAYS: {"positions": SAMPLES},
    Kind.NOT_STUDIED: {"seconds": round(TIME_LIMIT_S), "gigabytes": MEMORY_LIMIT >> 30},
    Kind.TOO_LARGE: {"triangles": MOST_TRIANGLES},
}


@dataclass(frozen=True, eq=False)
class PairPlan:
    """The self-collision check of an arm.

    Attributes:
        bodies: Hulls, each with the number of its link; the box of a hull contains the link's visual shape
            too if that is checked.
        pairs: Numbers of two bodies, and the bodies to check for them.
        verdicts: One for every two links with a shape.
        pending: The study of pairs with touching hulls is still running; until it ends, hulls are checked.
    """

    bodies: Bodies
    pairs: Pairs
    verdicts: tuple[Verdict, ...]
    pending: bool = False

    @property
    def ignored(self) -> tuple[tuple[Links, str], ...]:
        """The unchecked pairs, and the reasons."""
        return tuple((each.links, each.text) for each in self.verdicts if each.kind in IGNORED)

    @property
    def refined(self) -> tuple[tuple[Links, str], ...]:
        """Pairs of which the hulls touch at home, and how they are checked."""
        others = IGNORED | {Kind.APART} | ELSEWHERE
        return tuple((each.links, each.text) for each in self.verdicts if each.kind not in others)

    @property
    def elsewhere(self) -> tuple[tuple[Links, str], ...]:
        """Pairs of which the hulls are apart at home and often touch elsewhere, and how they are checked."""
        return tuple((each.links, each.text) for each in self.verdicts if each.kind in ELSEWHERE)


def ignored_pairs(description: RobotDescription, tree: Tree) -> dict[frozenset[str], Verdict]:
    """Return the pairs of links with a shape that are ignored without a study."""
    found: dict[frozenset[str], Verdict] = {}
    if isinstance(description, UrdfDescription):
        for links, file in description.robot.ignored:
            found[frozenset(links)] = Verdict(links, Kind.SRDF, {"file": file})
    for links in description.collision.ignore:
        found[frozenset(links)] = Verdict(links, Kind.DESCRIPTION)
    for one, other in combinations([link for link in tree.links if link.checked], 2):
        if are_neighbours(tree, one.joint, other.joint):
            links = one.name, other.name
            found[frozenset(links)] = Verdict(links, Kind.ADJACENT)
    return found


def plan_pairs(model: Model, confined: bool, *, wait: bool) -> PairPlan:
    """Plan an arm's self-collision check.

    Args:
        model, confined: For `robots.descriptions.description.load`.
        wait: Wait for the study. Otherwise it continues in its process, and the plan is pending.

    Raises:
        ShapeError: If a shape cannot be read.
    """
    return _with_study(_prepare_model(model, confined), wait=wait)


def plan_of(description: RobotDescription) -> PairPlan:
    """Plan an arm's self-collision check, and wait for the study.

    Raises:
        ShapeError: If a shape cannot be read.
    """
    return _with_study(_prepare(description), wait=True)


def _with_study(start: "_Preparation", *, wait: bool) -> PairPlan:
    if start.case is None:
        return start.plan
    found = study_results(start.case, wait=wait)
    if found is None:
        return replace(start.plan, pending=True)
    if found not in start.refined:
        start.refined[found] = _refine(start, found)
    return start.refined[found]


@dataclass(frozen=True, eq=False)
class _Preparation:
    """A plan before its study.

    Attributes:
        plan: The plan with hulls only.
        numbers: Numbers of the pairs to study.
        case: The study of these pairs; None if there are none.
        refined: Refined plans by the study's results; cached, because a plant has many equal arms.
    """

    plan: PairPlan
    numbers: tuple[int, ...] = ()
    case: Case | None = None
    refined: dict[tuple[Finding, ...], PairPlan] = field(default_factory=dict)


@lru_cache(maxsize=8)
def _prepare_model(model: Model, confined: bool) -> _Preparation:
    return _prepare(load(model, confined=confined))


def _prepare(description: RobotDescription) -> _Preparation:
    tree, built = tree_of(description), build_model(description)
    bodies = tuple(
        (number, body) for number, link in enumerate(tree.links) for body in hull_bodies(link.checked)
    )
    ignored = ignored_pairs(description, tree)
    pairs, verdicts = [], []
    for one, other in combinations(range(len(bodies)), 2):
        links = tree.links[bodies[one][0]].name, tree.links[bodies[other][0]].name
        verdict = ignored.get(frozenset(links))
        verdicts.append(replace(verdict, links=links) if verdict else Verdict(links, Kind.APART))
        if verdict is None:
            pairs.append((one, other, (bodies[one][1], bodies[other][1])))
    plan = PairPlan(bodies, tuple(pairs), tuple(verdicts))
    positions = allowed_positions(built.joints, SURVEYED)
    touching = _touching(self_pairs(tree, bodies, pairs), built, positions)
    if not touching:
        return _Preparation(plan)
    case = _case(
        [tree.links[number] for number, _ in bodies],
        built,
        [(pairs[number][:2], samples) for number, samples in touching.items()],
        positions,
    )
    return _Preparation(plan, tuple(touching), case)


def _touching(own: SelfPairs, model: RobotModel, positions: FloatArray) -> dict[int, list[int]]:
    """Return the pairs of which the hulls touch at home or often, with the positions in which they touch.

    Args:
        positions: (m, n) joint positions [rad] or [m], home first.
    """
    found: dict[int, list[int]] = {}
    for sample, each in enumerate(positions):
        for number in touching_pairs(own, model, each):
            found.setdefault(number, []).append(sample)
    return {
        number: samples
        for number, samples in found.items()
        if samples[0] == 0 or len(samples) >= FEWEST_FALSE
    }


def _case(
    links: Sequence[TreeLink],
    model: RobotModel,
    pairs: Sequence[tuple[tuple[int, int], Sequence[int]]],
    positions: FloatArray,
) -> Case:
    """Make the case for a study of pairs of links.

    Args:
        pairs: Numbers of two links, and of the positions in which their hulls touch.
        positions: (m, n) joint positions [rad] or [m], home first.
    """
    used = sorted({number for pair, _ in pairs for number in pair})
    frames = [model.link_names.index(links[number].name) for number in used]
    at_home = {number for pair, samples in pairs if samples[0] == 0 for number in pair}
    first = 0
    if at_home:
        many = allowed_positions(model.joints, SAMPLES)
        first, positions = len(many), np.concatenate([many, positions])
    return Case(
        tuple((used.index(one), used.index(other)) for (one, other), _ in pairs),
        tuple(surface(links[number].checked) for number in used),
        # Only pairs that touch at home may be checked as visual surfaces.
        tuple(surface(links[number].shapes if number in at_home else ()) for number in used),
        np.stack([link_placements(model, each)[frames] for each in positions]),
        tuple(np.array([] if samples[0] == 0 else samples, np.int64) + first for _, samples in pairs),
    )


def _refine(start: _Preparation, found: tuple[Finding, ...]) -> PairPlan:
    """Return the plan with the results of its study."""
    assert start.case is not None
    case, bodies, verdicts, pairs = start.case, list(start.plan.bodies), [], []

    @cache
    def exact(number: int, drawn: bool) -> Body:
        triangles = (case.drawn if drawn else case.checked)[number]
        return replace(exact_body(triangles), hull=hull_body(triangles.reshape(-1, 3)).geometry)

    results = dict(zip(start.numbers, found, strict=True))
    studied_pairs = dict(zip(start.numbers, start.case.pairs, strict=True))
    checked = iter(enumerate(start.plan.pairs))
    for verdict in start.plan.verdicts:
        if verdict.kind in IGNORED:
            verdicts.append(verdict)
            continue
        number, (one, other, measured) = next(checked)
        kind, share = results.get(number, Finding(Kind.APART))
        values = _VALUES.get(kind, {})
        if kind in ELSEWHERE:
            values = {"percent": round(100 * share), **values}
        verdicts.append(replace(verdict, kind=kind, values=values))
        if kind is Kind.ALWAYS:
            continue
        if kind in EXACT:
            first, second = studied_pairs[number]
            measured = exact(first, kind is Kind.VISUAL_SURFACES), exact(second, kind is Kind.VISUAL_SURFACES)
            if kind is Kind.VISUAL_SURFACES:
                for body, geometry in zip((one, other), measured, strict=True):
                    bodies[body] = bodies[body][0], enlarged(bodies[body][1], geometry.corners)
        pairs.append((one, other, measured))
    return PairPlan(tuple(bodies), tuple(pairs), tuple(verdicts))
