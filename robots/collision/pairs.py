"""Which pairs of an arm's own links are checked, how, and why the others are not."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations
from pathlib import Path

import numpy as np

from robots.collision.bodies import Body, exact_body, hull_bodies, surface, wider
from robots.collision.own import Pairs, own_pairs, touching_pairs
from robots.collision.sampling import SAMPLES, allowed_positions, are_neighbours
from robots.collision.study import Case, Found, Kind, studied
from robots.description import load
from robots.model import RobotModel, build_model, link_placements
from robots.schema import RobotDescription, UrdfDescription
from robots.tree import Tree, TreeLink, tree_of

Bodies = tuple[tuple[int, Body], ...]
Links = tuple[str, str]
ADJACENT = "one joint apart"


@dataclass(frozen=True, eq=False)
class PairPlan:
    """How an arm is checked against itself.

    Attributes:
        bodies: Hulls, each with the number of its link; the box of one that is checked as what is drawn
            holds that, too.
        pairs: Numbers of two bodies, and what is checked of them.
        ignored: Pairs that are not checked, and the reason.
        refined: Pairs that touch at home as hulls, and what was found of them.
        pending: The study of those goes on; until it ends they are checked as hulls.
    """

    bodies: Bodies
    pairs: Pairs
    ignored: tuple[tuple[Links, str], ...]
    refined: tuple[tuple[Links, str], ...]
    pending: bool = False


def ignored_pairs(description: RobotDescription, tree: Tree) -> dict[frozenset[str], str]:
    """Pairs of links with a shape that are ignored without a study, and the reason."""
    found: dict[frozenset[str], str] = {}
    if isinstance(description, UrdfDescription):
        found |= {frozenset(pair): reason for pair, reason in description.robot.ignored}
    found |= {frozenset(pair): "the description says so" for pair in description.collision.ignore}
    for one, other in combinations([link for link in tree.links if link.checked], 2):
        if are_neighbours(tree, one.joint, other.joint):
            found[frozenset((one.name, other.name))] = ADJACENT
    return found


def plan_pairs(model: str | Path, confined: bool, *, wait: bool) -> PairPlan:
    """Decide how an arm is checked against itself.

    Args:
        model, confined: As `robots.description.load` takes them.
        wait: Else a study that takes time goes on elsewhere, and the plan is pending.

    Raises:
        MeshError: If a mesh cannot be read.
    """
    start = _start(model, confined)
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
    names: tuple[str, ...]
    touching: tuple[int, ...] = ()
    case: Case | None = None


@lru_cache(maxsize=8)
def _start(model: str | Path, confined: bool) -> _Start:
    description = load(model, confined=confined)
    tree, built = tree_of(description), build_model(description)
    bodies = tuple(
        (number, body) for number, link in enumerate(tree.links) for body in hull_bodies(link.checked)
    )
    names = tuple(tree.links[number].name for number, _ in bodies)
    reasons = ignored_pairs(description, tree)
    ignored, pairs = [], []
    for one, other in combinations(range(len(bodies)), 2):
        links = names[one], names[other]
        if reason := reasons.get(frozenset(links)):
            ignored.append((links, reason))
        else:
            pairs.append((one, other, (bodies[one][1], bodies[other][1])))
    plan = PairPlan(bodies, tuple(pairs), tuple(ignored), ())
    touching = tuple(touching_pairs(own_pairs(tree, bodies, pairs), built, built.joints.home))
    if not touching:
        return _Start(plan, names)
    case = _case(
        [tree.links[number] for number, _ in bodies], built, [pairs[number][:2] for number in touching]
    )
    return _Start(plan, names, touching, case)


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


def _refined(start: _Start, found: Sequence[Found]) -> PairPlan:
    """The plan with what a study found."""
    bodies, ignored, refined = list(start.plan.bodies), list(start.plan.ignored), []
    by_pair = dict(zip(start.touching, range(len(found)), strict=True))
    pairs = []
    for number, (one, other, measured) in enumerate(start.plan.pairs):
        links = start.names[one], start.names[other]
        if start.case is not None and (place := by_pair.get(number)) is not None:
            result = found[place]
            if result.kind is Kind.ALWAYS:
                ignored.append((links, result.text))
                continue
            refined.append((links, result.text))
            if result.kind is not Kind.HULLS:
                some = start.case.checked if result.kind is Kind.COLLISION_MESHES else start.case.drawn
                surfaces = [some[each] for each in start.case.pairs[place]]
                measured = exact_body(surfaces[0]), exact_body(surfaces[1])
                if result.kind is Kind.VISUAL_MESHES:
                    for body, triangles in zip((one, other), surfaces, strict=True):
                        bodies[body] = bodies[body][0], wider(bodies[body][1], triangles.reshape(-1, 3))
        pairs.append((one, other, measured))
    return PairPlan(tuple(bodies), tuple(pairs), tuple(ignored), tuple(refined))
