"""A class has a name of its own, and one of many fields is made by their names."""

import ast
from collections import defaultdict
from collections.abc import Iterator

from parsed import trees

MANY = 8


def classes() -> Iterator[tuple[str, ast.ClassDef]]:
    for name, tree in trees().items():
        yield from ((name, node) for node in ast.walk(tree) if isinstance(node, ast.ClassDef))


def is_record(node: ast.ClassDef) -> bool:
    above = [ast.unparse(each) for each in (*node.bases, *node.decorator_list)]
    return any("NamedTuple" in each or "dataclass" in each for each in above)


def test_no_two_classes_have_one_name() -> None:
    places = defaultdict(list)
    for name, node in classes():
        places[node.name].append(name)
    assert len(places) > 500
    assert not {name: found for name, found in places.items() if len(found) > 1}


def test_what_has_many_fields_is_made_by_their_names() -> None:
    records = {node.name for _, node in classes() if is_record(node)}
    assert len(records) > 100
    found = [
        f"{name}:{node.lineno}: {ast.unparse(node.func)} of {len(node.args)} by position"
        for name, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and len(node.args) >= MANY
        and ast.unparse(node.func).rpartition(".")[2] in records
    ]
    assert not found, "\n".join(found)
