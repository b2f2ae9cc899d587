"""Changes of a scenario's plain data."""

from typing import Any

DELETE = object()


def edit(tree: Any, changes: dict[str, Any]) -> Any:
    """Change values at dotted places; `DELETE` takes a key away."""
    for place, value in changes.items():
        *way, last = (int(part) if part.isdigit() else part for part in place.split("."))
        target = tree
        for part in way:
            target = target[part]
        if value is DELETE:
            del target[last]
        elif isinstance(target, list) and last == len(target):
            target.append(value)
        else:
            target[last] = value
    return tree
