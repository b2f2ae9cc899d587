"""What `gcs compare` found: lines for the terminal, Markdown, JUnit XML."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

from ftc_lab.campaigns.gate import Check
from ftc_lab.reports.markdown import bullets, table
from mavlink_defs.visible import visible, visible_lines


def gate_lines(checks: Sequence[Check], notes: Sequence[str]) -> list[str]:
    """Return one line for each check, and the notes."""
    lines = [f"{_verdict(each)}  {each.variant}: {each.rule}: {each.text}" for each in checks]
    return [*lines, *notes]


def gate_markdown(old: str, new: str, checks: Sequence[Check], notes: Sequence[str]) -> str:
    """Return a summary with a table, as CI systems show it."""
    violated = sum(each.violated for each in checks)
    verdict = f"**{violated} of {len(checks)} checks failed.**" if violated else "No check failed."
    rows = [[_verdict(each), f"`{each.variant}`", f"`{each.rule}`", each.text] for each in checks]
    return (
        f"# `{new}` compared with `{old}`\n\n{verdict}\n\n"
        + table(["verdict", "variant", "fails if", "found"], rows)
        + ("\n" + bullets(notes) if notes else "")
    )


def junit(old: str, new: str, checks: Sequence[Check], notes: Sequence[str]) -> str:
    """Return a test suite with a case for each check."""
    violated = sum(each.violated for each in checks)
    counts = {"tests": str(len(checks)), "failures": str(violated), "errors": "0", "skipped": "0"}
    suites = ET.Element("testsuites", counts)
    suite = ET.SubElement(suites, "testsuite", {"name": f"gcs compare {old} {new}"} | counts)
    for each in checks:
        case = ET.SubElement(suite, "testcase", classname=each.variant, name=each.rule)
        if each.violated:
            ET.SubElement(case, "failure", message=each.text).text = each.text
        else:
            ET.SubElement(case, "system-out").text = each.text
    if notes:
        ET.SubElement(suite, "system-out").text = "\n".join(notes)
    ET.indent(suites)
    for element in suites.iter():  # XML has no way to write most control characters
        element.text = visible_lines(element.text or "")
        element.attrib.update({key: visible(text) for key, text in element.attrib.items()})
    return ET.tostring(suites, encoding="unicode", xml_declaration=True) + "\n"


def _verdict(check: Check) -> str:
    return "FAILED" if check.violated else "passed"
