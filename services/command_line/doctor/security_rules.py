"""The routers' file of rules, compared with what the list of principals gives."""

import json
from typing import Any

from services.pki import Folder, authority
from services.pki.principals import Principals
from services.router.router import AccessError, read_access


def wrong_rules(keys: Folder, principals: Principals) -> list[str]:
    """Return what differs, in words; none: the rules are exactly what `principals.toml` gives."""
    try:
        found = read_access(keys.access)
    except AccessError as error:
        return [str(error)]
    wanted = json.loads("\n".join(_lines(authority.rules_of(principals))))
    if found == wanted:
        return []
    problems = []
    has, gives = _allowed(found), _allowed(wanted)
    for entry in sorted(has - gives):
        problems.append(
            f"{_words(entry)}: principals.toml gives no such rule; robomesh up writes the rules anew"
        )
    for entry in sorted(gives - has):
        problems.append(f"{_words(entry)} is missing; robomesh up writes the rules anew")
    return problems or ["it is not what principals.toml gives: robomesh up writes it anew"]


def _lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if not line.lstrip().startswith("//")]


def _allowed(sections: Any) -> set[tuple[str, str, str, str]]:
    """Permission, message, key and the certificate's name, one by one."""
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
