"""The paper's theory made checkable; see docs/explanation/theory.md."""

from ftc_lab.theory.check import Theory, UavTheory, check_theory
from ftc_lab.theory.findings import theory_sentences

__all__ = ["Theory", "UavTheory", "check_theory", "theory_sentences"]
