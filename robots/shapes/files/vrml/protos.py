"""Instantiation of PROTOs.

Source: ISO/IEC 14772-1:1997, 4.8.
"""

from dataclasses import replace

from robots.shapes.files.vrml.parser import MAX_DEPTH, Is, Node, Proto, Value
from robots.shapes.files.vrml.values import nodes_of

# Most nodes and fields that instances may make, drawn or not: a few nested PROTOs can make billions.
MAX_MADE = 5_000_000


def node_of(node: Node | None, name: str) -> Node | None:
    """Return a field's single node, with PROTOs resolved."""
    found = nodes_of(node, name) if node is not None else []
    return resolved(found[0]) if found else None


def resolved(node: Node) -> Node | None:
    """Return the standard node that a node resolves to; None for an empty PROTO.

    Raises:
        ShapeError: If a PROTO contains itself.
    """
    step: Node | None = node
    for _ in range(MAX_DEPTH):
        if step is None or step.proto is None:
            return step
        step = instance(step, step.proto)
    raise node.error("this PROTO contains itself")


def instance(use: Node, proto: Proto) -> Node | None:
    """Return the first node of a PROTO's body, the only one drawn, with the values of this use."""
    definition = found_proto(proto)
    if definition is None:
        use.warn(f"EXTERNPROTO {proto.name}: {proto.reason_missing}", once=f"extern {proto.name}")
        return replace(use, proto=None)
    if not definition.body:
        return None
    _charge(use, len(definition.defaults) + len(use.fields))
    return _filled(definition.body[0], definition.defaults | use.fields, use, {})


def found_proto(proto: Proto) -> Proto | None:
    """Return the PROTO that an EXTERNPROTO refers to, None if it was not found; a PROTO itself."""
    seen: Proto | None = proto
    for _ in range(MAX_DEPTH):
        if seen is None or seen.urls is None:
            return seen
        seen = seen.target
    return None


def _charge(use: Node, amount: int) -> None:
    count = use.source.count
    count.made += amount
    if count.made > MAX_MADE:
        raise use.error(f"the scene's PROTOs make more than {MAX_MADE} nodes and fields")


def _filled(node: Node, given: dict[str, Value], use: Node, done: dict[Node, Node]) -> Node:
    """Return a body's node with every IS resolved; the same object if it contains none."""
    _charge(use, 1)
    if node in done:
        return done[node]
    _charge(use, len(node.fields))
    fields: dict[str, Value] = {}
    changed = False
    for name, value in node.fields.items():
        if isinstance(value, Is):
            changed = True
            # Without a given value or a default (an event, say), the field is left out.
            if value.name in given:
                fields[name] = given[value.name]
        elif isinstance(value, list) and value and isinstance(value[0], Node):
            inner = [_filled(child, given, use, done) for child in value if isinstance(child, Node)]
            changed = changed or inner != value
            fields[name] = inner
        else:
            fields[name] = value
    done[node] = replace(node, fields=fields) if changed else node
    return done[node]
