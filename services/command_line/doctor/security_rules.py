"""A comparison of the routers' file of rules with the list of principals."""

import json
from typing import Any

from services.pki import Folder, site_keys
from services.pki.principals import Principals
from services.router.router import AccessError, read_access


def wrong_rules(keys: Folder, principals: Principals) -> list[str]:
    """Return the differences, in words; empty: the rules are those of `principals.toml`."""
    try:
        found = read_access(keys.access)
    except AccessError as error:
        return [str(error)]
    wanted = json.loads("\n".join(_lines(site_keys.rules_of(principals))))
    if found == wanted:
        return []
    problems = []
    actual, expected = _allowed(found), _allowed(wanted)
    for entry in sorted(actual - expected):
        problems.append(f"{_words(entry)}: not a rule of principals.toml; robomesh up rewrites the rules")
    for entry in sorted(expected - actual):
        problems.append(f"{_words(entry)} is missing; robomesh up rewrites the rules")
    return problems or ["it differs from principals.toml: robomesh up rewrites it"]


def _lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if not line.lstrip().startswith("//")]


def _allowed(sections: Any) -> set[tuple[str, str, str, str]]:
    """Return each combination of permission, message, key and certificate name."""
    control = sections.get("access_control", {})
    rules = {rule.get("id"): rule for rule in control.get("rules", ())}
    names = {each.get("id"): each.get("cert_common_names", ["*"]) for each in control.get("subjects", ())}
    return {
        (rules[each].get("permission", ""), f"{flow} {message}", key, name)
        for policy in control.get("policies", ())
        for each in policy.get("rules", ())
        if each in rules
        for flow in rules[each].get("flows", ("both",))
        for message in rules[each].get("messages", ())
        for key in rules[each].get("key_exprs", ())
        for subject in policy.get("subjects", ())
        for name in names.get(subject, ("?",))
    }


def _words(entry: tuple[str, str, str, str]) -> str:
    permission, message, key, name = entry
    return f"{permission} {name} {message} {key}"
