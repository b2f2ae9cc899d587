"""``gcs scenarios``: list the scenarios that come with the package."""

from gcs.console.lines import print_line
from gcs.scenario.bundled import addition_names, bundled_names, file_of
from gcs.scenario.model import scenario_tree
from mavlink_defs.config.files import read


def scenarios() -> None:
    """List the bundled scenarios and additions.

    One in a line: its name and what it shows.

    Examples:
        - gcs scenarios
        - gcs scenarios | grep rudder

    Other packages add theirs by the group of entry points ftc_sitl.scenarios.

    A name works wherever a file does: gcs fly paper/scenario1, gcs campaign campaigns/faults. The
    last ones are not scenarios but additions to one: gcs fly paper/scenario1 --with realistic

    Exit status: 0 listed.
    """
    names = bundled_names()
    width = max(map(len, names))
    for name in names:
        tree = read(file_of(name))
        print_line(f"{name:{width}}  {tree.get('description') or tree['name']}")
    for name in addition_names():
        print_line(f"{name:{width}}  --with {name} sets {', '.join(scenario_tree(name))}.")
