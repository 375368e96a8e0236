"""Verdicts on the pairs of an arm's links: how a pair is checked, or why not, with English texts."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum


class Kind(StrEnum):
    """The reason why a pair is not checked (the first four), or the geometry that is checked and why."""

    ADJACENT = "adjacent"
    DESCRIPTION = "description"
    SRDF = "srdf"
    ALWAYS = "always"
    # The hulls are apart at home. Elsewhere they seldom touch, or the surfaces touch too.
    APART = "apart"
    # The hulls are apart at home and touch in many other positions.
    FALSE_CONTACTS = "false_contacts"
    TOO_LARGE = "too_large"
    # The hulls touch at home.
    COLLISION_SURFACES = "collision_meshes"
    VISUAL_SURFACES = "visual_meshes"
    TOUCHING = "touching"
    NO_SURFACE = "no_surface"
    NOT_STUDIED = "not_studied"


IGNORED = frozenset({Kind.ADJACENT, Kind.DESCRIPTION, Kind.SRDF, Kind.ALWAYS})
# Kinds that are checked with exact surfaces.
EXACT = frozenset({Kind.FALSE_CONTACTS, Kind.COLLISION_SURFACES, Kind.VISUAL_SURFACES})
# The hulls are apart at home; the texts give a share of the positions.
ELSEWHERE = frozenset({Kind.FALSE_CONTACTS, Kind.TOO_LARGE})

_TEXTS: Mapping[Kind, str] = {
    Kind.ADJACENT: "one joint apart",
    Kind.DESCRIPTION: "the description says so",
    Kind.SRDF: "{file} says so",
    Kind.ALWAYS: "they touch in all of {positions:,} positions, as exact meshes too",
    Kind.APART: "their hulls are apart at home: hulls are checked",
    Kind.FALSE_CONTACTS: "only their hulls touch in {percent} % of positions: "
    "checked as exact collision meshes",
    Kind.TOO_LARGE: "their hulls touch in {percent} % of positions: hulls are checked, for the exact meshes "
    "have over {triangles:,} triangles",
    Kind.COLLISION_SURFACES: "only their hulls touch at home: checked as exact collision meshes",
    Kind.VISUAL_SURFACES: "only their hulls touch at home: checked as exact visual meshes",
    Kind.TOUCHING: "they touch at home, as exact meshes too, which is no reason to ignore them",
    Kind.NO_SURFACE: "they touch at home; one has no surface, so hulls are checked",
    Kind.NOT_STUDIED: "the study of them failed or took over {seconds} s or {gigabytes} GB: "
    "hulls are checked",
}


@dataclass(frozen=True)
class Verdict:
    """The decision on how to check a pair of links.

    Attributes:
        values: The text's parameters: the file, the number or share of positions, limits of the study.
    """

    links: tuple[str, str]
    kind: Kind
    values: Mapping[str, str | int] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The reason in English."""
        return _TEXTS[self.kind].format(**self.values)
