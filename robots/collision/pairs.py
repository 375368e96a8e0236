"""Which pairs of an arm's own links are checked, how, and why the others are not."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations
from pathlib import Path

import numpy as np

from robots.collision.bodies import Body, exact_body, hull_bodies, surface, wider
from robots.collision.own import Pairs, own_pairs, touching_pairs
from robots.collision.sampling import SAMPLES, allowed_positions
from robots.collision.study import MEMORY_LIMIT, TIME_LIMIT_S, Case, studied
from robots.collision.verdicts import IGNORED, Kind, Verdict
from robots.description import load
from robots.model import RobotModel, build_model, link_placements
from robots.schema import RobotDescription, UrdfDescription
from robots.tree import Tree, TreeLink, are_neighbours, tree_of

Bodies = tuple[tuple[int, Body], ...]
Links = tuple[str, str]
# What the texts of verdicts name.
_VALUES: dict[Kind, dict[str, str | int]] = {
    Kind.ALWAYS: {"positions": SAMPLES},
    Kind.NOT_STUDIED: {"seconds": round(TIME_LIMIT_S), "gigabytes": MEMORY_LIMIT >> 30},
}


@dataclass(frozen=True, eq=False)
class PairPlan:
    """How an arm is checked against itself.

    Attributes:
        bodies: Hulls, each with the number of its link; the box of one that is checked as what is drawn
            holds that, too.
        pairs: Numbers of two bodies, and what is checked of them.
        verdicts: Of every two links with a shape.
        pending: The study of pairs that touch at home goes on; until it ends they are checked as hulls.
    """

    bodies: Bodies
    pairs: Pairs
    verdicts: tuple[Verdict, ...]
    pending: bool = False

    @property
    def ignored(self) -> tuple[tuple[Links, str], ...]:
        """Pairs that are not checked, and the reason."""
        return tuple((each.links, each.text) for each in self.verdicts if each.kind in IGNORED)

    @property
    def refined(self) -> tuple[tuple[Links, str], ...]:
        """Pairs that touch at home as hulls, and as what they are checked."""
        own = IGNORED | {Kind.APART}
        return tuple((each.links, each.text) for each in self.verdicts if each.kind not in own)


def ignored_pairs(description: RobotDescription, tree: Tree) -> dict[frozenset[str], Verdict]:
    """Pairs of links with a shape that are ignored without a study."""
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


def plan_pairs(model: str | Path, confined: bool, *, wait: bool) -> PairPlan:
    """Decide how an arm is checked against itself.

    Args:
        model, confined: As `robots.description.load` takes them.
        wait: Else a study that takes time goes on elsewhere, and the plan is pending.

    Raises:
        MeshError: If a mesh cannot be read.
    """
    return _planned(_start(model, confined), wait=wait)


def plan_of(description: RobotDescription) -> PairPlan:
    """Decide how an arm is checked against itself, and wait for the study.

    Raises:
        MeshError: If a mesh cannot be read.
    """
    return _planned(_begun(description), wait=True)


def _planned(start: "_Start", *, wait: bool) -> PairPlan:
    if start.case is None:
        return start.plan
    found = studied(start.case, wait=wait)
    if found is None:
        return replace(start.plan, pending=True)
    return _refined(start, found)


@dataclass(frozen=True, eq=False)
class _Start:
    """What is known without a study.

    Attributes:
        plan: With hulls alone.
        touching: Which of its pairs touch at home.
        case: A study of those; None: there is none.
    """

    plan: PairPlan
    touching: tuple[int, ...] = ()
    case: Case | None = None


@lru_cache(maxsize=8)
def _start(model: str | Path, confined: bool) -> _Start:
    return _begun(load(model, confined=confined))


def _begun(description: RobotDescription) -> _Start:
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
    touching = tuple(touching_pairs(own_pairs(tree, bodies, pairs), built, built.joints.home))
    if not touching:
        return _Start(plan)
    case = _case(
        [tree.links[number] for number, _ in bodies], built, [pairs[number][:2] for number in touching]
    )
    return _Start(plan, touching, case)


def _case(links: Sequence[TreeLink], model: RobotModel, pairs: Sequence[tuple[int, int]]) -> Case:
    """A study of pairs of links, by their numbers among these."""
    used = sorted({number for pair in pairs for number in pair})
    frames = [model.link_names.index(links[number].name) for number in used]
    positions = allowed_positions(model.joints, SAMPLES)
    return Case(
        tuple((used.index(one), used.index(other)) for one, other in pairs),
        tuple(surface(links[number].checked) for number in used),
        tuple(surface(links[number].shapes) for number in used),
        np.stack([link_placements(model, each)[frames] for each in positions]),
    )


def _refined(start: _Start, found: Sequence[Kind]) -> PairPlan:
    """The plan with what a study found."""
    assert start.case is not None
    bodies, verdicts, pairs = list(start.plan.bodies), [], []
    kinds = dict(zip(start.touching, found, strict=True))
    studied_pairs = dict(zip(start.touching, start.case.pairs, strict=True))
    checked = iter(enumerate(start.plan.pairs))
    for verdict in start.plan.verdicts:
        if verdict.kind in IGNORED:
            verdicts.append(verdict)
            continue
        number, (one, other, measured) = next(checked)
        kind = kinds.get(number, Kind.APART)
        verdicts.append(replace(verdict, kind=kind, values=_VALUES.get(kind, {})))
        if kind is Kind.ALWAYS:
            continue
        if kind in (Kind.COLLISION_MESHES, Kind.VISUAL_MESHES):
            some = start.case.checked if kind is Kind.COLLISION_MESHES else start.case.drawn
            surfaces = [some[each] for each in studied_pairs[number]]
            measured = exact_body(surfaces[0]), exact_body(surfaces[1])
            if kind is Kind.VISUAL_MESHES:
                for body, triangles in zip((one, other), surfaces, strict=True):
                    bodies[body] = bodies[body][0], wider(bodies[body][1], triangles.reshape(-1, 3))
        pairs.append((one, other, measured))
    return PairPlan(tuple(bodies), tuple(pairs), tuple(verdicts))
