"""The paper's theory made checkable; see docs/explanation/theory.md."""

from gcs.theory.check import Theory, UavTheory, check_theory
from gcs.theory.findings import theory_words

__all__ = ["Theory", "UavTheory", "check_theory", "theory_words"]
